"""MF4 files of a bus logger, laid out byte by byte, in the ways in which loggers do: sorted or not, packed or not."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from ingest.formats._mdf_records import FileBytes

FINAL, OPEN = b"MDF     ", b"UnFinMF "
HEADER_END = 64 + 104
FIXED, VARIABLE, TIME, VIRTUAL = 0, 1, 2, 6
UNSIGNED, BYTES = 0, 10
Part = tuple[str, int, int, int, int]  # name, kind, byte, bit, bits

PARTS: tuple[Part, ...] = (
    ("Timestamp", TIME, 0, 0, 32),  # [us]
    ("CAN_DataFrame", FIXED, 4, 0, 120),
    ("CAN_DataFrame.ID", FIXED, 4, 0, 29),
    ("CAN_DataFrame.IDE", FIXED, 7, 5, 1),
    ("CAN_DataFrame.Dir", FIXED, 7, 6, 1),
    ("CAN_DataFrame.EDL", FIXED, 7, 7, 1),
    ("CAN_DataFrame.BusChannel", FIXED, 8, 0, 16),
    ("CAN_DataFrame.DataLength", FIXED, 10, 0, 8),
)
IN_RECORD: Part = ("CAN_DataFrame.DataBytes", FIXED, 11, 0, 64)
ELSEWHERE: Part = ("CAN_DataFrame.DataBytes", VARIABLE, 11, 0, 64)
SIZE = 19


def record(us: int, can_id: int, data: bytes = b"", *, bits: int = 0, bus: int = 1, length: int | None = None) -> bytes:
    """A record with its payload, or whatever stands there. `bits`: 1 extended, 2 sent, 4 CAN FD."""
    size = len(data) if length is None else length
    return struct.pack("<IIHB", us, can_id | bits << 29, bus, size) + data.ljust(8, b"\0")


@dataclass
class Mf4:
    """A file in the making; blocks that others name come first."""

    data: bytearray = field(default_factory=lambda: bytearray(HEADER_END))

    def block(self, mark: bytes, links: Sequence[int] = (), body: bytes = b"", length: int | None = None) -> int:
        """Where the block is."""
        self.data += bytes(-len(self.data) % 8)
        at, size = len(self.data), 24 + 8 * len(links) + len(body) if length is None else length
        self.data += struct.pack(f"<4s4xQQ{len(links)}Q", b"##" + mark, size, len(links), *links) + body
        return at

    def packed(self, content: bytes, columns: int = 0) -> int:
        """A packed block of records, stored column by column where there are `columns`."""
        lines, body = len(content) // columns if columns else 0, content
        if columns:
            table = np.frombuffer(content, np.uint8, lines * columns).reshape(lines, columns)
            body = table.T.tobytes() + content[lines * columns :]
        small = zlib.compress(body)
        head = struct.pack("<2sBxIQQ", b"DT", int(columns > 0), columns, len(content), len(small))
        return self.block(b"DZ", (), head + small)

    def linear(self, offset: float, factor: float) -> int:
        """A conversion."""
        return self.block(b"CC", (0,) * 4, struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, offset, factor))

    def group(
        self,
        parts: Sequence[Part],
        count: int,
        *,
        number: int = 0,
        size: int = SIZE,
        values_at: int = 0,
        constant: float = 0.0,
    ) -> int:
        """A channel group; `constant`: the value of its virtual channels."""
        first = 0
        for name, kind, byte, bit, bits in reversed(parts):
            called = self.block(b"TX", (), name.encode() + b"\0")
            convert = self.linear(0.0, 1e-6) if kind == TIME else self.linear(constant, 0.0) if kind == VIRTUAL else 0
            form = BYTES if name.endswith(("DataBytes", "Frame")) else UNSIGNED
            body = struct.pack("<BBBBIIII", kind, int(kind == TIME), form, bit, byte, bits, 0, 0) + bytes(52)
            links = (first, 0, called, 0, convert, values_at if kind == VARIABLE else 0, 0, 0)
            first = self.block(b"CN", links, body)
        return self.block(b"CG", (0, first, 0, 0, 0, 0), struct.pack("<QQHH4xII", number, count, 6, 0, size, 0))

    def values_group(self, number: int, count: int) -> int:
        """A channel group of values of variable length."""
        return self.block(b"CG", (0,) * 6, struct.pack("<QQHH4xII", number, count, 1, 0, 0, 0))

    def follows(self, one: int, other: int) -> None:
        """Let block `one` name `other` as the next of its kind."""
        struct.pack_into("<Q", self.data, one + 24, other)

    def holds(self, data_group: int, records: int) -> None:
        """Let a data group name its records."""
        struct.pack_into("<Q", self.data, data_group + 24 + 16, records)

    def data_group(self, group: int, records: int, *, id_size: int = 0, after: int = 0) -> int:
        """A data group, after which that at `after` comes."""
        return self.block(b"DG", (after, group, records, 0), struct.pack("<B7x", id_size))

    def save(self, path: Path, data_group: int, *, start_ns: int = 0, local: bool = False, open_parts: int = 0) -> Path:
        """Write the file with its header."""
        mark = OPEN if open_parts else FINAL
        head = struct.pack("<8s8s8s4xH30xHH", mark, b"4.11", b"test", 411, open_parts, 0)
        body = struct.pack("<QhhBB2xdd", start_ns, 0, 0, int(local), 0, 0.0, 0.0)
        header = struct.pack("<4s4xQQ6Q", b"##HD", 104, 6, data_group, 0, 0, 0, 0, 0) + body
        self.data[:HEADER_END] = (head + header).ljust(HEADER_END, b"\0")
        path.write_bytes(self.data)
        return path


def in_small_parts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Let readers take few records at once; how many bytes each reading takes, as they read."""
    sizes = {"_mdf_records.WINDOW": 40, "_merged.MOST": 1, "_merged.LEAST": 1, "BATCH_ROWS": 2, "mf4.BATCH": 2}
    for name, size in sizes.items():
        monkeypatch.setattr(f"ingest.formats.{name}", size)
    read, taken = FileBytes.read, list[int]()

    def counted(part: FileBytes, start: int = 0, stop: int | None = None) -> bytes:
        found = read(part, start, stop)
        taken.append(len(found))
        return found

    monkeypatch.setattr(FileBytes, "read", counted)
    return taken
