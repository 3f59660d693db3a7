"""Rows as MF4 (MDF 4.10): one group of records, in which a channel without a sample at a stamp is marked as invalid.

Blocks as https://www.asam.net/standards/detail/mdf/wiki/ describes them; all that stands before the records is made
first, so that these are written as they come.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO
from xml.sax.saxutils import escape

import numpy as np

from replay.exports.samples import Part, SessionRows
from whyhot import __version__

HEADER_AT = 64  # after the bytes that say what the file is
FLOAT, VALUE, MASTER, TIME, MAY_BE_INVALID = 4, 0, 2, 1, 2


class _Blocks:
    """Blocks in the making; those that others name come first."""

    def __init__(self) -> None:
        program = f"{'MDF':8}{'4.10':8}{'whyhot':8}".encode()
        self.data = bytearray(program + struct.pack("<4xH34x", 410))

    def add(self, mark: bytes, links: Sequence[int], body: bytes = b"") -> int:
        """Where the block is."""
        self.data += bytes(-len(self.data) % 8)
        at = len(self.data)
        self.data += struct.pack(
            f"<4s4xQQ{len(links)}Q", b"##" + mark, 24 + 8 * len(links) + len(body), len(links), *links
        )
        self.data += body
        return at

    def text(self, text: str | None, mark: bytes = b"TX") -> int:
        """Where the text is, 0 for none."""
        data = (text or "").encode(errors="replace") + b"\0"
        return self.add(mark, (), data + bytes(-len(data) % 8)) if text else 0

    def channel(self, after: int, name: str, unit: str | None, place: int, invalid: int | None = None) -> int:
        """A number of 64 bits at a `place` of the record; without a bit that says when it is `invalid`, the time."""
        kind = (MASTER, TIME) if invalid is None else (VALUE, 0)
        body = struct.pack(
            "<BBBBIIII", *kind, FLOAT, 0, 8 * place, 64, 0 if invalid is None else MAY_BE_INVALID, invalid or 0
        )
        return self.add(b"CN", (after, 0, self.text(name), 0, 0, 0, self.text(unit), 0), body + bytes(52))


def write(path: Path, rows: SessionRows) -> None:
    blocks, width = _Blocks(), len(rows.columns)
    blocks.data += bytes(104)  # of the header, which names what follows
    channel = 0
    for i in reversed(range(width)):
        channel = blocks.channel(channel, rows.columns[i].name, rows.columns[i].unit, i + 1, i)
    channel = blocks.channel(channel, "t_s", "s", 0)
    sizes = struct.pack("<QQHH4xII", 0, 0, 0, 0, 8 * (width + 1), -(-width // 8))
    group = blocks.add(b"CG", (0, channel, blocks.text(rows.name), 0, 0, 0), sizes)
    made = f"<FHcomment><TX>{escape(rows.name)}</TX><tool_id>whyhot</tool_id><tool_vendor>whyhot</tool_vendor>"
    made += f"<tool_version>{__version__}</tool_version></FHcomment>"
    start_ns = rows.start_ns if rows.absolute else 0
    history = blocks.add(b"FH", (0, blocks.text(made, b"MD")), struct.pack("<Qhh4x", start_ns, 0, 0))
    records = -(-(len(blocks.data) + 24 + 32 + 8) // 8) * 8
    data_group = blocks.add(b"DG", (0, group, records, 0), bytes(8))
    blocks.data += bytes(records - len(blocks.data))
    blocks.data[HEADER_AT : HEADER_AT + 104] = struct.pack(
        "<4s4xQQ6QQhhBBBxdd", b"##HD", 104, 6, data_group, history, 0, 0, 0, 0, start_ns, 0, 0, 0, 0, 0, 0.0, 0.0
    )
    with path.open("wb") as file:
        file.write(blocks.data + struct.pack("<4s4xQQ", b"##DT", 0, 0))
        count = sum(_records(file, rows, part) for part in rows.parts)
        _patch(file, records + 8, file.tell() - records)
        _patch(file, group + 24 + 8 * 6 + 8, count)


def _records(file: IO[bytes], rows: SessionRows, part: Part) -> int:
    """Write a part; how many records that are."""
    t_ns, values = part
    numbers = np.column_stack([rows.seconds(t_ns), np.nan_to_num(values)]).astype("<f8").view(np.uint8)
    marks = np.packbits(np.isnan(values), axis=1, bitorder="little")
    file.write(np.hstack([numbers, marks]).tobytes())
    return len(t_ns)


def _patch(file: IO[bytes], at: int, number: int) -> None:
    file.seek(at)
    file.write(struct.pack("<Q", number))
    file.seek(0, 2)
