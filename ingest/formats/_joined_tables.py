"""Tables of one file that each have their own times, as one: a row is what all of them say at one time.

Columns are named as in their tables, with the table before (`Engine_1/Speed`) where two are called alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import Log, Rejected, Rows
from ingest.formats._csv_dialect import unique

CELLS = 4_000_000  # of a batch, at most
ROWS = 100_000  # of a batch, at most

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass
class OwnTimes:
    """One table of `count` records. `times(start, stop)`: of some of them the stamps, and which have none or cannot be
    read, with `why` and the first bytes of each; `cells(k, start, stop)`: of its column k, numbers or texts; `where`
    each stands in the file."""

    name: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    count: int
    times: Callable[[int, int], tuple[Ints, Flags]]
    cells: Callable[[int, int, int], NDArray[Any]]
    raw: Callable[[int], bytes]
    why: Callable[[int], str]
    where: Callable[[int], str]
    row: Ints | None = (
        None  # of each record among all rows, rising; None where each is a row, and no table is beside it
    )

    def within(self, first: int, end: int) -> tuple[int, int, Ints]:
        """(start, stop, rows) of the records in the rows from `first` to before `end`."""
        if self.row is None:
            return first, end, np.arange(first, end)
        start, stop = np.searchsorted(self.row, [first, end]).tolist()
        return start, stop, self.row[start:stop]


def held(t_ns: Ints, bad: Flags) -> Callable[[int, int], tuple[Ints, Flags]]:
    """`OwnTimes.times` of stamps (N,) that are in memory."""
    return lambda start, stop: (t_ns[start:stop], bad[start:stop])


def counted(tables: Sequence[OwnTimes]) -> dict[str, int]:
    """Name of a table -> its records."""
    found: Counter[str] = Counter()
    for table in tables:
        found[table.name] += table.count
    return dict(found)


class JoinedTables(Log):
    """A log that holds such tables."""

    def _joined(self, tables: Sequence[OwnTimes]) -> Iterator[Rows]:
        """The rows of all tables in the order of time. Those of one table keep their order."""
        often = Counter(name for table in tables for name in table.columns)
        full = [name if often[name] == 1 else f"{table.name}/{name}" for table in tables for name in table.columns]
        names = unique(full)[0]
        units = [unit.strip() for table in tables for unit in table.units]
        self.units |= {name: unit for name, unit in zip(names, units, strict=True) if unit}
        self.found = _place(tables)
        size = max(1, min(ROWS, CELLS // max(1, len(names))))
        for first in range(0, self.found, size):
            yield from self._rows(tables, names, first, min(first + size, self.found))

    def _rows(self, tables: Sequence[OwnTimes], names: Sequence[str], first: int, end: int) -> Iterator[Rows]:
        """The rows from `first` to before `end`."""
        t_ns, fine = np.zeros(end - first, np.int64), np.ones(end - first, np.bool_)
        columns: dict[str, NDArray[Any]] = {}
        rejected: list[Rejected] = []
        name = iter(names)
        for table in tables:
            start, stop, rows = table.within(first, end)
            at = rows - first
            t_ns[at], bad = table.times(start, stop)
            fine[at] = ~bad
            for place in np.flatnonzero(bad).tolist():
                i = start + place
                where = f'group "{table.name}", record {i + 1:,}'
                rejected.append(Rejected(int(rows[place]), where, table.why(i), table.raw(i)))
            for place in range(len(table.columns)):
                cells = table.cells(place, start, stop)
                column = np.full(end - first, "" if cells.dtype == object else np.nan, cells.dtype)
                column[at] = cells
                columns[next(name)] = column
        self.note_places(np.arange(first, end), lambda i: _where(tables, first + i))
        self.rejected.extend(sorted(rejected, key=lambda one: one.record))
        kept = np.flatnonzero(fine)
        if len(kept):
            yield Rows(t_ns[kept], {name: cells[kept] for name, cells in columns.items()}, first + kept)


def _where(tables: Sequence[OwnTimes], row: int) -> str:
    """Where the records of a row stand in the file, each with its table where there are several."""
    found = ((table, table.within(row, row + 1)) for table in tables)
    there = [(table, i) for table, (start, stop, _) in found for i in range(start, stop)]
    return "; ".join(f"{table.name}: {table.where(i)}" if len(tables) > 1 else table.where(i) for table, i in there)


def _place(tables: Sequence[OwnTimes]) -> int:
    """Give each record its row, and say how many rows there are.

    Records of several tables with one stamp are one row. Those of a table keep their order: one whose stamp steps back
    stays behind the latest before it, and the second with one stamp has a row of its own.
    """
    if len(tables) < 2:
        return sum(table.count for table in tables)
    whole = np.concatenate([_keys(number, table) for number, table in enumerate(tables)], axis=1)
    order = np.lexsort(whole[::-1])
    again = np.zeros(len(order), np.bool_)
    again[:1] = True
    for key in whole:  # one after another: memory holds one of them twice, not all
        again[1:] |= np.diff(key[order]) != 0
    row = np.empty(len(order), np.int64)
    row[order] = np.cumsum(again) - 1
    ends = np.cumsum([table.count for table in tables])
    for table, rows in zip(tables, np.split(row, ends[:-1]), strict=True):
        table.row = rows
    return int(again.sum())


def _keys(number: int, table: OwnTimes) -> Ints:
    """What tells the row of a record (4, N): latest stamp so far, place among those, own stamp, whose alone it is."""
    t_ns, bad = table.times(0, table.count)
    latest = np.maximum.accumulate(np.where(bad, np.iinfo(np.int64).min, t_ns))
    new = np.concatenate([[True], np.diff(latest) != 0])
    begin = np.maximum.accumulate(np.where(new, np.arange(len(latest)), 0))
    return np.stack([latest, np.arange(len(latest)) - begin, t_ns, np.where(bad, number + 1, 0)])
