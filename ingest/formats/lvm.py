"""LVM: LabVIEW measurement files, packed with gzip or not, read as the table that they hold.

A file is a header, and segments of a header, a line of names and rows each. The time of a row is the date and time of
its segment, a local wall clock, and what its X column, or X0 and Delta_X, add to it. Units are those of the channels. A
segment of other channels than the first one's ends what is read. Described at
https://www.ni.com/en/support/documentation/supplemental/06/specification-for-the-labview-measurement-file---lvm-.html
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from ingest.errors import UnreadableLogError
from ingest.formats import EPOCH, TimeSpec, utc_ns
from ingest.formats._text import TextFile
from ingest.formats.csv import CsvLog

TIME = "time [s]"
END = "***End_of_Header***"
SECOND_NS = 1_000_000_000
SINCE_1904_NS = utc_ns(EPOCH.replace(year=1904))
LEAST_ABSOLUTE_S, LATEST_S = 1e9, 9e9  # of an X that counts from 1904, and of any
ROW_BEGINS = tuple("0123456789+-.,\t ")


@dataclass
class _LvmText(TextFile):
    """The rows of all segments as one table: time, channels, comment, between tabs. Lines of headers are blank."""

    time: TimeSpec = field(default_factory=TimeSpec)
    units: dict[str, str] = field(default_factory=dict)
    _said: dict[str, list[str]] = field(default_factory=dict)  # tag -> its values, of the file and of its last segment
    _names: list[str] = field(default_factory=list)
    _inside: str = "header"  # header, special, names or rows
    _separator: str = "\t"
    _begun_ns: int = 0  # of the segment
    _step_s: tuple[float, float] | None = None  # X0 and Delta_X where there is no X column
    _row: int = 0  # of the segment
    _lines: int = 0

    def _pieces(self) -> Iterator[bytes]:
        file = TextFile(self.path)
        for block in file.blocks():
            self.packed = file.packed
            yield "\n".join(self._tables(_decoded(block).split("\n"))).encode(errors="replace")
            if self.ended:
                return
        self.ended = file.ended

    def _tables(self, lines: Sequence[str]) -> Iterator[str]:
        for line in lines:
            yield self._line(line.rstrip("\r"))
            self._lines += 1
            if self.ended:
                return

    def _line(self, line: str) -> str:
        if self._inside == "rows" and line.startswith(ROW_BEGINS):
            return self._values(line) if line.strip(self._separator) else ""
        if line.startswith("Separator"):  # written as the line itself shows
            self._separator = line.removeprefix("Separator")[:1] or self._separator
        tag, *values = (cell.strip() for cell in line.split(self._separator))
        if tag in ("***Start_Special***", "***End_Special***"):
            self._inside = "special" if tag == "***Start_Special***" else "rows" if self._names else "header"
        elif tag == END:
            self._inside = "names" if "Channels" in self._said else "header"
        elif self._inside == "names":
            return self._header(values)
        elif tag and self._inside != "special":
            if self._inside == "rows":  # the header of the next segment
                self._said.pop("Channels", None)
            self._inside = "header"
            self._said[tag] = values
        return ""

    def _header(self, cells: Sequence[str]) -> str:
        """The line of names, of the first segment; of others none."""
        names = [cell.replace('"', "'") for cell in cells]
        names = [*names[: names.index("Comment") if "Comment" in names else None], "Comment"]
        self._begin_segment()
        if self._names:
            if names != self._names:
                self.ended = f"goes on with other channels at line {self._lines + 1:,}"
            return ""
        self._names = names
        units = zip(names, self._said.get("Y_Unit_Label", ()), strict=False)
        self.units = {name: unit for name, unit in units if unit}
        return "\t".join([TIME, *names])

    def _begin_segment(self) -> None:
        """What its header says of the time. Raises UnreadableLogError where X is none, or there are several."""
        columns, dimension = self._value("X_Columns").lower(), self._value("X_Dimension")
        if columns == "multi":
            raise UnreadableLogError(
                f"{self.path.name}: has a column of times for each channel (X_Columns Multi). Write it with one."
            )
        if dimension.lower() not in ("", "time", "zeit"):
            raise UnreadableLogError(
                f"{self.path.name}: its X is {dimension} and not time: it is no log. Write the measured signals."
            )
        step = (_number(self._value("X0") or "0"), _number(self._value("Delta_X")))
        self._step_s = step if columns == "no" else None
        self._inside, self._row, self._begun_ns = "rows", 0, self._date_ns() or 0

    def _value(self, tag: str) -> str:
        return next(iter(self._said.get(tag, ())), "")

    def _date_ns(self) -> int | None:
        """Nanoseconds UTC of the segment's date and time; None where it has none."""
        clock, _, fraction = self._value("Time").replace(",", ".").partition(".")
        date = self._value("Date").replace("-", "/").replace(".", "/")
        try:
            begun = self.time.wall_ns(datetime.strptime(f"{date} {clock}", "%Y/%m/%d %H:%M:%S"))
            return None if begun is None else begun + int(f"{fraction[:9]:0<9}")
        except ValueError:
            return None

    def _values(self, line: str) -> str:
        """A row with its time, and with decimal points."""
        x, _, rest = line.replace('"', "'").partition(self._separator)
        cells = rest.split(self._separator)
        channels = len(self._names) - 1
        if self._separator == "\t" and "," in rest:
            cells[:channels] = [cell.replace(",", ".") for cell in cells[:channels]]
        if len(cells) >= channels:  # the comment, most often none
            cells[channels:] = [" ".join(cells[channels:]).strip()]
        time, self._row = self._time(x), self._row + 1
        return "\t".join([time, *cells])

    def _time(self, x: str) -> str:
        """The time of a row in seconds; its cell where this is no number."""
        since_s = _number(x) if self._step_s is None else self._step_s[0] + self._row * self._step_s[1]
        if not abs(since_s) < LATEST_S:
            return x
        absolute = since_s > LEAST_ABSOLUTE_S and self._value("Time_Pref").lower() == "absolute"
        t_ns = (SINCE_1904_NS if absolute else self._begun_ns) + round(since_s * SECOND_NS)
        return f"{'-' if t_ns < 0 else ''}{abs(t_ns) // SECOND_NS}.{abs(t_ns) % SECOND_NS:09d}"


def _number(text: str) -> float:
    """The number in a cell; NaN where it is none."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return math.nan


def _decoded(block: bytes) -> str:
    try:
        return block.decode("utf-8-sig")
    except UnicodeDecodeError:
        return block.decode("cp1252", errors="replace")


@dataclass
class LvmLog(CsvLog):
    """A LabVIEW measurement file, read from front to back in bounded memory."""

    unsaid = ("delimiter", "decimal", "units_row", "time_column")
    _file: _LvmText = field(init=False)

    def _text(self) -> TextFile:
        self._file = _LvmText(self.path, time=self.time)
        return self._file

    def _kinds(self) -> tuple[bool, ...]:
        self._dialect = replace(self._dialect, numeric=(*self._dialect.numeric[:-1], False))  # a comment, if it has any
        return super()._kinds()

    def _begin(self, lines: Sequence[str]) -> int:
        file = self._file
        begin = super()._begin(lines)
        self.units.pop(TIME, None)
        self.units |= file.units
        return begin


reader = LvmLog
