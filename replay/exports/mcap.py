"""Rows as MCAP: a JSON message a stamp on the topic `/samples`, with a schema that says the unit of each field."""

from __future__ import annotations

import json
from math import isnan
from pathlib import Path

from mcap.writer import CompressionType, Writer

from replay.exports.samples import SessionRows

TOPIC = "/samples"


def write(path: Path, rows: SessionRows) -> None:
    """Stamps without a date count from 0, the logger's start."""
    names = [one.name for one in rows.columns]
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library="whyhot")
        schema = writer.register_schema("whyhot.samples", "jsonschema", _schema(rows))
        channel = writer.register_channel(TOPIC, "json", schema)
        counted_from = "1970, UTC" if rows.absolute else "the logger's start"
        writer.add_metadata("session", {"name": rows.name, "times_since": counted_from})
        for t_ns, values in rows.parts:
            for at_ns, row in zip(t_ns.clip(min=0).tolist(), values.tolist(), strict=True):
                there = {name: value for name, value in zip(names, row, strict=True) if not isnan(value)}
                writer.add_message(channel, at_ns, json.dumps(there, ensure_ascii=False).encode(), at_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def _schema(rows: SessionRows) -> bytes:
    fields = {one.name: {"type": "number", "description": one.unit or ""} for one in rows.columns}
    return json.dumps({"title": "whyhot.samples", "type": "object", "properties": fields}, ensure_ascii=False).encode()
