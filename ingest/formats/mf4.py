"""MF4 of bus loggers: CAN and CAN FD frames as ASAM's standard for bus logging has them (CANedge, Vector, CSM ...).

Sorted or not, packed or not, finalised or not: a logger that lost its power leaves a file that is read up to there. The
start is UTC; where the file says that it is local time, `[time] zone` tells which. Frames of several groups come in the
order of time. Error frames are found and rejected, remote frames have no payload; records of other buses (LIN ...) are
counted in `settings["other_records"]`, measured channels beside frames are not read and named
(`settings["channels_unread"]`). A file without frames is one of measured or decoded channels: `mdf`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, LATE_NS, REMOTE, SHOWN, TRANSMIT, Frames, Rejected, payloads
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    FD_LENGTHS,
    HIGHEST_BUS,
    HIGHEST_ID,
    HIGHEST_STANDARD,
    LONGEST_CLASSIC,
    LONGEST_FD,
    Ints,
)
from ingest.formats._mdf_blocks import Block, BrokenBlock, MdfBlocks, MdfChannel, MdfGroup
from ingest.formats._mdf_log import HEADER_AT, MdfLog
from ingest.formats._mdf_records import OPEN_OFFSETS, Mdf, Records, Stored, gathered, in_turn, octets
from ingest.formats._mdf_values import TEXTS, TIMES, VIRTUAL, values
from ingest.formats._merged import part_size, rows

EXTENDED_BIT = 31  # of an identifier of 32 bits
NAME = re.compile(r"(?:^|\.)(CAN_(?:Data|Remote|Error)Frame|[A-Z]+_\w+?)(?:\.(\w+))?$")
FRAMES = DATA, REMOTES, ERRORS = "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"
MEASURED = "measured"  # what a group holds that is of no bus
MOST_NAMES = 20  # of a group are looked at: frames begin theirs with their time and themselves
MOST_GROUPS = 10_000  # are looked at
BATCH = 100_000
VARIABLE = 1
FARTHEST_S = 1e9


WHY = (
    ERROR_FRAME,
    "has a stamp that no log can reach",
    "its channel is above 255",
    "its identifier has more than 11 or 29 bits",
    f"says it holds more than the {LONGEST_FD} bytes of a frame",
    "holds fewer bytes than it says",
)


@dataclass(frozen=True)
class _Group:
    """The records of one group of frames, which is called `kind`. `apart`: the payloads that lie in no record, and
    `offsets`: where each begins there, where the records do not say it."""

    kind: str
    count: int
    table: Stored
    clock: MdfChannel | None
    channels: Mapping[str, MdfChannel]  # by the last part of their names
    apart: Stored | None
    offsets: Stored | None
    where: Callable[[int], str]  # record i stands in the file


@dataclass
class _Part:
    """Some records of a group as frames, all (N,). The payload of frame i is
    `data[source[i]:source[i] + length[i]]`."""

    t_ns: Ints
    bus: Ints
    can_id: Ints
    flags: Ints
    source: Ints
    length: Ints
    why: Ints  # place in WHY + 1 of a record that is no frame, else 0
    data: NDArray[np.uint8]


@dataclass
class Mf4Log(MdfLog):
    """An MF4 file, read in bounded memory."""

    _other: Counter[str] = field(default_factory=Counter)
    _measured: list[str] = field(default_factory=list)  # channels that are not read

    def batches(self) -> Iterator[Frames]:
        """Frames in the order of time. Raises UnreadableLogError where the file holds none."""
        with self._opened() as found:
            groups = [group for mdf, records in found if isinstance(mdf, Mdf) for group in self._groups(mdf, records)]
            self.settings["other_records"] = dict(sorted(self._other.items()))
            if self._measured:
                self.settings["channels_unread"] = self._measured
            self.found = sum(group.count for group in groups)
            if not self.found:
                why = self._problems[0] if self._problems else "its groups of frames hold no record"
                raise UnreadableLogError(
                    f"{self.path.name}: {why}: no CAN frame of it can be read. Copy the file again."
                )
            yield from self._ordered(groups)
        if self._problems:
            self.mark_cut("; ".join(self._problems[:3]), f"{self.found - len(self.rejected):,} frames")

    def _groups(self, mdf: Mdf, records: Records) -> Iterator[_Group]:
        """The groups of frames of a data group; what is damaged in it is noted."""
        try:
            for group in records.groups:
                kind, channels = _bus_channels(group)
                table = records.of.get(group.at)
                if kind in FRAMES and table:
                    yield self._group(mdf, records, group, table, kind, channels)
                elif group.channels and table:
                    self._other[kind] += len(table)
                    self._measured += [one.name for one in group.channels if kind == MEASURED and one.kind not in TIMES]
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _group(
        self, mdf: Mdf, records: Records, group: MdfGroup, table: Stored, kind: str, channels: Mapping[str, MdfChannel]
    ) -> _Group:
        """Raises BrokenBlock where a channel lies outside its records."""
        clock = next((one for one in group.channels if one.kind in TIMES), None)
        payload = channels.get("DataBytes")
        apart = offsets = None
        if payload and payload.kind == VARIABLE:
            apart = records.values.get(payload.values_at)
            if apart is None:
                apart = mdf.values(payload.values_at) if payload.values_at else octets([])
            if mdf.open_parts & OPEN_OFFSETS:
                offsets = in_turn(apart, len(table), mdf.waiting)
        where = partial(records.where, group)
        found = _Group(kind, len(table), table, clock, channels, apart, offsets, where)
        self._part(found, 0, 1)
        return found

    def _part(self, group: _Group, start: int, stop: int) -> _Part:
        """The records from `start` to before `stop` of a group."""
        table, channels = group.table[start:stop], group.channels

        def value(name: str, otherwise: int = 0) -> Ints:
            channel = channels.get(name)
            return _integers(table, channel, start) if channel else np.full(len(table), otherwise, np.int64)

        t_ns, late = self._times(group, start, stop)
        number, bus = value("ID"), value("BusChannel", 1)
        extended = (value("IDE") != 0) | (number >> EXTENDED_BIT & 1 != 0)
        number &= (1 << EXTENDED_BIT) - 1
        fd = value("EDL") != 0
        flags = FD * fd | TRANSMIT * _sent(table, channels.get("Dir")) | REMOTE * (group.kind == REMOTES)
        data, source, held = _payload(group, start, stop)
        length = value("DataLength") if "DataLength" in channels else _coded(value("DLC"), fd)
        length = length if group.kind == DATA else np.zeros(len(table), np.int64)
        wrong = (
            np.full(len(table), group.kind == ERRORS),
            late,
            (bus < 0) | (bus > HIGHEST_BUS),
            number > np.where(extended, HIGHEST_ID, HIGHEST_STANDARD),
            (length < 0) | (length > LONGEST_FD),
            held < length,
        )
        why = np.select(wrong, range(1, len(wrong) + 1), 0)
        can_id = number | np.where(extended, int(EXTENDED), 0)
        return _Part(t_ns, bus, can_id, flags, source, length, why, data)

    def _times(self, group: _Group, start: int, stop: int) -> tuple[Ints, NDArray[np.bool_]]:
        """(t_ns, whether there is none) of each of some records (N,)."""
        table = group.table[start:stop]
        seconds = values(table, group.clock, start).astype(np.float64) if group.clock else np.full(len(table), np.nan)
        late = ~(np.abs(seconds) < FARTHEST_S)
        t_ns = self._start_ns + np.rint(np.where(late, 0.0, seconds) * 1e9).astype(np.int64)
        return t_ns, late | (t_ns < 0) | (t_ns >= LATE_NS)

    def _keys(self, number: int, group: _Group, step: int) -> Iterator[Ints]:
        """What the order of records goes by (3, N): the latest stamp so far, their group, their place in it."""
        latest = np.iinfo(np.int64).min
        for start in range(0, group.count, step):
            t_ns, _ = self._times(group, start, min(start + step, group.count))
            so_far = np.maximum(np.maximum.accumulate(t_ns), latest)
            latest = so_far[-1]
            yield np.stack([so_far, np.full(len(t_ns), number), np.arange(start, start + len(t_ns))])

    def _ordered(self, groups: Sequence[_Group]) -> Iterator[Frames]:
        """The frames of all groups, each group's in its own order, groups one among the other by time."""
        step = part_size(len(groups))
        starts = [0] * len(groups)
        for places in rows([self._keys(number, group, step) for number, group in enumerate(groups)], BATCH):
            ends = [start + len(own) for start, own in zip(starts, places, strict=True)]
            spans = [span for span in zip(groups, starts, ends, strict=True) if span[1] < span[2]]
            record = np.concatenate(places)
            at = np.argsort(record)
            whole = _joined([self._part(*span) for span in spans])
            begins = np.cumsum([0, *(stop - start for _, start, stop in spans)])
            bad = whole.why[at] != 0
            self.note_places(record[at], partial(_where, spans, begins, at))
            for place in np.flatnonzero(bad).tolist():
                group, index = _record(spans, begins, int(at[place]))
                where, raw = f"{group.kind} {index + 1:,}", group.table[index : index + 1][0, :SHOWN].tobytes()
                why = WHY[whole.why[at[place]] - 1]
                self.rejected.append(Rejected(int(record[at[place]]), where, why, raw))
            if not bad.all():
                yield _frames(whole, at[~bad], record[at[~bad]])
            starts = ends


Span = tuple[_Group, int, int]  # records of a group: the first, and that behind the last


def _joined(parts: Sequence[_Part]) -> _Part:
    """Several as one."""
    if len(parts) == 1:
        return parts[0]
    begins = np.cumsum([0, *(len(part.data) for part in parts[:-1])])
    placed = [replace(part, source=part.source + begin) for part, begin in zip(parts, begins, strict=True)]
    return _Part(**{one.name: np.concatenate([getattr(part, one.name) for part in placed]) for one in fields(_Part)})


def _record(spans: Sequence[Span], begins: Ints, at: int) -> tuple[_Group, int]:
    """The group that record `at` of all spans is of, and its number there."""
    number = int(np.searchsorted(begins, at, "right")) - 1
    group, start, _ = spans[number]
    return group, start + int(at - begins[number])


def _where(spans: Sequence[Span], begins: Ints, at: Ints, i: int) -> str:
    group, index = _record(spans, begins, int(at[i]))
    return group.where(index)


def _frames(whole: _Part, at: Ints, record: Ints) -> Frames:
    """The frames `at` (M,)."""
    offsets, data = payloads(whole.data, whole.source[at], whole.length[at])
    return Frames(
        whole.t_ns[at],
        whole.bus[at].astype(np.uint8),
        whole.can_id[at].astype(np.uint32),
        whole.flags[at].astype(np.uint8),
        offsets,
        data,
        record,
    )


def _bus_channels(group: MdfGroup) -> tuple[str, dict[str, MdfChannel]]:
    """What a group holds ("CAN_DataFrame"), and its channels by the last part of their names ("ID")."""
    found: dict[str, MdfChannel] = {}
    kind = MEASURED
    for channel in group.channels:
        match = NAME.search(channel.name)
        if match and match[2]:
            kind = match[1]
            found[match[2]] = channel
    return kind, found


def _coded(code: Ints, fd: NDArray[np.bool_]) -> Ints:
    """The bytes (N,) of frames with these data length codes."""
    lengths = np.array(FD_LENGTHS)[np.clip(code, 0, len(FD_LENGTHS) - 1)]
    return np.where(fd, lengths, np.minimum(lengths, LONGEST_CLASSIC))


def _payload(group: _Group, start: int, stop: int) -> tuple[NDArray[np.uint8], Ints, Ints]:
    """(bytes, where in them each payload begins, and how many each has), the latter two (N,)."""
    table, channel = group.table[start:stop], group.channels.get("DataBytes")
    count, size = table.shape
    if channel is None:
        return np.empty(0, np.uint8), np.zeros(count, np.int64), np.zeros(count, np.int64)
    if group.apart is None:
        held = min(channel.bits // 8, max(0, size - channel.byte))
        return table.reshape(-1), np.arange(count) * size + channel.byte, np.full(count, held)
    offsets = group.offsets.integers(start, stop) if group.offsets else _integers(table, channel, start)
    return gathered(group.apart, offsets, LONGEST_FD)


def _sent(table: NDArray[np.uint8], channel: MdfChannel | None) -> NDArray[np.bool_]:
    """Which records (N,) say that the logger sent the frame, as a number or as a text."""
    if channel is None or (channel.kind in VIRTUAL and channel.form >= TEXTS):
        return np.zeros(len(table), np.bool_)
    if channel.form >= TEXTS:
        sent: NDArray[np.bool_] = table[:, channel.byte : channel.byte + 1].max(axis=1, initial=0) == ord("T")
        return sent
    return np.asarray(_integers(table, channel) == 1)


def _integers(table: NDArray[np.uint8], channel: MdfChannel, first: int = 0) -> Ints:
    found = values(table, channel, first)
    if found.dtype.kind == "f":
        found = np.where(np.abs(found) < 1 << 62, np.nan_to_num(found), -1.0)
    return found.astype(np.int64)


def claims(path: Path) -> bool:
    """Whether an MF4 file says that it holds frames."""
    with path.open("rb") as file, suppress(BrokenBlock):
        mdf = MdfBlocks(file, path.stat().st_size, 0)
        groups = islice(_groups(mdf), MOST_GROUPS)
        names = (name for group in groups for name in islice(mdf.names(group), MOST_NAMES))
        return any((match := NAME.search(name)) and match[1] in FRAMES for name in names)
    return False


def _groups(mdf: MdfBlocks) -> Iterator[Block]:
    header = mdf.block(HEADER_AT, b"##HD")
    for data_group in mdf.chain(header.links[0] if header.links else 0, b"##DG"):
        yield from mdf.channel_groups(data_group)


reader = Mf4Log
