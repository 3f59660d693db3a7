"""Messages of several packets put together, as J1939's transport protocol sends them (SAE J1939-21, 5.10).

To all (BAM) or to one address (RTS, CTS): a frame announces size and group, frames of seven bytes each follow in
order. A message that lacks a packet, or pauses longer than the protocol allows, is broken: its frames are counted so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ingest.formats import EXTENDED, REMOTE, Frames
from ingest.log.j1939 import Explained
from ingest.log.parameter_groups import BEGINS, DATA, LONGEST, MANAGEMENT, announced_group, identifier

CTS = 17
OTHERS = (CTS, 19, 255)  # of its messages that manage: go on, received, and given up
GIVEN_UP = 255
STEP = 7  # bytes of a packet
LONGEST_PAUSE_NS = 1_250_000_000  # between packets

Ints = NDArray[np.int64]
Place = tuple[int, int, int]  # bus, sender, receiver


@dataclass
class _Message:
    """A message on its way. `frames`: how many carried it so far; `wanted`: the number of the next packet."""

    can_id: int
    size: int
    packets: int
    t_ns: int
    data: bytearray = field(default_factory=bytearray)
    wanted: int = 1
    frames: int = 1


@dataclass(frozen=True)
class Decodable:
    """Frames to decode. `carried` (N,): how many frames of the log each of them is, None where each is one. Those that
    only managed a message have no data."""

    frames: Frames
    carried: Ints | None = None


class Unpacked:
    """The frames of a log as messages: identifiers as they are decoded, messages of several packets put together.

    `broken`: the first record of each message that is not whole -> how many frames it is; final after `finish`.
    """

    def __init__(self, means: Explained) -> None:
        self._means = means
        self._open: dict[Place, _Message] = {}
        self._began: dict[Place, int] = {}  # the record that announced it
        self.broken: dict[int, int] = {}

    def parts(self, frames: Frames) -> Iterator[Decodable]:
        """The frames of one bus, next in the order of the log, and what they complete."""
        packed = _packets(frames) if self._means.transport else np.zeros(0, np.bool_)
        if not packed.any():
            yield Decodable(self._means.renamed(frames))
            return
        yield Decodable(self._means.renamed(frames.taken(np.flatnonzero(~packed))))
        done = [one for i in np.flatnonzero(packed).tolist() if (one := self._take(frames, i))]
        if done:
            yield self._joined(frames, done)

    def finish(self) -> None:
        """The log is at its end: what is open is not whole."""
        for place in list(self._open):
            self._break(place)

    def _take(self, frames: Frames, i: int) -> tuple[int, _Message] | None:
        """Take a frame of the protocol; (its position, the message that it completes, or manages)."""
        can_id, t_ns, record = int(frames.can_id[i]), int(frames.t_ns[i]), int(frames.record[i])
        data = frames.data[frames.offsets[i] : frames.offsets[i + 1]].tobytes()
        source, target = can_id & 0xFF, can_id >> 8 & 0xFF
        place = int(frames.bus[i]), source, target
        if can_id >> 16 & 0xFF == DATA:
            message = self._packet(place, t_ns, data)
        elif len(data) < LONGEST or data[0] not in (*BEGINS, *OTHERS):
            message = None
        elif data[0] in BEGINS:
            self._break(place)
            size = int.from_bytes(data[1:3], "little")
            self._open[place] = _Message(
                identifier(announced_group(data), source, target), size, -(-size // STEP), t_ns
            )
            self._began[place] = record
            return None
        else:
            back = place[0], target, source
            message = self._managed(place if place in self._open and back not in self._open else back, data)
        if message is None:
            self.broken[record] = 1
        return (i, message) if message and (message.size == 0 or len(message.data) >= message.size) else None

    def _packet(self, place: Place, t_ns: int, data: bytes) -> _Message | None:
        """The message that a packet is the next of; None where it is of none."""
        message = self._open.get(place)
        if message is None:
            return None
        late = t_ns - message.t_ns > LONGEST_PAUSE_NS
        if late or len(data) < 2 or data[0] != message.wanted or message.wanted > message.packets:
            self._break(place)
            return None
        message.data += data[1:].ljust(STEP, b"\xff")
        message.wanted, message.t_ns, message.frames = message.wanted + 1, t_ns, message.frames + 1
        if message.wanted > message.packets:
            del self._open[place], self._began[place]
        return message

    def _managed(self, place: Place, data: bytes) -> _Message:
        """What a frame of the receiver says of a message: a message of size 0 that this one frame carried."""
        message = self._open.get(place)
        if message and data[0] == GIVEN_UP:
            self._break(place)
        elif message and data[0] == CTS and data[1] and 1 <= data[2] <= message.wanted:
            message.wanted = data[2]  # some are sent again
            del message.data[STEP * (message.wanted - 1) :]
        return _Message(identifier(announced_group(data), place[1], place[2]), 0, 0, 0)

    def _break(self, place: Place) -> None:
        if message := self._open.pop(place, None):
            self.broken[self._began.pop(place)] = message.frames

    def _joined(self, frames: Frames, done: list[tuple[int, _Message]]) -> Decodable:
        """Messages as frames, each at the time of its last packet."""
        whole = [bytes(message.data[: message.size]) for _, message in done]
        joined = replace(
            frames.taken(np.array([i for i, _ in done])),
            can_id=np.array([message.can_id for _, message in done], np.uint32),
            offsets=np.cumsum([0, *map(len, whole)]),
            data=np.frombuffer(b"".join(whole), np.uint8),
        )
        return Decodable(self._means.renamed(joined), np.array([message.frames for _, message in done]))


def _packets(frames: Frames) -> NDArray[np.bool_]:
    """Which frames (N,) are the protocol's."""
    second = frames.can_id >> np.uint32(16) & np.uint32(0xFF)
    return np.asarray(np.isin(second, (MANAGEMENT, DATA)) & (frames.can_id >= EXTENDED) & (frames.flags & REMOTE == 0))
