"""Tables of one file that each have their own times, as one: a row is what all of them say at one time.

Columns are named as in their tables, with the table before (`Engine_1/Speed`) where two are called alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import RASTERS, Log, Rejected, Rows, rows_at_once
from ingest.formats._csv_dialect import unique
from ingest.formats._merged import part_size
from ingest.formats._merged import rows as merged_rows

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


NO_DATE = "no date, as other rows of the file have one: say start under [time] of the bench file"
Span = tuple[OwnTimes, int, Ints]  # of a table: the number of a record, and the rows of it and of those behind it


def held(t_ns: Ints, bad: Flags) -> Callable[[int, int], tuple[Ints, Flags]]:
    """`OwnTimes.times` of stamps (N,) that are in memory."""
    return lambda start, stop: (t_ns[start:stop], bad[start:stop])


def undated(table: OwnTimes) -> OwnTimes:
    """A table none of whose records has a time that can be compared with those of others."""
    none = np.zeros(table.count, np.int64), np.ones(table.count, np.bool_)
    return replace(table, times=held(*none), why=lambda _: NO_DATE)


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
        if len(tables) > 1:
            each = iter(names)
            self.settings[RASTERS] = [[next(each) for _ in table.columns] for table in tables]
        size = rows_at_once(len(names))
        starts = [0] * len(tables)
        for rows in _placed(tables, size):
            yield from self._rows([*zip(tables, starts, rows, strict=True)], names)
            starts = [start + len(own) for start, own in zip(starts, rows, strict=True)]

    def _rows(self, spans: Sequence[Span], names: Sequence[str]) -> Iterator[Rows]:
        """The next rows."""
        first, end = self.found, 1 + max(int(rows[-1]) for _, _, rows in spans if len(rows))
        self.found = end
        t_ns, fine = np.zeros(end - first, np.int64), np.ones(end - first, np.bool_)
        columns: dict[str, NDArray[Any]] = {}
        rejected: list[Rejected] = []
        name = iter(names)
        for table, start, rows in spans:
            stop, at = start + len(rows), rows - first
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
        self.note_places(np.arange(first, end), lambda i: _where(spans, first + i))
        self.rejected.extend(sorted(rejected, key=lambda one: one.record))
        kept = np.flatnonzero(fine)
        if len(kept):
            yield Rows(t_ns[kept], {name: cells[kept] for name, cells in columns.items()}, first + kept)


def _where(spans: Sequence[Span], row: int) -> str:
    """Where the records of a row stand in the file, each with its table where there are several."""
    found = ((table, start + int(i)) for table, start, rows in spans for i in np.flatnonzero(rows == row))
    return "; ".join(f"{table.name}: {table.where(i)}" if len(spans) > 1 else table.where(i) for table, i in found)


def _placed(tables: Sequence[OwnTimes], size: int) -> Iterator[list[Ints]]:
    """The rows of the next records of each table, for `size` rows after another.

    Records of several tables with one stamp are one row. Those of a table keep their order: one whose stamp steps back
    stays behind the latest before it, and the second with one stamp has a row of its own.
    """
    if len(tables) == 1:
        count = tables[0].count
        return ([np.arange(first, min(first + size, count))] for first in range(0, count, size))
    step = part_size(len(tables))
    return merged_rows([_keys(number, table, step) for number, table in enumerate(tables)], size)


def _keys(number: int, table: OwnTimes, step: int) -> Iterator[Ints]:
    """What tells the row of a record (4, N): latest stamp so far, place among those, own stamp, whose alone it is."""
    latest, place = np.iinfo(np.int64).min, -1
    for start in range(0, table.count, step):
        t_ns, bad = table.times(start, min(start + step, table.count))
        so_far = np.maximum.accumulate(np.where(bad, latest, np.maximum(t_ns, latest)))
        new, at = np.diff(so_far, prepend=latest) != 0, np.arange(len(so_far))
        places = at - np.maximum.accumulate(np.where(new, at, -1 - place))
        yield np.stack([so_far, places, t_ns, np.where(bad, number + 1, 0)])
        latest, place = so_far[-1], int(places[-1])
