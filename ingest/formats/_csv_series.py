"""Series of a table: columns that have their own times, one series in most tables.

Loggers that sample at several rates write a column of times before the columns of each: `Time 1; T; Time 2; n`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import TimeSpec
from ingest.formats._csv_clocks import Clock, Flags
from ingest.formats._csv_dialect import Dialect
from ingest.formats._csv_time import clock_of, rises
from ingest.formats._csv_time_names import is_time_name, is_x

NUMBERED = re.compile(r"[ _]?\d+(?=$| ?[\[(][^\])\d]*[\])]$)")  # `Zeit 2` and `t2 [s]` are one of several


@dataclass(frozen=True)
class TimedColumns:
    """Columns that one clock stamps; `name` is "" for the first of a table. `again`: columns that say its times too."""

    name: str
    clock: Clock
    columns: tuple[str, ...]
    again: tuple[str, ...] = ()

    def there(self, table: Mapping[str, NDArray[Any]], count: int) -> Flags:
        """Which of `count` rows of a table of several series hold anything of this one (N,)."""
        there = np.zeros(count, np.bool_)
        for name in (*self.clock.columns, *self.columns):
            cells = table[name]
            there |= cells != "" if cells.dtype == object else ~np.isnan(cells)
        return there

    def apart(self, table: Mapping[str, NDArray[Any]], count: int) -> Flags:
        """Which of `count` rows say another time in the columns that said the same ones (N,)."""
        apart = np.zeros(count, np.bool_)
        for other in (table[name] for name in self.again):
            said = other != "" if other.dtype == object else ~np.isnan(other)
            apart |= said & (other != table[self.clock.columns[0]])
        return apart

    def times(self, table: Mapping[str, NDArray[Any]], line: NDArray[np.int64]) -> NDArray[Any]:
        """The cells of its clock (N,)."""
        held = [table[name] for name in self.clock.columns]
        return self.clock.cells(held) if held else line


def series_of(time: TimeSpec, clock: Clock, dialect: Dialect, name: str) -> list[TimedColumns]:
    """The series of a table that `clock` was found for: one for each of its columns of times, if these do not all tell
    the same."""
    times = _columns_of_times(clock, dialect)
    clocks = _clocks(time, clock, dialect, times)
    if not clocks:
        return [TimedColumns(name, clock, tuple(one for one in dialect.names if one not in clock.columns))]
    ends = [*map(dialect.names.index, times), len(dialect.names)]
    if all(len({row[place] for place in ends[:-1]}) == 1 for row in dialect.sample):
        return [TimedColumns(name, clock, tuple(one for one in dialect.names if one not in times), tuple(times[1:]))]
    columns = (dialect.names[first + 1 : end] for first, end in pairwise(ends))
    series = [TimedColumns(one.columns[0], one, some) for one, some in zip(clocks, columns, strict=True)]
    return [replace(series[0], name=name), *series[1:]]


def _columns_of_times(clock: Clock, dialect: Dialect) -> list[str]:
    """Columns that are called as times are, the clock's own first, each before others; none where it is only that."""
    said = {name: text for text, names in dialect.renamed.items() for name in names}
    called = {name: NUMBERED.sub("", said.get(name, name)) for name in dialect.names}
    times = [name for name in dialect.names if is_time_name(called[name])]
    times = times or [name for name in dialect.names if is_x(name, dialect, called[name])]
    places = [*map(dialect.names.index, times), len(dialect.names)]
    beside = len(times) > 1 and all(end - first > 1 for first, end in pairwise(places))
    go_on = all(rises(np.array(dialect.numbers(name))) for name in times if dialect.is_number(name))
    return times if beside and go_on and (times[0],) == clock.columns == dialect.names[:1] else []


def _clocks(time: TimeSpec, clock: Clock, dialect: Dialect, times: Sequence[str]) -> list[Clock]:
    """A clock for each of these columns; none where they are not all of one kind."""
    said = {name: text for text, names in dialect.renamed.items() for name in names}
    clocks = [clock, *(clock_of(time, name, said.get(name, name), dialect) for name in times[1:])]
    alike = [one for one in clocks if one and type(one) is type(clock) and one.absolute == clock.absolute]
    return alike if times and len(alike) == len(clocks) else []
