"""XLSX: the sheet of a workbook that holds a table, read as the text of a table would be.

python-calamine reads it: https://github.com/dimastbk/python-calamine (MIT, installed separately). Numbers, dates and
times are those of the cells; what a text holds (numbers in German notation, stamps, units) is recognised as in CSV, the
header too. Times of day alone, without a date in the sheet, count from their midnight where their column is called as
times are, elsewhere as seconds, as durations do. The sheet is the one that `[time] sheet` names, else the first with a
table whose times are recognised, else the first with a table, hidden ones last; `settings["other_sheets"]` names the
others with a table.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time, timedelta
from itertools import islice, zip_longest
from typing import Any

from ingest.errors import UnreadableLogError, not_installed
from ingest.formats import Rows, _csv_numbers, most_unpacked
from ingest.formats._csv_clocks import Clock, Serial
from ingest.formats._csv_dialect import SAMPLE_ROWS, Dialect, cells, no_table_of, recognise_dialect
from ingest.formats._csv_numbers import Numerals
from ingest.formats._csv_tables import first_table
from ingest.formats._csv_time import ORIGIN_1904_NS, SERIAL_NS, recognise_clock
from ingest.formats._csv_time_names import is_time_name
from ingest.formats._text import TextFile
from ingest.formats._xlsx_sheets import Row, Workbook
from ingest.formats.csv import CsvLog
from ingest.texts.nearest import hint

TOGETHER = 2000  # rows that are handed on at once
DAMAGE = Exception  # calamine's own, and what a damaged byte leads to beneath it


@dataclass(kw_only=True)
class _SheetText(TextFile):
    """The rows of a sheet as lines, cells between tabs. Blank rows are blank lines: line 12 is row 12."""

    book: Workbook
    sheet: str
    _numerals: Numerals = field(init=False)
    _stamped: tuple[bool, ...] = ()  # which columns hold dates with a time of day
    _clocks: tuple[bool, ...] = ()  # which columns, called so, hold times of day
    _dated: bool = False  # whether any does hold a date

    def __post_init__(self) -> None:
        head = list(islice(self.book.rows(self.sheet), 2 * SAMPLE_ROWS))
        columns = [*zip_longest(*head)]
        self._stamped = tuple(any(isinstance(cell, datetime) for cell in column) for column in columns)
        self._clocks = tuple(
            any(isinstance(cell, time) for cell in column)
            and any(isinstance(cell, str) and is_time_name(cell) for cell in column)
            for column in columns
        )
        self._dated = any(isinstance(cell, date) for row in head for cell in row)
        self._numerals = _csv_numbers.recognise((cell for row in head for cell in row if isinstance(cell, str)), ";")

    def _pieces(self) -> Iterator[bytes]:
        rows = self.book.rows(self.sheet)
        try:
            while some := [self._line(row) for row in islice(rows, TOGETHER)]:
                yield "".join(some).encode(errors="replace")
        except DAMAGE as error:
            raise _damaged(self.path.name, error) from None

    def _line(self, row: Row) -> str:
        """A row, as wide as the first ones at least."""
        together = zip_longest(row, self._stamped, self._clocks, fillvalue="")
        cells = [self._text(cell, bool(stamped), bool(clock)) for cell, stamped, clock in together]
        return "\t".join(cells) + "\n" if any(cells) else "\n"

    def _text(self, cell: Any, stamped: bool, clock: bool) -> str:
        """A cell as a table with decimal points would have it."""
        if isinstance(cell, str):
            return self._written(" ".join(cell.split()))
        if isinstance(cell, date):  # a datetime is one
            return cell.isoformat() + (" 00:00:00" if stamped and not isinstance(cell, datetime) else "")
        if isinstance(cell, time):
            return cell.isoformat() if self._dated or clock else self._text(_since_midnight(cell), stamped, clock)
        if isinstance(cell, timedelta):
            return _as_clock(cell) if clock else f"{cell.total_seconds():.9g}"
        return f"{float(cell):.17g}"

    def _written(self, text: str) -> str:
        """A text as it is, a number in German notation with a decimal point."""
        if self._numerals.decimal == "," and not text.isdecimal() and self._numerals.is_number(text):
            return f"{self._numerals.value(text):.17g}"
        quoted = text.replace('"', '""')
        return f'"{quoted}"' if quoted != text else text


@dataclass
class XlsxLog(CsvLog):
    """The table of a workbook."""

    line = "row"
    unsaid = ("encoding", "delimiter", "decimal", "gz")
    _book: Workbook = field(init=False)

    def _place(self, line: int) -> str:
        """The row of the sheet: its cells are packed, and written elsewhere in the file."""
        return f'{self.line} {line:,} of sheet "{self.settings["sheet"]}"'

    def _take(self, dialect: Dialect, clock: Clock) -> None:
        """As it is, with days that count from 1904 where those of the workbook do; its cells of dates are right."""
        if self._book.of_1904 and isinstance(clock, Serial) and clock.origin_ns == SERIAL_NS:
            says = clock.says.replace("1899-12-30", "1904-01-01")
            clock = replace(clock, says=says, origin_ns=ORIGIN_1904_NS)
        super()._take(dialect, clock)

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of the sheet. Raises UnreadableLogError where it holds no table, or python-calamine is
        missing."""
        self._open()
        yield from super().batches()

    def _text(self) -> TextFile:
        return _SheetText(path=self.path, book=self._book, sheet=self.settings["sheet"])

    def _open(self) -> None:
        library = _library(self.path.name)
        _check_size(self)
        stated = self.time.sheet
        try:
            self._book = Workbook(self.path, library)
            filled = [one for one in self._book.names if any(self._book.rows(one))]
            tables = {one: timed for one in filled if (timed := self._is_timed(one)) is not None}
        except DAMAGE as error:
            raise _damaged(self.path.name, error) from None
        if stated is not None and stated not in filled:
            raise UnreadableLogError(
                f'{self.path.name}: sheet = "{stated}" under [time] of the bench file is no sheet with cells.'
                f"{hint(stated, filled)} Its sheets: {', '.join(filled)[:300]}."
            )
        if not filled:
            raise UnreadableLogError(f"{self.path.name}: no sheet of it holds a cell: nothing to read. Save it again.")
        dated = [one for one in tables if tables[one]]
        self.settings["sheet"] = stated or (dated or [*tables] or filled)[0]
        if others := [one for one in tables if one != self.settings["sheet"]]:
            self.settings["other_sheets"] = others

    def _is_timed(self, sheet: str) -> bool | None:
        """Whether the first rows of a sheet say their times; None where it does not begin with a header and rows that
        hold numbers."""
        text = _SheetText(path=self.path, book=self._book, sheet=sheet)
        lines = [line for line in next(text.blocks()).decode().split("\n") if line][: 2 * SAMPLE_ROWS]
        if no_table_of(lines, self.path.name) is not None:
            return None
        dialect = recognise_dialect(first_table(lines), self.path.name)
        dialect = replace(dialect, rows=lambda: [cells(line, dialect.delimiter) for line in lines])
        try:
            recognise_clock(self.time, dialect, self.path.name)
        except UnreadableLogError:
            return False
        return True


def _since_midnight(cell: time) -> timedelta:
    return datetime.combine(date.min, cell) - datetime.min


def _as_clock(cell: timedelta) -> str:
    """A duration as times of day are written, with as many hours as it has."""
    minutes, seconds = divmod(cell.total_seconds(), 60)
    return f"{int(minutes // 60)}:{int(minutes % 60):02d}:{seconds:09.6f}"


def _check_size(log: XlsxLog) -> None:
    """Raises UnreadableLogError for a file that was cut, or that unpacks to more than any workbook does."""
    limit = most_unpacked(log.path.stat().st_size)
    try:
        with zipfile.ZipFile(log.path) as packed:
            size = sum(one.file_size for one in packed.infolist())
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        raise _damaged(log.path.name, error) from None
    if size > limit:
        raise UnreadableLogError(
            f"{log.path.name}: unpacks to more than {limit:,} bytes: it is no workbook of a log. Export it as CSV."
        )


def _damaged(log: str, error: BaseException) -> UnreadableLogError:
    says = " ".join(str(error).split())[:200]
    return UnreadableLogError(
        f"{log}: is no whole workbook ({says}): nothing of it is used. Copy it again, or save it as CSV."
    )


def _library(log: str) -> Any:
    try:
        import python_calamine
    except ImportError:
        raise UnreadableLogError(f"{log}: {not_installed('the reader of XLSX files')}") from None
    return python_calamine


reader = XlsxLog
