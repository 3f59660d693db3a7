"""The blocks of an MF4 file that describe it: groups of records and their channels.

A file is blocks that name each other by their place in it: data groups, each with the bytes of its records and a
channel group for each kind of record, each with its channels. Nothing that a block says is believed before it is
checked. Described in https://www.asam.net/standards/detail/mdf/wiki/
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from ingest.formats._mdf_conversions import FORMULA, RANGE_TEXTS, TEXTS, MdfConversion, Named, as_stored, conversion

HEAD = struct.Struct("<4s4xQQ")  # mark, length, number of links
CHANNEL_GROUP = struct.Struct("<QQHH4xII")
CHANNEL = struct.Struct("<BBBBIIII")
CONVERSION = struct.Struct("<BBHHHdd")
NEVER_VALID, MAY_BE_INVALID = 1, 2  # flags of a channel
DEEPEST = 8  # parts of parts, conversions within conversions
MOST_TEXTS = 4096  # of a conversion
XML_TEXT = re.compile(r"<TX[^>]*>([^<]*)")
LONGEST_BLOCK = 1 << 20  # bytes of a block that describes
LONGEST_RECORD = 1 << 16  # bytes; a frame takes a hundred
VLSD_GROUP = 1  # flag of a group of values of variable length


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


class MdfBlocks:
    """The blocks of an open file. `open_parts`: flags of what is not written yet, 0 in a file that was finalised."""

    def __init__(self, file: IO[bytes], size: int, open_parts: int) -> None:
        self._file, self._size, self.open_parts = file, size, open_parts
        self._texts: dict[int, str] = {}
        self._conversions: dict[int, tuple[MdfConversion, str]] = {}

    def block(self, at: int, *marks: bytes) -> Block:
        """The block at `at`, which must have one of `marks`. Raises BrokenBlock."""
        mark, length, count = self.head(at)
        if mark not in marks or length > LONGEST_BLOCK or HEAD.size + 8 * count > length or at + length > self._size:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        body = self.read(at + HEAD.size, length - HEAD.size)
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
            at = link(block, 0)

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
        return self.chain(link(data_group, 1), b"##CG")

    def _group(self, block: Block) -> MdfGroup:
        record_id, declared, flags, _, size, invalid = unpack(CHANNEL_GROUP, block)
        if size + invalid > LONGEST_RECORD:
            raise BrokenBlock(f"is damaged at byte {block.at:,}")
        channels = () if flags & VLSD_GROUP else tuple(self._channels(link(block, 1), size))
        name = self.text(link(block, 2))
        return MdfGroup(name, block.at, record_id, declared, flags, size + invalid, channels)

    def names(self, group: Block) -> Iterator[str]:
        """The names of the channels of a group, but of parts. Raises BrokenBlock."""
        return (self.text(link(block, 2)) for block in self.chain(link(group, 1), b"##CN"))

    def _channels(self, at: int, size: int, depth: int = 0) -> Iterator[MdfChannel]:
        """The channels of a chain, each before its parts. `size`: of a record before its invalidation bits."""
        for block in self.chain(at, b"##CN"):
            kind, sync, form, bit, byte, bits, flags, invalid = unpack(CHANNEL, block)
            law, unit = self._conversion(link(block, 4))
            part = link(block, 1)
            mark = self.head(part)[0] if part else b""
            yield MdfChannel(
                name=self.text(link(block, 2)),
                kind=kind,
                sync=sync,
                form=form,
                bit=bit,
                byte=byte,
                bits=bits,
                values_at=link(block, 5),
                conversion=law,
                unit=self.text(link(block, 6)) or unit,
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
            kind, _, _, names, count, _, _ = unpack(CONVERSION, block)
            if len(block.data) < CONVERSION.size + 8 * count or depth > DEEPEST or names > MOST_TEXTS:
                raise BrokenBlock(f"is damaged at byte {at:,}")
            values = np.frombuffer(block.data, "<f8", count, CONVERSION.size)
            links = block.links[4 : 4 + names]
            named = [self._named(link, depth + 1) for link in links] if kind in (TEXTS, RANGE_TEXTS) else []
            formula = self.text(links[0]) if kind == FORMULA and links else ""
            unit = "" if named else self.text(link(block, 1))  # some writers give a text there that stands for a number
            self._conversions[at] = conversion(kind, values, named, formula), unit
        return self._conversions[at]

    def _named(self, at: int, depth: int) -> Named:
        """What an entry of a table of texts stands for."""
        if not at:
            return None
        if self.head(at)[0] == b"##CC":
            return self._conversion(at, depth)[0]
        return self.text(at) or None

    def head(self, at: int) -> tuple[bytes, int, int]:
        head = self.read(at, HEAD.size)
        if len(head) < HEAD.size:
            raise BrokenBlock(f"ends before byte {at:,}")
        mark, length, count = HEAD.unpack(head)
        return mark, length, count

    def read(self, at: int, count: int) -> bytes:
        if not 0 <= at <= self._size or count < 0:
            return b""
        self._file.seek(at)
        return self._file.read(min(count, self._size - at))


def link(block: Block, number: int) -> int:
    return block.links[number] if number < len(block.links) else 0


def unpack(form: struct.Struct, block: Block) -> tuple[Any, ...]:
    if len(block.data) < form.size:
        raise BrokenBlock(f"is damaged at byte {block.at:,}")
    return form.unpack_from(block.data)
