"""A BLF file of any length, written with array operations: as many frames as a logger writes in hours, in a second."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

AT_ONCE = 100_000  # frames
CONTAINER_BYTES = 131_072
FRAME = np.dtype(
    [
        ("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4"), ("flags", "<u4"),
        ("client", "<u4"), ("stamp", "<u8"), ("bus", "<u2"), ("transmit", "u1"), ("dlc", "u1"), ("id", "<u4"),
        ("data", "<u2", (4,)),
    ]
)  # fmt: skip


def write_blf(path: Path, count: int, step_ns: int = 250_000) -> None:
    """`count` frames of identifier 0x100 on bus 1, with four words that rise and fall in minutes, and some noise."""
    random = np.random.default_rng(1)
    start = (2025, 3, 0, 4, 8, 0, 0, 0)
    head = struct.pack("<4sL8xQQLL8H8H", b"LOGG", 144, 0, 0, count, 0, *start, *start)
    with path.open("wb") as file:
        file.write(head + bytes(144 - len(head)))
        for first in range(0, count, AT_ONCE):
            number = np.arange(first, min(first + AT_ONCE, count))
            frames = np.zeros(len(number), FRAME)
            known = {"magic": b"LOBJ", "header": 32, "version": 1, "size": FRAME.itemsize, "type": 1, "flags": 2}
            for name, value in {**known, "bus": 1, "dlc": 8, "id": 0x100, "stamp": number * step_ns}.items():
                frames[name] = value
            slow = 2000 + 1500 * np.sin(number[:, None] * step_ns / 1e9 / np.array([60, 95, 140, 300]))
            frames["data"] = slow + random.integers(-3, 4, (len(number), 4))
            file.write(b"".join(map(_container, _pieces(frames.tobytes()))))


def _pieces(data: bytes) -> list[bytes]:
    return [data[at : at + CONTAINER_BYTES] for at in range(0, len(data), CONTAINER_BYTES)]


def _container(data: bytes) -> bytes:
    packed = zlib.compress(data, 1)
    size = 32 + len(packed)
    return struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, 2, len(data)) + packed + bytes(size % 4)
