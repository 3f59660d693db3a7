"""The objects inside the unpacked stream of a BLF file, found and read with array operations.

An object is `LOBJ`, header size, header version, object size, type; those that carry a stamp continue with flags and
the stamp. Objects stand one behind the other with up to 4 bytes of padding. Layouts as in Vector's binary logging
format 4.x (the same that python-can and Vector_BLF read).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import FD, REMOTE, SHOWN, TRANSMIT, Frames, Rejected, payloads

Ints = NDArray[np.int64]

MAGIC = b"LOBJ"
PADDING = 4  # bytes between two objects, at most
LONGEST_OBJECT = 64 << 20  # bytes
LONGEST_FRAME = 1024  # bytes of an object that holds a frame; the longest is about 200
LONGEST_PAYLOAD = 64
MARGIN = 128  # zero bytes behind the stream, so that a layout may be laid over its very end
LAST_NS = np.iinfo(np.int64).max

HEADER = np.dtype(
    [
        ("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4"),
        ("flags", "<u4"), ("client", "<u4"), ("stamp", "<u8"),
    ]
)  # fmt: skip
BASE_BYTES = 16  # of the header, what every object has
SIZE_AT = 8  # in the header
CLASSIC = np.dtype([("bus", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4")])
FD_100 = np.dtype(
    [
        ("bus", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("frame_ns", "<u4"), ("bits", "u1"),
        ("fd_flags", "u1"), ("length", "u1"), ("reserved", "V5"),
    ]
)  # fmt: skip
FD_101 = np.dtype(
    [
        ("bus", "u1"), ("dlc", "u1"), ("length", "u1"), ("tries", "u1"), ("id", "<u4"), ("frame_ns", "<u4"),
        ("fd_flags", "<u4"), ("timing", "V18"), ("transmit", "u1"), ("extra", "u1"), ("crc", "<u4"),
    ]
)  # fmt: skip
CLASSIC_TYPES, FD_100_TYPES, FD_101_TYPES = (1, 86), (100,), (101,)
FRAME_TYPES = (*CLASSIC_TYPES, *FD_100_TYPES, *FD_101_TYPES)
ERROR_TYPES = (2, 73, 104)
OURS = (*FRAME_TYPES, *ERROR_TYPES)


def overlay(stream: bytes, layout: np.dtype[np.void], at: Ints) -> NDArray[np.void]:
    """The records of `layout` that begin at the bytes `at` of `stream` (which ends with MARGIN spare bytes)."""
    step = int(at[1] - at[0]) if len(at) > 1 else 1
    if step > 0 and len(at) and (np.diff(at) == step).all():  # at even distances: nothing has to be copied
        return np.ndarray((len(at),), layout, stream, int(at[0]), (step,))
    shape = (len(stream) - layout.itemsize + 1,)
    return np.ndarray(shape, layout, stream, strides=(1,))[at]


@dataclass(frozen=True)
class Objects:
    """The whole objects (N,) of a stream, and what remains of it for the next one."""

    at: Ints  # their first bytes
    head: NDArray[np.void]  # their headers
    damage: tuple[tuple[int, str], ...]  # (byte, why) where something else stood than an object
    rest: int  # the first byte that belongs before the next stream
    wanted: int  # the length that this must reach to hold a whole object
    aligned: bool  # whether it begins with one


def split(stream: bytes, *, aligned: bool) -> Objects:
    """Find the objects of `stream` (its MARGIN spare bytes not counted). Not `aligned`: it may begin inside an object.

    Every `LOBJ` is a candidate; the chain of sizes tells the true ones from those inside a payload. Python runs once
    for each break of that chain, never for each object.
    """
    length = len(stream) - MARGIN
    alike = _alike(stream, length) if aligned else 0
    if alike:
        count = length // alike
        at = np.arange(count) * alike
        return Objects(at, overlay(stream, HEADER, at), (), count * alike, 0, True)
    at = _candidates(stream, length)
    head = overlay(stream, HEADER, at)
    chain = _Chain.of(at, head, length)
    taken, damage, lost = chain.walk(aligned)
    at, head, end = at[taken], head[taken], chain.end[taken]
    if lost and damage and not stream[damage[-1][0] : length].strip(b"\0"):
        damage = damage[:-1]  # some writers fill up the end with zeros
    if lost:
        return Objects(at, head, damage, max(0, length - BASE_BYTES + 1), 0, False)
    if len(at) and end[-1] > length:
        return Objects(at[:-1], head[:-1], damage, int(at[-1]), int(end[-1] - at[-1]), True)
    return Objects(at, head, damage, int(end[-1]) if len(at) else 0, 0, True)


def _alike(stream: bytes, length: int) -> int:
    """The length of each object where all of a stream are equally long, as classic frames are: their chain is seen at a
    glance then. 0 where they are not."""
    size = int.from_bytes(stream[SIZE_AT : SIZE_AT + 4], "little")
    if not HEADER.itemsize <= size <= min(length, LONGEST_FRAME) or size % PADDING:
        return 0
    count = length // size
    words = np.ndarray((2, count), "<u4", stream, 0, (SIZE_AT, size))  # the mark and the size of each
    marks = words == np.array([[int.from_bytes(MAGIC, "little")], [size]], np.uint32)
    rest = stream[count * size : min(length, count * size + len(MAGIC))]
    return size if marks.all() and MAGIC.startswith(rest) else 0


def _candidates(stream: bytes, length: int) -> Ints:
    """Where `LOBJ` stands with a whole header behind it."""
    octets = np.frombuffer(stream, np.uint8)[: max(0, length - BASE_BYTES + len(MAGIC))]
    if len(octets) < len(MAGIC):
        return np.empty(0, np.int64)
    hit = np.ones(len(octets) - len(MAGIC) + 1, bool)
    for offset, letter in enumerate(MAGIC):
        hit &= octets[offset : offset + len(hit)] == letter
    return np.flatnonzero(hit)


@dataclass(frozen=True)
class _Chain:
    """Candidates (N,) and whether the size in each leads to the next."""

    at: Ints
    end: Ints
    following: Ints  # the first candidate at or after `end`
    possible: NDArray[np.bool_]  # its size is one that an object of its type can have
    good: NDArray[np.bool_]  # and an object, or the end of the stream, follows it
    length: int

    @classmethod
    def of(cls, at: Ints, head: NDArray[np.void], length: int) -> _Chain:
        size = head["size"].astype(np.int64)
        end = at + size
        following = np.searchsorted(at, end)
        gap = np.append(at, end.max(initial=0) + length)[following] - end
        frame = np.isin(head["type"], OURS)
        possible = (size >= BASE_BYTES) & (size <= np.where(frame, LONGEST_FRAME, LONGEST_OBJECT))
        good = possible & ((gap <= PADDING) | (end > length - BASE_BYTES))
        return cls(at, end, following, possible, good, length)

    def walk(self, aligned: bool) -> tuple[Ints, tuple[tuple[int, str], ...], bool]:
        """Candidates that are objects, the damage between them, and whether the stream ends in damage."""
        count = len(self.at)
        goods = np.append(np.flatnonzero(self.good), count)
        breaks = np.append(np.flatnonzero(~self.good | (self.following != np.arange(1, count + 1))), count - 1)
        taken: list[Ints] = []
        damage: list[tuple[int, str]] = []
        here = 0
        if not aligned or (count and self.at[0] > PADDING) or (not count and self.length > BASE_BYTES + PADDING):
            damage += [(0, "no object begins here")] if aligned else []
            here = int(goods[0])
            if here == count:
                return np.empty(0, np.int64), tuple(damage), True
        while here < count:
            last = int(breaks[np.searchsorted(breaks, here)])
            if self.good[last]:
                taken.append(np.arange(here, last + 1))
                here = int(self.following[last])
                continue
            resume = int(goods[np.searchsorted(goods, last + 1)])
            whole = self.possible[last] and self.end[last] <= (self.at[resume] if resume < count else self.length)
            taken.append(np.arange(here, last + whole))
            damage.append(self._damage(last, bool(whole)))
            here = resume
            if here == count:
                return np.concatenate(taken), tuple(damage), True
        return np.concatenate([np.empty(0, np.int64), *taken]), tuple(damage), False

    def _damage(self, index: int, whole: bool) -> tuple[int, str]:
        if whole:
            return int(self.end[index]), "no object begins here"
        return int(self.at[index]), f"an object says it is {int(self.end[index] - self.at[index]):,} bytes long"


# ---- objects that are frames ---------------------------------------------------------------------------------------

WHY = (
    "",
    "error frame",
    "its object is too short for its type",
    "its channel is above 255",
    f"its payload is longer than {LONGEST_PAYLOAD} bytes",
    "its stamp is beyond the year 2262",
)
FINE, ERROR_FRAME, SHORT, CHANNEL, LONG, LATE = range(len(WHY))
ID_BITS = 0x9FFF_FFFF  # 29 bits, and bit 31 for an extended identifier
FIELDS = {"why": "u1", "bus": "u1", "id": "<u4", "flags": "u1", "source": "<i8", "length": "<i8", "present": "<i8"}
Fields = dict[str, NDArray[Any]]  # of objects (N,), by the names in FIELDS


def read_frames(
    stream: bytes,
    objects: Objects,
    start_ns: int,
    first_record: int,
    where: Callable[[int], str],
    note: Callable[[Ints, Callable[[int], str]], None] = lambda *_: None,
) -> tuple[Frames, list[Rejected]]:
    """The frames among `objects`, and what had to be rejected: error frames, damage, impossible values.

    Stamps count from `start_ns` [ns], records from `first_record` in the order of the stream; `where` says a byte.
    `note` hears the records with the place of each.
    """
    at, head = objects.at, objects.head
    ours = is_one(head["type"], OURS)
    if not ours.all():
        at, head = at[ours], head[ours]
    fields = _fields(stream, at, head)
    t_ns = _stamps(head, start_ns, fields["why"])
    fields["why"][is_one(head["type"], ERROR_TYPES)] = ERROR_FRAME
    damaged_at = np.array([byte for byte, _ in objects.damage], np.int64)
    record = np.arange(first_record, first_record + len(at))
    if len(damaged_at):
        record += np.searchsorted(damaged_at, at)
    note(record, lambda i: where(int(at[i])))
    rejected = [
        Rejected(
            int(record[i]), where(int(at[i])), WHY[fields["why"][i]], stream[at[i] : at[i] + head["size"][i]][:SHOWN]
        )
        for i in np.flatnonzero(fields["why"])
    ]
    order = first_record + np.searchsorted(at, damaged_at) + np.arange(len(damaged_at))
    for (byte, why), number in zip(objects.damage, order, strict=True):
        rejected.append(Rejected(int(number), where(byte), why, stream[byte : byte + SHOWN]))
    return _frames(stream, fields, t_ns, record), sorted(rejected, key=lambda entry: entry.record)


def is_one(kind: NDArray[Any], types: Sequence[int]) -> NDArray[np.bool_]:
    """Which objects (N,) are of one of these types."""
    found = np.zeros(len(kind), np.bool_)
    for one in types:
        found |= kind == one
        if found.all():
            break
    return found


def _fields(stream: bytes, at: Ints, head: NDArray[np.void]) -> Fields:
    """FIELDS of each object; `why` is SHORT where no layout fits."""
    fields: Fields = {name: np.zeros(len(at), kind) for name, kind in FIELDS.items()}
    fields["why"][:] = SHORT
    header = head["header"].astype(np.int64)
    space = head["size"] - header
    space[header < HEADER.itemsize] = -1
    for types, layout, read in LAYOUTS:
        fits = is_one(head["type"], types) & (space >= layout.itemsize)
        if fits.all():
            return _read(stream, layout, read, at, header, space)
        which = np.flatnonzero(fits)
        found = _read(stream, layout, read, at[which], header[which], space[which])
        for name in FIELDS:
            fields[name][which] = found[name]
    return fields


def _read(stream: bytes, layout: np.dtype[np.void], read: Read, at: Ints, header: Ints, space: Ints) -> Fields:
    """FIELDS of objects (N,) of one layout, behind headers of `header` bytes with `space` bytes behind these."""
    part = overlay(stream, layout, at + header)
    flags, length, present = read(part, space - layout.itemsize, header)
    why = np.zeros(len(at), np.uint8)
    for problem, there in ((SHORT, present < 0), (CHANNEL, part["bus"] > 0xFF), (LONG, length > LONGEST_PAYLOAD)):
        why[there] = problem
    length[flags & REMOTE != 0] = 0
    source = at + header + layout.itemsize
    values: tuple[NDArray[Any], ...] = (why, part["bus"], part["id"] & ID_BITS, flags, source, length, present)
    return {name: value.astype(FIELDS[name], copy=False) for name, value in zip(FIELDS, values, strict=True)}


def _classic(part: NDArray[np.void], space: Ints, _: Ints) -> tuple[NDArray[Any], Ints, Ints]:
    length = np.minimum(part["dlc"], 8).astype(np.int64)
    return _flags(part, 0), length, np.where(space < length, -1, length)


def _fd_100(part: NDArray[np.void], space: Ints, _: Ints) -> tuple[NDArray[Any], Ints, Ints]:
    length = part["length"].astype(np.int64)
    return _flags(part, part["fd_flags"] & 1), length, np.where(space < length, -1, length)


def _fd_101(part: NDArray[np.void], space: Ints, header: Ints) -> tuple[NDArray[Any], Ints, Ints]:
    """(flags, length, room for the payload) of CAN FD objects of type 101.

    `extra`: where further data begins, from the start of the object; what that leaves out of a payload is zero.
    """
    bits, extra = part["fd_flags"].astype(np.int64), part["extra"].astype(np.int64)
    flags = FD * (bits >> 12 & 1) | REMOTE * (bits >> 4 & 1) | TRANSMIT * (part["transmit"] != 0)
    space = np.where(extra > 0, np.clip(extra - header - FD_101.itemsize, 0, space), space)
    return flags, part["length"].astype(np.int64), space


def _flags(part: NDArray[np.void], fd: NDArray[Any] | int) -> NDArray[Any]:
    bits = part["flags"]
    return REMOTE * (bits >> 7) | TRANSMIT * (bits & 1) | FD * fd


Read = Callable[[NDArray[np.void], Ints, Ints], tuple[NDArray[Any], Ints, Ints]]
LAYOUTS: tuple[tuple[tuple[int, ...], np.dtype[np.void], Read], ...] = (
    (CLASSIC_TYPES, CLASSIC, _classic),
    (FD_100_TYPES, FD_100, _fd_100),
    (FD_101_TYPES, FD_101, _fd_101),
)


def _stamps(head: NDArray[np.void], start_ns: int, why: NDArray[np.uint8]) -> Ints:
    """Stamps of objects [ns]: with flag 1 they count 10 us in the file, else 1 ns."""
    scale = np.where(head["flags"] == 1, np.uint64(10_000), np.uint64(1))
    most = LAST_NS - max(0, start_ns)
    late = head["stamp"] > np.where(scale == 1, np.uint64(most), np.uint64(most // 10_000))
    why[late] = LATE
    since = head["stamp"] * scale
    since[late] = 0
    return since.view(np.int64) + start_ns


def _frames(stream: bytes, fields: Fields, t_ns: Ints, record: Ints) -> Frames:
    fine = fields["why"] == FINE
    if not fine.all():
        fields, t_ns, record = {name: values[fine] for name, values in fields.items()}, t_ns[fine], record[fine]
    length, present = fields["length"], fields["present"]
    offsets, data = payloads(np.frombuffer(stream, np.uint8), fields["source"], length)
    if (present < length).any():
        inside = np.arange(offsets[-1]) - np.repeat(offsets[:-1], length)
        data[inside >= np.repeat(present, length)] = 0
    return Frames(t_ns, fields["bus"], fields["id"], fields["flags"], offsets, data, record)
