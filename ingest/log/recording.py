"""The recording of a log: an MCAP file with every record as it arrived, in blocks of one second.

Topics: `raw/can<n>` (n = channel number stored in the file), `raw/rows` for a table, `raw/rows/<name>` for a series of
a long one, `raw/rejected` for what could not be read (JSON). The payload of frames and rows is an Arrow record batch;
the Arrow schema is the MCAP schema, so that `schema.data + message.data` is an Arrow IPC stream any Arrow reader opens.
A block ends where the second of the log's own time changes (also backwards), never where a reader's batch ended: the
bytes depend on the log alone. Format: https://mcap.dev/spec,
https://arrow.apache.org/docs/format/Columnar.html#serialization-and-interprocess-communication-ipc
"""

from __future__ import annotations

import json
import struct
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import zstandard
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from ingest.errors import DamageError
from ingest.formats import EXTENDED, REMOTE, Frames, Log, Rejected, Rows
from ingest.log.ahead import ahead
from ingest.log.arrow import from_numpy, to_numpy
from ingest.log.parameter_groups import announced

CHUNK_BYTES = 1 << 20
BLOCK_RECORDS = 65_536  # a block is cut here where a second (or a stopped clock) holds more
ROWS_RECORDS = 64  # rows are often one a second: a block of them ends with the second that reached this many
BATCH_RECORDS = 100_000  # records that `read` hands out at once, about
SECOND_NS = 1_000_000_000
ROWS, REJECTED = "raw/rows", "raw/rejected"
FIXED = ("t_ns", "log_t_ns", "record")  # the first columns of every block, by position: a table's own may be named so
T_NS, RECORD = 0, 2

FRAMES_SCHEMA = pa.schema(
    [
        ("t_ns", pa.int64()),
        ("log_t_ns", pa.int64()),
        ("record", pa.int64()),
        ("can_id", pa.uint32()),
        ("flags", pa.uint8()),
        ("data", pa.binary()),
    ]
)


@dataclass(frozen=True)
class Attachment:
    """A file that explains the recording: a DBC, a bench file."""

    name: str
    data: bytes
    media_type: str


@dataclass(frozen=True)
class Contents:
    """The metadata record `reading`: the reader's counters (found = written + rejected), and what was recorded."""

    found: int
    written: int
    rejected: int
    absolute: bool
    start_ns: int | None  # the least stamp [ns], and the greatest; None where nothing could be read
    end_ns: int | None
    cut: str | None
    buses: tuple[int, ...]
    ids: Mapping[str, int] = field(default_factory=dict)  # "can1:0x123" -> frames with data
    columns: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


def bus_name(bus: int) -> str:
    """`can<n>`: the name of bus `bus` in topics, groups and causes."""
    return f"can{bus}"


def identifiers(reading: Contents) -> set[tuple[int, int]]:
    """(bus, can_id) of all frames with data, and of the messages of several packets that some of them announce."""
    return {identifier_in(text) for text in (*reading.ids, *reading.settings.get("announced", ()))}


def identifier_in(text: str) -> tuple[int, int]:
    """(bus, can_id) of what `id_text` wrote."""
    bus, _, number = text.removeprefix("can").partition(":0x")
    return int(bus), int(number, 16) | (int(EXTENDED) if len(number) == 8 else 0)


def id_text(bus: int, can_id: int) -> str:
    """`can1:0x123`; a 29-bit identifier (bit 31 set) is written with eight digits: `can1:0x00000123`."""
    plain = can_id & ~int(EXTENDED)
    return f"{bus_name(bus)}:0x{plain:08X}" if can_id & int(EXTENDED) else f"{bus_name(bus)}:0x{plain:X}"


# ---- writing -------------------------------------------------------------------------------------------------------


def write(path: Path, log: Log, attachments: Sequence[Attachment] = ()) -> Contents:
    """Write all that `log` gives to `path`, and return what was written. Raises what `log.batches()` raises."""
    with path.open("wb") as file:
        writer = Writer(
            file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True
        )
        writer.start(profile="whyhot", library="whyhot")
        for attachment in attachments:
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        blocks = _Blocks(writer)
        batches: Iterator[Frames | Rows] = log.batches()
        for batch in ahead(batches):
            blocks.add(batch)
        blocks.finish()
        _write_rejected(writer, log, blocks.last_ns)
        contents = blocks.contents(log)
        writer.add_metadata("reading", {name: json.dumps(value) for name, value in vars(contents).items()})
        writer.finish()  # type: ignore[no-untyped-call]
    return contents


class _Blocks:
    """Cuts the batches of a reader into blocks, topic by topic, and writes each block once it is complete."""

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self.open: dict[str, pa.RecordBatch] = {}  # topic -> records of the block that is not complete yet
        self.channels: dict[tuple[str, bytes], int] = {}
        self.ids: Counter[str] = Counter()
        self.announced: Counter[str] = Counter()
        self.columns: dict[str, None] = {}
        self.buses: set[int] = set()
        self.written = 0
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.last_ns = 0

    def add(self, batch: Frames | Rows) -> None:
        """Write what is complete with `batch`, in the order of the records that completed it."""
        self._count(batch)
        complete: list[tuple[int, str, pa.RecordBatch]] = []
        for topic, part in _by_topic(batch):
            joined, edges = self._joined(topic, part)
            record = to_numpy(joined.column(RECORD))
            for start, stop in pairwise(edges[:-1]):
                complete.append((int(record[stop]), topic, joined.slice(start, stop - start)))
            self.open[topic] = joined.slice(edges[-2])
        for _, topic, block in sorted(complete, key=lambda entry: entry[0]):
            self._write(topic, block)

    def finish(self) -> None:
        """Write the blocks that the end of the log completes."""
        for topic in sorted(self.open):
            self._write(topic, self.open[topic])

    def _joined(self, topic: str, part: pa.RecordBatch) -> tuple[pa.RecordBatch, list[int]]:
        pending = self.open.get(topic)
        if pending is not None and pending.schema != part.schema:
            self._write(topic, pending)
            pending = None
        joined = part if pending is None else pa.concat_batches([pending, part])
        return joined, _edges(to_numpy(joined.column(T_NS)), ROWS_RECORDS if topic.startswith(ROWS) else 1)

    def _write(self, topic: str, block: pa.RecordBatch) -> None:
        self.last_ns = max(0, block.column(T_NS)[0].as_py())
        data = block.serialize().to_pybytes()
        self.writer.add_message(self._channel(topic, block.schema), self.last_ns, data, publish_time=self.last_ns)

    def _channel(self, topic: str, schema: pa.Schema) -> int:
        arrow = schema.serialize().to_pybytes()
        if (topic, arrow) not in self.channels:
            name = "whyhot.Rows" if topic.startswith(ROWS) else "whyhot.Frames"
            identity = self.writer.register_schema(name, "arrow", arrow)
            self.channels[topic, arrow] = self.writer.register_channel(topic, "arrow", identity)
        return self.channels[topic, arrow]

    def _count(self, batch: Frames | Rows) -> None:
        if not len(batch.t_ns):
            return
        self.written += len(batch.t_ns)
        least, greatest = int(batch.t_ns.min()), int(batch.t_ns.max())
        self.start_ns = least if self.start_ns is None else min(least, self.start_ns)
        self.end_ns = greatest if self.end_ns is None else max(greatest, self.end_ns)
        if isinstance(batch, Rows):
            self.columns.update(dict.fromkeys(batch.columns))
            return
        self.buses.update(np.unique(batch.bus).tolist())
        with_data = (batch.flags & REMOTE) == 0
        keys = (batch.bus[with_data].astype(np.uint64) << np.uint64(32)) | batch.can_id[with_data]
        for key, frames in zip(*np.unique(keys, return_counts=True), strict=True):
            self.ids[id_text(int(key) >> 32, int(key) & 0xFFFFFFFF)] += int(frames)
        self.announced.update(id_text(bus, can_id) for bus, can_id in announced(batch))

    def contents(self, log: Log) -> Contents:
        """What was written, with what `log` counted."""
        return Contents(
            found=log.found,
            written=self.written,
            rejected=len(log.rejected),
            absolute=log.absolute,
            start_ns=self.start_ns,
            end_ns=self.end_ns,
            cut=log.cut,
            buses=tuple(sorted(self.buses)),
            ids=dict(sorted(self.ids.items())),
            columns=tuple(self.columns),
            units=log.units,
            settings=log.settings | ({"announced": dict(sorted(self.announced.items()))} if self.announced else {}),
        )


def _edges(t_ns: NDArray[np.int64], least: int) -> list[int]:
    """Ends of the blocks in `t_ns` [ns, in file order], 0 and N included; a block holds at least `least` records."""
    change = np.flatnonzero(np.diff(t_ns // SECOND_NS)) + 1
    edges = [0]
    while True:
        at = int(np.searchsorted(change, edges[-1] + least))
        end = int(change[at]) if at < len(change) else len(t_ns)
        end = min(end, edges[-1] + BLOCK_RECORDS)
        edges.append(end)
        if end >= len(t_ns):
            return edges


def _by_topic(batch: Frames | Rows) -> Iterator[tuple[str, pa.RecordBatch]]:
    if not len(batch.t_ns):
        return
    if isinstance(batch, Rows):
        yield ROWS if batch.series is None else f"{ROWS}/{batch.series}", _rows_to_arrow(batch)
        return
    table = _frames_to_arrow(batch)
    buses = np.unique(batch.bus).tolist()
    for bus in buses:
        part = table if len(buses) == 1 else table.take(from_numpy(np.flatnonzero(batch.bus == bus)))
        yield f"raw/{bus_name(bus)}", part


def _frames_to_arrow(frames: Frames) -> pa.RecordBatch:
    offsets = pa.py_buffer(frames.offsets.astype(np.int32))
    data = pa.Array.from_buffers(pa.binary(), len(frames.t_ns), [None, offsets, pa.py_buffer(frames.data)])
    t_ns = from_numpy(frames.t_ns)
    arrays = [t_ns, t_ns, from_numpy(frames.record), from_numpy(frames.can_id), from_numpy(frames.flags), data]
    return pa.RecordBatch.from_arrays(arrays, schema=FRAMES_SCHEMA)


def _rows_to_arrow(rows: Rows) -> pa.RecordBatch:
    """Columns t_ns, log_t_ns, record, then those of the table, whose names may be anything (also `record`)."""
    t_ns = from_numpy(rows.t_ns)
    arrays = [t_ns, t_ns, from_numpy(rows.record), *map(from_numpy, rows.columns.values())]
    return pa.RecordBatch.from_arrays(arrays, names=[*FIXED, *rows.columns])


def _write_rejected(writer: Writer, log: Log, t_ns: int) -> None:
    if not log.rejected:
        return
    schema = writer.register_schema("whyhot.Rejected", "jsonschema", json.dumps(_REJECTED_SCHEMA).encode())
    channel = writer.register_channel(REJECTED, "json", schema)
    for entry in log.rejected:
        body = {"record": entry.record, "where": entry.where, "why": entry.why, "raw": entry.raw.hex()}
        writer.add_message(channel, t_ns, json.dumps(body).encode(), publish_time=t_ns)


_REJECTED_SCHEMA = {
    "type": "object",
    "properties": {
        "record": {"type": "integer"},
        "where": {"type": "string"},
        "why": {"type": "string"},
        "raw": {"type": "string", "description": "first bytes of the record, in hexadecimal"},
    },
}


# ---- reading -------------------------------------------------------------------------------------------------------

_DAMAGE = (McapError, ValueError, KeyError, struct.error, zstandard.ZstdError, pa.ArrowException, MemoryError)


def read(path: Path) -> Iterator[tuple[str, Frames | Rows]]:
    """(topic, records) of a recording, in the order of the file within a topic, about 100,000 records at once.

    Every CRC is checked, that of the whole data section included; DamageError at the first that does not hold.
    """
    try:
        with path.open("rb") as file:
            yield from _merged(_blocks_of(file))
    except _DAMAGE as error:
        raise _damage(path, error) from error


def read_rejected(path: Path) -> Iterator[Rejected]:
    """Every record of the log that could not be read, in the order of its reader. Raises DamageError."""
    try:
        with path.open("rb") as file:
            for _, _, message in make_reader(file, validate_crcs=True).iter_messages(REJECTED, log_time_order=False):
                body = json.loads(message.data)
                yield Rejected(**body | {"raw": bytes.fromhex(body["raw"])})
    except _DAMAGE as error:
        raise _damage(path, error) from error


def _blocks_of(file: IO[bytes]) -> Iterator[tuple[str, pa.RecordBatch]]:
    schemas: dict[int, pa.Schema] = {}
    reader = NonSeekingReader(file, validate_crcs=True)
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if channel.topic == REJECTED or schema is None:
            continue
        if schema.id not in schemas:
            schemas[schema.id] = pa.ipc.read_schema(pa.py_buffer(schema.data))
        yield channel.topic, pa.ipc.read_record_batch(pa.py_buffer(message.data), schemas[schema.id])


def _merged(blocks: Iterable[tuple[str, pa.RecordBatch]]) -> Iterator[tuple[str, Frames | Rows]]:
    waiting: defaultdict[str, list[pa.RecordBatch]] = defaultdict(list)
    records: Counter[str] = Counter()
    for topic, block in blocks:
        batches = waiting[topic]
        if batches and batches[0].schema != block.schema:
            yield topic, _from_arrow(topic, batches)
            waiting[topic], records[topic] = [], 0
        waiting[topic].append(block)
        records[topic] += block.num_rows
        if records[topic] >= BATCH_RECORDS:
            yield topic, _from_arrow(topic, waiting[topic])
            waiting[topic], records[topic] = [], 0
    for topic in sorted(topic for topic, batches in waiting.items() if batches):
        yield topic, _from_arrow(topic, waiting[topic])


def _from_arrow(topic: str, batches: Sequence[pa.RecordBatch]) -> Frames | Rows:
    batch = pa.concat_batches(batches)
    t_ns, record = to_numpy(batch.column(T_NS)), to_numpy(batch.column(RECORD))
    if topic.startswith(ROWS):
        named = zip(batch.schema.names[len(FIXED) :], batch.columns[len(FIXED) :], strict=True)
        series = topic.removeprefix(f"{ROWS}/") if topic != ROWS else None
        return Rows(t_ns, {name: to_numpy(column) for name, column in named}, record, series)
    data = batch.column("data")
    _, offsets, values = data.buffers()
    return Frames(
        t_ns=t_ns,
        bus=np.full(len(t_ns), int(topic.removeprefix("raw/can")), np.uint8),
        can_id=to_numpy(batch.column("can_id")),
        flags=to_numpy(batch.column("flags")),
        offsets=np.frombuffer(offsets, np.int32)[data.offset : data.offset + len(data) + 1].astype(np.int64),
        data=np.frombuffer(values, np.uint8) if values is not None and values.size else np.empty(0, np.uint8),
        record=record,
    )


def _damage(path: Path, error: BaseException) -> DamageError:
    says = str(error) or type(error).__name__
    return DamageError(
        f"{path}: the recording is damaged ({says}): it is not what was written. "
        "Make it again from the archive with `whyhot rebuild`."
    )
