"""A session as MCAP: a topic a channel, `/samples/TC_winding`, with a message of protobuf a sample.

Messages of JSON would plot in Foxglove alone: rerun reads the numbers of protobuf, by the schema in the file, and takes
JSON for bytes. A topic a channel, and not a message a stamp: protobuf writes 0 where a number is missing.
"""

from __future__ import annotations

import struct
from math import isnan
from pathlib import Path

from mcap.writer import CompressionType, Writer

from replay.exports.samples import SessionRows

TOPIC = "/samples/"
SCHEMA = "whyhot.Sample"
DOUBLE, OPTIONAL, FIXED64 = 1, 1, 1  # as https://protobuf.dev and its descriptor.proto number them


def write(path: Path, rows: SessionRows) -> None:
    """Stamps without a date count from 0, the logger's start."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library="whyhot")
        schema = writer.register_schema(SCHEMA, "protobuf", _descriptors())
        channels = [
            writer.register_channel(TOPIC + one.name, "protobuf", schema, {"unit": one.unit or ""})
            for one in rows.columns
        ]
        counted_from = "1970, UTC" if rows.absolute else "the logger's start"
        writer.add_metadata("session", {"name": rows.name, "times_since": counted_from})
        for t_ns, values in rows.parts:
            for at_ns, row in zip(t_ns.clip(min=0).tolist(), values.tolist(), strict=True):
                for channel, value in zip(channels, row, strict=True):
                    if not isnan(value):
                        writer.add_message(channel, at_ns, struct.pack("<Bd", 1 << 3 | FIXED64, value), at_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def _descriptors() -> bytes:
    """The FileDescriptorSet of `message Sample { double value = 1; }` in proto3."""
    value = _text(1, b"value") + bytes((3 << 3, 1, 4 << 3, OPTIONAL, 5 << 3, DOUBLE))
    package, name = SCHEMA.encode().split(b".")
    message = _text(1, name) + _text(2, value)
    file = _text(1, b"sample.proto") + _text(2, package) + _text(4, message) + _text(12, b"proto3")
    return _text(1, file)


def _text(number: int, content: bytes) -> bytes:
    """A field of bytes, fewer than 128 of them."""
    return bytes((number << 3 | 2, len(content))) + content
