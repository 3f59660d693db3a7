"""CSV: tables of text, packed with gzip or not.

Delimiter, decimal sign, encoding (UTF-8, one that `encoding_of` tells, else cp1252), a row of units and the time are
recognised from the first 200 rows and stored in `settings`; so are lines that a logger wrote above the header. Dates
such as 5/6/2025 have their order from a day above 12 anywhere in the table. A line is a row: a quoted cell does not go
on in the next, but for names in the header. Blank lines, comments (`#`), statistics below the table, delimiters alone
and the header again are no rows. `columns` are those of the header without the one (or several: date, time of day,
milliseconds) that holds the time; an empty name becomes `column_<place>`, a second `T` becomes `T_2`
(`settings["renamed"]`). A row with too few or too many fields, with text where its column holds numbers, or without a
time is rejected; a row whose time goes back is kept and counted. In a local zone, the hour that comes twice in autumn
counts as the first until its stamps go back, then as the second (`settings["ambiguous_rows"]`), and a time in the hour
that spring leaves out is none. A long table, columns of times side by side, and another table below the first are
series with their own stamps (`settings["series"]`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import SERIES, SHOWN, Log, Rejected, Rows
from ingest.formats._csv_begun import begun, in_doubt, says_start
from ingest.formats._csv_clocks import Clock
from ingest.formats._csv_dialect import (
    BLANKS,
    SAMPLE_ROWS,
    Dialect,
    cells,
    header_in_one_line,
    is_value,
    no_table_of,
    recognise_dialect,
)
from ingest.formats._csv_labels import labels_aside, remarks_aside
from ingest.formats._csv_lines import LineReader, Lines
from ingest.formats._csv_no_rows import is_row, no_rows
from ingest.formats._csv_numbers import MISSING, OTHER, Numerals, is_missing
from ingest.formats._csv_series import TimedColumns, series_of
from ingest.formats._csv_stamp_columns import times_of
from ingest.formats._csv_tables import BELOW, first_table, is_header
from ingest.formats._csv_time import recognise_clock
from ingest.formats._long_tables import LongTable, recognise_long
from ingest.formats._text import TextFile, decoded, place_of

NUMBER_AND_UNIT = re.compile(  # or a sign behind it: 1.5-, 20 ± 0.5; or (1.5), 0x1F, and 1.5D+01 of Fortran
    r"[+-]?\d[\d.,]* ?[^\W\d]{1,4}|[+-]?\d[\d.,]* [^\s\d]{1,6}|[+-]?\d[\d.,]*(?:[-*°%]| ?± ?[\d.,]+)"
    r"|\(\d[\d.,]*\)|0[xX][0-9a-fA-F]+|[+-]?\d[\d.,]*[dD][+-]?\d+"
)
LATE_DECIMAL = rb"[+-]?(?:\d+,(?:\d{1,2}|\d{4,})|0,\d+|\d+,\d+[eE][+-]?\d+)"
NUMBER_BEGINS = frozenset("0123456789+-.")
MINUS = "\u2212"  # the sign that typesetters write for it
ABOVE = 20  # lines above the header that are kept as they stand


@dataclass
class CsvLog(Log):
    """A table, read from front to back in bounded memory."""

    line: ClassVar[str] = "line"  # what one row of the table is called
    unsaid: ClassVar[tuple[str, ...]] = ()  # settings of a text that such a file does not have
    no_row: ClassVar[str] = ""  # as in `LineReader`
    _dialect: Dialect = field(init=False)
    _clock: Clock = field(init=False)
    _series: Sequence[TimedColumns] = ()
    _columns: dict[str, list[str]] = field(default_factory=dict)  # of each series so far
    _known: dict[str, tuple[str | None, bool]] = field(default_factory=dict)  # column -> its unit, whether it is text
    _long: LongTable | None = None
    _numeric: tuple[bool, ...] = ()
    _heads: frozenset[str] = frozenset()  # lines above the rows: where they stand again they are none
    _lines: int = 0  # that were read
    _left: int = 0  # lines below the header that are comments, or the header again
    _bounds: dict[str, tuple[str, int]] = field(default_factory=dict)  # column -> a cell that is but a bound, how many
    _back: int = 0  # steps of time that go back
    _last_ns: dict[str | None, int] = field(default_factory=dict)  # of each series

    def batches(self) -> Iterator[Rows]:
        """Rows in file order. Raises UnreadableLogError where the table, or its time, cannot be recognised."""
        text = self._text()
        held: list[str] = []  # of the block before
        for number, (block, next_block) in enumerate(pairwise(chain(text.blocks(), [None]))):
            if number == 0:
                self.settings["encoding"] = text.encoding
            lines = self._decoded(block or b"", first=number == 0).split("\n")
            lines = lines[:-1] if not lines[-1] else lines
            lines = _with_header([self._headed(lines[0]), *lines[1:]]) if number == 0 else held + lines
            begin = self._begin(lines) if number == 0 else 0
            self._lines += begin
            last = next_block is None
            end = len(lines) if last else _before_a_header(lines, begin)
            held = lines[end:]
            cut = last and text.open_line and (text.ended is not None or self._is_short(lines[-1]))
            yield from self._tables(lines[begin:end], cut=cut)
        if not self._lines:
            raise UnreadableLogError(
                f"{self.path.name}: {text.ended or 'unpacks to 0 bytes'}: no row of it can be read. "
                "Copy the file again."
            )
        self._finish(text)

    def _text(self) -> TextFile:
        """The table as text."""
        return TextFile(self.path)

    def _decoded(self, block: bytes, *, first: bool) -> str:
        """A block as text: UTF-8, or cp1252 in lines that are not UTF-8."""
        try:
            text = block.decode("utf-8-sig" if first else "utf-8")
        except UnicodeDecodeError:
            self.settings["encoding"] = "cp1252"
            text = decoded(block)
        lines = text.replace("\r\n", "\n").replace(MINUS, "-")
        return lines.replace("\n\ufeff", "\n").removeprefix("\ufeff")  # files joined to one have marks inside

    def _headed(self, line: str) -> str:
        """The first line of the file without the zeros above it, which a disk gives back for what is lost."""
        headed = line.lstrip("\0")
        if lost := len(line) - len(headed):
            self.settings["zeros_at_head"] = lost
        return headed

    def _begin(self, lines: Sequence[str]) -> int:
        """Recognise the table from its first lines; the number of lines before its first row."""
        above = self.time.skip_rows
        shown = lines[above : above + 2 * SAMPLE_ROWS]
        written = [place for place, line in enumerate(shown, above) if is_row(line)]
        if above and not written:
            raise UnreadableLogError(
                f"{self.path.name}: has no line below the {above:,} that skip_rows under [time] of the bench file "
                "leaves out: correct that number."
            )
        dialect = recognise_dialect(first_table([lines[place] for place in written]), self.path.name)
        if (lost := self.settings.get("zeros_at_head")) and any(map(is_value, dialect.names)):
            raise UnreadableLogError(
                f"{self.path.name}: its first {lost:,} bytes are 0: its header is lost. Copy the file again, "
                "or write the header above its rows."
            )
        begin = written[len(dialect.lines_above) + dialect.units_row] + 1
        comments = (line for line in lines[:begin] if line[:1] == "#")
        over = (line for line in dialect.lines_above if line[:1] not in NUMBER_BEGINS)  # 1;2;3 may be a row as well
        self._heads = frozenset((lines[written[len(dialect.lines_above)]], lines[begin - 1], *over, *comments))
        if "decimal" not in self.unsaid and not dialect.shows_decimals() and self._has_commas(dialect.delimiter):
            dialect = replace(dialect, numerals=Numerals(","))
        dialect = replace(dialect, rows=lambda: self._all_rows(begin, dialect.delimiter))
        self._take(dialect, self._dated(recognise_clock(self.time, dialect, self.path.name), dialect))
        if self._clock.columns:
            self._long = recognise_long(dialect, self._clock.columns, times_of(self._clock, dialect))
        self.absolute = self._clock.absolute
        self.settings.update(
            delimiter=dialect.delimiter,
            decimal=dialect.numerals.decimal,
            units_row=dialect.units_row,
            time_column=" + ".join(self._clock.columns) or None,
            time=self._clock.says,
        )
        if above := len(dialect.lines_above):
            self.settings["header_line"] = written[above] + 1
            self.settings["above_header"] = [lines[place].strip()[:SHOWN] for place in written[:above]][:ABOVE]
        if said := self._with_units():
            self.settings["numbers_with_units"] = said
        if dialect.numerals.group:
            self.settings["thousands"] = dialect.numerals.group
        if dialect.renamed:
            self.settings["renamed"] = dialect.renamed
        return begin

    def _dated(self, clock: Clock, dialect: Dialect) -> Clock:
        """The clock, from the start that a line above the table says, where nothing else dates it."""
        if clock.absolute or self.time.untimed:
            return clock
        start = begun(self.time, clock, dialect)
        if start is None:
            if said := in_doubt(dialect):
                self.settings["date_not_understood"] = said[:SHOWN]
            return clock
        self.settings["begun"] = start.line[:SHOWN]
        self.time = replace(self.time, start_ns=start.start_ns)
        return recognise_clock(self.time, dialect, self.path.name)

    def _take(self, dialect: Dialect, clock: Clock) -> None:
        """Let the rows to come be of this table."""
        self._dialect, self._clock = dialect, clock
        self._numeric = self._kinds()
        self._series = series_of(self.time, clock, dialect, f"table {len(self._columns) + 1}" if self._columns else "")
        self._columns |= {one.name: [*one.columns] for one in self._series}
        for name, number in zip(dialect.names, self._numeric, strict=True):
            self._known.setdefault(name, (dialect.units.get(name), not number))
        self.units = dialect.units | self.units

    def _kinds(self) -> tuple[bool, ...]:
        """Which columns hold numbers; those empty at first are looked at further down."""
        kinds = dict(enumerate(self._dialect.numeric))
        kinds |= {self._dialect.names.index(name): not self._clock.is_text for name in self._clock.columns}
        unnamed = map(self._dialect.names.index, self._dialect.renamed.get("", ()))
        kinds |= {place: False for place in unnamed if kinds[place] is None}  # a remark may stand there
        empty = {place for place, kind in kinds.items() if kind is None}
        for row in self._dialect.rows() if empty else ():
            for place in [place for place in empty if place < len(row) and not is_missing(row[place].strip())]:
                kinds[place] = self._dialect.numerals.value(row[place]) is not None
                empty.remove(place)
            if not empty:
                break
        return tuple(kind is not False for kind in kinds.values())

    def _with_units(self) -> dict[str, str]:
        """Columns of text that begin with "20.5 °C", which is no number, or hold "1.500" beside decimal commas, which
        may be 1500 as well as 1.5; and that cell."""
        other, found = Numerals(OTHER[self._dialect.numerals.decimal]), dict[str, str]()
        columns = zip(self._dialect.names, self._numeric, zip(*self._dialect.sample, strict=True), strict=False)
        for name, kind, said in columns:
            odd = [cell for cell in said if other.decimal in cell and other.is_number(cell)]
            odd = [said[0]] if NUMBER_AND_UNIT.fullmatch(said[0]) else odd
            if odd and not kind:
                found[name] = odd[0][:SHOWN]
        return found

    def _is_short(self, line: str) -> bool:
        """Whether the last number of a line without an end has fewer decimals than all others of its column."""
        row = [cell.strip() for cell in cells(line, self._dialect.delimiter)]
        above = {self._decimals(other[-1]) for other in self._dialect.sample if list(other) != row}
        whole = len(row) == len(self._dialect.names) and self._numeric[-1] and row[-1] not in MISSING
        return whole and len(above) == 1 and self._decimals(row[-1]) < above.pop()

    def _decimals(self, cell: str) -> int:
        """The digits behind the decimal sign of a cell, and that sign."""
        return len("".join(cell.partition(self._dialect.numerals.decimal)[1:]))

    def _has_commas(self, delimiter: str) -> bool:
        """Whether a cell anywhere in the file is a number with a comma that stands between no thousands: the first rows
        may all be whole."""
        ends = re.escape(delimiter.encode()) if delimiter != BLANKS else rb" \t"
        number = re.compile(rb'(?m)(?:^|[%b])[ "]*(?:%b)[ "]*(?:$|[%b\r])' % (ends, LATE_DECIMAL, ends))
        return delimiter != "," and any(number.search(block) for block in self._text().blocks())

    def _all_rows(self, begin: int, delimiter: str) -> Iterator[list[str]]:
        """Every line of the file from line `begin` on, cell by cell."""
        for block in self._text().blocks():
            for line in self._decoded(block, first=False).split("\n")[begin:]:
                yield cells(line, delimiter)
            begin = 0

    # ---- rows ------------------------------------------------------------------------------------------------------

    def _tables(self, lines: list[str], *, cut: bool) -> Iterator[Rows]:
        """The rows of consecutive lines, where another table may begin. `cut`: the last line is not whole."""
        while lines:
            odd = _no_number_first(lines)
            end = self._end(lines, odd)
            yield from self._rows(lines[:end], [place for place in odd if place < end], cut=cut and end == len(lines))
            self._lines += end
            lines = lines[end:]
            if lines:
                begin = self._begin_again(lines) if self._says_start(lines[0]) else self._begin_another(lines)
                self._lines += begin
                lines = lines[begin:]

    def _end(self, lines: Sequence[str], odd: Sequence[int]) -> int:
        """Where the table ends, by its lines: where one of the `odd` ones is the header of another."""
        for place in odd if self._long is None else ():
            if self._says_start(lines[place]):
                return place
            if self._has_other_units(lines, place) if lines[place] in self._heads else self._is_header(lines, place):
                return place
        return len(lines)

    def _says_start(self, line: str) -> bool:
        """Whether a logger whose rows count from a start wrote another one."""
        return "begun" in self.settings and says_start(line, self._dialect.delimiter)

    def _is_header(self, lines: Sequence[str], place: int) -> bool:
        return is_header(lines[place : place + BELOW], self._dialect.delimiter)

    def _has_other_units(self, lines: Sequence[str], place: int) -> bool:
        """Whether units other than those of the table stand below its header that comes again."""
        below = lines[place + 1] if place + 1 < len(lines) else ""
        row = [cell.strip() for cell in cells(below, self._dialect.delimiter)]
        words = len(row) == len(self._dialect.names) and not any(map(is_value, row))
        return self._dialect.units_row and words and below not in self._heads

    def _new_name(self, name: str, unit: str | None, text: bool) -> str:
        """The name of a column of another table: another one where it is no more of what was called so above."""
        before = self._known.get(name, (unit, text))
        same = before[1] == text and (unit is None or before[0] in (None, unit))
        return name if same else self._new_name(f"{name}_{len(self._columns) + 1}", unit, text)

    def _begin_again(self, lines: Sequence[str]) -> int:
        """Let the rows to come count from the start that their logger wrote above them as it was started anew; the
        number of lines before the first of them."""
        first = next((place for place, line in enumerate(lines) if line[:1] in NUMBER_BEGINS), len(lines))
        row = [cell.strip() for line in lines[first : first + 1] for cell in cells(line, self._dialect.delimiter)]
        sample = (tuple(row),) if len(row) == len(self._dialect.names) else ()
        dialect = replace(self._dialect, lines_above=tuple(lines[:first]), sample=sample)
        if start := begun(self.time, self._clock.counting_from(0, 0), dialect):
            self._series = [
                replace(one, clock=one.clock.counting_from(start.start_ns, self.found)) for one in self._series
            ]
            self._clock = self._series[0].clock
        self._left += first
        return first

    def _begin_another(self, lines: Sequence[str]) -> int:
        """Recognise another table below the first, whose columns join those of the first where they have its name; the
        number of lines before its first row. Raises UnreadableLogError."""
        where, first = f"{self.line} {self._lines + 1:,}", self._clock.absolute
        written = [place for place, line in enumerate(lines[: 2 * SAMPLE_ROWS]) if is_row(line)]
        try:
            dialect = recognise_dialect(first_table([lines[place] for place in written]), self.path.name)
            dialect = replace(dialect, rows=lambda: [cells(line, dialect.delimiter) for line in lines])
            dialect = dialect.renamed_as(self._new_name)
            self._take(dialect, recognise_clock(replace(self.time, column=None), dialect, self.path.name))
        except UnreadableLogError as error:
            why = str(error).removeprefix(f"{self.path.name}: ")
            raise UnreadableLogError(f"{self.path.name}: another table begins at {where}: {why}") from None
        if self._clock.absolute != first:
            raise UnreadableLogError(
                f"{self.path.name}: another table begins at {where}, one of both without dates: make two files of it."
            )
        begin = written[len(dialect.lines_above) + dialect.units_row] + 1
        self._heads |= {lines[written[len(dialect.lines_above)]], lines[begin - 1]}
        self.settings.setdefault("further_tables", []).append(where)
        return begin

    def _rows(self, lines: list[str], odd: Sequence[int], *, cut: bool) -> Iterator[Rows]:
        """The rows of consecutive lines of one table; `odd`: places of those that do not begin with a number. `cut`:
        the last line is not whole."""
        written = np.array([line.strip(" \r") != "" for line in lines], bool)
        text_first = not (self._numeric[0] or self._dialect.names[0] in self._clock.columns)
        empty = bool(self._clock.columns) and "delimiter" not in self.unsaid  # without times each counts as one
        left = no_rows(lines, odd, self._dialect, self._heads, empty=empty, text_first=text_first)
        written[left] = False
        self._left += len(left)
        bad: dict[int, tuple[str, str]] = {}
        if cut and lines and is_row(lines[-1]):
            bad[len(lines) - 1] = ("", "the file ends inside it")
        reader = LineReader(self._dialect, self._numeric, self.no_row, self._bounds)
        part = reader.read(lines, [place for place in np.flatnonzero(written).tolist() if place not in bad], bad)
        there = self._there(part)
        records = written.astype(np.int64)  # of each line: a row of several series is one of each that it says
        records[part.line] = np.sum(there, axis=0)
        first = self.found + np.cumsum(records) - records
        self.found += int(records.sum())
        at = np.flatnonzero(written)
        self.note_places(first[at], partial(self._place_of, at))
        refused = [(int(first[place]), place, *why) for place, why in bad.items()]
        yield from self._of_series(part, there, first[part.line], refused)
        for number, place, column, why in sorted(refused):
            where = f"{self.line} {self._lines + place + 1:,}" + (f", column {column}" if column else "")
            self.rejected.append(Rejected(number, where, why, lines[place].encode()[:SHOWN]))

    def _there(self, part: Lines) -> list[NDArray[np.bool_]]:
        """Which rows hold something of each series (N,): of at least one."""
        if len(self._series) == 1:
            return [np.ones(len(part.line), np.bool_)]
        table = dict(zip(self._dialect.names, part.columns, strict=True))
        there = [one.there(table, len(part.line)) for one in self._series]
        there[0] |= ~np.any(there, axis=0)
        return there

    def _of_series(
        self,
        part: Lines,
        there: Sequence[NDArray[np.bool_]],
        record: NDArray[np.int64],
        refused: list[tuple[int, int, str, str]],
    ) -> Iterator[Rows]:
        """The rows of each series; `record` (N,): of the first series that a row holds; `refused` takes the others."""
        table = dict(zip(self._dialect.names, part.columns, strict=True))
        for series, here in zip(self._series, there, strict=True):
            own, line, cells = record[here], part.line[here], series.times(table, part.line)[here]
            t_ns, wrong = series.clock.t_ns(cells, own)
            times = " + ".join(series.clock.columns)
            apart = series.apart(table, len(here))[here]
            for i in np.flatnonzero(wrong | apart).tolist():
                why = "no time" if str(cells[i]).strip() in MISSING else series.clock.why(str(cells[i]))
                why = why if wrong[i] else f"another time in {' or '.join(series.again)}, which said the same at first"
                refused.append((int(own[i]), int(line[i]), times, why))
            wrong |= apart
            columns = {name: table[name][here][~wrong] for name in series.columns}
            rows = Rows(t_ns[~wrong], columns, own[~wrong], series.name or None)
            if len(self._series) > 1:
                self.note_places(own, partial(self._place_of, line))
            if self._long is not None:
                yield from self._long.series(self.path.name, rows)
            elif len(rows.t_ns):
                self._count_back(rows)
                yield rows
            record = record + here

    def _place_of(self, line: NDArray[np.int64], i: int) -> str:
        """Where the i-th of some lines (N,) of the lines to come stands in the file."""
        return self._place(self._lines + int(line[i]) + 1)

    def _place(self, line: int) -> str:
        """Where a line (from 1) stands in the file."""
        return place_of(self.path, line)

    # ---- time and end ----------------------------------------------------------------------------------------------

    def _count_back(self, rows: Rows) -> None:
        before = self._last_ns.get(rows.series, int(rows.t_ns[0]))
        self._back += int((np.diff(rows.t_ns, prepend=before) < 0).sum())
        self._last_ns[rows.series] = int(rows.t_ns[-1])

    def _finish(self, text: TextFile) -> None:
        self.settings.update(gz=text.packed, backward_steps=self._back, **self._clock.counted())
        if self._left:
            self.settings["lines_of_no_row"] = self._left
        if self._bounds:
            self.settings["bounds"] = {name: [cell[:SHOWN], count] for name, (cell, count) in self._bounds.items()}
        if len(self._columns) > 1:
            self.settings[SERIES] = self._columns
        if len(self._series) > 1:
            self.settings["times_beside"] = [one.clock.columns[0] for one in self._series]
        if self._long is not None:
            self.units = self._long.units
            self.settings.update(self._long.settings())
        for name in self.unsaid:
            self.settings.pop(name, None)
        ended = text.ended
        if ended is None and text.open_line and self.rejected and self.rejected[-1].record == self.found - 1:
            ended = f"ends inside {self.line} {self._lines:,}"
        first = self.rejected[0] if self.rejected else None
        self.end_rows(ended, f"{first.where}: {first.why}" if first else "there is none below its header")


def no_table(path: Path) -> str | None:
    """Why a text does not begin as a table does, with a header and rows that hold numbers; None where it does."""
    block = next(TextFile(path).blocks(), b"")
    text = block.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").lstrip("\0")
    lines = _with_header(text.split("\n"))
    return no_table_of([line for line in lines if is_row(line)][: 2 * SAMPLE_ROWS], path.name)


def _with_header(lines: list[str]) -> list[str]:
    """The first lines of a file with a header in one line."""
    return remarks_aside(labels_aside(header_in_one_line(lines)))


def _before_a_header(lines: Sequence[str], begin: int) -> int:
    """The place among the last lines of a block, from `begin` on, where a header may stand whose units or rows are in
    the next block; the number of lines where there is none."""
    tail = max(begin, len(lines) - BELOW)
    return next((tail + place for place in _no_number_first(lines[tail:])), len(lines))


def _no_number_first(lines: Sequence[str]) -> list[int]:
    """Places of the lines that do not begin as most rows do: few, in most tables."""
    return [place for place, line in enumerate(lines) if line[:1] not in NUMBER_BEGINS]


reader = CsvLog
