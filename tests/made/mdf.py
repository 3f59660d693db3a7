"""MF4 files of measured channels, laid out byte by byte: groups, channels, conversions, invalidation bits."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from made.mf4 import Mf4

LINEAR, RATIONAL, FORMULA, INTERPOLATED, NEAREST, RANGES, TEXTS, RANGE_TEXTS = range(1, 9)
UNSIGNED, UNSIGNED_BIG, SIGNED, SIGNED_BIG, FLOAT, FLOAT_BIG, TEXT = range(7)
FIXED, VARIABLE, MASTER, VIRTUAL_MASTER = range(4)
NEVER_VALID, MAY_BE_INVALID = 1, 2


@dataclass(frozen=True)
class Channel:
    """A channel as its block says it; `law` and `part` are places of other blocks."""

    name: str
    form: int
    byte: int
    bits: int
    bit: int = 0
    kind: int = FIXED
    sync: int = 0
    unit: str = ""
    law: int = 0
    part: int = 0
    flags: int = 0
    invalid: int = 0


SECONDS = Channel("t", FLOAT, 0, 64, kind=MASTER, sync=1, unit="s")


class Mdf4(Mf4):
    """A file in the making; blocks that others name come first."""

    def text(self, text: str, mark: bytes = b"TX") -> int:
        return self.block(mark, (), text.encode() + b"\0") if text else 0

    def conversion(self, kind: int, values: Sequence[float] = (), named: Sequence[int] = (), unit: str = "") -> int:
        head = struct.pack("<BBHHHdd", kind, 0, 0, len(named), len(values), 0.0, 0.0)
        links = (0, self.text(unit), 0, 0, *named)
        return self.block(b"CC", links, head + struct.pack(f"<{len(values)}d", *values))

    def channels(self, some: Sequence[Channel]) -> int:
        """The first block of a chain of channels."""
        first = 0
        for one in reversed(some):
            body = (one.kind, one.sync, one.form, one.bit, one.byte, one.bits, one.flags, one.invalid)
            links = (first, one.part, self.text(one.name), 0, one.law, 0, self.text(one.unit), 0)
            first = self.block(b"CN", links, struct.pack("<BBBBIIII", *body) + bytes(48))
        return first

    def measured(
        self, name: str, some: Sequence[Channel], count: int, size: int, *, invalid: int = 0, number: int = 0
    ) -> int:
        """A channel group with records of `size` bytes and `invalid` bytes of invalidation bits behind."""
        links = (0, self.channels(some), self.text(name), 0, 0, 0)
        return self.block(b"CG", links, struct.pack("<QQHH4xII", number, count, 0, 0, size, invalid))

    def stored(self, name: str, some: Sequence[Channel], records: bytes, size: int, after: int = 0) -> int:
        """A data group of one channel group, with its records."""
        group = self.measured(name, some, len(records) // size, size)
        return self.data_group(group, self.block(b"DT", (), records), after=after)


def at(channel: Channel, byte: int) -> Channel:
    return replace(channel, byte=byte)
