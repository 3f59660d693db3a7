"""Rows as an Excel workbook: numbers and dates as such, so that every Excel shows them as its country does."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator
from itertools import chain, islice
from math import isnan
from pathlib import Path
from typing import IO
from xml.sax.saxutils import escape

import numpy as np

from ingest.texts.plain import plain_line
from replay.exports.csv import number
from replay.exports.samples import SessionRows

MOST_ROWS = 1_048_576  # of a sheet; what is left goes on in the next
EPOCH_DAYS = 25_569  # from Excel's day 0 to 1970
OFFICE, PACKAGE = (
    "http://schemas.openxmlformats.org/officeDocument/2006/relationships",
    "http://schemas.openxmlformats.org/package/2006",
)
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml"
HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_CELL = 'fontId="0" fillId="0" borderId="0"'
STYLES = (
    '<numFmts count="1"><numFmt numFmtId="164" formatCode="yyyy\\-mm\\-dd\\ hh:mm:ss.000"/></numFmts>'
    '<fonts count="1"><font><sz val="11"/><name val="Calibri"/></font></fonts>'
    '<fills count="2"><fill><patternFill patternType="none"/></fill><fill><patternFill patternType="gray125"/></fill>'
    '</fills><borders count="1"><border><left/><right/><top/><bottom/><diagonal/></border></borders>'
    f'<cellStyleXfs count="1"><xf numFmtId="0" {_CELL}/></cellStyleXfs><cellXfs count="2">'
    f'<xf numFmtId="0" {_CELL} xfId="0"/><xf numFmtId="164" {_CELL} xfId="0" applyNumberFormat="1"/></cellXfs>'
    '<cellStyles count="1"><cellStyle name="Normal" xfId="0" builtinId="0"/></cellStyles>'
)


def write(path: Path, rows: SessionRows) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        title, lines, sheets = _row(_titles(rows)), _lines(rows), 0
        while (first := next(lines, None)) is not None or not sheets:
            sheets += 1
            with book.open(f"xl/worksheets/sheet{sheets}.xml", "w", force_zip64=True) as sheet:
                _sheet(sheet, chain([title, first or ""], islice(lines, MOST_ROWS - 2)))
        _parts(book, [f"samples {i}" if i > 1 else "samples" for i in range(1, sheets + 1)])


def _titles(rows: SessionRows) -> Iterator[str]:
    names = [*(["time_utc"] if rows.absolute else []), "t_s", *rows.titles]
    return (f'<c t="inlineStr"><is><t xml:space="preserve">{escape(plain_line(name))}</t></is></c>' for name in names)


def _lines(rows: SessionRows) -> Iterator[str]:
    for t_ns, values in rows.parts:
        days = (t_ns / 86_400e9 + EPOCH_DAYS).tolist()
        stamps = [[f'<c s="1"><v>{day!r}</v></c>' for day in days]] if rows.absolute else []
        numbers = np.column_stack([rows.seconds(t_ns), values]).T.tolist()
        cells = ([f"<c><v>{number(x)}</v></c>" if not isnan(x) else "<c/>" for x in own] for own in numbers)
        for line in zip(*stamps, *cells, strict=True):
            yield _row(line)


def _row(cells: Iterable[str]) -> str:
    return f"<row>{''.join(cells)}</row>"


def _sheet(file: IO[bytes], lines: Iterable[str]) -> None:
    file.write(f'{HEAD}<worksheet xmlns="{MAIN}"><sheetData>'.encode())
    file.writelines(line.encode() for line in lines)
    file.write(b"</sheetData></worksheet>")


def _parts(book: zipfile.ZipFile, sheets: list[str]) -> None:
    """What a workbook holds beside its sheets."""
    numbered = list(enumerate(sheets, 1))
    overrides = [("xl/workbook.xml", "sheet.main"), ("xl/styles.xml", "styles")]
    overrides += [(f"xl/worksheets/sheet{i}.xml", "worksheet") for i, _ in numbered]
    types = "".join(f'<Override PartName="/{part}" ContentType="{TYPE}.{kind}+xml"/>' for part, kind in overrides)
    links = "".join(
        f'<Relationship Id="rId{i}" Type="{OFFICE}/worksheet" Target="worksheets/sheet{i}.xml"/>' for i, _ in numbered
    )
    named = "".join(f'<sheet name="{name}" sheetId="{i}" r:id="rId{i}"/>' for i, name in numbered)
    files = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types"><Default Extension="rels" ContentType='
        f'"application/vnd.openxmlformats-package.relationships+xml"/>{types}</Types>',
        "_rels/.rels": _related(f'<Relationship Id="rId1" Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/>'),
        "xl/_rels/workbook.xml.rels": _related(
            f'{links}<Relationship Id="rId0" Type="{OFFICE}/styles" Target="styles.xml"/>'
        ),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{named}</sheets></workbook>',
        "xl/styles.xml": f'<styleSheet xmlns="{MAIN}">{STYLES}</styleSheet>',
    }
    for name, text in files.items():
        book.writestr(name, HEAD + text)


def _related(links: str) -> str:
    return f'<Relationships xmlns="{PACKAGE}/relationships">{links}</Relationships>'
