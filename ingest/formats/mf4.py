"""MF4 of bus loggers: CAN and CAN FD frames as ASAM's standard for bus logging has them (CANedge, Vector, CSM ...).

Sorted or not, packed or not, finalised or not: a logger that lost its power leaves a file that is read up to there. The
start is UTC; where the file says that it is local time, `[time] zone` tells which. Frames of several groups come in the
order of time. Error frames are found and rejected, remote frames have no payload; records of other buses (LIN ...) are
counted in `settings["other_records"]`. A file without frames is one of measured or decoded channels: `mdf`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, LATE_NS, REMOTE, TRANSMIT, Frames, Rejected, payloads
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    FD_LENGTHS,
    HIGHEST_BUS,
    HIGHEST_ID,
    HIGHEST_STANDARD,
    LONGEST_CLASSIC,
    LONGEST_FD,
    SHOWN,
    Ints,
)
from ingest.formats._mdf_blocks import Block, BrokenBlock, MdfBlocks, MdfChannel, MdfGroup
from ingest.formats._mdf_log import HEADER_AT, MdfLog
from ingest.formats._mdf_records import LENGTH, OPEN_OFFSETS, Mdf, Octets, Records, gathered
from ingest.formats._mdf_values import TEXTS, TIMES, VIRTUAL, values

EXTENDED_BIT = 31  # of an identifier of 32 bits
NAME = re.compile(r"(?:^|\.)(CAN_(?:Data|Remote|Error)Frame|[A-Z]+_\w+?)(?:\.(\w+))?$")
FRAMES = DATA, REMOTES, ERRORS = "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"
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


@dataclass
class _Part:
    """Records of one group as frames, all (N,). The payload of frame i is `data[source[i]:source[i] + length[i]]`."""

    called: str
    t_ns: Ints
    bus: Ints
    can_id: Ints
    flags: Ints
    source: Ints
    length: Ints
    why: Ints  # place in WHY + 1 of a record that is no frame, else 0
    data: NDArray[np.uint8]
    table: NDArray[np.uint8]  # (N, size of a record)
    where: Callable[[int], str]  # record i stands in the file


@dataclass
class Mf4Log(MdfLog):
    """An MF4 file, read as a whole."""

    _other: Counter[str] = field(default_factory=Counter)

    def batches(self) -> Iterator[Frames]:
        """Frames in the order of time. Raises UnreadableLogError where the file holds none."""
        with self._opened() as found:
            groups = ((mdf, records) for mdf, records in found if isinstance(mdf, Mdf))
            parts = [part for mdf, records in groups for part in self._parts(mdf, records)]
        self.settings["other_records"] = dict(sorted(self._other.items()))
        self.found = sum(len(part.t_ns) for part in parts)
        if not self.found:
            why = self._problems[0] if self._problems else "its groups of frames hold no record"
            raise UnreadableLogError(f"{self.path.name}: {why}: no CAN frame of it can be read. Copy the file again.")
        yield from self._ordered(parts)
        if self._problems:
            self.mark_cut("; ".join(self._problems[:3]), f"{self.found - len(self.rejected):,} frames")

    def _parts(self, mdf: Mdf, records: Records) -> Iterator[_Part]:
        """The frames of a data group; what is damaged in it is noted."""
        try:
            for group in records.groups:
                kind, channels = _bus_channels(group)
                table = records.of.get(group.at, ())
                if kind in FRAMES and len(table):
                    yield self._part(mdf, records, group, kind, channels)
                elif group.channels and len(table):
                    self._other[kind] += len(table)
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _part(
        self, mdf: Mdf, records: Records, group: MdfGroup, kind: str, channels: Mapping[str, MdfChannel]
    ) -> _Part:
        table = records.of[group.at][:]

        def value(name: str, otherwise: int = 0) -> Ints:
            channel = channels.get(name)
            return _integers(table, channel) if channel else np.full(len(table), otherwise, np.int64)

        t_ns, late = self._times(table, next((one for one in group.channels if one.kind in TIMES), None))
        number, bus = value("ID"), value("BusChannel", 1)
        extended = (value("IDE") != 0) | (number >> EXTENDED_BIT & 1 != 0)
        number &= (1 << EXTENDED_BIT) - 1
        fd = value("EDL") != 0
        flags = FD * fd | TRANSMIT * _sent(table, channels.get("Dir")) | REMOTE * (kind == REMOTES)
        data, source, held = _payload(mdf, records, table, channels.get("DataBytes"))
        length = value("DataLength") if "DataLength" in channels else _coded(value("DLC"), fd)
        length = length if kind == DATA else np.zeros(len(table), np.int64)
        wrong = (
            np.full(len(table), kind == ERRORS),
            late,
            (bus < 0) | (bus > HIGHEST_BUS),
            number > np.where(extended, HIGHEST_ID, HIGHEST_STANDARD),
            (length < 0) | (length > LONGEST_FD),
            held < length,
        )
        why = np.select(wrong, range(1, len(wrong) + 1), 0)
        can_id = number | np.where(extended, int(EXTENDED), 0)
        return _Part(kind, t_ns, bus, can_id, flags, source, length, why, data, table, partial(records.where, group))

    def _times(self, table: NDArray[np.uint8], channel: MdfChannel | None) -> tuple[Ints, NDArray[np.bool_]]:
        """(t_ns, whether there is none) of each record (N,)."""
        seconds = values(table, channel).astype(np.float64) if channel else np.full(len(table), np.nan)
        late = ~(np.abs(seconds) < FARTHEST_S)
        t_ns = self._start_ns + np.rint(np.where(late, 0.0, seconds) * 1e9).astype(np.int64)
        return t_ns, late | (t_ns < 0) | (t_ns >= LATE_NS)

    def _ordered(self, parts: list[_Part]) -> Iterator[Frames]:
        """The frames of all groups, each group's in its own order, groups one among the other by time."""
        latest = np.concatenate([np.maximum.accumulate(part.t_ns) for part in parts])
        order = np.argsort(latest, kind="stable")
        begins = np.cumsum([0, *(len(part.t_ns) for part in parts)])
        whole = _joined(parts)
        for first in range(0, self.found, BATCH):
            at = order[first : first + BATCH]
            bad = whole.why[at] != 0
            self.note_places(np.arange(first, first + len(at)), partial(_where, parts, begins, at))
            for place in np.flatnonzero(bad).tolist():
                part, index = _part_of(parts, begins, int(at[place]))
                where, raw = f"{part.called} {index + 1:,}", part.table[index, :SHOWN].tobytes()
                self.rejected.append(Rejected(first + place, where, WHY[part.why[index] - 1], raw))
            if not bad.all():
                yield _frames(whole, at[~bad], first + np.flatnonzero(~bad))


def _joined(parts: list[_Part]) -> _Part:
    """All groups as one, without their records."""
    if len(parts) == 1:
        return parts[0]
    names = ("t_ns", "bus", "can_id", "flags", "source", "length", "why", "data")
    begins = np.cumsum([0, *(len(part.data) for part in parts[:-1])])
    placed = [replace(part, source=part.source + begin) for part, begin in zip(parts, begins, strict=True)]
    arrays = {name: np.concatenate([getattr(part, name) for part in placed]) for name in names}
    return _Part("", **arrays, table=np.empty((0, 0), np.uint8), where=str)


def _part_of(parts: Sequence[_Part], begins: Ints, at: int) -> tuple[_Part, int]:
    """The part that record `at` of all is of, and its number there."""
    number = int(np.searchsorted(begins, at, "right")) - 1
    return parts[number], int(at - begins[number])


def _where(parts: Sequence[_Part], begins: Ints, at: Ints, i: int) -> str:
    part, index = _part_of(parts, begins, int(at[i]))
    return part.where(index)


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
    kind = "measured"
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


def _payload(
    mdf: Mdf, records: Records, table: NDArray[np.uint8], channel: MdfChannel | None
) -> tuple[NDArray[np.uint8], Ints, Ints]:
    """(bytes, where in them each payload begins, and how many each has), the latter two (N,)."""
    count, size = table.shape
    if channel is None:
        return np.empty(0, np.uint8), np.zeros(count, np.int64), np.zeros(count, np.int64)
    if channel.kind != VARIABLE:
        held = min(channel.bits // 8, max(0, size - channel.byte))
        return table.reshape(-1), np.arange(count) * size + channel.byte, np.full(count, held)
    apart: Octets | None = records.values.get(channel.values_at)
    if apart is None:
        apart = mdf.values(channel.values_at) if channel.values_at else b""
    offsets = _integers(table, channel)
    if mdf.open_parts & OPEN_OFFSETS:
        offsets = _in_turn(apart, count)
    starts, lengths = gathered(apart, offsets)
    return np.frombuffer(apart, np.uint8), starts, lengths


def _in_turn(values: Octets, count: int) -> Ints:
    """Where `count` values of variable length begin that follow each other."""
    offsets, at = np.full(count, len(values), np.int64), 0
    for i in range(count):
        if at + LENGTH.size > len(values):
            break
        offsets[i] = at
        at += LENGTH.size + LENGTH.unpack_from(values, at)[0]
    return offsets


def _sent(table: NDArray[np.uint8], channel: MdfChannel | None) -> NDArray[np.bool_]:
    """Which records (N,) say that the logger sent the frame, as a number or as a text."""
    if channel is None or (channel.kind in VIRTUAL and channel.form >= TEXTS):
        return np.zeros(len(table), np.bool_)
    if channel.form >= TEXTS:
        sent: NDArray[np.bool_] = table[:, channel.byte : channel.byte + 1].max(axis=1, initial=0) == ord("T")
        return sent
    return np.asarray(_integers(table, channel) == 1)


def _integers(table: NDArray[np.uint8], channel: MdfChannel) -> Ints:
    found = values(table, channel)
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
