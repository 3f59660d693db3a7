"""MCAP of other recorders: the numbers in messages of JSON, protobuf, ROS 1 and ROS 2 (CDR), by the file's schemas.

A topic is a table with the time at which its messages were published, where the publisher's clock agrees with the
recorder's, else logged; `topic.publish_delay` [s] is logged minus published. A row is what all topics say at one time.
A column is `topic.field` (`/motor.winding.T`, `/cells.voltage[3]`). Texts, long lists and topics without numbers are
left out and named (`settings["left_out"]`). A message that cannot be read is rejected. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import io
import struct
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import IO, Any, cast

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.records import Chunk
from mcap.stream_reader import MAGIC_SIZE, get_chunk_data_stream
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EARLIEST_NS, LATE_NS, SHOWN, Rows
from ingest.formats import _cdr as cdr
from ingest.formats import _protobuf as protobuf
from ingest.formats._flattened import NotRead, Numbers, decoded_json
from ingest.formats._joined_tables import JoinedTables, OwnTimes, counted, held

DAMAGE = (
    *(McapError, ValueError, KeyError, AssertionError, EOFError, struct.error, RuntimeError, zstandard.ZstdError),
    OverflowError,  # a size that is no size
)
OURS = "arrow"  # encoding of the recordings that whyhot writes
MOST_COLUMNS = 5000
DELAY, AGREE_NS = "publish_delay", 1_000_000_000
RECORD = struct.Struct("<BQ")  # kind and length of what follows
WAYS_OUT = {"flatbuffer": "flatbuffer is not read. Export it as JSON in Foxglove, or as CSV"}

Decoder = Callable[[bytes], Numbers]


@dataclass
class _Topic:
    """The messages of one topic, N so far. `columns`: name -> (places, values) of the messages that have it."""

    name: str
    t_ns: list[int] = field(default_factory=list)  # logged
    published_ns: list[int] = field(default_factory=list)
    why: dict[int, tuple[str, bytes]] = field(default_factory=dict)  # of those that cannot be read, first bytes beside
    columns: dict[str, tuple[array[int], array[float]]] = field(default_factory=dict)
    no_numbers: dict[str, int] = field(default_factory=dict)  # fields that are something else -> how often
    number: array[int] = field(default_factory=lambda: array("q"))  # of each among all messages of the file
    unit: str = ""  # of its numbers, where the channel's metadata say one


@dataclass
class McapLog(JoinedTables):
    """An MCAP file, read from front to back up to damage."""

    _topics: dict[str, _Topic] = field(default_factory=dict)
    _beyond: set[str] = field(default_factory=set)  # columns that are too many

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where no message can be read."""
        ended = self._read()
        topics = [one for one in self._topics.values() if one.columns or one.why]
        left = [f"{one.name} ({len(one.t_ns):,} messages)" for one in self._topics.values() if one not in topics]
        left += [f"{name}.{one} ({n:,})" for name, topic in self._topics.items() for one, n in topic.no_numbers.items()]
        if self._beyond:
            left.append(f"{len(self._beyond):,} columns more than {MOST_COLUMNS:,}")
        if left:
            self.settings["left_out"] = left
        stamps = [min(one.t_ns) for one in topics]
        dated = all(EARLIEST_NS <= one < LATE_NS for one in stamps)
        self.absolute = dated or self.time.start_ns is not None
        tables = [self._table(one, 0 if dated else self.time.start_ns or 0) for one in topics]
        self.settings["groups"] = counted(tables)
        yield from self._joined(tables)
        why = self.rejected[0].why if self.rejected else ended or "it holds no message with a number"
        self.end_rows(ended, why)

    def _read(self) -> str | None:
        """Read the messages; how the file ends before its end."""
        count, size = 0, self.path.stat().st_size
        with self.path.open("rb") as file:
            try:
                reader = NonSeekingReader(
                    cast(IO[bytes], _Rest(file, size)), validate_crcs=True, record_size_limit=size
                )
                for schema, channel, message in reader.iter_messages(log_time_order=False):
                    if channel.message_encoding == OURS:
                        raise UnreadableLogError(
                            f"{self.path.name}: is a recording that whyhot wrote. Name the log that it was made of."
                        )
                    self._take(schema, channel, message, count)
                    count += 1
            except DAMAGE as error:
                says = " ".join(str(error).split())[:120] or type(error).__name__
                return f"is cut or damaged behind message {count:,} ({says})"
        return None

    def _take(self, schema: Any, channel: Any, message: Any, number: int) -> None:
        topic = self._topics.setdefault(channel.topic, _Topic(channel.topic, unit=channel.metadata.get("unit", "")))
        place = len(topic.t_ns)
        topic.t_ns.append(message.log_time)
        topic.published_ns.append(message.publish_time or message.log_time)
        if self.sought:
            topic.number.append(number)
        told = (schema.encoding, schema.name, schema.data) if schema else ("", "", b"")
        try:
            numbers = _decoder(channel.message_encoding, *told)(message.data)
        except NotRead as error:
            topic.why[place] = str(error), message.data[:SHOWN] or channel.topic.encode() or b"\0"
            return
        for name, value in numbers.items():
            if value is None:
                topic.no_numbers[name] = topic.no_numbers.get(name, 0) + 1
            elif name in topic.columns or self._is_room(f"{topic.name}.{name}"):
                places, values = topic.columns.setdefault(name, (array("q"), array("d")))
                places.append(place)
                values.append(value)

    def _table(self, topic: _Topic, origin_ns: int) -> OwnTimes:
        return _table(topic, origin_ns, lambda i: self._place(topic.number[i]))

    def _place(self, number: int) -> str:
        """Where the message of this number stands in the file, or in what a chunk of it unpacks to."""
        with self.path.open("rb") as file:
            file.seek(MAGIC_SIZE)
            for kind, at, length in _records_of(file, self.path.stat().st_size):
                if kind == Opcode.CHUNK:
                    chunk = Chunk.read(ReadDataStream(io.BytesIO(file.read(length))))
                    data = get_chunk_data_stream(chunk)[0].read(chunk.uncompressed_size)
                    inner = [
                        inside for one, inside, _ in _records_of(io.BytesIO(data), len(data)) if one == Opcode.MESSAGE
                    ]
                    if number < len(inner):
                        return f"byte {at:,}, unpacked +{inner[number]:,}"
                    number -= len(inner)
                elif kind == Opcode.MESSAGE:
                    if number == 0:
                        return f"byte {at:,}"
                    number -= 1
        raise IndexError(number)

    def _is_room(self, column: str) -> bool:
        if sum(len(topic.columns) for topic in self._topics.values()) < MOST_COLUMNS:
            return True
        self._beyond.add(column)
        return False


def _records_of(file: IO[bytes], end: int) -> Iterator[tuple[int, int, int]]:
    """(kind, byte where it begins, length of its contents) of each record up to `end`; these may be read then."""
    at = file.tell()
    while at + RECORD.size <= end:
        file.seek(at)
        kind, length = RECORD.unpack(file.read(RECORD.size))
        yield kind, at, length
        at += RECORD.size + length


@dataclass(frozen=True)
class _Rest:
    """A file of which no more can be asked than it has: a damaged length is no reason to ask for all memory."""

    file: IO[bytes]
    size: int

    def read(self, count: int) -> bytes:
        return self.file.read(min(count, self.size - self.file.tell()))


@cache
def _decoder(encoding: str, schema_encoding: str, name: str, schema: bytes) -> Decoder:
    """What reads messages of an encoding and a schema. Raises NotRead where nothing does."""
    if encoding == "json":
        return decoded_json
    ros1 = encoding == "ros1" and schema_encoding == "ros1msg"
    if ros1 or (encoding == "cdr" and schema_encoding == "ros2msg"):
        known = cdr.definitions(schema.decode("utf-8", errors="replace"))
        return lambda data: cdr.decoded(known, data, ros1=ros1)
    if encoding == schema_encoding == "protobuf":
        messages = protobuf.definitions(schema)
        return lambda data: protobuf.decoded(messages, name, data)
    told = f"{encoding} with a schema of {schema_encoding}" if encoding == "cdr" else encoding[:60] or "no encoding"
    raise NotRead(WAYS_OUT.get(encoding, f"its encoding is not read ({told}). Export it as JSON"))


def _agree(published: NDArray[np.int64], logged: NDArray[np.int64]) -> bool:
    """Whether the times of publishing (N,) are of a clock, and of one that agrees with the recorder's: none is later
    than its message was logged, and some message took less than `AGREE_NS`."""
    is_clock = len(np.unique(published)) >= len(np.unique(logged))
    return is_clock and bool(0 <= (logged - published).min() < AGREE_NS)


def _table(topic: _Topic, origin_ns: int, where: Callable[[int], str]) -> OwnTimes:
    logged, published = (np.minimum(one, LATE_NS).astype(np.int64) for one in (topic.t_ns, topic.published_ns))
    delay_ns = logged - published
    stamps = published if _agree(published, logged) else logged
    bad = stamps + origin_ns >= LATE_NS
    bad[list(topic.why)] = True
    names, delays = list(topic.columns), [DELAY] if delay_ns.any() else []

    def cells(place: int, start: int, stop: int) -> NDArray[Any]:
        if place == len(names):
            return delay_ns[start:stop] / 1e9
        places, values = (np.asarray(one) for one in topic.columns[names[place]])
        some = slice(*np.searchsorted(places, [start, stop]).tolist())
        found = np.full(stop - start, np.nan)
        found[places[some].astype(np.int64) - start] = values[some]
        return found

    def why(i: int) -> tuple[str, bytes]:
        return topic.why.get(i, ("has a stamp that no log can reach", topic.name.encode() or b"\0"))

    return OwnTimes(
        name=topic.name,
        columns=tuple(f"{topic.name}.{name}" if name else topic.name for name in (*names, *delays)),
        units=(*[topic.unit] * len(names), *["s"] * len(delays)),
        count=len(stamps),
        times=held(stamps + origin_ns, bad),
        cells=cells,
        raw=lambda i: why(i)[1],
        why=lambda i: why(i)[0],
        where=where,
    )


reader = McapLog
