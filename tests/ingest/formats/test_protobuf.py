"""Messages of protobuf in MCAP: bytes and descriptors laid out by hand, as its description of the encoding has them."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.writer import Writer

from ingest.errors import UnreadableLogError
from ingest.formats import _protobuf as protobuf
from ingest.formats._flattened import NotRead
from made.tables import START_NS, columns_of

DOUBLE, FLOAT, INT64, INT32, BOOL, STRING, MESSAGE, ENUM, SINT32 = 1, 2, 3, 5, 8, 9, 11, 14, 17
OPTIONAL, REPEATED = 1, 3


def varint(number: int) -> bytes:
    number &= (1 << 64) - 1
    found = b""
    while number >= 0x80:
        found, number = found + bytes([number & 0x7F | 0x80]), number >> 7
    return found + bytes([number])


def put(number: int, value: int | bytes | str) -> bytes:
    """A field: a varint, or what has a length."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def f64(number: int, value: float) -> bytes:
    return varint(number << 3 | 1) + struct.pack("<d", value)


def f32(number: int, value: float) -> bytes:
    return varint(number << 3 | 5) + struct.pack("<f", value)


def told(number: int, name: str, kind: int, label: int = OPTIONAL, of: str = "", optional: bool = False) -> bytes:
    """A field of a descriptor."""
    said = put(1, name) + put(3, number) + put(4, label) + put(5, kind) + (put(6, of) if of else b"")
    return put(2, said + (put(9, 0) + put(17, 1) if optional else b""))


MOTOR = put(1, "Motor") + b"".join(
    [
        told(1, "speed", DOUBLE),
        told(2, "torque", FLOAT),
        told(3, "counter", INT32),
        told(4, "trim", SINT32),
        told(5, "on", BOOL),
        told(6, "note", STRING),
        told(7, "cells", FLOAT, REPEATED),
        told(8, "phase", MESSAGE, REPEATED, ".lab.Motor.Phase"),
        told(9, "limit", DOUBLE, optional=True),
        told(10, "mode", ENUM, of=".lab.Mode"),
        put(3, put(1, "Phase") + told(1, "amps", DOUBLE) + told(2, "counts", INT64, REPEATED)),
    ]
)
SCHEMA = put(1, put(1, "lab.proto") + put(2, "lab") + put(4, MOTOR) + put(12, "proto3"))
PHASE = f64(1, 2.5) + put(2, varint(3) + varint(-1))  # a packed list
WHOLE = b"".join(
    [
        f64(1, 1500.5),
        f32(2, -2.5),
        put(3, -7),
        put(4, 5),  # folded: 5 stands for -3
        put(5, 1),
        put(6, "hot"),
        put(7, struct.pack("<2f", 1.5, 2.5)),
        put(8, PHASE),
        put(8, f64(1, 4.0)),
        put(10, 2),
        put(99, "what a newer schema has"),
    ]
)


def write(path: Path, *messages: bytes, name: str = "lab.Motor", schema: bytes = SCHEMA) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("test", "test")
        topic = writer.register_channel("/motor", "protobuf", writer.register_schema(name, "protobuf", schema))
        for t, data in enumerate(messages):
            writer.add_message(topic, START_NS + t * 10**9, data, START_NS)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_a_field_of_the_description_is_read_as_it_says_there() -> None:
    """`08 96 01`: field 1 is 150, the example of the encoding's own page."""
    known = protobuf.definitions(put(1, put(4, put(1, "Test1") + told(1, "a", INT32))))
    assert protobuf.decoded(known, "Test1", bytes.fromhex("089601")) == {"a": 150.0}


def test_each_kind_of_field_becomes_numbers() -> None:
    assert protobuf.decoded(protobuf.definitions(SCHEMA), "lab.Motor", WHOLE) == {
        "speed": 1500.5,
        "torque": -2.5,
        "counter": -7.0,
        "trim": -3.0,
        "on": 1.0,
        "note": None,
        "cells[0]": 1.5,
        "cells[1]": 2.5,
        "phase[0].amps": 2.5,
        "phase[0].counts[0]": 3.0,
        "phase[0].counts[1]": -1.0,
        "phase[1].amps": 4.0,
        "mode": 2.0,
    }


def test_what_proto3_does_not_write_is_zero_and_what_is_optional_is_not_there() -> None:
    found = protobuf.decoded(protobuf.definitions(SCHEMA), "lab.Motor", b"")
    assert found == dict.fromkeys(["speed", "torque", "counter", "trim", "on", "mode"], 0.0)
    proto2 = protobuf.definitions(SCHEMA.replace(b"proto3", b"proto2"))
    assert protobuf.decoded(proto2, "lab.Motor", b"") == {}


def test_a_log_of_protobuf_becomes_columns_of_its_topic(tmp_path: Path) -> None:
    log, columns = columns_of("mcap", write(tmp_path / "log", WHOLE, f64(1, 1600.0)))
    assert columns["t"] == [0, 1] and columns["/motor.speed"] == [1500.5, 1600.0]
    assert columns["/motor.counter"] == [-7.0, 0.0] and log.settings["left_out"] == ["/motor.note (1)"]


@pytest.mark.parametrize(
    ("data", "name", "schema", "why"),
    [
        (WHOLE[:-3], "lab.Motor", SCHEMA, "is no message of its schema"),
        (b"\xff" * 12, "lab.Motor", SCHEMA, "is no message of its schema"),
        (b"\x0b", "lab.Motor", SCHEMA, "is no message of its schema"),  # a group, of before 2008
        (WHOLE, "lab.Other", SCHEMA, "its schema does not say what lab.Other is"),
        (WHOLE, "lab.Motor", SCHEMA[:-1], "is no message of its schema"),
    ],
)
def test_what_does_not_fit_its_schema_is_refused_in_one_line(
    tmp_path: Path, data: bytes, name: str, schema: bytes, why: str
) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        columns_of("mcap", write(tmp_path / "log", data, name=name, schema=schema))
    assert f"no row of it can be read: {why}" in str(refused.value) and "\n" not in str(refused.value)


def test_bytes_cut_anywhere_are_read_or_refused() -> None:
    for end in range(len(SCHEMA)):
        for data in (WHOLE[:end], WHOLE):
            try:
                protobuf.decoded(protobuf.definitions(SCHEMA[: end if data is WHOLE else None]), "lab.Motor", data)
            except NotRead as error:
                assert "\n" not in str(error)
