"""MF4 of bus loggers: CAN and CAN FD frames as ASAM's standard for bus logging has them (CANedge, Vector, CSM ...).

Sorted or not, packed or not, finalised or not: a logger that lost its power leaves a file that is read up to there. The
start is UTC; where the file says that it is local time, `[time] zone` tells which. Frames of several groups come in the
order of time. Error frames are found and rejected, remote frames have no payload; records of other buses (LIN ...) are
counted in `settings["other_records"]`. Files of measured or decoded channels hold no frames, and are refused.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EARLIEST_NS, EPOCH, EXTENDED, FD, LATE_NS, REMOTE, TRANSMIT, Frames, Log, Rejected
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
    payloads,
)
from ingest.formats._mdf_blocks import (
    LENGTH,
    OPEN_OFFSETS,
    Block,
    BrokenBlock,
    Mdf,
    MdfChannel,
    MdfGroup,
    Records,
    gathered,
)

FILE_HEAD = struct.Struct("<8s8s8s4xH30xHH")  # mark, version, program, version, what is not written yet
START = struct.Struct("<QhhB")  # ns, offsets [min], flags
HEADER_AT = 64
LOCAL_TIME = 1  # flag of a start
EXTENDED_BIT = 31  # of an identifier of 32 bits
UNFINISHED = b"UnFinMF "
NAME = re.compile(r"(?:^|\.)(CAN_(?:Data|Remote|Error)Frame|[A-Z]+_\w+?)(?:\.(\w+))?$")
DATA, REMOTES, ERRORS = "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"
BATCH = 100_000
TEXTS = 6  # forms from here on are texts or bytes
TIMES = (2, 3)  # kinds of a channel of time
VIRTUAL = (3, 6)  # kinds of a channel that lies in no record
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


@dataclass
class Mf4Log(Log):
    """An MF4 file, read as a whole."""

    _start_ns: int = 0
    _problems: list[str] = field(default_factory=list)
    _other: Counter[str] = field(default_factory=Counter)

    def batches(self) -> Iterator[Frames]:
        """Frames in the order of time. Raises UnreadableLogError where the file holds none."""
        with self.path.open("rb") as file:
            parts = list(self._parts(file))
        self.settings["other_records"] = dict(sorted(self._other.items()))
        self.found = sum(len(part.t_ns) for part in parts)
        if not self.found:
            self._refuse()
        yield from self._ordered(parts)
        if self._problems:
            self.mark_cut("; ".join(self._problems[:3]), f"{self.found - len(self.rejected):,} frames")

    def _refuse(self) -> None:
        if self._problems:
            raise UnreadableLogError(
                f"{self.path.name}: {self._problems[0]}: no CAN frame of it can be read. Copy the file again."
            )
        raise UnreadableLogError(
            f"{self.path.name}: is an MF4 file without CAN frames ({self._other.total():,} records of other kinds): "
            "measured or decoded channels in MF4 are not read. Export them as CSV with the program that wrote them, or "
            f"with asammdf: MDF('{self.path.name}').export('csv')."
        )

    def _parts(self, file: IO[bytes]) -> Iterator[_Part]:
        size = self.path.stat().st_size
        head = file.read(FILE_HEAD.size)
        if len(head) < FILE_HEAD.size:
            self._problems.append(f"ends inside its header ({size:,} bytes)")
            return
        mark, version, _, _, open_parts, _ = FILE_HEAD.unpack(head)
        self.settings["version"] = version.split(b"\0")[0].decode("latin-1").strip()
        self.settings["finalised"] = mark != UNFINISHED
        mdf = Mdf(file, size, open_parts if mark == UNFINISHED else 0)
        try:
            header = mdf.block(HEADER_AT, b"##HD")
            self._take_start(header.data)
            for data_group in mdf.chain(header.links[0] if header.links else 0, b"##DG"):
                yield from self._group_parts(mdf, data_group)
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _take_start(self, data: bytes) -> None:
        start_ns, _, _, flags = START.unpack_from(data.ljust(START.size, b"\0"))
        if flags & LOCAL_TIME and start_ns < LATE_NS:
            start_ns = self.time.wall_ns((EPOCH + timedelta(microseconds=start_ns // 1000)).replace(tzinfo=None)) or 0
        dated = EARLIEST_NS <= start_ns < LATE_NS
        self.absolute = dated or self.time.start_ns is not None
        self._start_ns = self.time.start_ns if self.time.start_ns is not None else start_ns if dated else 0

    def _group_parts(self, mdf: Mdf, data_group: Block) -> Iterator[_Part]:
        """The frames of a data group; one that is damaged is noted, and the next is read."""
        try:
            records = mdf.records(data_group)
            for group in records.groups:
                kind, channels = _bus_channels(group)
                table = records.of.get(group.at, ())
                if kind in (DATA, REMOTES, ERRORS) and len(table):
                    yield self._part(mdf, records, group, kind, channels)
                elif group.channels and len(table):
                    self._other[kind] += len(table)
            if records.ended:
                self._problems.append(records.ended)
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _part(
        self, mdf: Mdf, records: Records, group: MdfGroup, kind: str, channels: Mapping[str, MdfChannel]
    ) -> _Part:
        table = records.of[group.at]

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
        return _Part(kind, t_ns, bus, can_id, flags, source, length, why, data, table)

    def _times(self, table: NDArray[np.uint8], channel: MdfChannel | None) -> tuple[Ints, NDArray[np.bool_]]:
        """(t_ns, whether there is none) of each record (N,)."""
        seconds = _values(table, channel).astype(np.float64) if channel else np.full(len(table), np.nan)
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
            for place in np.flatnonzero(bad).tolist():
                number = int(np.searchsorted(begins, at[place], "right")) - 1
                part, index = parts[number], int(at[place] - begins[number])
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
    return _Part("", **arrays, table=np.empty((0, 0), np.uint8))


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
    values = records.values.get(channel.values_at)
    if values is None:
        values = mdf.values(channel.values_at)[0] if channel.values_at else b""
    offsets = _integers(table, channel)
    if mdf.open_parts & OPEN_OFFSETS:
        offsets = _in_turn(values, count)
    starts, lengths = gathered(values, offsets)
    return np.frombuffer(values, np.uint8), starts, lengths


def _in_turn(values: bytes, count: int) -> Ints:
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
    values = _values(table, channel)
    if values.dtype.kind == "f":
        values = np.where(np.abs(values) < 1 << 62, np.nan_to_num(values), -1.0)
    return values.astype(np.int64)


def _values(table: NDArray[np.uint8], channel: MdfChannel) -> NDArray[Any]:
    """The values (N,) of a channel, converted."""
    if channel.kind in VIRTUAL:
        return channel.convert(np.arange(len(table)))
    width = (channel.bit + channel.bits + 7) // 8
    if not 0 < width <= 8 or channel.byte + width > table.shape[1]:
        raise BrokenBlock(f'is damaged: channel "{channel.name[:SHOWN]}" lies outside its records')
    octets = table[:, channel.byte : channel.byte + width]
    octets = octets[:, ::-1] if channel.form % 2 and channel.form < TEXTS else octets
    whole = np.zeros((len(table), 8), np.uint8)
    whole[:, :width] = octets
    raw = whole.view("<u8")[:, 0]
    if channel.form in (4, 5):
        return channel.convert(raw.view(np.float64) if width == 8 else raw.astype(np.uint32).view(np.float32))
    raw = raw >> np.uint64(channel.bit)
    if channel.bits < 64:
        raw &= np.uint64((1 << channel.bits) - 1)
    return channel.convert(raw.astype(np.int64))


reader = Mf4Log
