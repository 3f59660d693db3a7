"""Series of a table: columns that have their own times, one series in most tables.

Loggers that sample at several rates write a column of times before the columns of each: `Time 1; T; Time 2; n`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import TimeSpec
from ingest.formats._csv_clocks import Clock, Flags
from ingest.formats._csv_dialect import Dialect
from ingest.formats._csv_time import clock_of, is_time_name

NUMBERED = re.compile(r"[ _]?\d+$")  # `Zeit 2` is one of several


@dataclass(frozen=True)
class TimedColumns:
    """Columns that one clock stamps; `name` is "" for the first of a table."""

    name: str
    clock: Clock
    columns: tuple[str, ...]

    def there(self, table: Mapping[str, NDArray[Any]], count: int) -> Flags:
        """Which of `count` rows of a table of several series hold anything of this one (N,)."""
        there = np.zeros(count, np.bool_)
        for name in (*self.clock.columns, *self.columns):
            cells = table[name]
            there |= cells != "" if cells.dtype == object else ~np.isnan(cells)
        return there

    def times(self, table: Mapping[str, NDArray[Any]], line: NDArray[np.int64]) -> NDArray[Any]:
        """The cells of its clock (N,)."""
        held = [table[name] for name in self.clock.columns]
        return self.clock.cells(held) if held else line


def series_of(time: TimeSpec, clock: Clock, dialect: Dialect, name: str) -> list[TimedColumns]:
    """The series of a table that `clock` was found for; several where its columns of times do not tell the same."""
    found = [*_side_by_side(time, clock, dialect)]
    if len(found) > 1:
        return [replace(one, name=one.clock.columns[0] if i else name) for i, one in enumerate(found)]
    return [TimedColumns(name, clock, tuple(one for one in dialect.names if one not in clock.columns))]


def _side_by_side(time: TimeSpec, clock: Clock, dialect: Dialect) -> Iterator[TimedColumns]:
    """Each column of times with those behind it; nothing where they are no clocks of one kind, or tell the same."""
    said = {name: text for text, names in dialect.renamed.items() for name in names}
    times = [name for name in dialect.names if is_time_name(NUMBERED.sub("", said.get(name, name)))]
    if len(times) < 2 or [dialect.names[0]] != [*clock.columns] or times[0] != dialect.names[0]:
        return
    ends = [*map(dialect.names.index, times), len(dialect.names)]
    clocks = [clock, *(clock_of(time, name, said.get(name, name), dialect) for name in times[1:])]
    alike = all(one and type(one) is type(clock) and one.absolute == clock.absolute for one in clocks)
    same = all(len({row[place] for place in ends[:-1]}) == 1 for row in dialect.sample)
    if alike and not same and all(end - first > 1 for first, end in pairwise(ends)):
        for one, (first, end) in zip(clocks, pairwise(ends), strict=True):
            assert one is not None
            yield TimedColumns("", one, dialect.names[first + 1 : end])
