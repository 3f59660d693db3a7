"""MDF of measured or decoded channels, of version 2, 3 and 4: of INCA, CANape, CANoe, asammdf and others.

A row is what the channels of all groups say at one time; a column is empty where its group has no record then. Each
group has its own time, and its records come in their own order. Columns are named as the channels, with the group
before (`Engine_1/Speed`) where two are called alike. Conversions are applied; a channel that stands for texts is a
column of text, a text among numbers is a missing number (`settings["texts"]`), and so is a value that the file calls
invalid (`settings["invalid"]`). Texts, bytes and arrays of a record are left out and named, and channels whose
conversion is not read (`settings["unconverted"]`). A record without a time is rejected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import LATE_NS, SHOWN, Rows
from ingest.formats._joined_tables import JoinedTables, OwnTimes, counted
from ingest.formats._mdf_blocks import BrokenBlock, MdfChannel
from ingest.formats._mdf_log import MdfLog
from ingest.formats._mdf_records import Records, Stored, chunks
from ingest.formats._mdf_values import TEXTS, TIMES, VIRTUAL, invalid, stored, values

TIME = 1  # what a master stands for
FIXED = (0, 2)  # kinds of a channel that lies in its record
FARTHEST_S = 1e9  # after the start
SINCE_1970_S = (1e9, 4e9)  # stamps of the years 2001 to 2096: some writers give them in place of times since the start
NO_TIME = "no time: its group has no channel of time"
BAD_TIME = "has a stamp that no log can reach"

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass
class MdfTables(MdfLog, JoinedTables):
    """An MDF file of channels, read in bounded memory."""

    _left: list[str] = field(default_factory=list)
    _unread: dict[str, str] = field(default_factory=dict)
    _missing: dict[str, Counter[str]] = field(default_factory=lambda: {"invalid": Counter(), "texts": Counter()})

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where no row can be read."""
        with self._opened() as found:
            tables = [table for _, records in found for table in self._tables(records)]
            self.settings["groups"] = counted(tables)
            if self._left:
                self.settings["left_out"] = self._left
            if self._unread:
                self.settings["unconverted"] = self._unread
            yield from self._joined(tables)
        self.settings |= {what: dict(sorted(found.items())) for what, found in self._missing.items() if found}
        why = self.rejected[0].why if self.rejected else "it holds no channel of numbers"
        self.end_rows(
            "; ".join(self._problems[:3]) or None, self._problems[0] if not self.found and self._problems else why
        )

    def _tables(self, found: Records) -> Iterator[OwnTimes]:
        """The groups of a data group that hold numbers."""
        for number, group in enumerate(found.groups):
            records = found.of.get(group.at)
            if not group.channels or records is None or not len(records):
                continue
            name = group.name or f"group {number + 1} at byte {group.at:,}"
            clock = next((one for one in group.channels if one.kind in TIMES and one.sync == TIME), None)
            kept = tuple(one for one in group.channels if one is not clock and self._keep(one, name, records))
            if kept:
                yield self._table(name, kept, records, clock, partial(found.where, group))

    def _keep(self, channel: MdfChannel, group: str, records: Stored) -> bool:
        """Whether a channel is a column; else it is named with why not."""
        called = f"{group}/{channel.name}"
        if channel.is_array or channel.form >= TEXTS or channel.kind not in (*FIXED, *VIRTUAL):
            self._left.append(f"{called} ({len(records):,} values)")
            return False
        if channel.conversion.refused:
            self._unread[called] = channel.conversion.refused
            return False
        return self._is_whole(channel, records)

    def _is_whole(self, channel: MdfChannel, records: Stored) -> bool:
        """Whether a channel lies in its records; else that is noted."""
        try:
            stored(records[:1], channel)
        except BrokenBlock as broken:
            self._problems.append(str(broken))
            return False
        return True

    def _table(
        self,
        name: str,
        kept: tuple[MdfChannel, ...],
        records: Stored,
        clock: MdfChannel | None,
        where: Callable[[int], str],
    ) -> OwnTimes:
        known = clock is not None and self._is_whole(clock, records)

        def seconds(first: int, some: NDArray[np.uint8]) -> NDArray[np.float64]:
            if clock is None or not known:
                return np.full(len(some), np.nan)
            return np.where(invalid(some, clock), np.nan, values(some, clock, first))

        parts = (seconds(first, some) for first, some in chunks(records, 0, len(records)))
        since_1970 = self._is_since_1970(parts)
        records[:1]  # lets go of the part that was read: there may be many groups

        def times(start: int, stop: int) -> tuple[Ints, Flags]:
            found = [self._stamps(seconds(*part), since_1970) for part in chunks(records, start, stop)]
            return np.concatenate([np.empty(0, np.int64), *(t_ns for t_ns, _ in found)]), np.concatenate(
                [np.empty(0, np.bool_), *(bad for _, bad in found)]
            )

        def cells(place: int, start: int, stop: int) -> NDArray[Any]:
            called = f"{name}/{kept[place].name}"
            found = [
                _cells(some, kept[place], first, called, self._missing) for first, some in chunks(records, start, stop)
            ]
            return found[0] if len(found) == 1 else np.concatenate([np.empty(0), *found])

        return OwnTimes(
            name=name,
            columns=tuple(one.name for one in kept),
            units=tuple(one.unit for one in kept),
            count=len(records),
            times=times,
            cells=cells,
            raw=lambda i: records[i : i + 1][0, :SHOWN].tobytes(),
            why=lambda i: NO_TIME if clock is None else BAD_TIME,
            where=where,
        )

    def _is_since_1970(self, seconds: Iterator[NDArray[np.float64]]) -> bool:
        """Whether the times of a group count from 1970: they are of a year that logs are from."""
        known = next((some for part in seconds if len(some := part[np.isfinite(part)])), np.empty(0))
        since_1970 = bool(len(known) and SINCE_1970_S[0] <= np.median(known) <= SINCE_1970_S[1])
        if since_1970:
            self.absolute = True
            self.settings["time"] = "s since 1970"
        return since_1970

    def _stamps(self, seconds: NDArray[np.float64], since_1970: bool) -> tuple[Ints, Flags]:
        """(t_ns, whether there is none) of some records (N,)."""
        bad = ~(np.abs(seconds) < (SINCE_1970_S[1] if since_1970 else FARTHEST_S))
        some = np.where(bad, 0.0, seconds)
        since = np.rint(some * 1e6).astype(np.int64) * 1000 if since_1970 else np.rint(some * 1e9).astype(np.int64)
        t_ns = since + (0 if since_1970 else self._start_ns)
        return t_ns, bad | (t_ns < 0) | (t_ns >= LATE_NS)


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


reader = MdfTables
