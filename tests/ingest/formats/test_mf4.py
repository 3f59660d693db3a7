"""MF4 of bus loggers: equal to what python-can and asammdf wrote, and to files laid out by hand, whole and damaged.

`files/sample.mf4` was written by can.io.MF4Writer (python-can 4.6.1, asammdf 8.8.28) with compression_level=2.
"""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, TRANSMIT, WALL_CLOCK, TimeSpec, recognise
from made.frames import Frame, as_frames, messages, read
from made.mf4 import ELSEWHERE, FIXED, IN_RECORD, PARTS, SIZE, TIME, VIRTUAL, Mf4, in_small_parts, record
from made.places import LOGS

START_NS = 1_700_000_000_000_000_000
OPEN_PARTS = 0x25  # cycle counters, length of the last data block, size of values: as CANedge leaves them
RECORDS = [
    record(1_000, 0x123, b"\1\2\3"),
    record(2_000, 0x18EBFF00, bytes(range(8)), bits=1, bus=2),
    record(3_000, 0x7FF, bits=2),
]
FRAMES: list[Frame] = [
    (START_NS + 1_000_000, 1, 0x123, 0, "010203"),
    (START_NS + 2_000_000, 2, 0x18EBFF00 | int(EXTENDED), 0, "0001020304050607"),
    (START_NS + 3_000_000, 1, 0x7FF, TRANSMIT, ""),
]


def one_group(path: Path, records: bytes, *, declared: int = 3, start_ns: int = START_NS) -> Path:
    """A file that ends with its records."""
    file = Mf4()
    group = file.data_group(file.group((*PARTS, IN_RECORD), declared), 0)
    file.holds(group, file.block(b"DT", (), records))
    return file.save(path, group, start_ns=start_ns)


def unsorted(path: Path, *, open_parts: int = 0, cut: int = 0) -> Path:
    """Records of three kinds one after the other: frames, their payloads, and frames of LIN."""
    payloads = [b"\1\2\3", bytes(range(64)), b"\xff"]
    content, offset = b"", 0
    for i, payload in enumerate(payloads):
        content += b"\1" + record(
            1_000 * i, 0x100 + i, struct.pack("<Q", offset), bits=4 * (i == 1), length=len(payload)
        )
        content += b"\2" + struct.pack("<I", len(payload)) + payload + b"\3" + bytes(8)
        offset += 4 + len(payload)
    file = Mf4()
    values = file.values_group(2, 3)
    frames = file.group((*PARTS, ELSEWHERE), 3, number=1, values_at=values)
    lin = file.group((("t", TIME, 0, 0, 32), ("LIN_Frame.ID", FIXED, 4, 0, 6)), 3, number=3, size=8)
    file.follows(values, lin)
    file.follows(frames, values)
    group = file.data_group(frames, 0, id_size=1)
    at = file.block(b"DT", (), content[: len(content) - cut], length=24 if open_parts else None)
    file.holds(group, at)
    return file.save(path, group, start_ns=START_NS, open_parts=open_parts)


def test_frames_equal_those_that_python_can_and_asammdf_wrote() -> None:
    some = messages(200)[44:56]
    log, frames = read(LOGS / "sample.mf4")
    assert [(round(t_ns / 1e3) * 1000, *rest) for t_ns, *rest in frames] == as_frames(some)
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(5, "CAN_ErrorFrame 1", "error frame")]
    settings = {"version": "4.10", "finalised": True, "other_records": {}}
    assert log.settings == settings | {"time": WALL_CLOCK}  # as it says
    assert log.absolute and log.cut is None


def packed(file: Mf4, content: bytes) -> int:
    return file.packed(content)


def by_column(file: Mf4, content: bytes) -> int:
    return file.packed(content, SIZE)


def in_pieces(file: Mf4, content: bytes) -> int:
    """A list of lists, cut in the middle of records."""
    pieces = [file.packed(content[:7]), file.block(b"DT", (), content[7:30]), file.packed(content[30:], 5)]
    last = file.block(b"DL", (0, pieces[2]), struct.pack("<B3xIQ", 0, 1, 30))
    first = file.block(b"DL", (last, *pieces[:2]), struct.pack("<B3xIQQ", 0, 2, 0, 7))
    return file.block(b"HL", (first,), struct.pack("<HB5x", 0, 0))


@pytest.mark.parametrize("stored", [packed, by_column, in_pieces], ids=lambda one: one.__name__)
def test_records_are_read_however_they_are_stored(stored: Callable[[Mf4, bytes], int], tmp_path: Path) -> None:
    file = Mf4()
    group = file.group((*PARTS, IN_RECORD), 3)
    path = file.save(tmp_path / "log", file.data_group(group, stored(file, b"".join(RECORDS))), start_ns=START_NS)
    log, frames = read(path)
    assert frames == FRAMES
    assert not log.rejected and log.cut is None


@pytest.mark.parametrize("open_parts", [0, OPEN_PARTS, OPEN_PARTS | 1 << 6])
def test_unsorted_records_with_payloads_of_their_own_are_read(open_parts: int, tmp_path: Path) -> None:
    log, frames = read(unsorted(tmp_path / "log.mf4", open_parts=open_parts))
    assert recognise(tmp_path / "log.mf4").name == "mf4"
    assert frames == [
        (START_NS, 1, 0x100, 0, "010203"),
        (START_NS + 1_000_000, 1, 0x101, FD, bytes(range(64)).hex()),
        (START_NS + 2_000_000, 1, 0x102, 0, "ff"),
    ]
    assert log.settings == {"version": "4.11", "finalised": not open_parts, "other_records": {"LIN_Frame": 3}}
    assert log.cut is None


@pytest.mark.parametrize("is_packed", [False, True])
def test_payloads_in_a_block_of_their_own_are_read(is_packed: bool, tmp_path: Path) -> None:
    """Sorted records name the place of their payload; a place where there is none is one record's loss."""
    payloads = [b"\1\2\3", bytes(range(48))]
    content = b"".join(struct.pack("<I", len(payload)) + payload for payload in payloads)
    places = (0, 7, 999)
    records = [
        record(i, 0x100 + i, struct.pack("<Q", place), bits=4, length=(3, 48, 1)[i]) for i, place in enumerate(places)
    ]
    file = Mf4()
    values_at = file.packed(content) if is_packed else file.block(b"SD", (), content)
    group = file.group((*PARTS, ELSEWHERE), 3, values_at=values_at)
    path = file.save(tmp_path / "log.mf4", file.data_group(group, file.block(b"DT", (), b"".join(records))))
    log, frames = read(path)
    assert [frame[4] for frame in frames] == [payload.hex() for payload in payloads]
    assert [one.why for one in log.rejected] == ["holds fewer bytes than it says"]


def test_what_is_the_same_for_all_frames_may_stand_in_no_record(tmp_path: Path) -> None:
    """A virtual channel: its value is what its conversion says; and lengths are told by their code alone."""
    bus = ("CAN_DataFrame.BusChannel", VIRTUAL, 0, 0, 0)
    code = ("CAN_DataFrame.DLC", FIXED, 10, 0, 4)
    parts = [part for part in PARTS if not part[0].endswith(("BusChannel", "DataLength"))]
    file = Mf4()
    group = file.group((*parts, bus, code, IN_RECORD), 1, constant=9)
    records = record(1_000, 0x100, bytes(range(8)), length=0xF)  # of a classic frame this code is 8 bytes
    _, frames = read(file.save(tmp_path / "log.mf4", file.data_group(group, file.block(b"DT", (), records))))
    assert frames == [(1_000_000, 9, 0x100, 0, bytes(range(8)).hex())]


@pytest.mark.parametrize("lost", [10, 13])
def test_a_logger_that_lost_its_power_leaves_what_it_wrote(lost: int, tmp_path: Path) -> None:
    """The last record is there, its payload is not."""
    log, frames = read(unsorted(tmp_path / "log.mf4", open_parts=OPEN_PARTS, cut=lost))
    assert len(frames) == 2
    assert [one.why for one in log.rejected] == ["holds fewer bytes than it says"]
    assert log.cut is not None and log.cut.startswith("ends inside a record: 2 frames were read and kept")


def test_a_file_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    path = one_group(tmp_path / "log.mf4", b"".join(RECORDS))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) - 25])
    log, frames = read(path)
    assert frames == FRAMES[:1]
    assert log.cut is not None and log.cut.startswith(f"ends at byte {len(whole) - 25:,} of {len(whole):,}: 1 frames")


@pytest.mark.parametrize(
    ("declared", "kept", "says"),
    [(5, 3, "holds 2 records fewer than it says: 3 frames were read"), (2, 2, None), (0, 3, None)],
)
def test_the_number_of_records_is_compared_with_what_the_file_says(
    declared: int, kept: int, says: str | None, tmp_path: Path
) -> None:
    """What stands behind the records is none; a writer that tells no number leaves 0."""
    log, frames = read(one_group(tmp_path / "log.mf4", b"".join(RECORDS), declared=declared))
    assert frames == FRAMES[:kept]
    assert log.cut is None if says is None else log.cut is not None and log.cut.startswith(says)


def several_groups(path: Path) -> Path:
    file, after = Mf4(), 0
    for stamps in ((20, 40, 30, 60), (10, 50)):
        records = b"".join(record(us, us) for us in stamps)
        group = file.group((*PARTS, IN_RECORD), len(stamps))
        after = file.data_group(group, file.block(b"DT", (), records), after=after)
    return file.save(path, after, start_ns=START_NS)


def test_groups_come_one_among_the_other_by_time_each_in_its_own_order(tmp_path: Path) -> None:
    """A clock that steps back within a group is not sorted away."""
    _, frames = read(several_groups(tmp_path / "log.mf4"))
    assert [frame[2] for frame in frames] == [10, 20, 40, 30, 50, 60]


def test_records_are_read_a_part_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some values of variable length are longer than a part."""
    paths = [several_groups(tmp_path / "groups.mf4"), unsorted(tmp_path / "cut.mf4", cut=3)]
    paths += [unsorted(tmp_path / f"{parts}.mf4", open_parts=parts) for parts in (0, OPEN_PARTS | 1 << 6)]
    whole = [read(path) for path in paths]
    taken = in_small_parts(monkeypatch)
    for path, (log, frames) in zip(paths, whole, strict=True):
        again, same = read(path)
        assert (same, again.settings, again.cut) == (frames, log.settings, log.cut)
    assert 40 <= max(taken) <= 80


@pytest.mark.parametrize(
    ("damaged", "why"),
    [
        (record(5, 0x800), "its identifier has more than 11 or 29 bits"),
        (record(5, 0x100, bus=300), "its channel is above 255"),
        (record(5, 0x100, length=9), "holds fewer bytes than it says"),
        (record(5, 0x100, length=65), "says it holds more than the 64 bytes of a frame"),
    ],
)
def test_a_record_that_cannot_be_read_is_rejected_with_its_number(damaged: bytes, why: str, tmp_path: Path) -> None:
    log, frames = read(one_group(tmp_path / "log.mf4", RECORDS[0] + damaged + RECORDS[2]))
    assert len(frames) == 2
    assert [(one.where, one.why) for one in log.rejected] == [("CAN_DataFrame 2", why)]


def test_a_start_in_local_time_is_of_the_stated_zone(tmp_path: Path) -> None:
    file = Mf4()
    group = file.data_group(file.group((*PARTS, IN_RECORD), 1), file.block(b"DT", (), RECORDS[0]))
    path = file.save(tmp_path / "log.mf4", group, start_ns=START_NS, local=True)
    assert read(path)[1][0][0] == FRAMES[0][0]
    assert read(path, TimeSpec(zone="Europe/Berlin"))[1][0][0] == FRAMES[0][0] - 3600 * 10**9
    assert read(path, TimeSpec(start_ns=0))[1][0][0] == 1_000_000


def test_a_file_without_a_start_counts_from_zero(tmp_path: Path) -> None:
    log, frames = read(one_group(tmp_path / "log.mf4", RECORDS[0], declared=1, start_ns=0))
    assert (log.absolute, frames[0][0]) == (False, 1_000_000)


def test_a_file_that_packs_more_than_it_can_hold_is_refused(tmp_path: Path) -> None:
    file = Mf4()
    at = file.packed(bytes(1000))
    struct.pack_into("<Q", file.data, at + 24 + 8, 1 << 40)
    group = file.data_group(file.group((*PARTS, IN_RECORD), 3), at)
    with pytest.raises(UnreadableLogError, match=r"packed in a way that is not read, at byte .* Copy the file again"):
        read(file.save(tmp_path / "log.mf4", group))


def test_blocks_that_name_each_other_in_a_circle_are_refused(tmp_path: Path) -> None:
    file = Mf4()
    group = file.data_group(file.group((*PARTS, IN_RECORD), 3), file.block(b"DT", (), b"".join(RECORDS)))
    file.follows(group, group)
    log, frames = read(file.save(tmp_path / "log.mf4", group, start_ns=START_NS))
    assert frames == FRAMES
    assert (
        log.cut
        == f"is damaged at byte {group:,}: 3 frames were read and kept; copy the file again if the original is whole."
    )


def test_what_unpacks_to_far_more_than_any_log_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats.ALWAYS", 1 << 20)
    file = Mf4()
    piece = file.packed(bytes(1 << 18))
    pieces = file.block(b"DL", (0, *[piece] * 9), struct.pack("<B3xI9Q", 0, 9, *range(9)))
    path = file.save(tmp_path / "log.mf4", file.data_group(file.group((*PARTS, IN_RECORD), 3), pieces))
    says = None
    try:
        says = read(path)[0].cut
    except UnreadableLogError as error:
        says = str(error)
    assert says and f"unpacks to more than 1,048,576 bytes, from byte {piece:,} on" in says
