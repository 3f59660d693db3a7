"""MDF of measured or decoded channels: MF4 of INCA, CANape, CANoe, asammdf and others.

A row is what the channels of all groups say at one time; a column is empty where its group has no record then. Each
group has its own time, and its records come in their own order. Columns are named as the channels, with the group
before (`Engine_1/Speed`) where two are called alike. Conversions are applied; a channel that stands for texts is a
column of text, a text among numbers is a missing number (`settings["texts"]`), and so is a value that the file calls
invalid (`settings["invalid"]`). Texts, bytes and arrays of a record are left out and named, and channels whose
conversion is not read (`settings["unconverted"]`). A record without a time is rejected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import LATE_NS, Rejected, Rows
from ingest.formats._csv_dialect import unique
from ingest.formats._mdf_blocks import BrokenBlock, MdfChannel, MdfGroup
from ingest.formats._mdf_log import MdfLog
from ingest.formats._mdf_values import TEXTS, TIMES, VIRTUAL, invalid, stored, values

TIME = 1  # what a master stands for
FIXED = (0, 2)  # kinds of a channel that lies in its record
SHOWN = 64  # first bytes of a rejected record
CELLS = 4_000_000  # of a batch, at most
ROWS = 100_000  # of a batch, at most
FARTHEST_S = 1e9  # after the start
SINCE_1970_S = (1e9, 4e9)  # stamps of the years 2001 to 2096: some writers give them in place of times since the start
NO_TIME = "no time: its group has no channel of time"
BAD_TIME = "has a stamp that no log can reach"

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass
class _Table:
    """N records of one channel group. `timed`: it has a channel of time; `bad`: which records have no time (N,)."""

    name: str
    channels: tuple[MdfChannel, ...]
    records: NDArray[np.uint8]  # (N, size)
    timed: bool
    t_ns: Ints
    bad: Flags
    names: list[str] = field(default_factory=list)  # the columns of `channels`
    row: Ints = field(default_factory=lambda: np.empty(0, np.int64))  # of each record, rising (N,)


@dataclass
class MdfTables(MdfLog):
    """An MDF file of channels, read as a whole; its rows come in bounded memory."""

    _left: list[str] = field(default_factory=list)
    _unread: dict[str, str] = field(default_factory=dict)

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where no row can be read."""
        with self.path.open("rb") as file:
            tables = [table for _, records in self._records(file) for table in self._tables(records.groups, records.of)]
        self._name(tables)
        self.settings["groups"] = _counts(tables)
        if self._left:
            self.settings["left_out"] = self._left
        if self._unread:
            self.settings["unconverted"] = self._unread
        self.found = _place(tables)
        counts: dict[str, Counter[str]] = {"invalid": Counter(), "texts": Counter()}
        size = max(1, min(ROWS, CELLS // max(1, sum(len(table.names) for table in tables))))
        for first in range(0, self.found, size):
            yield from self._rows(tables, first, min(first + size, self.found), counts)
        self.settings |= {what: dict(sorted(found.items())) for what, found in counts.items() if found}
        why = self.rejected[0].why if self.rejected else "it holds no channel of numbers"
        self.end_rows(
            "; ".join(self._problems[:3]) or None, self._problems[0] if not self.found and self._problems else why
        )

    def _tables(self, groups: Sequence[MdfGroup], of: Any) -> Iterator[_Table]:
        """The groups of a data group that hold numbers."""
        for number, group in enumerate(groups):
            records = of.get(group.at)
            if not group.channels or records is None or not len(records):
                continue
            name = group.name or f"group {number + 1} at byte {group.at:,}"
            clock = next((one for one in group.channels if one.kind in TIMES and one.sync == TIME), None)
            kept = tuple(one for one in group.channels if one is not clock and self._keep(one, name, records))
            if kept:
                yield self._table(name, kept, records, clock)

    def _keep(self, channel: MdfChannel, group: str, records: NDArray[np.uint8]) -> bool:
        """Whether a channel is a column; else it is named with why not."""
        called = f"{group}/{channel.name}"
        if channel.is_array or channel.form >= TEXTS or channel.kind not in (*FIXED, *VIRTUAL):
            self._left.append(f"{called} ({len(records):,} values)")
            return False
        if channel.conversion.refused:
            self._unread[called] = channel.conversion.refused
            return False
        try:
            stored(records[:1], channel)
        except BrokenBlock as broken:
            self._problems.append(str(broken))
            return False
        return True

    def _table(
        self, name: str, kept: tuple[MdfChannel, ...], records: NDArray[np.uint8], clock: MdfChannel | None
    ) -> _Table:
        seconds = np.full(len(records), np.nan)
        if clock is not None:
            try:
                seconds = np.where(invalid(records, clock), np.nan, values(records, clock).astype(np.float64))
            except BrokenBlock as broken:
                self._problems.append(str(broken))
        t_ns, bad = self._stamps(seconds)
        return _Table(name, kept, records, clock is not None, t_ns, bad)

    def _stamps(self, seconds: NDArray[np.float64]) -> tuple[Ints, Flags]:
        """(t_ns, whether there is none) of each record (N,). Seconds of a year that logs are from count from 1970."""
        known = np.isfinite(seconds)
        since_1970 = known.any() and bool(SINCE_1970_S[0] <= np.median(seconds[known]) <= SINCE_1970_S[1])
        if since_1970:
            self.absolute = True
            self.settings["time"] = "s since 1970"
        bad = ~(np.abs(seconds) < (SINCE_1970_S[1] if since_1970 else FARTHEST_S))
        some = np.where(bad, 0.0, seconds)
        since = np.rint(some * 1e6).astype(np.int64) * 1000 if since_1970 else np.rint(some * 1e9).astype(np.int64)
        t_ns = since + (0 if since_1970 else self._start_ns)
        return t_ns, bad | (t_ns < 0) | (t_ns >= LATE_NS)

    def _name(self, tables: Sequence[_Table]) -> None:
        often = Counter(channel.name for table in tables for channel in table.channels)
        called = [one.name if often[one.name] == 1 else f"{t.name}/{one.name}" for t in tables for one in t.channels]
        names = iter(unique(called)[0])
        for table in tables:
            table.names = [next(names) for _ in table.channels]
            self.units |= {
                name: one.unit for name, one in zip(table.names, table.channels, strict=True) if one.unit.strip()
            }

    def _rows(self, tables: Sequence[_Table], first: int, end: int, counts: dict[str, Counter[str]]) -> Iterator[Rows]:
        """The rows from `first` to before `end`."""
        t_ns, fine = np.zeros(end - first, np.int64), np.ones(end - first, np.bool_)
        columns: dict[str, NDArray[Any]] = {}
        for table in tables:
            start, stop = np.searchsorted(table.row, [first, end]).tolist()
            at = table.row[start:stop] - first
            t_ns[at], fine[at] = table.t_ns[start:stop], ~table.bad[start:stop]
            for i in (start + np.flatnonzero(table.bad[start:stop])).tolist():
                where, raw = f'group "{table.name}", record {i + 1:,}', table.records[i, :SHOWN].tobytes()
                self.rejected.append(Rejected(int(table.row[i]), where, BAD_TIME if table.timed else NO_TIME, raw))
            for name, channel in zip(table.names, table.channels, strict=True):
                cells = _cells(table.records[start:stop], channel, start, name, counts)
                columns[name] = np.full(end - first, "" if cells.dtype == object else np.nan, cells.dtype)
                columns[name][at] = cells
        self.rejected.sort(key=lambda one: one.record)
        kept = np.flatnonzero(fine)
        if len(kept):
            yield Rows(t_ns[kept], {name: cells[kept] for name, cells in columns.items()}, first + kept)


def _cells(
    records: NDArray[np.uint8], channel: MdfChannel, first: int, name: str, counts: dict[str, Counter[str]]
) -> NDArray[Any]:
    """The values (N,) of a channel in some records, float64 or texts; counts what is missing and why."""
    raw, none = stored(records, channel, first), invalid(records, channel)
    law = channel.conversion
    if law.all_texts and law.texts:
        cells = law.texts(raw)
        cells[none] = ""
    else:
        cells = law.numbers(raw).astype(np.float64)
        if law.texts and (texts := int((np.isnan(cells) & ~none & (law.texts(raw) != "")).sum())):
            counts["texts"][name] += texts
        cells[none] = np.nan
    if none.any():
        counts["invalid"][name] += int(none.sum())
    return cells


def _counts(tables: Sequence[_Table]) -> dict[str, int]:
    """Name of a group -> its records."""
    found: Counter[str] = Counter()
    for table in tables:
        found[table.name] += len(table.records)
    return dict(found)


def _place(tables: Sequence[_Table]) -> int:
    """Give each record its row, and say how many rows there are.

    Records of several groups with one stamp are one row. Those of a group keep their order: one whose stamp steps back
    stays behind the latest before it, and the second with one stamp has a row of its own.
    """
    if not tables:
        return 0
    keys = [_keys(number, table) for number, table in enumerate(tables)]
    whole = np.concatenate(keys, axis=1)
    order = np.lexsort(whole[::-1])
    again = np.concatenate([[True], (np.diff(whole[:, order], axis=1) != 0).any(axis=0)])
    row = np.empty(len(order), np.int64)
    row[order] = np.cumsum(again) - 1
    ends = np.cumsum([len(table.t_ns) for table in tables])
    for table, rows in zip(tables, np.split(row, ends[:-1]), strict=True):
        table.row = rows
    return int(again.sum())


def _keys(number: int, table: _Table) -> Ints:
    """What tells the row of a record (4, N): latest stamp so far, place among those, own stamp, whose alone it is."""
    latest = np.maximum.accumulate(np.where(table.bad, np.iinfo(np.int64).min, table.t_ns))
    new = np.concatenate([[True], np.diff(latest) != 0])
    begin = np.maximum.accumulate(np.where(new, np.arange(len(latest)), 0))
    return np.stack([latest, np.arange(len(latest)) - begin, table.t_ns, np.where(table.bad, number + 1, 0)])


reader = MdfTables
