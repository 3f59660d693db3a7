"""TwinCAT Scope: the text (CSV, TXT) that its export writes, packed with gzip or not, read as the table that it holds.

Lines say of each channel what it is (`Name`, `Unit`, `SampleTime[ms]` ...). Each begins with that word, which comes
again before the channels of another clock; below it stand in the rows the milliseconds since the start of the export.
The channels of each such column are series of their own where there are several. Values are scaled, in the unit that is
said. Laid out as files of TwinCAT 3 are: https://github.com/CagtayFabry/pytcs
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from ingest.errors import UnreadableLogError
from ingest.formats import EPOCH, SHOWN, utc_ns
from ingest.formats._csv_dialect import DELIMITERS, cells, is_value
from ingest.formats._text import TextFile, decoded
from ingest.formats.csv import ABOVE, CsvLog

TIME, UNIT_OF_TIME = "Time", "ms"
NAME, SYMBOL, UNIT, START = "Name", "SymbolName", "Unit", "Starttime of export"
SINCE_1601_NS = utc_ns(EPOCH.replace(year=1601))
TICK_NS = 100
IN_BRACKETS = re.compile(r" ?\([^()]*\)$")  # (None), V (Voltage)
BLANK = re.compile(rb"(?m)(^|[\t;,|]) (?=[\t;,|\r\n])")  # in place of a sample of a channel that has no more


@dataclass
class _ScopeText(TextFile):
    """The rows below a line of names and one of units. Lines above these are blank, so that each keeps its number."""

    start_ns: int | None = None
    above: list[str] = field(default_factory=list)
    _delimiter: bytes = b""
    _width: int = 0  # delimiters in a line of all columns

    def blocks(self) -> Iterator[bytes]:
        for number, block in enumerate(super().blocks()):
            rows = BLANK.sub(rb"\1", block if number else self._headed(block)).split(b"\n")
            yield b"\n".join([*map(self._whole, rows[:-1]), rows[-1]])

    def _whole(self, row: bytes) -> bytes:
        """A row with all its cells: those of the last columns are left out once these have no more samples."""
        missing = self._width - row.count(self._delimiter) if self._delimiter in row else 0
        return row.rstrip(b"\r") + missing * self._delimiter if missing > 0 else row

    def _headed(self, block: bytes) -> bytes:
        lines = decoded(block).split("\n")
        place = next((place for place, line in enumerate(lines) if place and line.startswith(NAME)), None)
        if place is None:
            return block
        delimiter = lines[place][len(NAME) : len(NAME) + 1]
        if delimiter not in DELIMITERS:
            raise UnreadableLogError(
                f'{self.path.name}: "{delimiter}" stands between its columns, as it may within a name or a number. '
                "Export it from TwinCAT Scope with tabs or semicolons between them."
            )
        said = [[cell.strip() for cell in cells(line, delimiter)] for line in lines]
        first = next((at for at in range(place, len(lines)) if _is_row(said[at], len(said[place]))), len(lines))
        begun = next((row[1] for row in said[:place] if row[0] == START and len(row) > 1), "")
        self.start_ns = SINCE_1601_NS + int(begun) * TICK_NS if begun.isdecimal() else None
        self.above = lines[:place]
        self._delimiter, self._width = delimiter.encode(), len(said[place]) - 1
        header, units = _header({row[0]: row for row in said[place:first] if len(row) == len(said[place])})
        blank = [""] * (first - 2)
        return "\n".join([*blank, delimiter.join(header), delimiter.join(units), *lines[first:]]).encode()


def _is_row(row: Sequence[str], width: int) -> bool:
    return len(row) == width and any(row) and all(is_value(cell) or cell in ("", "1") for cell in row)


def _header(said: dict[str, list[str]]) -> tuple[list[str], list[str]]:
    """Names and units of all columns, by what is said of each: by its symbol where another one is called alike."""
    names, symbols = said[NAME], said.get(SYMBOL, said[NAME])
    header = [TIME if name == NAME else name for name in names]
    both = zip(header, symbols, strict=True)
    header = [symbol if name != TIME and names.count(name) > 1 else name for name, symbol in both]
    units = [IN_BRACKETS.sub("", unit) for unit in said.get(UNIT, [""] * len(names))]
    return header, [UNIT_OF_TIME if name == TIME else unit for name, unit in zip(header, units, strict=True)]


@dataclass
class ScopeLog(CsvLog):
    """A text that TwinCAT Scope exported, read from front to back in bounded memory."""

    _file: _ScopeText = field(init=False)

    def _text(self) -> TextFile:
        self._file = _ScopeText(self.path)
        return self._file

    def _begin(self, lines: Sequence[str]) -> int:
        if self.time.start_ns is None:
            self.time = replace(self.time, start_ns=self._file.start_ns)
        begin = super()._begin(lines)
        self.units = {
            name: unit for name, unit in self.units.items() if any(name in one.columns for one in self._series)
        }
        self.settings["above_header"] = [line.strip()[:SHOWN] for line in self._file.above if line.strip()][:ABOVE]
        return begin


reader = ScopeLog
