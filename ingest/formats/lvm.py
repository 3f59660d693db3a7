"""LVM: LabVIEW measurement files, packed with gzip or not, read as the table that they hold.

A file is a header, and segments of a header, a line of names and rows each. The time of a row is the date and time of
its segment, a local wall clock, and what its X column, or X0 and Delta_X, add to it; a channel with an X column of its
own has a date and time too. Units are those of the channels. A segment of other channels than the first one's ends what
is read. Described at
https://www.ni.com/en/support/documentation/supplemental/06/specification-for-the-labview-measurement-file---lvm-.html
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from ingest.errors import UnreadableLogError
from ingest.formats import EPOCH, TimeSpec, utc_ns
from ingest.formats._text import TextFile, decoded
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
    _begun_ns: tuple[int, ...] = ()  # of the segment, for each column of X
    _step_s: tuple[float, float] | None = None  # X0 and Delta_X where there is no X column
    _row: int = 0  # of the segment
    _lines: int = 0

    def _pieces(self) -> Iterator[bytes]:
        file = TextFile(self.path)
        for block in file.blocks():
            self.packed = file.packed
            yield "\n".join(self._tables(decoded(block).split("\n"))).encode(errors="replace")
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
        several = self._value("X_Columns").lower() == "multi"
        names[1:-1:2] = [TIME] * len(names[1:-1:2]) if several else names[1:-1:2]
        self._begin_segment(names.count(TIME) if several else 0)
        if self._names:
            if names != self._names:
                self.ended = f"goes on with other channels at line {self._lines + 1:,}"
            return ""
        self._names = names
        units = zip(names, self._said.get("Y_Unit_Label", ()), strict=False)
        self.units = {name: unit for name, unit in units if unit and name != TIME}
        return "\t".join([TIME, *names])

    def _begin_segment(self, further: int) -> None:
        """What its header says of the time, with so many `further` columns of X. Raises UnreadableLogError where X is
        none."""
        columns, dimension = self._value("X_Columns").lower(), self._value("X_Dimension")
        if dimension.lower() not in ("", "time", "zeit"):
            raise UnreadableLogError(
                f"{self.path.name}: its X is {dimension} and not time: it is no log. Write the measured signals."
            )
        step = (_number(self._value("X0") or "0"), _number(self._value("Delta_X")))
        self._step_s = step if columns == "no" else None
        self._inside, self._row = "rows", 0
        self._begun_ns = tuple(self._date_ns(2 * k) or 0 for k in range(1 + further))

    def _value(self, tag: str, place: int = 0) -> str:
        return next(iter(self._said.get(tag, ())[place:]), "")

    def _date_ns(self, place: int) -> int | None:
        """Nanoseconds UTC of the date and time of the segment, or of one of its channels; None where it has none."""
        clock, _, fraction = self._value("Time", place).replace(",", ".").partition(".")
        date = self._value("Date", place).replace("-", "/").replace(".", "/")
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
        for k, begun_ns in enumerate(self._begun_ns[1:], 1):
            cells[2 * k - 1 : 2 * k] = [self._time(cell, begun_ns) for cell in cells[2 * k - 1 : 2 * k]]
        time, self._row = self._time(x, self._begun_ns[0]), self._row + 1
        return "\t".join([time, *cells])

    def _time(self, x: str, begun_ns: int) -> str:
        """The time in seconds of a cell of X; the cell where this is no number."""
        since_s = _number(x) if self._step_s is None else self._step_s[0] + self._row * self._step_s[1]
        if not abs(since_s) < LATEST_S:
            return x
        absolute = since_s > LEAST_ABSOLUTE_S and self._value("Time_Pref").lower() == "absolute"
        t_ns = (SINCE_1904_NS if absolute else begun_ns) + round(since_s * SECOND_NS)
        return f"{'-' if t_ns < 0 else ''}{abs(t_ns) // SECOND_NS}.{abs(t_ns) % SECOND_NS:09d}"


def _number(text: str) -> float:
    """The number in a cell; NaN where it is none."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return math.nan


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
        self.units = {name: unit for name, unit in self.units.items() if not name.startswith(TIME)} | file.units
        return begin


reader = LvmLog
