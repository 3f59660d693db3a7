"""The sheets of a workbook, each read a part at a time.

python-calamine holds all cells of a sheet that it reads. So a sheet is cut between its rows, and each part is given to
it as a workbook of its own, with the strings and styles of the whole one: memory holds the cells of one part.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

PART = 8 << 20  # bytes of a sheet that are read at once; more where the strings of the workbook are more
BOOK, RELATED = "xl/workbook.xml", "xl/_rels/workbook.xml.rels"
COMMON = tuple(map(PurePosixPath, (".", "_rels", "xl", "xl/_rels")))  # folders of what all sheets need
NOT_NEEDED = "xl/calcChain.xml"  # order of formulas, long in large sheets
HEAD = re.compile(rb"<((?:\w+:)?)sheetData(?: [^>]*[^/>])?>")
NUMBERED = re.compile(rb'<(?:\w+:)?(?:row|c) [^>]*\br="')  # a row or cell that says where it stands
OF_1904 = re.compile(rb"""<(?:\w+:)?workbookPr [^>]*\bdate1904\s*=\s*["'](?:1|true)["']""")
ROW = re.compile(rb"<(?:\w+:)?row\b")

Row = Sequence[Any]


@dataclass
class Workbook:
    """A workbook; `names` of its sheets, hidden ones last; `of_1904`: its days count from 1904-01-01, as Excel of a Mac
    counted them.

    Raises what zipfile, ElementTree and the library raise of a damaged one.
    """

    path: Path
    library: Any
    names: list[str] = field(init=False)
    of_1904: bool = field(init=False)
    _common: dict[str, bytes] = field(init=False)  # files in the workbook that all its sheets need
    _places: dict[str, str] = field(init=False)  # name of a sheet -> its file in the workbook

    def __post_init__(self) -> None:
        book = self.library.load_workbook(str(self.path))
        visible = self.library.SheetVisibleEnum.Visible
        hidden = {one.name for one in book.sheets_metadata if one.visible != visible}
        self.names = sorted(book.sheet_names, key=hidden.__contains__)
        with zipfile.ZipFile(self.path) as packed:
            needed = (name for name in packed.namelist() if PurePosixPath(name).parent in COMMON and name != NOT_NEEDED)
            self._common = {name: packed.read(name) for name in needed}
        self._places = _places(self._common) if BOOK in self._common else {}
        self.of_1904 = bool(OF_1904.search(self._common.get(BOOK, b"")))

    def rows(self, name: str) -> Iterator[Row]:
        """The rows of a sheet from row 1 to the last with a cell."""
        given = 0
        for before, sheet in self._parts(name):
            if sheet.start is None:
                continue
            row, column = sheet.start
            yield from [()] * (before + row - given)
            yield from ([""] * column + cells for cells in sheet.to_python())
            given = before + row + sheet.height

    def _parts(self, name: str) -> Iterator[tuple[int, Any]]:
        """The parts of a sheet, each with how many rows stand before it where its own do not say it."""
        if name not in self._places:  # of a binary workbook
            yield 0, self.library.load_workbook(str(self.path)).get_sheet_by_name(name)
            return
        with zipfile.ZipFile(self.path) as packed, packed.open(self._places[name]) as file:
            least = max(map(len, self._common.values()))
            text = file.read(max(PART // 8, least))  # few rows: what a sheet is shows at its beginning
            begin = HEAD.search(text)
            if begin is None:
                yield 0, self._sheet(name, text + file.read())
                return
            head, text = text[: begin.end()], text[begin.end() :]
            row_end, tail = b"</%brow>" % begin[1], b"</%bsheetData></%bworksheet>" % (begin[1], begin[1])
            before, more = 0, True
            while more:
                rows, end, rest = text.rpartition(row_end)
                if end:
                    yield 0 if NUMBERED.search(rows) else before, self._sheet(name, head + rows + end + tail)
                    before += len(ROW.findall(rows))
                piece = file.read(max(PART, least))
                text, more = rest + piece, bool(piece)
            yield 0 if NUMBERED.search(text) else before, self._sheet(name, head + text)

    def _sheet(self, name: str, text: bytes) -> Any:
        """A sheet with this text."""
        whole = BytesIO()
        with zipfile.ZipFile(whole, "w") as part:
            for place, data in (self._common | {self._places[name]: text}).items():
                part.writestr(place, data)
        whole.seek(0)
        return self.library.load_workbook(whole).get_sheet_by_name(name)


def _places(common: dict[str, bytes]) -> dict[str, str]:
    """Name of a sheet -> its file, as the workbook says it."""
    targets = {one.get("Id"): one.get("Target", "") for one in ElementTree.fromstring(common[RELATED])}
    sheets = (one for one in ElementTree.fromstring(common[BOOK]).iter() if one.tag.endswith("}sheet"))
    said = {one.get("name", ""): next(v for k, v in one.items() if k.endswith("}id")) for one in sheets}
    folder = PurePosixPath(BOOK).parent
    return {name: str(folder / targets[key]).removeprefix("/") for name, key in said.items()}
