"""MCAP of other recorders: written by the mcap library, payloads of ROS laid out by hand."""

import json
import struct
from collections.abc import Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import CompressionType, Writer

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from made.tables import START_NS, columns_of, same

read = partial(columns_of, "mcap")

Message = tuple[str, float, bytes]  # topic, seconds, payload
NAN = float("nan")


def write(
    path: Path,
    some: Sequence[Message],
    encoding: str = "json",
    schema: tuple[str, str | bytes] = ("", ""),
    published: Sequence[float] = (),
) -> Path:
    """A file with these messages; `schema`: its encoding and text; `published`: when each was, in seconds as `some`."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=200, compression=CompressionType.ZSTD)
        writer.start("test", "test")
        text = schema[1] if isinstance(schema[1], bytes) else schema[1].encode()
        told = writer.register_schema("Told", schema[0], text) if schema[0] else 0
        channels: dict[str, int] = {}
        for (topic, t, data), source_t in zip(some, published or [t for _, t, _ in some], strict=True):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, told)
            stamp = START_NS + round(t * 1e9)
            writer.add_message(channels[topic], stamp, data, publish_time=START_NS + round(source_t * 1e9))
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_numbers_of_json_become_columns_of_their_topic(tmp_path: Path) -> None:
    some = [
        ("/motor", 0.0, json.dumps({"T": 20, "in": {"on": True}, "cells": [1.5, 2.5], "name": "x"}).encode()),
        ("/speed", 0.0, b'{"rpm": 1500}'),
        ("/motor", 1.0, b'{"T": 21.5, "cells": [3], "none": null}'),
    ]
    log, columns = read(write(tmp_path / "log", some))
    assert columns["t"] == [0, 1]
    assert columns["/motor.T"] == [20, 21.5]
    assert same(columns["/motor.in.on"], [1, NAN]) and same(columns["/speed.rpm"], [1500, NAN])
    assert same(columns["/motor.cells[0]"], [1.5, 3]) and same(columns["/motor.cells[1]"], [2.5, NAN])
    assert log.settings["left_out"] == ["/motor.name (1)"]
    assert log.settings["groups"] == {"/motor": 2, "/speed": 1} and log.absolute and log.cut is None


@pytest.mark.parametrize(
    ("published", "t", "delay"),
    [
        ((0, 1, 2), (0, 1, 2), (0.5, 0.25, 30)),  # the last one waited
        ((-37, -36, -35), (0.5, 1.25, 32), (37.5, 37.25, 67)),  # a clock that is late
        ((1, 1.75, 32.5), (0.5, 1.25, 32), (-0.5, -0.5, -0.5)),  # one that is ahead
        ((0.5, 0.5, 0.5), (0.5, 1.25, 32), (0, 0.75, 31.5)),  # no clock
        ((-START_NS / 1e9,) * 3, (0.5, 1.25, 32), None),  # no time
    ],
)
def test_the_time_of_publishing_counts_where_its_clock_agrees_and_the_delay_is_kept(
    published: Sequence[float], t: Sequence[float], delay: Sequence[float] | None, tmp_path: Path
) -> None:
    some = [("/a", t, json.dumps({"x": x}).encode()) for x, t in enumerate((0.5, 1.25, 32.0))]
    log, columns = read(write(tmp_path / "log", some, published=published))
    assert columns == {"t": [*t], "/a.x": [0, 1, 2]} | ({"/a.publish_delay": [*delay]} if delay else {})
    assert log.units == ({"/a.publish_delay": "s"} if delay else {})


def test_a_message_that_is_no_json_is_rejected(tmp_path: Path) -> None:
    log, columns = read(write(tmp_path / "log", [("/a", 0, b'{"x": 1}'), ("/a", 1, b"{"), ("/a", 2, b'{"x": 3}')]))
    assert columns == {"t": [0, 2], "/a.x": [1, 3]}
    assert [(one.record, one.where, one.raw) for one in log.rejected] == [(1, 'group "/a", record 2', b"{")]
    assert log.rejected[0].why.startswith("is no JSON (")


def test_a_topic_without_numbers_and_long_lists_are_left_out_and_named(tmp_path: Path) -> None:
    some = [("/says", 0, b'{"text": "hello"}'), ("/a", 0, json.dumps({"x": 1, "cloud": [0] * 65}).encode())]
    log, columns = read(write(tmp_path / "log", some))
    assert columns == {"t": [0], "/a.x": [1]}
    assert log.settings["left_out"] == ["/says (1 messages)", "/says.text (1)", "/a.cloud (1)"]


DEFINITION = """# of a motor
std_msgs/Header header
uint8 MAX=3      # a constant
bool on
float64 T 20.5
int16[3] phases
float32[] cells
string<=10 name
Inner[<=2] inner
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: motor_msgs/Inner
uint64 n
"""


class Cdr:
    """Bytes of CDR: each value at a multiple of its size, behind four bytes."""

    def __init__(self, order: str) -> None:
        self.order, self.out = order, BytesIO()

    def put(self, *values: tuple[str, Any]) -> "Cdr":
        for form, value in values:
            if form == "s":
                text = value.encode() + b"\0"
                self.put(("I", len(text)))
                self.out.write(text)
                continue
            self.out.write(bytes(-self.out.tell() % struct.calcsize(form)) + struct.pack(self.order + form, value))
        return self

    def bytes(self) -> bytes:
        return bytes([0, int(self.order == "<"), 0, 0]) + self.out.getvalue()


VALUES: tuple[tuple[str, Any], ...] = (
    *(("i", 12), ("I", 500), ("s", "map"), ("?", True), ("d", 21.5)),
    *(("h", -1), ("h", 2), ("h", 3), ("I", 2), ("f", 0.5), ("f", 1.5), ("s", "x"), ("I", 1), ("Q", 7)),
)
NUMBERS = {
    "header.stamp.sec": 12,
    "header.stamp.nanosec": 500,
    "on": 1,
    "T": 21.5,
    "phases[0]": -1,
    "phases[1]": 2,
    "phases[2]": 3,
    "cells[0]": 0.5,
    "cells[1]": 1.5,
    "inner[0].n": 7,
}


@pytest.mark.parametrize("order", ["<", ">"])
def test_messages_of_ros_2_are_read_by_their_schema(order: str, tmp_path: Path) -> None:
    some = [("/motor", 1.0, Cdr(order).put(*VALUES).bytes())]
    log, columns = read(write(tmp_path / "log", some, "cdr", ("ros2msg", DEFINITION)))
    assert {name: cells[0] for name, cells in columns.items()} == {"t": 1} | {
        f"/motor.{name}": value for name, value in NUMBERS.items()
    }
    assert log.rejected == []


def test_messages_of_ros_1_are_read_by_their_schema(tmp_path: Path) -> None:
    header = "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\n"
    definition = f"time stamp\nHeader header\nfloat64 T\nuint8[] data\n{header}"
    data = struct.pack("<IIIdI", 5, 6, 9, 20.5, 100) + bytes(100)
    log, columns = read(write(tmp_path / "log", [("/a", 0, data)], "ros1", ("ros1msg", definition)))
    assert columns == {"t": [0], "/a.stamp.sec": [5], "/a.stamp.nsec": [6], "/a.header.seq": [9], "/a.T": [20.5]}
    assert log.settings["left_out"] == ["/a.data (1)"]


@pytest.mark.parametrize(
    ("data", "schema", "why"),
    [
        (b"\0\1\0\0\1\0", "float64 x", "ends before its schema does"),
        (b"\0\1\0\0" + struct.pack("<I", 1 << 31), "float32[] x", "says that x has 2,147,483,648 elements"),
        (b"\0\1\0\0" + struct.pack("<I", 1 << 31), "string x", "ends before its schema does"),
        (b"\7\7\0\0", "int8 x", "does not begin as CDR does"),
        (b"\0\1\0\0\1", "Other x", 'its schema does not say what "Other" is'),
        (b"\0\1\0\0" + bytes(99), "Self x\n====\nMSG: p/Self\nSelf x\n", "its schema is nested deeper than 20"),
        (b"\0\1\0\0\1", "no-field", 'its schema holds "no-field", which is no field'),
    ],
)
def test_a_message_that_does_not_fit_its_schema_is_rejected(data: bytes, schema: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(write(tmp_path / "log", [("/a", 0, data)], "cdr", ("ros2msg", schema)))
    assert f"no row of it can be read: {why}" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("encoding", "says"),
    [
        ("flatbuffer", r"flatbuffer is not read\. Export it as JSON in Foxglove, or as CSV"),
        ("protobuf", r"its encoding is not read \(protobuf\)\. Export it as JSON"),
        ("cdr", r"its encoding is not read \(cdr with a schema of ros2idl\)\. Export it as JSON"),
        ("arrow", r"is a recording that whyhot wrote\. Name the log that it was made of"),
    ],
)
def test_an_encoding_that_is_not_read_is_refused_with_a_way_out(encoding: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(UnreadableLogError, match=says):
        read(write(tmp_path / "log", [("/a", 0, b"x")], encoding, ("ros2idl", "x")))


def test_a_file_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    path = write(tmp_path / "log", [("/a", t, json.dumps({"x": t}).encode()) for t in range(200)])
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    log, columns = read(path)
    kept = len(columns["t"])
    assert 20 < kept < 200 and columns["/a.x"] == list(range(kept))
    assert log.cut is not None and log.cut.startswith(f"is cut or damaged behind message {kept} (")


def test_a_chunk_that_names_an_impossible_size_keeps_what_comes_before(tmp_path: Path) -> None:
    path = write(tmp_path / "log", [("/a", t, json.dumps({"x": t}).encode()) for t in range(200)])
    whole, places, at = path.read_bytes(), [], MAGIC_SIZE
    while at < len(whole) - MAGIC_SIZE:
        kind, length = struct.unpack_from("<BQ", whole, at)
        places += [at + 9 + 16] * (kind == Opcode.CHUNK)  # behind its two stamps stands its size, unpacked
        at += 9 + length
    path.write_bytes(whole[: places[2]] + b"\xff" * 8 + whole[places[2] + 8 :])
    log, columns = read(path)
    assert columns["/a.x"] == list(range(len(columns["t"]))) and 5 < len(columns["t"]) < 100
    assert log.cut is not None and log.cut.startswith(f"is cut or damaged behind message {len(columns['t'])} (")


def test_times_from_the_start_of_a_machine_are_no_dates(tmp_path: Path) -> None:
    path = write(tmp_path / "log", [("/a", 5 - START_NS / 1e9, b'{"x": 1}')])
    assert not read(path)[0].absolute
    log, columns = read(path, TimeSpec(start_ns=START_NS))
    assert log.absolute and columns["t"] == [pytest.approx(5, abs=1e-6)]
