"""Tables whose columns have types, as Arrow and Parquet files hold them: their rows, and the column that is their time.

Numbers, truths and decimals become numbers, null a missing one; texts, dates and further stamps become texts. Those of
structures and of lists of one length are columns of their own (`motor.T`, `phases.0`). Columns of other types are left
out (`settings["left_out"]`). The time is the first column of stamps (one that is called time
before others), else the first of durations, else what a table of text would have as its time. Stamps without a zone are
local ones. A row without a time is rejected.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import types

from ingest.formats import EARLIEST_NS, LATE_NS, RATIO, SHOWN, Log, Rejected, Rows, rows_at_once
from ingest.formats._csv_clocks import LATEST_NS, Clock, Flags, Ints
from ingest.formats._csv_dialect import SAMPLE_ROWS, UNIT_IN_NAME, Dialect, unique
from ingest.formats._csv_numbers import Numerals
from ingest.formats._csv_stamps import LocalClock
from ingest.formats._csv_time import recognise_clock
from ingest.formats._csv_time_names import UNITS_NS, is_time_name
from ingest.formats._long_tables import LongTable, recognise_long

LONG_LOG = 4 << 30  # bytes, unpacked, of a log that may be as small as it likes: about a minute of reading
DAMAGE = (pa.ArrowException, OSError, ValueError, KeyError)  # pyarrow raises these for damaged bytes
MOST_PLACES, MOST_COLUMNS, LEVELS = 64, 1000, 16  # of a list; of what holds lists and structures
NUMERALS = (Numerals("."), Numerals(","))
NO_TIME = np.iinfo(np.int64).min  # in place of a missing stamp or duration

Table = Mapping[str, pa.Array]  # columns by name


@dataclass(kw_only=True)
class _Instants(Clock):
    """Stamps [ns since 1970], by a local clock where they have no zone."""

    local: LocalClock | None

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        t_ns, bad = np.zeros(len(cells), np.int64), ~((cells >= EARLIEST_NS) & (cells < LATE_NS))
        t_ns[~bad] = cells[~bad]
        if self.local is not None:
            t_ns[~bad], bad[~bad] = self.local.to_utc(t_ns[~bad])
        return t_ns, bad


@dataclass(kw_only=True)
class _Durations(Clock):
    """Durations [ns] since the origin."""

    origin_ns: int

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        bad = ~(np.abs(cells.astype(np.float64)) < LATEST_NS - self.origin_ns)
        return self.origin_ns + np.where(bad, 0, cells), bad


def most_in_columns(size: int) -> int:
    """Bytes that the columns of a file of `size` bytes may unpack to. A column that stands still takes no room: hours
    of a hundred switches are a few megabytes."""
    return max(LONG_LOG, RATIO * size)


@dataclass
class ArrowLog(Log):
    """A table of typed columns, read batch by batch in bounded memory."""

    _clock: Clock = field(init=False)
    _long: LongTable | None = None
    _back: int = 0  # steps of time that go back
    _last_ns: int | None = None
    _ended: str | None = None  # how the file ends before its end

    @abstractmethod
    def _tables(self) -> Iterator[pa.RecordBatch]:
        """The table from its first row on, in batches. Says in `_ended` where it ends before its end."""

    def _place(self, record: int) -> str | None:
        """Where a row stands in the file, None where the format does not tell."""
        return None

    def batches(self) -> Iterator[Rows]:
        """Rows in file order. Raises UnreadableLogError where none can be read, or their time not be recognised."""
        left = most = most_in_columns(self.path.stat().st_size)
        for table in self._tables():
            left -= table.nbytes
            if left < 0:
                self._ended = f"unpacks to more than {most:,} bytes, in row {self.found:,}"
                break
            table = _flat(table)
            if not self.found and table.num_rows:
                self._begin(table)
            size = rows_at_once(table.num_columns)
            for start in range(0, table.num_rows, size):
                yield from self._rows(_kept(table.slice(start, size)))
        if self.found:
            self.settings.update(backward_steps=self._back, **self._clock.counted())
        if self._long is not None:
            self.units = self._long.units
            self.settings.update(self._long.settings())
        self.end_rows(self._ended, self.rejected[0].why if self.rejected else "it holds none")

    def _begin(self, first: pa.RecordBatch) -> None:
        """Recognise columns and time from the first rows."""
        names, renamed = unique(first.schema.names)
        kept = _kept(first)
        self.units = {name: unit for name, one in zip(names, first.schema, strict=True) if (unit := _unit(one))}
        dialect = self._dialect(kept)
        self._clock = self._typed(kept) or recognise_clock(self.time, dialect, self.path.name)
        if self._clock.columns:
            cells = self._clock.cells([self._time_cells(kept[name][:SAMPLE_ROWS]) for name in self._clock.columns])
            t_ns = deepcopy(self._clock).t_ns(cells, np.arange(len(cells)))[0]
            self._long = recognise_long(dialect, self._clock.columns, t_ns)
        self.absolute = self._clock.absolute
        self.settings.update(time_column=" + ".join(self._clock.columns) or None, time=self._clock.says)
        if renamed:
            self.settings["renamed"] = renamed
        if left := [name for name in names if name not in kept]:
            self.settings["left_out"] = left
        if self._long is None and (said := _numbers_as_texts(dialect, self._clock.columns)):
            self.settings["numbers_with_units"] = said

    def _typed(self, table: Table) -> Clock | None:
        """The clock of a column of stamps, or of durations; None without, and where `[time]` says something else."""
        if self.time.rate_hz is not None or self.time.format is not None:
            return None
        stated = [name for name in table if self.time.column in (None, name)]
        named = sorted(stated, key=lambda name: not is_time_name(name))
        start = self.time.start_ns
        for name in (name for name in named if types.is_timestamp(table[name].type)):
            zone = table[name].type.tz
            says = f"stamps in {'UTC' if zone else self.time.zone}"
            local = None if zone else LocalClock(self.time.local)
            return _Instants(says=says, absolute=True, columns=(name,), local=local)
        for name in (name for name in named if types.is_duration(table[name].type)):
            says, absolute = "durations from the start", start is not None
            return _Durations(says=says, absolute=absolute, columns=(name,), origin_ns=start or 0)
        return None

    def _dialect(self, table: Table) -> Dialect:
        """The table as one of text."""
        numeric = tuple(_is_number(column.type) for column in table.values())
        head = tuple(map(tuple, islice(_texts(table), SAMPLE_ROWS)))
        return Dialect("\t", Numerals("."), tuple(table), numeric, self.units, False, {}, head, rows=self._all_rows)

    def _all_rows(self) -> Iterator[list[str]]:
        return (row for table in self._tables() for row in _texts(_kept(_flat(table))))

    # ---- rows ------------------------------------------------------------------------------------------------------

    def _rows(self, table: Table) -> Iterator[Rows]:
        count = len(next(iter(table.values()), ()))
        record = self.found + np.arange(count)
        self.found += count
        held = [self._time_cells(table[name]) for name in self._clock.columns]
        cells = self._clock.cells(held) if held else record
        t_ns, bad = self._clock.t_ns(cells, record)
        columns = {name: _values(column) for name, column in table.items() if name not in self._clock.columns}
        for i in np.flatnonzero(bad).tolist():
            where = f"row {record[i] + 1:,}, column {' + '.join(self._clock.columns)}"
            raw = " ".join(str(column[i]) for column in columns.values()).encode(errors="replace")[:SHOWN]
            self.rejected.append(Rejected(int(record[i]), where, self._why(cells[i]), raw))
        fine = np.flatnonzero(~bad)
        self.note_places(record[fine], lambda i: self._place(int(record[fine[i]])))
        rows = Rows(t_ns[fine], {name: values[fine] for name, values in columns.items()}, record[fine])
        if self._long is not None:
            yield from self._long.series(self.path.name, rows)
        elif len(fine):
            before = self._last_ns if self._last_ns is not None else int(t_ns[fine[0]])
            self._back += int((np.diff(t_ns[fine], prepend=before) < 0).sum())
            self._last_ns = int(t_ns[fine[-1]])
            yield rows

    def _time_cells(self, column: pa.Array) -> NDArray[Any]:
        if isinstance(self._clock, _Instants | _Durations):
            return _nanoseconds(column)
        if self._clock.is_text and _is_number(column.type):
            return np.array(pc.fill_null(pc.cast(column, pa.string()), "").to_pylist(), object)
        return _values(column)

    def _why(self, cell: Any) -> str:
        missing = not cell.strip() if isinstance(cell, str) else cell == NO_TIME or np.isnan(cell)
        return "no time" if missing else self._clock.why(str(cell))


def checked(table: pa.RecordBatch) -> pa.RecordBatch:
    """The table, where all of it is as its types say. Raises one of DAMAGE."""
    table.validate(full=True)
    assert all(isinstance(name, str) for name in table.schema.names)  # decodes them
    return table


def _flat(table: pa.RecordBatch) -> pa.RecordBatch:
    """The table with a column for each field of its structures, and for each place of its lists of one length."""
    while any(_parts(one.type) for one in table.schema):
        together = zip(table.schema, table.columns, strict=True)
        fields, columns = zip(*(part for one, column in together for part in _parted(one, column)), strict=True)
        table = pa.RecordBatch.from_arrays([*columns], schema=pa.schema(fields))
    return table


def _parted(said: pa.Field, column: pa.Array) -> list[tuple[pa.Field, pa.Array]]:
    """The parts of a column, one level down; the column itself where it has none."""
    parts = _parts(said.type)
    if not parts:
        return [(said, column)]
    if types.is_struct(said.type):
        columns = column.flatten()
    else:
        columns = [pc.list_element(column, place) for place in range(len(parts))]
    names = (part.name if types.is_struct(said.type) else str(place) for place, part in enumerate(parts))
    fields = [part.with_name(f"{said.name}.{name}") for part, name in zip(parts, names, strict=True)]
    return [*zip(fields, columns, strict=True)]


def _parts(one: pa.DataType) -> list[pa.Field]:
    """The fields that a type has, those of a list of one length once for each place; none of most types, and of one
    that would be more columns than a log has."""
    return _fields(one) if 0 < _width(one) <= MOST_COLUMNS else []


def _fields(one: pa.DataType) -> list[pa.Field]:
    if types.is_fixed_size_list(one):
        return [one.value_field] * one.list_size if one.list_size <= MOST_PLACES else []
    return [one.field(place) for place in range(one.num_fields)] if types.is_struct(one) else []


def _width(one: pa.DataType, levels: int = LEVELS) -> int:
    """How many columns a type would be in all; 0 of one with more levels."""
    if types.is_fixed_size_list(one) and one.list_size <= MOST_PLACES:
        return one.list_size * _width(one.value_type, levels - 1) if levels else 0
    if types.is_struct(one):
        widths = [_width(field.type, levels - 1) if levels else 0 for field in _fields(one)]
        return sum(widths) if all(widths) else 0
    return 1


def _kept(table: pa.RecordBatch) -> dict[str, pa.Array]:
    """The columns of numbers, stamps, durations and texts; those of dictionaries as what they stand for."""
    columns = (one.dictionary_decode() if types.is_dictionary(one.type) else one for one in table.columns)
    named = zip(unique(table.schema.names)[0], columns, strict=True)
    return {name: column for name, column in named if _is_number(column.type) or _is_text(column.type)}


def _is_number(one: pa.DataType) -> bool:
    are = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean, types.is_duration, types.is_null)
    return any(is_one(one) for is_one in are)


def _is_text(one: pa.DataType) -> bool:
    texts = (types.is_string, types.is_large_string, types.is_string_view, types.is_date, types.is_time)
    return types.is_timestamp(one) or any(is_one(one) for is_one in texts)


def _numbers_as_texts(dialect: Dialect, others: Collection[str]) -> dict[str, str]:
    """Columns of texts, none of `others`, that are numbers with decimals in the first rows, each with one. Those of
    digits alone may be serial numbers."""
    found = {}
    for name, numeric, cells in zip(dialect.names, dialect.numeric, zip(*dialect.sample, strict=True), strict=False):
        some = [] if numeric or name in others else [cell for cell in cells if cell]
        decimal = next((cell for cell in some if not cell.lstrip("+-").isdigit()), None)
        if decimal and all(any(numerals.is_number(cell) for numerals in NUMERALS) for cell in some):
            found[name] = decimal
    return found


def _texts(table: Table) -> Iterator[list[str]]:
    """The rows as a table of text would have them."""
    for row in zip(*(_values(column).tolist() for column in table.values()), strict=True):
        yield [value if isinstance(value, str) else "" if np.isnan(value) else f"{value:.17g}" for value in row]


def _values(column: pa.Array) -> NDArray[Any]:
    """A column as numbers (durations in seconds), NaN where missing, or as texts, "" where missing (N,)."""
    if types.is_duration(column.type):
        since = _nanoseconds(column)
        return np.where(since == NO_TIME, np.nan, since / 1e9)
    if _is_number(column.type):
        numbers = pc.cast(column, pa.int8()) if types.is_boolean(column.type) else column
        return np.array(pc.fill_null(pc.cast(numbers, pa.float64(), safe=False), np.nan))
    zone = types.is_timestamp(column.type) and column.type.tz
    text = pc.cast(column.cast(pa.timestamp(column.type.unit)) if zone else column, pa.string())
    return np.array([f"{one}{'Z' if zone else ''}" if one is not None else "" for one in text.to_pylist()], object)


def _nanoseconds(column: pa.Array) -> Ints:
    """Stamps since 1970, or durations, in nanoseconds (N,); NO_TIME where missing, or too large for one."""
    size = int(UNITS_NS[column.type.unit])
    counts = np.asarray(pc.fill_null(pc.cast(column, pa.int64()), NO_TIME).to_numpy(zero_copy_only=False))
    fits = np.abs(counts.astype(np.float64)) < LATEST_NS / size
    return np.where(fits, np.where(fits, counts, 0) * size, NO_TIME)


def _unit(column: pa.Field) -> str | None:
    """The unit that a column's metadata says, or its name (`T [degC]`)."""
    said = next((value for key, value in (column.metadata or {}).items() if key.lower() in (b"unit", b"units")), b"")
    named = UNIT_IN_NAME.search(column.name)
    return said.decode(errors="replace").strip() or (named[1] if named else None)
