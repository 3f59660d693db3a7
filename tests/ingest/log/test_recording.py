"""The MCAP recording: what goes in comes out, and the bytes depend on the log alone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from mcap.reader import make_reader

from ingest.errors import DamageError
from ingest.formats import EXTENDED, FD, REMOTE, Frames, Log, Rejected, Rows, TimeSpec
from ingest.log import recording
from ingest.log.recording import Attachment, Contents

START_NS = 1_700_000_000_250_000_000


class Given(Log):
    """A log whose batches are given."""

    def __init__(self, given: Sequence[Frames] | Sequence[Rows], **fields: object) -> None:
        super().__init__(Path("given.log"), TimeSpec(), **fields)  # type: ignore[arg-type]
        self.given: Sequence[Frames | Rows] = given

    def batches(self) -> Iterator[Frames] | Iterator[Rows]:
        yield from self.given


def some_frames(count: int, seed: int = 1, buses: int = 3) -> Frames:
    """`count` frames over 10 s with payloads of 0 to 64 bytes."""
    random = np.random.default_rng(seed)
    lengths = random.choice([0, 3, 8, 64], count)
    return Frames(
        t_ns=START_NS + np.sort(random.integers(0, 10 * recording.SECOND_NS, count)),
        bus=random.integers(1, buses + 1, count).astype(np.uint8),
        can_id=random.choice([0x123, 0x7FF, 0x18FEF100 | int(EXTENDED)], count).astype(np.uint32),
        flags=np.where(lengths > 8, FD, 0).astype(np.uint8),
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        data=random.integers(0, 256, int(lengths.sum())).astype(np.uint8),
        record=np.arange(count),
    )


def part(frames: Frames, start: int, stop: int) -> Frames:
    first, last = frames.offsets[start], frames.offsets[stop]
    return Frames(
        frames.t_ns[start:stop],
        frames.bus[start:stop],
        frames.can_id[start:stop],
        frames.flags[start:stop],
        frames.offsets[start : stop + 1] - first,
        frames.data[first:last],
        frames.record[start:stop],
    )


def in_parts(frames: Frames, *edges: int) -> list[Frames]:
    ends = [0, *edges, len(frames.t_ns)]
    return [part(frames, start, stop) for start, stop in pairwise(ends)]


def written(path: Path, given: Sequence[Frames] | Sequence[Rows], **fields: object) -> Contents:
    return recording.write(path, Given(given, **fields))


def described(path: Path) -> Contents:
    """The metadata record that a recording carries."""
    with path.open("rb") as file:
        (record,) = make_reader(file, validate_crcs=True).iter_metadata()
    assert record.name == "reading"
    values = {name: json.loads(text) for name, text in record.metadata.items()}
    return Contents(**values | {"buses": tuple(values["buses"]), "columns": tuple(values["columns"])})


def by_record(path: Path) -> dict[int, tuple[int, int, int, int, bytes]]:
    found = {}
    for topic, batch in recording.read(path):
        assert isinstance(batch, Frames)
        assert topic == f"raw/can{batch.bus[0]}"
        for i, record in enumerate(batch.record.tolist()):
            payload = batch.data[batch.offsets[i] : batch.offsets[i + 1]].tobytes()
            found[record] = (int(batch.t_ns[i]), int(batch.bus[i]), int(batch.can_id[i]), int(batch.flags[i]), payload)
    return found


def test_every_frame_comes_back_as_it_went_in(tmp_path: Path) -> None:
    frames = some_frames(5000)
    written(tmp_path / "a.mcap", in_parts(frames, 1, 2000, 2001))
    found = by_record(tmp_path / "a.mcap")
    assert sorted(found) == list(range(5000))
    for i, (t_ns, bus, can_id, flags, payload) in found.items():
        assert (t_ns, bus, can_id, flags) == (frames.t_ns[i], frames.bus[i], frames.can_id[i], frames.flags[i])
        assert payload == frames.data[frames.offsets[i] : frames.offsets[i + 1]].tobytes()


@pytest.mark.parametrize("edges", [(1,), (17, 18, 1999), (500, 1000, 1500)])
def test_the_bytes_do_not_depend_on_how_the_reader_batched(tmp_path: Path, edges: tuple[int, ...]) -> None:
    frames = some_frames(2000)
    frames.t_ns[700:900] -= 5 * recording.SECOND_NS  # the clock was set back, and forth again
    written(tmp_path / "whole.mcap", [frames])
    written(tmp_path / "parts.mcap", in_parts(frames, *edges))
    assert (tmp_path / "parts.mcap").read_bytes() == (tmp_path / "whole.mcap").read_bytes()


def test_a_block_holds_one_second_of_one_bus(tmp_path: Path) -> None:
    written(tmp_path / "a.mcap", [some_frames(3000)])
    with (tmp_path / "a.mcap").open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    seconds = []
    for schema, channel, message in messages:
        assert schema is not None
        table = pa.ipc.open_stream(schema.data + message.data).read_all()  # what an outside reader does
        assert table.column_names == ["t_ns", "log_t_ns", "record", "can_id", "flags", "data"]
        [second] = set((table["t_ns"].to_numpy() // recording.SECOND_NS).tolist())
        seconds.append((channel.topic, second))
    assert len(set(seconds)) == len(seconds) == 3 * 11


def test_a_clock_that_stands_still_fills_blocks_of_bounded_size(tmp_path: Path) -> None:
    frames = some_frames(2 * recording.BLOCK_RECORDS + 5, buses=1)
    frames.t_ns[:] = START_NS
    written(tmp_path / "a.mcap", in_parts(frames, 100_000))
    with (tmp_path / "a.mcap").open("rb") as file:
        statistics = make_reader(file).get_summary().statistics  # type: ignore[union-attr]
    assert statistics is not None
    assert statistics.message_count == 3
    assert sum(len(batch.t_ns) for _, batch in recording.read(tmp_path / "a.mcap")) == len(frames.t_ns)


def test_rows_come_back_with_text_and_empty_cells(tmp_path: Path) -> None:
    count = 500
    columns = {
        "T [°C]": np.where(np.arange(count) % 7 == 0, np.nan, np.arange(count) / 10),
        "record": np.arange(count, dtype=float),
        "serial": np.array([f"S-{i % 3}" for i in range(count)], dtype=object),
    }
    rows = Rows(START_NS + np.arange(count) * recording.SECOND_NS, columns, np.arange(count))
    written(tmp_path / "a.mcap", [rows], units={"T [°C]": "°C"})
    [(topic, found)] = recording.read(tmp_path / "a.mcap")
    assert topic == "raw/rows"
    assert isinstance(found, Rows)
    assert list(found.columns) == list(columns)
    np.testing.assert_array_equal(found.columns["T [°C]"], columns["T [°C]"])
    np.testing.assert_array_equal(found.columns["record"], columns["record"])
    assert found.columns["serial"].tolist() == columns["serial"].tolist()
    np.testing.assert_array_equal(found.record, rows.record)


def test_the_metadata_says_what_the_recording_holds(tmp_path: Path) -> None:
    frames = some_frames(1000, buses=2)
    frames.flags[0] = REMOTE
    refused = [Rejected(1000, "byte 7", "is cut", b"\x01\x02")]
    path = tmp_path / "a.mcap"
    contents = written(path, [frames], found=1001, rejected=refused, cut="ends 7 bytes early", settings={"version": 1})
    assert described(path) == contents
    assert (contents.found, contents.written, contents.rejected, contents.cut) == (1001, 1000, 1, "ends 7 bytes early")
    assert contents.buses == (1, 2)
    assert set(contents.ids) == {f"can{bus}:{name}" for bus in (1, 2) for name in ("0x123", "0x7FF", "0x18FEF100")}
    assert sum(contents.ids.values()) == 999
    assert (contents.start_ns, contents.end_ns) == (frames.t_ns[0], frames.t_ns[-1])


def test_rejected_records_and_attachments_are_in_the_file(tmp_path: Path) -> None:
    log = Given([some_frames(10)], found=11, rejected=[Rejected(4, "line 12", "no number", b"\xff;1")])
    recording.write(tmp_path / "a.mcap", log, [Attachment("bench.toml", b"schema = 1", "application/toml")])
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        [(_, channel, message)] = reader.iter_messages(topics=["raw/rejected"])
        [attachment] = reader.iter_attachments()
    assert channel.message_encoding == "json"
    assert json.loads(message.data) == {"record": 4, "where": "line 12", "why": "no number", "raw": "ff3b31"}
    assert (attachment.name, attachment.data, attachment.media_type) == (
        "bench.toml",
        b"schema = 1",
        "application/toml",
    )


def test_a_log_without_a_record_makes_an_empty_recording(tmp_path: Path) -> None:
    contents = written(tmp_path / "a.mcap", [some_frames(0)])
    assert (contents.written, contents.start_ns, contents.end_ns) == (0, None, None)
    assert list(recording.read(tmp_path / "a.mcap")) == []
    assert described(tmp_path / "a.mcap") == contents


def test_a_changed_byte_is_damage_or_changes_nothing_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    written(path, [some_frames(300, buses=1)])
    whole, expected = path.read_bytes(), by_record(path)
    random = np.random.default_rng(5)
    refused = 0
    for place in random.choice(len(whole), 150, replace=False).tolist():
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :])
        try:
            assert by_record(path) == expected
        except DamageError:
            refused += 1
    assert refused > 75


@pytest.mark.parametrize("keep", [0, 4, 100, 0.5, 0.99])
def test_a_cut_recording_is_damage_with_its_name(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "a.mcap"
    written(path, [some_frames(300)])
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep if keep > 1 or not keep else keep * len(whole))])
    with pytest.raises(DamageError, match=r"a\.mcap: the recording is damaged \(.*whyhot rebuild"):
        list(recording.read(path))
