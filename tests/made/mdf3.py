"""MDF files of version 3, laid out byte by byte."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

UNSIGNED, SIGNED, FLOAT, DOUBLE, TEXT, UNSIGNED_BIG, SIGNED_LITTLE = 0, 1, 2, 3, 7, 9, 14
HEADER_END = 64 + 208


@dataclass(frozen=True)
class Channel3:
    """A channel as its block says it; `law` is the place of its conversion."""

    name: str
    form: int
    bit: int
    bits: int
    is_time: bool = False
    law: int = 0
    byte: int = 0
    parts: int = 0


SECONDS = Channel3("time", DOUBLE, 0, 64, is_time=True)


@dataclass
class Mdf3File:
    """A file in the making; blocks that others name come first. `order`: "<" or ">"."""

    order: str = "<"
    data: bytearray = field(default_factory=lambda: bytearray(HEADER_END))

    def block(self, mark: bytes, form: str, *values: object, rest: bytes = b"") -> int:
        body = struct.pack(self.order + form, *values) + rest
        at = len(self.data)
        self.data += mark + struct.pack(self.order + "H", len(body) + 4) + body
        return at

    def text(self, text: str) -> int:
        return self.block(b"TX", "", rest=text.encode("latin-1") + b"\0") if text else 0

    def law(self, kind: int, count: int, rest: bytes, unit: str = "") -> int:
        return self.block(b"CC", "H2d20s2H", 0, 0.0, 0.0, unit.encode("latin-1"), kind, count, rest=rest)

    def numbers(self, *values: float) -> bytes:
        return struct.pack(f"{self.order}{len(values)}d", *values)

    def group(self, name: str, some: Sequence[Channel3], count: int, size: int, number: int = 0, after: int = 0) -> int:
        """A channel group."""
        first = 0
        for one in reversed(some):
            long = self.text(one.name) if len(one.name) > 31 else 0
            short = one.name[:31].encode("latin-1")
            links = (first, one.law, 0, one.parts, 0)
            rest = struct.pack(f"{self.order}H3dIIH", 0, 0.0, 0.0, 0.0, long, 0, one.byte)
            form = "5IH32s128s3H"
            first = self.block(b"CN", form, *links, one.is_time, short, b"", one.bit, one.bits, one.form, rest=rest)
        return self.block(b"CG", "3I3HI", after, first, self.text(name), number, len(some), size, count, rest=bytes(4))

    def data_group(self, group: int, records: bytes, ids: int = 0, after: int = 0) -> int:
        """A data group, after which that at `after` comes."""
        at = len(self.data)
        self.data += records
        return self.block(b"DG", "4I2H", after, group, 0, at, 1 + (ids > 0), ids, rest=bytes(4))

    def save(self, path: Path, data_group: int, *, start: tuple[int, int] | None = None, date: str = "") -> Path:
        """Write the file with its header. `start`: (ns of the wall clock, hours before UTC), as since version 3.2."""
        version = b"3.30" if start else b"3.10"
        mark = struct.pack("<8s8s8s", b"MDF     ", version, b"test")
        mark += struct.pack(self.order + "4H", self.order == ">", 0, 330, 0)
        day, clock = date.split(" ") if date else ("", "")
        body = struct.pack(f"{self.order}3IH10s8s", data_group, 0, 0, 1, day.encode(), clock.encode()) + bytes(128)
        body += struct.pack(f"{self.order}QhH32s", *start, 0, b"") if start else b""
        header = b"HD" + struct.pack(self.order + "H", len(body) + 4) + body
        self.data[: 64 + len(header)] = mark.ljust(64, b"\0") + header
        path.write_bytes(self.data)
        return path
