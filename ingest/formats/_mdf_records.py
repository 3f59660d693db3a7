"""The records of an MF4 file: their bytes, packed or not, in one piece or many, sorted or not."""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import SEEK_END
from itertools import accumulate
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ingest.formats import most_unpacked
from ingest.formats._mdf_blocks import HEAD, VLSD_GROUP, Block, BrokenBlock, MdfBlocks, MdfGroup, link, unpack

DATA_GROUP = struct.Struct("<B")
PACKED = struct.Struct("<2sBxIQQ")
LENGTH = struct.Struct("<I")  # before each value of variable length
AT_ONCE = 32 << 20  # bytes of records that are read at once
WINDOW = 4 << 20  # bytes in which records of several kinds are looked for at once: above the longest record
APART = 256  # bytes between values of variable length above which they are read one by one
RATIO = 1100  # which deflate cannot exceed
OPEN_LENGTH, OPEN_OFFSETS = 1 << 2, 1 << 6  # of a file that was not finalised: what in it is not written yet
PLAIN_MARKS = (b"##DT", b"##SD")

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]


class Piece(NamedTuple):
    """Some of the bytes of a data group: they begin at `begin` of all, and at byte `at` of the file (`packed`: in the
    block there)."""

    begin: int
    at: int
    packed: bool = False


class FileBytes(NamedTuple):
    """`length` bytes of a data group, from byte `at` of a file on."""

    file: IO[bytes]
    at: int
    length: int

    def read(self, start: int = 0, stop: int | None = None) -> bytes:
        """Some of them."""
        self.file.seek(self.at + start)
        return self.file.read((self.length if stop is None else min(stop, self.length)) - start)


class Stored:
    """Records (N, size) that lie in files, in parts, and are read as they are asked for."""

    def __init__(self, parts: Sequence[FileBytes], count: int, size: int) -> None:
        self._parts, self.shape = parts, (count, size)
        self._ends = [*accumulate(part.length for part in parts)]
        self._last: tuple[int, int, Bytes] = (0, 0, np.empty((0, size), np.uint8))  # columns are asked one by one

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, some: slice) -> Bytes:
        count, size = self.shape
        start, stop, _ = some.indices(count)
        if self._last[:2] != (start, stop):
            data = b"".join(self._read(start * size, stop * size))
            self._last = (start, stop, np.frombuffer(data, np.uint8).reshape(stop - start, size))
        return self._last[2]

    def integers(self, start: int, stop: int) -> Ints:
        """Records of eight bytes as numbers (N,)."""
        return self[start:stop].reshape(-1).view(np.int64)

    def _read(self, start: int, stop: int) -> Iterator[bytes]:
        """The bytes from `start` to before `stop` of all, a part at a time."""
        for number in range(bisect_right(self._ends, start), len(self._parts)):
            part, begin = self._parts[number], self._ends[number] - self._parts[number].length
            if begin >= stop:
                return
            yield part.read(max(0, start - begin), stop - begin)


def octets(parts: Sequence[FileBytes]) -> Stored:
    """All bytes of some parts, as records of one byte."""
    return Stored(parts, _whole(parts), 1)


def kept(data: bytes, waiting: IO[bytes]) -> FileBytes:
    """Bytes to be read again, at the end of the file `waiting`."""
    at = waiting.seek(0, SEEK_END)
    waiting.write(data)
    return FileBytes(waiting, at, len(data))


def chunks(table: Stored, start: int, stop: int) -> Iterator[tuple[int, Bytes]]:
    """Records from `start` to before `stop` as (number of the first, some of them), at most `AT_ONCE` bytes of them."""
    step = max(1, AT_ONCE // max(1, table.shape[1]))
    return ((first, table[first : min(first + step, stop)]) for first in range(start, stop, step))


@dataclass(frozen=True)
class Records:
    """Records of a data group: `of` by the place of their group, each (N, size); `ended`: why they are not whole.
    `begins` of each record among all bytes, as integers, by the place of its group, where there are several kinds."""

    groups: tuple[MdfGroup, ...]
    of: Mapping[int, Stored]
    values: Mapping[int, Stored]  # bytes of those of variable length, by the place of their group
    ended: str | None
    pieces: Sequence[Piece] = ()
    begins: Mapping[int, Stored] = field(default_factory=dict)

    def where(self, group: MdfGroup, i: int) -> str:
        """Where record `i` of a group begins in the file."""
        begins = self.begins.get(group.at)
        begin = i * group.size if begins is None else int(begins.integers(i, i + 1)[0])
        piece = next(one for one in reversed(self.pieces) if one.begin <= begin)
        inside = begin - piece.begin
        return f"byte {piece.at:,}, unpacked +{inside:,}" if piece.packed else f"byte {piece.at + inside:,}"


class Mdf(MdfBlocks):
    """An open file with its records. `waiting`: an empty file for what is unpacked."""

    def __init__(self, file: IO[bytes], size: int, open_parts: int, waiting: IO[bytes]) -> None:
        super().__init__(file, size, open_parts)
        self._left = most_unpacked(size)
        self.waiting = waiting

    def records(self, data_group: Block) -> Records:
        """All records of a data group. Raises BrokenBlock where its description is none."""
        groups = self.groups(data_group)
        (id_size,) = unpack(DATA_GROUP, data_group)
        if id_size not in (0, 1, 2, 4, 8) or (id_size == 0 and len(groups) > 1):
            raise BrokenBlock(f"is damaged at byte {data_group.at:,}")
        if not any(group.channels for group in groups):
            return Records(groups, {}, {}, None)
        parts, ended, pieces = self._found(link(data_group, 2)) if link(data_group, 2) else ([], None, [])
        if id_size:
            found = unsorted_records(groups, octets(parts), id_size, ended, self.waiting)
        else:
            found = self._sorted(groups, parts, ended)
        found = replace(found, pieces=pieces)
        lacking = sum(max(0, group.declared - len(found.of[group.at])) for group in groups if group.channels)
        if lacking and not self.open_parts and found.ended is None:
            return replace(found, ended=f"holds {lacking:,} records fewer than it says")
        return found

    def _sorted(self, groups: tuple[MdfGroup, ...], parts: Sequence[FileBytes], ended: str | None) -> Records:
        """Records of one kind; what stands behind those that a finalised file says it has is none."""
        (group,) = groups
        length = sum(part.length for part in parts)
        count = length // group.size if group.size else 0
        if self.open_parts and count * group.size < length:
            ended = ended or "ends inside a record"
        if group.declared and not self.open_parts:
            count = min(count, group.declared)
        return Records(groups, {group.at: Stored(parts, count, group.size)}, {}, ended)

    def values(self, at: int) -> Stored:
        """The bytes in the data blocks that begin at `at`, as far as they are whole."""
        return octets(self._found(at)[0])

    def _found(self, at: int) -> tuple[list[FileBytes], str | None, list[Piece]]:
        """The bytes in the data blocks that begin at `at`, why they are not whole, and where they stand."""
        ended, parts, pieces, begin = None, list[FileBytes](), list[Piece](), 0
        try:
            for place, packed, part in self._pieces(at):
                pieces.append(Piece(begin, place, packed))
                parts.append(part)
                begin += part.length
        except BrokenBlock as broken:
            ended = str(broken)
        return parts, ended, pieces

    def _pieces(self, at: int) -> Iterator[tuple[int, bool, FileBytes]]:
        """(byte of the file, whether a packed block stands there, bytes) of each block."""
        mark, length, _ = self.head(at)
        if mark == b"##HL":
            at = link(self.block(at, mark), 0)
            mark, length, _ = self.head(at)
        if mark == b"##DL":
            for block in self.chain(at, mark):
                for part in filter(None, block.links[1:]):
                    yield from self._piece(part, *self.head(part)[:2])
        else:
            yield from self._piece(at, mark, length)

    def _piece(self, at: int, mark: bytes, length: int) -> Iterator[tuple[int, bool, FileBytes]]:
        if mark == b"##DZ":
            yield at, True, kept(self._unpacked(at, length), self.waiting)
            return
        if mark not in PLAIN_MARKS or length < HEAD.size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        end, begin = at + length, at + HEAD.size
        if self.open_parts & OPEN_LENGTH and mark == b"##DT" and self.read(end, 2) != b"##":
            end = self._size
        yield begin, False, FileBytes(self._file, begin, max(0, min(end, self._size) - begin))
        if end > self._size:
            raise BrokenBlock(f"ends at byte {self._size:,} of {end:,}")

    def _unpacked(self, at: int, length: int) -> bytes:
        if at + length > self._size or length < HEAD.size + PACKED.size:
            raise BrokenBlock(f"ends inside a packed block at byte {at:,}")
        body = self.read(at + HEAD.size, length - HEAD.size)
        _, method, columns, size, packed = PACKED.unpack_from(body)
        if method > 1 or size > RATIO * max(1, packed) or packed > len(body) - PACKED.size:
            raise BrokenBlock(f"is damaged, or packed in a way that is not read, at byte {at:,}")
        self._left -= size
        if self._left < 0:
            raise BrokenBlock(f"unpacks to more than {most_unpacked(self._size):,} bytes, from byte {at:,} on")
        try:
            data = zlib.decompressobj().decompress(body[PACKED.size : PACKED.size + packed], size + 1)
        except zlib.error:
            data = b""
        if len(data) != size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        return _upright(data, columns) if method else data


def gathered(values: Stored, offsets: Ints, most: int) -> tuple[Bytes, Ints, Ints]:
    """Values of variable length at `offsets` (N,): (bytes, where in them each begins, lengths), the latter two (N,).

    Of each at most `most` bytes are read. Length -1 where there is none.
    """
    fine = np.flatnonzero((offsets >= 0) & (offsets <= len(values) - LENGTH.size))
    fine = fine[np.argsort(offsets[fine], kind="stable")]
    at = offsets[fine]
    runs = [run for run in np.split(at, np.flatnonzero(np.diff(at) > APART) + 1) if len(run)]
    read = [values[int(run[0]) : int(run[-1]) + LENGTH.size + most].reshape(-1) for run in runs]
    begins = np.cumsum([0, *map(len, read)])
    data = np.concatenate([np.empty(0, np.uint8), *read])
    starts, lengths = np.zeros(len(offsets), np.int64), np.full(len(offsets), -1, np.int64)
    inside = [run - run[0] + begin for run, begin in zip(runs, begins, strict=False)]
    starts[fine] = np.concatenate([np.empty(0, np.int64), *inside])
    heads = data[starts[fine][:, None] + np.arange(LENGTH.size)]
    lengths[fine] = heads.astype(np.int64) @ (1 << 8 * np.arange(LENGTH.size))
    starts += LENGTH.size
    lengths[offsets + LENGTH.size + lengths > len(values)] = -1
    return data, starts, lengths


def in_turn(values: Stored, count: int, waiting: IO[bytes]) -> Stored:
    """Where `count` values of variable length begin that follow each other, as integers."""
    parts, at, end = list[FileBytes](), 0, len(values)
    while count:
        some, begin, found = values[at : at + WINDOW].tobytes(), at, list[int]()
        while len(found) < count and (inside := at - begin) + LENGTH.size <= len(some):
            found.append(at)
            at += LENGTH.size + LENGTH.unpack_from(some, inside)[0]
        found = found or [end] * min(count, WINDOW)
        parts.append(kept(np.array(found, np.int64).tobytes(), waiting))
        count -= len(found)
    return Stored(parts, _whole(parts) // 8, 8)


def unsorted_records(
    groups: tuple[MdfGroup, ...], data: Stored, id_size: int, ended: str | None, waiting: IO[bytes]
) -> Records:
    """Records of several kinds, each with the number of its kind before it; they are kept sorted in `waiting`."""
    sizes = {group.record_id: None if group.flags & VLSD_GROUP else group.size for group in groups}
    of, begins, values = ({group.at: list[FileBytes]() for group in groups} for _ in range(3))
    at, end, is_known = 0, len(data), True
    while at + id_size <= end and is_known:
        window = data[at : at + WINDOW].reshape(-1)
        starts, pieces, inside, kind = _split(window.tobytes(), sizes, id_size, at + len(window) == end)
        for group in groups:
            own = np.array(starts[group.record_id], np.int64)
            own = own[own + group.size <= len(window)]
            of[group.at].append(kept(window[own[:, None] + np.arange(group.size)].tobytes(), waiting))
            begins[group.at].append(kept((own + at).tobytes(), waiting))
            values[group.at].append(kept(b"".join(pieces[group.record_id]), waiting))
            if kind == group.record_id and sizes[kind] is None:  # its last value may end far behind
                for begin in range(at + len(window), min(at + inside, end), WINDOW):
                    part = data[begin : min(begin + WINDOW, at + inside)]
                    values[group.at].append(kept(part.tobytes(), waiting))
        at += inside
        is_known = kind in sizes
        if not is_known:
            ended = ended or f"is damaged behind {at:,} bytes of records"
    if at > end:
        ended = ended or "ends inside a record"
    return Records(
        groups,
        {group.at: Stored(of[group.at], _whole(begins[group.at]) // 8, group.size) for group in groups},
        {place: octets(parts) for place, parts in values.items()},
        ended,
        begins={place: Stored(parts, _whole(parts) // 8, 8) for place, parts in begins.items()},
    )


def _split(
    some: bytes, sizes: Mapping[int, int | None], id_size: int, is_last: bool
) -> tuple[dict[int, list[int]], dict[int, list[bytes]], int, int]:
    """(where records of a fixed size begin, values of variable length, both by kind; bytes that they take; the last
    kind) of the whole records in `some`, and of one that goes on behind where it is the first or `is_last`."""
    starts = {kind: list[int]() for kind in sizes}
    pieces = {kind: list[bytes]() for kind in sizes}
    at, end, kind = 0, len(some), 0
    while at + id_size <= end:
        kind = int.from_bytes(some[at : at + id_size], "little")
        if kind not in sizes:
            break
        begin, size = at + id_size, sizes[kind]
        if size is None:
            size = LENGTH.size + (LENGTH.unpack_from(some, begin)[0] if begin + LENGTH.size <= end else end)
        if begin + size > end and at and not is_last:
            break
        if sizes[kind] is None:
            pieces[kind].append(some[begin : begin + size])
        else:
            starts[kind].append(begin)
        at = begin + size
    return starts, pieces, at, kind


def _whole(parts: Sequence[FileBytes]) -> int:
    return sum(part.length for part in parts)


def _upright(data: bytes, columns: int) -> bytes:
    """Bytes that were stored column by column."""
    if not 0 < columns <= len(data):
        return data
    lines = len(data) // columns
    table = np.frombuffer(data, np.uint8, lines * columns).reshape(columns, lines)
    return table.T.tobytes() + data[lines * columns :]
