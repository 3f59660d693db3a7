"""Tables of one file that each have their own times, as one: a row is what all of them say at one time.

Columns are named as in their tables, with the table before (`Engine_1/Speed`) where two are called alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import Log, Rejected, Rows
from ingest.formats._csv_dialect import unique

CELLS = 4_000_000  # of a batch, at most
ROWS = 100_000  # of a batch, at most

Ints = NDArray[np.int64]


@dataclass
class OwnTimes:
    """One table of N records. `cells(k, start, stop)`: of its column k, numbers or texts; `bad`: records without a time
    or that cannot be read (N,), with `why` and the first bytes of each; `where` each stands in the file."""

    name: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    t_ns: Ints
    bad: NDArray[np.bool_]
    cells: Callable[[int, int, int], NDArray[Any]]
    raw: Callable[[int], bytes]
    why: Callable[[int], str]
    where: Callable[[int], str]
    row: Ints = field(default_factory=lambda: np.empty(0, np.int64))  # of each record among all rows, rising


def counted(tables: Sequence[OwnTimes]) -> dict[str, int]:
    """Name of a table -> its records."""
    found: Counter[str] = Counter()
    for table in tables:
        found[table.name] += len(table.t_ns)
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
            start, stop = np.searchsorted(table.row, [first, end]).tolist()
            at = table.row[start:stop] - first
            t_ns[at], fine[at] = table.t_ns[start:stop], ~table.bad[start:stop]
            for i in (start + np.flatnonzero(table.bad[start:stop])).tolist():
                where = f'group "{table.name}", record {i + 1:,}'
                rejected.append(Rejected(int(table.row[i]), where, table.why(i), table.raw(i)))
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
    there = [(table, int(i)) for table in tables for i in np.flatnonzero(table.row == row)]
    return "; ".join(f"{table.name}: {table.where(i)}" if len(tables) > 1 else table.where(i) for table, i in there)


def _place(tables: Sequence[OwnTimes]) -> int:
    """Give each record its row, and say how many rows there are.

    Records of several tables with one stamp are one row. Those of a table keep their order: one whose stamp steps back
    stays behind the latest before it, and the second with one stamp has a row of its own.
    """
    if len(tables) < 2:
        for table in tables:
            table.row = np.arange(len(table.t_ns))
        return sum(len(table.t_ns) for table in tables)
    whole = np.concatenate([_keys(number, table) for number, table in enumerate(tables)], axis=1)
    order = np.lexsort(whole[::-1])
    again = np.zeros(len(order), np.bool_)
    again[:1] = True
    for key in whole:  # one after another: memory holds one of them twice, not all
        again[1:] |= np.diff(key[order]) != 0
    row = np.empty(len(order), np.int64)
    row[order] = np.cumsum(again) - 1
    ends = np.cumsum([len(table.t_ns) for table in tables])
    for table, rows in zip(tables, np.split(row, ends[:-1]), strict=True):
        table.row = rows
    return int(again.sum())


def _keys(number: int, table: OwnTimes) -> Ints:
    """What tells the row of a record (4, N): latest stamp so far, place among those, own stamp, whose alone it is."""
    latest = np.maximum.accumulate(np.where(table.bad, np.iinfo(np.int64).min, table.t_ns))
    new = np.concatenate([[True], np.diff(latest) != 0])
    begin = np.maximum.accumulate(np.where(new, np.arange(len(latest)), 0))
    return np.stack([latest, np.arange(len(latest)) - begin, table.t_ns, np.where(table.bad, number + 1, 0)])
