"""The blocks of an MF4 file: groups of records, their channels, and the records' bytes, packed or not, sorted or not.

A file is blocks that name each other by their place in it: data groups, each with the bytes of its records and a
channel group for each kind of record, each with its channels. Nothing that a block says is believed before it is
checked. Described in https://www.asam.net/standards/detail/mdf/wiki/
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats._mdf_conversions import FORMULA, RANGE_TEXTS, TEXTS, MdfConversion, Named, as_stored, conversion

HEAD = struct.Struct("<4s4xQQ")  # mark, length, number of links
DATA_GROUP, CHANNEL_GROUP = struct.Struct("<B"), struct.Struct("<QQHH4xII")
CHANNEL = struct.Struct("<BBBBIIII")
CONVERSION = struct.Struct("<BBHHHdd")
NEVER_VALID, MAY_BE_INVALID = 1, 2  # flags of a channel
DEEPEST = 8  # parts of parts, conversions within conversions
MOST_TEXTS = 4096  # of a conversion
XML_TEXT = re.compile(r"<TX[^>]*>([^<]*)")
PACKED = struct.Struct("<2sBxIQQ")
LENGTH = struct.Struct("<I")  # before each value of variable length
LONGEST_BLOCK = 1 << 20  # bytes of a block that describes
LONGEST_RECORD = 1 << 16  # bytes; a frame takes a hundred
RATIO = 1100  # which deflate cannot exceed
VLSD_GROUP = 1  # flag of a group of values of variable length
OPEN_LENGTH, OPEN_OFFSETS = 1 << 2, 1 << 6  # of a file that was not finalised: what in it is not written yet
PLAIN_MARKS = (b"##DT", b"##SD")

Bytes = NDArray[np.uint8]


class BrokenBlock(Exception):
    """A block is not what it should be. `str` says it as a clause: "is damaged at byte 1,234"."""


@dataclass(frozen=True)
class Block:
    """One block without its bytes of records."""

    at: int
    mark: bytes
    links: tuple[int, ...]
    data: bytes


@dataclass(frozen=True)
class MdfChannel:
    """One channel: where its value lies in a record. `kind`: 0 fixed, 1 of variable length, 2 master, 3, 6 virtual."""

    name: str
    kind: int
    sync: int  # 1 where a master is the time, 2 an angle, 3 a distance, 4 a number
    form: int  # 0, 1: unsigned, 2, 3: signed, 4, 5: float (little, big endian), above: text or bytes
    bit: int
    byte: int
    bits: int
    values_at: int  # the block of values of variable length
    conversion: MdfConversion
    unit: str = ""
    is_array: bool = False
    never_valid: bool = False
    invalid_bit: int | None = None  # of a record, which is set where the value is none


@dataclass(frozen=True)
class MdfGroup:
    """The records of one kind."""

    name: str
    at: int
    record_id: int
    declared: int  # number of records
    flags: int
    size: int  # of a record [bytes]
    channels: tuple[MdfChannel, ...]


@dataclass(frozen=True)
class Records:
    """Records of a data group: `of` by the place of their group, each (N, size); `ended`: why they are not whole."""

    groups: tuple[MdfGroup, ...]
    of: Mapping[int, Bytes]
    values: Mapping[int, bytes]  # of variable length, by the place of their group
    ended: str | None


class Mdf:
    """An open file. `open_parts`: flags of what in it is not written yet, 0 in a file that was finalised."""

    def __init__(self, file: IO[bytes], size: int, open_parts: int) -> None:
        self._file, self._size, self.open_parts = file, size, open_parts
        self._texts: dict[int, str] = {}
        self._conversions: dict[int, tuple[MdfConversion, str]] = {}

    def block(self, at: int, *marks: bytes) -> Block:
        """The block at `at`, which must have one of `marks`. Raises BrokenBlock."""
        mark, length, count = self._head(at)
        if mark not in marks or length > LONGEST_BLOCK or HEAD.size + 8 * count > length or at + length > self._size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        body = self._read(at + HEAD.size, length - HEAD.size)
        return Block(at, mark, struct.unpack_from(f"<{count}Q", body), body[8 * count :])

    def chain(self, at: int, mark: bytes) -> Iterator[Block]:
        """A block and those that follow it, each named by the first link of the one before. Raises BrokenBlock."""
        seen = set[int]()
        while at:
            if at in seen:
                raise BrokenBlock(f"is damaged at byte {at:,}")
            seen.add(at)
            block = self.block(at, mark)
            yield block
            at = _link(block, 0)

    def text(self, at: int) -> str:
        """The text at `at`, empty where there is none. Raises BrokenBlock."""
        if at and at not in self._texts:
            block = self.block(at, b"##TX", b"##MD")
            text = block.data.split(b"\0", 1)[0].decode(errors="replace")
            inner = XML_TEXT.search(text) if block.mark == b"##MD" else None
            self._texts[at] = inner[1] if inner else text
        return self._texts[at] if at else ""

    def groups(self, data_group: Block) -> tuple[MdfGroup, ...]:
        """The channel groups of a data group. Raises BrokenBlock."""
        return tuple(self._group(block) for block in self.channel_groups(data_group))

    def channel_groups(self, data_group: Block) -> Iterator[Block]:
        """Its channel groups as they stand in the file. Raises BrokenBlock."""
        return self.chain(_link(data_group, 1), b"##CG")

    def _group(self, block: Block) -> MdfGroup:
        record_id, declared, flags, _, size, invalid = _unpack(CHANNEL_GROUP, block)
        if size + invalid > LONGEST_RECORD:
            raise BrokenBlock(f"is damaged at byte {block.at:,}")
        channels = () if flags & VLSD_GROUP else tuple(self._channels(_link(block, 1), size))
        name = self.text(_link(block, 2))
        return MdfGroup(name, block.at, record_id, declared, flags, size + invalid, channels)

    def names(self, group: Block) -> Iterator[str]:
        """The names of the channels of a group, but of parts. Raises BrokenBlock."""
        return (self.text(_link(block, 2)) for block in self.chain(_link(group, 1), b"##CN"))

    def _channels(self, at: int, size: int, depth: int = 0) -> Iterator[MdfChannel]:
        """The channels of a chain, each before its parts. `size`: of a record before its invalidation bits."""
        for block in self.chain(at, b"##CN"):
            kind, sync, form, bit, byte, bits, flags, invalid = _unpack(CHANNEL, block)
            law, unit = self._conversion(_link(block, 4))
            part = _link(block, 1)
            mark = self._head(part)[0] if part else b""
            yield MdfChannel(
                name=self.text(_link(block, 2)),
                kind=kind,
                sync=sync,
                form=form,
                bit=bit,
                byte=byte,
                bits=bits,
                values_at=_link(block, 5),
                conversion=law,
                unit=self.text(_link(block, 6)) or unit,
                is_array=mark == b"##CA",
                never_valid=bool(flags & NEVER_VALID),
                invalid_bit=8 * size + invalid if flags & MAY_BE_INVALID else None,
            )
            if mark == b"##CN" and depth < DEEPEST:
                yield from self._channels(part, size, depth + 1)

    def _conversion(self, at: int, depth: int = 0) -> tuple[MdfConversion, str]:
        """The conversion at `at`, and its unit. Raises BrokenBlock."""
        if not at:
            return as_stored(), ""
        if at not in self._conversions:
            block = self.block(at, b"##CC")
            kind, _, _, names, count, _, _ = _unpack(CONVERSION, block)
            if len(block.data) < CONVERSION.size + 8 * count or depth > DEEPEST or names > MOST_TEXTS:
                raise BrokenBlock(f"is damaged at byte {at:,}")
            values = np.frombuffer(block.data, "<f8", count, CONVERSION.size)
            links = block.links[4 : 4 + names]
            named = [self._named(link, depth + 1) for link in links] if kind in (TEXTS, RANGE_TEXTS) else []
            formula = self.text(links[0]) if kind == FORMULA and links else ""
            self._conversions[at] = conversion(kind, values, named, formula), self.text(_link(block, 1))
        return self._conversions[at]

    def _named(self, at: int, depth: int) -> Named:
        """What an entry of a table of texts stands for."""
        if not at:
            return None
        if self._head(at)[0] == b"##CC":
            return self._conversion(at, depth)[0]
        return self.text(at) or None

    # ---- bytes of records ------------------------------------------------------------------------------------------

    def records(self, data_group: Block) -> Records:
        """All records of a data group. Raises BrokenBlock where its description is none."""
        groups = self.groups(data_group)
        (id_size,) = _unpack(DATA_GROUP, data_group)
        if id_size not in (0, 1, 2, 4, 8) or (id_size == 0 and len(groups) > 1):
            raise BrokenBlock(f"is damaged at byte {data_group.at:,}")
        if not any(group.channels for group in groups) or not _link(data_group, 2):
            return Records(groups, {}, {}, None)
        data, ended = self.values(_link(data_group, 2))
        found = unsorted_records(groups, data, id_size, ended) if id_size else self._sorted(groups, data, ended)
        lacking = sum(max(0, group.declared - len(found.of[group.at])) for group in groups if group.channels)
        if lacking and not self.open_parts and found.ended is None:
            return replace(found, ended=f"holds {lacking:,} records fewer than it says")
        return found

    def _sorted(self, groups: tuple[MdfGroup, ...], data: bytes, ended: str | None) -> Records:
        """Records of one kind; what stands behind those that a finalised file says it has is none."""
        (group,) = groups
        count = len(data) // group.size if group.size else 0
        if self.open_parts and count * group.size < len(data):
            ended = ended or "ends inside a record"
        if group.declared and not self.open_parts:
            count = min(count, group.declared)
        table = np.frombuffer(data, np.uint8, count * group.size).reshape(count, group.size)
        return Records(groups, {group.at: table}, {}, ended)

    def values(self, at: int) -> tuple[bytes, str | None]:
        """The bytes in the data blocks that begin at `at`, and why they are not whole."""
        found, ended = bytearray(), None
        try:
            for piece in self._pieces(at):
                found += piece
        except BrokenBlock as broken:
            ended = str(broken)
        return bytes(found), ended

    def _pieces(self, at: int) -> Iterator[bytes]:
        mark, length, _ = self._head(at)
        if mark == b"##HL":
            at = _link(self.block(at, mark), 0)
            mark, length, _ = self._head(at)
        if mark == b"##DL":
            for block in self.chain(at, mark):
                for part in filter(None, block.links[1:]):
                    yield from self._piece(part, *self._head(part)[:2])
        else:
            yield from self._piece(at, mark, length)

    def _piece(self, at: int, mark: bytes, length: int) -> Iterator[bytes]:
        if mark == b"##DZ":
            yield self._unpacked(at, length)
            return
        if mark not in PLAIN_MARKS or length < HEAD.size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        end = at + length
        if self.open_parts & OPEN_LENGTH and mark == b"##DT" and self._read(end, 2) != b"##":
            end = self._size
        yield self._read(at + HEAD.size, min(end, self._size) - at - HEAD.size)
        if end > self._size:
            raise BrokenBlock(f"ends at byte {self._size:,} of {end:,}")

    def _unpacked(self, at: int, length: int) -> bytes:
        if at + length > self._size or length < HEAD.size + PACKED.size:
            raise BrokenBlock(f"ends inside a packed block at byte {at:,}")
        body = self._read(at + HEAD.size, length - HEAD.size)
        _, method, columns, size, packed = PACKED.unpack_from(body)
        if method > 1 or size > RATIO * max(1, packed) or packed > len(body) - PACKED.size:
            raise BrokenBlock(f"is damaged, or packed in a way that is not read, at byte {at:,}")
        try:
            data = zlib.decompressobj().decompress(body[PACKED.size : PACKED.size + packed], size + 1)
        except zlib.error:
            data = b""
        if len(data) != size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        return _upright(data, columns) if method else data

    def _head(self, at: int) -> tuple[bytes, int, int]:
        head = self._read(at, HEAD.size)
        if len(head) < HEAD.size:
            raise BrokenBlock(f"ends before byte {at:,}")
        mark, length, count = HEAD.unpack(head)
        return mark, length, count

    def _read(self, at: int, count: int) -> bytes:
        if not 0 <= at <= self._size or count < 0:
            return b""
        self._file.seek(at)
        return self._file.read(min(count, self._size - at))


def gathered(values: bytes, offsets: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(starts, lengths) in `values` of those of variable length at `offsets` (N,); length -1 where there is none."""
    octets = np.frombuffer(values, np.uint8)
    fine = (offsets >= 0) & (offsets <= len(octets) - LENGTH.size)
    lengths = np.full(len(offsets), -1, np.int64)
    heads = octets[offsets[fine][:, None] + np.arange(LENGTH.size)]
    lengths[fine] = heads.astype(np.int64) @ (1 << 8 * np.arange(LENGTH.size))
    starts = offsets + LENGTH.size
    lengths[starts + lengths > len(octets)] = -1
    return starts, lengths


def unsorted_records(groups: tuple[MdfGroup, ...], data: bytes, id_size: int, ended: str | None) -> Records:
    """Records of several kinds, each with the number of its kind before it."""
    sizes = {group.record_id: None if group.flags & VLSD_GROUP else group.size for group in groups}
    starts: dict[int, list[int]] = {group.record_id: [] for group in groups}
    pieces: dict[int, list[bytes]] = {group.record_id: [] for group in groups}
    at, end = 0, len(data)
    while at + id_size <= end:
        kind = int.from_bytes(data[at : at + id_size], "little")
        if kind not in sizes:
            ended = ended or f"is damaged behind {at:,} bytes of records"
            break
        at += id_size
        size = sizes[kind]
        if size is None:
            size = LENGTH.size + (LENGTH.unpack_from(data, at)[0] if at + LENGTH.size <= end else end)
            pieces[kind].append(data[at : at + size])
        else:
            starts[kind].append(at)
        at += size
    if at > end:
        ended = ended or "ends inside a record"
    octets = np.frombuffer(data, np.uint8)
    of, values = dict[int, Bytes](), dict[int, bytes]()
    for group in groups:
        own = np.array(starts[group.record_id], np.int64)
        own = own[own + group.size <= end]
        of[group.at] = octets[own[:, None] + np.arange(group.size)]
        values[group.at] = b"".join(pieces[group.record_id])
    return Records(groups, of, values, ended)


def _upright(data: bytes, columns: int) -> bytes:
    """Bytes that were stored column by column."""
    if not 0 < columns <= len(data):
        return data
    lines = len(data) // columns
    table = np.frombuffer(data, np.uint8, lines * columns).reshape(columns, lines)
    return table.T.tobytes() + data[lines * columns :]


def _link(block: Block, number: int) -> int:
    return block.links[number] if number < len(block.links) else 0


def _unpack(form: struct.Struct, block: Block) -> tuple[Any, ...]:
    if len(block.data) < form.size:
        raise BrokenBlock(f"is damaged at byte {block.at:,}")
    return form.unpack_from(block.data)
