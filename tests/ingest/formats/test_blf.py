"""BLF: equal to python-can where both read, bounded and honest where the file is not whole."""

import random
import struct
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, Frames, Log, TimeSpec, _blf_objects, open_log

COPY_AGAIN = "; copy the file again if the original is whole."

START_S = 1_700_000_000
Frame = tuple[int, int, int, int, bytes]  # t_ns, bus, can_id, flags, payload


def read(path: Path, spec: TimeSpec | None = None) -> tuple[Log, list[Frame]]:
    log = open_log(path, spec)
    return log, [frame for batch in log.batches() for frame in _frames(batch)]


def _frames(batch: object) -> list[Frame]:
    assert isinstance(batch, Frames)
    payloads = [batch.data[a:b].tobytes() for a, b in zip(batch.offsets[:-1], batch.offsets[1:], strict=True)]
    columns = (array.tolist() for array in (batch.t_ns, batch.bus, batch.can_id, batch.flags))
    return list(zip(*columns, payloads, strict=True))


def as_frame(message: can.Message) -> Frame:
    """What python-can read, in our words; its channels count from 0."""
    flags = REMOTE * message.is_remote_frame | FD * message.is_fd | TRANSMIT * (not message.is_rx)
    can_id = message.arbitration_id | int(EXTENDED) * message.is_extended_id
    payload = b"" if message.is_remote_frame else bytes(message.data)
    assert isinstance(message.channel, int)
    return round(message.timestamp * 1e9), message.channel + 1, can_id, flags, payload


def written(path: Path, count: int = 400, **options: Any) -> None:
    """A log by python-can: classic, extended, FD, remote and error frames, and payloads that look like objects."""
    chance = random.Random(1)
    makers: list[Callable[[], dict[str, Any]]] = [
        lambda: {"arbitration_id": chance.randrange(2048), "data": chance.randbytes(chance.randrange(9))},
        lambda: {"arbitration_id": chance.randrange(1 << 29), "is_extended_id": True, "data": b"LOBJ\x20\x00\x01\x00"},
        lambda: {
            "arbitration_id": 1,
            "is_fd": True,
            "bitrate_switch": True,
            "data": bytes(chance.choice((12, 48, 64))),
        },
        lambda: {"arbitration_id": 0x7FF, "is_remote_frame": True, "dlc": 4},
        lambda: {"is_error_frame": True},
    ]
    with can.BLFWriter(path, **options) as writer:
        for number in range(count):
            fields = {"is_extended_id": False, "channel": number % 3, "is_rx": number % 5 > 0} | chance.choice(makers)()
            writer.on_message_received(can.Message(timestamp=START_S + number * 0.001, **fields))


# ---- files made by hand ---------------------------------------------------------------------------------------------


def item(kind: int, body: bytes, *, stamp: int = 0, flags: int = 2, version: int = 1, size: int | None = None) -> bytes:
    """An object with its padding."""
    header = 32 if version == 1 else 40
    size = header + len(body) if size is None else size
    head = struct.pack("<4sHHLLLLQ", b"LOBJ", header, version, size, kind, flags, 0, stamp)
    return head.ljust(header, b"\0") + body + bytes(len(body) % 4)


def classic(can_id: int, data: bytes = b"\1\2", *, bus: int = 1, stamp: int = 0, kind: int = 1) -> bytes:
    tail = b"" if kind == 1 else bytes(8)
    return item(kind, struct.pack("<HBBL8s", bus, 0, len(data), can_id, data) + tail, stamp=stamp)


def container(data: bytes, *, method: int = 2, declared: int | None = None, size: int | None = None) -> bytes:
    packed = zlib.compress(data) if method == 2 else data
    declared = len(data) if declared is None else declared
    size = 32 + len(packed) if size is None else size
    head = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, method, declared)
    return head + packed + bytes(len(packed) % 4)


def blf(path: Path, *parts: bytes, count: int = 0, size: int | None = None, start: Sequence[int] = (0,) * 8) -> Path:
    contents = b"".join(parts)
    size = 144 + len(contents) if size is None else size
    head = struct.pack("<4sL8xQQLL8H8H", b"LOGG", 144, size, 0, count, 0, *start, *(0,) * 8)
    path.write_bytes(head.ljust(144, b"\0") + contents)
    return path


# ---- what is read ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options", [{}, {"compression_level": 0}, {"max_container_size": 300}], ids=["packed", "stored", "spanning"]
)
def test_frames_equal_those_of_python_can(tmp_path: Path, options: dict[str, Any]) -> None:
    path = tmp_path / "log.blf"
    written(path, **options)
    log, ours = read(path)
    theirs = list(can.BLFReader(path))
    wanted = [as_frame(message) for message in theirs if not message.is_error_frame]
    assert [frame[1:] for frame in ours] == [frame[1:] for frame in wanted]
    # Theirs are float seconds.
    np.testing.assert_allclose([f[0] for f in ours], [f[0] for f in wanted], atol=500, rtol=0)
    assert {entry.why for entry in log.rejected} == {"error frame"}
    assert [entry.record for entry in log.rejected] == [i for i, message in enumerate(theirs) if message.is_error_frame]
    assert log.found == len(theirs) and log.cut is None and log.absolute


@pytest.mark.parametrize("kind", [1, 86])
def test_objects_of_one_length_are_read_as_those_of_many(
    kind: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = random.Random(kind)
    frames = [classic(i, chance.choice((b"LOBJ\x30\0\0\0", bytes(8), b"")), stamp=i, kind=kind) for i in range(40)]
    whole = b"".join(frames)
    streams = [whole[: len(whole) - cut] for cut in range(len(frames[0]) + 2)]
    streams += [whole + frames[0][:rest] for rest in (1, 3, 4, 16)] + [whole + b"LOBX" + whole, whole + bytes(2)]
    for _ in range(100):
        damaged = bytearray(whole)
        damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
        streams.append(bytes(damaged))
    assert _blf_objects._alike(whole + bytes(128), len(whole)) == len(frames[0]), "there are streams that are alike"
    seen = []
    for alike in (_blf_objects._alike, lambda *_: 0):
        monkeypatch.setattr(_blf_objects, "_alike", alike)
        read_so = [read(blf(tmp_path / "log.blf", container(stream))) for stream in streams]
        seen.append([(found, [*log.rejected], log.settings, log.cut) for log, found in read_so])
    assert seen[0] == seen[1]


def test_every_kind_of_frame_object_equals_python_can(tmp_path: Path) -> None:
    def fd_101(length: int, data: bytes, extra: int = 0) -> bytes:
        body = struct.pack(
            "<BBBBLLLLLLLHBBL", 4, 15, length, 0, 0x1ABCDEF | 1 << 31, 0, 0x3000, 0, 0, 0, 0, 0, 1, extra, 0
        )
        return item(101, body + data, stamp=5)

    fd_100 = struct.pack("<HBBLLBBB5x64s", 2, 1, 9, 0x123, 0, 0, 3, 12, bytes(range(12)))
    data = b"".join(
        [
            classic(0x10, stamp=1_000_000),
            classic(0x11, kind=86, stamp=2_000_000),
            item(86, struct.pack("<HBBL8s8x", 3, 0x80, 2, 0x22, b""), stamp=7, flags=1, version=2),
            item(100, fd_100, stamp=3),
            fd_101(64, bytes(range(64))),
            fd_101(64, bytes(range(48))),
            fd_101(12, bytes(range(8)) + bytes([255] * 8), extra=32 + 40 + 8),
        ]
    )
    path = blf(tmp_path / "kinds.blf", container(data))
    log, ours = read(path)
    wanted = [as_frame(message) for message in can.BLFReader(path)]
    assert ours == wanted
    assert [frame[0] for frame in ours[:3]] == [1_000_000, 2_000_000, 70_000]
    assert not log.rejected and not log.absolute


def test_frames_outside_of_containers_are_read(tmp_path: Path) -> None:
    path = blf(tmp_path / "bare.blf", classic(1), classic(2), container(classic(3)))
    assert [frame[2] for frame in read(path)[1]] == [1, 2, 3]


def test_other_objects_are_counted_by_type(tmp_path: Path) -> None:
    path = blf(
        tmp_path / "mixed.blf", container(item(65, bytes(20)) + classic(1) + item(65, bytes(8)) + item(96, bytes(4)))
    )
    log, frames = read(path)
    assert len(frames) == log.found == 1
    assert log.settings["other_objects"] == {"65": 2, "96": 1}


def test_impossible_values_are_rejected_with_the_place(tmp_path: Path) -> None:
    long = struct.pack("<HBBLLBBB5x64s", 2, 1, 9, 0x123, 0, 0, 3, 65, bytes(64))
    data = (
        classic(1) + classic(2, bus=256) + item(100, long) + classic(3, stamp=2**63) + item(1, b"\0" * 4) + classic(4)
    )
    log, frames = read(blf(tmp_path / "odd.blf", container(data)))
    assert [frame[2] for frame in frames] == [1, 4]
    assert [(entry.record, entry.where, entry.why) for entry in log.rejected] == [
        (1, "byte 144, unpacked +48", "its channel is above 255"),
        (2, "byte 144, unpacked +96", "its payload is longer than 64 bytes"),
        (3, "byte 144, unpacked +212", "its stamp is beyond the year 2262"),
        (4, "byte 144, unpacked +260", "its object is too short for its type"),
    ]


# ---- time -----------------------------------------------------------------------------------------------------------

NOON = (2024, 7, 1, 1, 12, 0, 0, 250)  # Monday 1 July 2024, 12:00:00.250
NOON_NS = 1_719_835_200_250_000_000


@pytest.mark.parametrize(
    ("spec", "first_ns", "absolute"),
    [
        (TimeSpec(), NOON_NS + 7, True),
        (TimeSpec(zone="Europe/Rome"), NOON_NS - 7_200_000_000_000 + 7, True),
        (TimeSpec(start_ns=1_709_280_000_000_000_000), 1_709_280_000_000_000_007, True),
    ],
)
def test_the_start_is_utc_unless_the_bench_file_says_otherwise(
    tmp_path: Path, spec: TimeSpec, first_ns: int, absolute: bool
) -> None:
    log, frames = read(blf(tmp_path / "noon.blf", container(classic(1, stamp=7)), start=NOON), spec)
    assert (frames[0][0], log.absolute) == (first_ns, absolute)


def test_a_file_without_a_start_counts_from_zero_or_from_the_stated_start(tmp_path: Path) -> None:
    path = blf(tmp_path / "none.blf", container(classic(1, stamp=7)))
    log, frames = read(path)
    assert (frames[0][0], log.absolute, log.settings["start"]) == (7, False, "none")
    log, frames = read(path, TimeSpec(start_ns=31_536_000_000_000_000))
    assert (frames[0][0], log.absolute, log.settings["start"]) == (31_536_000_000_000_007, True, "bench file")


# ---- damage ---------------------------------------------------------------------------------------------------------


def test_a_cut_file_says_where_and_how_much_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "2_s2.blf"
    written(path, 2000, max_container_size=4096)
    whole = path.read_bytes()
    path.write_bytes(whole[:20_000])
    log, frames = read(path)
    kept = log.found - len(log.rejected)
    assert len(frames) == kept
    assert log.cut == (
        f"ends inside a container at byte 20,000 of {len(whole):,}: "
        f"{kept:,} of about 2,000 frames were read and kept{COPY_AGAIN}"
    )


def test_a_file_cut_between_two_containers_is_noticed_by_its_declared_size(tmp_path: Path) -> None:
    first = container(classic(1) + classic(2))
    path = blf(tmp_path / "cut.blf", first, size=900, count=9)
    log, frames = read(path)
    assert len(frames) == 2
    assert log.cut == f"ends at byte {144 + len(first)} of 900: 2 of about 9 frames were read and kept{COPY_AGAIN}"


def test_a_damaged_container_costs_only_its_own_frames(tmp_path: Path) -> None:
    good, broken = container(classic(1) + classic(2)), bytearray(container(classic(3) * 40))
    broken[40:60] = bytes(20)
    path = blf(tmp_path / "torn.blf", good, bytes(broken), container(classic(4)), count=43)
    log, frames = read(path)
    assert [frame[2] for frame in frames][:2] == [1, 2] and frames[-1][2] == 4
    assert log.cut == (
        f"is damaged at byte {144 + len(good)} (a container that cannot be unpacked): "
        f"{len(frames)} of about 43 frames were read and kept{COPY_AGAIN}"
    )


def test_bytes_between_containers_are_passed_over_and_said(tmp_path: Path) -> None:
    good = container(classic(1))
    path = blf(tmp_path / "gap.blf", good, b"garbage!" * 9, container(classic(2)))
    log, frames = read(path)
    assert [frame[2] for frame in frames] == [1, 2]
    assert log.cut and log.cut.startswith("is damaged at byte 144 (an object that says it is ")


def test_a_damaged_object_in_a_container_is_one_rejected_record(tmp_path: Path) -> None:
    data = classic(1) + item(1, bytes(16), size=0) + classic(2) + classic(3)
    log, frames = read(blf(tmp_path / "zero.blf", container(data)))
    assert [frame[2] for frame in frames] == [1, 2, 3]
    assert [(entry.record, entry.why) for entry in log.rejected] == [(1, "an object says it is 0 bytes long")]
    assert log.cut is None


def test_zeros_are_padding_at_the_end_and_damage_in_the_middle(tmp_path: Path) -> None:
    log, frames = read(blf(tmp_path / "end.blf", container(classic(1) + classic(2) + bytes(99))))
    assert (len(frames), log.found, log.cut) == (2, 2, None)
    log, frames = read(blf(tmp_path / "middle.blf", container(classic(1) + bytes(99) + classic(2))))
    assert (len(frames), [entry.why for entry in log.rejected]) == (2, ["no object begins here"])


@pytest.mark.parametrize("size", [0, 15, 0xFFFF_FFFF, 60 << 20])
def test_a_size_that_cannot_be_neither_hangs_nor_fills_memory(tmp_path: Path, size: int) -> None:
    began = time.monotonic()
    log, frames = read(blf(tmp_path / "size.blf", container(classic(1)), container(classic(2), size=size)))
    assert [frame[2] for frame in frames][:1] == [1]
    assert log.cut is not None
    assert time.monotonic() - began < 5


def test_a_container_that_declares_four_gigabytes_is_not_unpacked(tmp_path: Path) -> None:
    path = blf(tmp_path / "huge.blf", container(classic(1)), container(classic(2), declared=0xFFFF_FFFF))
    log, frames = read(path)
    assert len(frames) == 1
    assert log.cut and "(a container of 4,294,967,295 bytes unpacked)" in log.cut


def test_a_zlib_bomb_is_stopped_at_its_declared_size(tmp_path: Path) -> None:
    bomb = container(classic(1) + bytes(50 << 20), declared=100)
    log, frames = read(blf(tmp_path / "bomb.blf", bomb))
    assert len(frames) == 1
    assert log.cut and "(a container that unpacks to more than the 100 bytes it declares)" in log.cut


def test_an_object_longer_than_the_file_is_waited_for_only_once(tmp_path: Path) -> None:
    """An object of 40 MB spread over many small containers must not be joined again for each of them."""
    parts = [container(classic(1) + item(65, b"", size=40 << 20)), *[container(bytes(64))] * 2000]
    began = time.monotonic()
    log, frames = read(blf(tmp_path / "spread.blf", *parts))
    assert len(frames) == 1
    assert log.cut and log.cut.startswith("ends inside an object at byte")
    assert time.monotonic() - began < 5


def test_an_unknown_compression_is_named(tmp_path: Path) -> None:
    path = blf(tmp_path / "lzma.blf", container(classic(1)), container(classic(2), method=7))
    assert "(a container of unknown compression 7)" in (read(path)[0].cut or "")


def test_a_file_without_frames_is_refused(tmp_path: Path) -> None:
    path = blf(tmp_path / "lin.blf", container(item(11, bytes(20))))
    with pytest.raises(
        UnreadableLogError, match=r"^lin\.blf: is whole: no CAN frame is in it \(1 other objects\)\. Its recorder"
    ):
        read(path)


def test_a_file_that_ends_in_its_header_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "stub.blf"
    path.write_bytes(b"LOGG" + bytes(30))
    with pytest.raises(UnreadableLogError, match=r"stub\.blf: is no BLF file, or ends inside its header \(34 bytes\)"):
        read(path)


PARTS = [container(b"".join(classic(16 * k + i, stamp=k) for i in range(16)), method=2 * (k % 2)) for k in range(6)]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, sum(map(len, PARTS)) - 1), removed=st.integers(0, 60), inserted=st.binary(max_size=60))
def test_frames_before_the_damage_are_always_kept(tmp_path: Path, at: int, removed: int, inserted: bytes) -> None:
    contents = b"".join(PARTS)
    path = blf(tmp_path / "hurt.blf", contents[:at] + inserted + contents[at + removed :])
    whole = sum(sum(map(len, PARTS[: k + 1])) <= at for k in range(len(PARTS)))
    try:
        log, frames = read(path)
    except UnreadableLogError:
        assert whole == 0
        return
    before = [frame[2] for frame in frames[: 16 * whole]]
    assert before == list(range(16 * whole))
    assert log.found == len(frames) + len(log.rejected)


def test_what_unpacks_to_far_more_than_any_log_is_read_up_to_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.formats.ALWAYS", 1 << 20)
    bomb = container(item(65, bytes(1 << 19)))
    path = blf(tmp_path / "bomb.blf", container(classic(1)), bomb, bomb, bomb, container(classic(2)))
    log, frames = read(path)
    stopped = f"unpacks to more than 1,048,576 bytes, from byte {144 + len(container(classic(1))) + len(bomb):,} on"
    assert [frame[2] for frame in frames] == [1]
    assert log.cut == f"{stopped}: 1 frames were read and kept{COPY_AGAIN}"
