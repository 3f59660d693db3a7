"""ASC: equal to python-can where both read, and every line that is no frame accounted for."""

import gzip
import random
from datetime import datetime
from pathlib import Path

import can
import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, Frames, Log, TimeSpec, open_log
from ingest.formats._asc_lines import parse_date
from made.places import LOGS

COPY_AGAIN = "; copy the file again if the original is whole."

Frame = tuple[int, int, int, int, str]  # t_ns, bus, can_id, flags, payload in hexadecimal
HEAD = "date Tue May 27 04:09:35.000 pm 2014\nbase hex  timestamps absolute\ninternal events logged\n"
HEAD_NS = 1_401_206_975_000_000_000  # 27 May 2014, 16:09:35 UTC
S_NS = 1_000_000_000


def read(path: Path, spec: TimeSpec | None = None) -> tuple[Log, list[Frame]]:
    log = open_log(path, spec)
    frames: list[Frame] = []
    for batch in log.batches():
        assert isinstance(batch, Frames)
        payloads = [batch.data[a:b].tobytes().hex() for a, b in zip(batch.offsets[:-1], batch.offsets[1:], strict=True)]
        columns = (array.tolist() for array in (batch.t_ns, batch.bus, batch.can_id, batch.flags))
        frames += zip(*columns, payloads, strict=True)
    return log, frames


def asc(folder: Path, text: str, name: str = "log.asc") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_the_sample_gives_every_kind_of_frame() -> None:
    log, frames = read(LOGS / "sample.asc")
    start = 1_506_783_973_191_000_000  # 30 September 2017, 15:06:13.191 UTC
    long = 0x18EBFF00 | int(EXTENDED)
    assert frames == [
        (start + 2_510_001_000, 2, 0x100, REMOTE | TRANSMIT, ""),
        (start + 2_510_002_000, 2, 0x100, REMOTE | TRANSMIT, ""),
        (start + 3_098_426_000, 1, long, 0, "01a00fa6603bd140"),
        (start + 3_098_611_000, 1, 0x6F9, TRANSMIT, "050c"),
        (start + 3_200_000_000, 1, 0x6F8, 0, ""),
        (start + 3_300_000_000, 3, 0x7A, 0, "ff000cfe00010203"),
        (start + 30_005_071_000, 2, 0x300, FD, "0102030405060708090a0b0c"),
    ]
    assert [(entry.where, entry.why) for entry in log.rejected] == [
        ("line 9", "error frame"),
        ("line 17", "holds 3 of its 8 bytes"),
    ]
    assert log.settings == {"base": "hex", "stamps": "absolute", "other_lines": 6, "gz": False}
    assert log.absolute and log.cut is None


def test_frames_equal_those_of_python_can(tmp_path: Path) -> None:
    chance, path = random.Random(3), tmp_path / "log.asc"
    with can.ASCWriter(path) as writer:
        for number in range(300):
            fd = number % 7 == 0
            data = chance.randbytes(chance.choice((12, 64)) if fd else chance.randrange(9))
            extended, error = number % 3 == 0, number % 50 == 49
            writer.on_message_received(
                can.Message(
                    timestamp=1_700_000_000 + number / 1000,
                    arbitration_id=chance.randrange(1 << (29 if extended else 11)),
                    is_extended_id=extended,
                    is_fd=fd,
                    is_error_frame=error,
                    is_rx=number % 2 == 0,
                    channel=number % 4,
                    data=b"" if error else data,
                )
            )
    log, ours = read(path)
    theirs = list(can.ASCReader(path))
    wanted = [message for message in theirs if not message.is_error_frame]
    assert [frame[4] for frame in ours] == [bytes(message.data).hex() for message in wanted]
    assert [frame[2] for frame in ours] == [m.arbitration_id | int(EXTENDED) * m.is_extended_id for m in wanted]
    assert [frame[3] for frame in ours] == [FD * m.is_fd | TRANSMIT * (not m.is_rx) for m in wanted]
    seconds = [(frame[0] - ours[0][0]) / S_NS for frame in ours]
    np.testing.assert_allclose(seconds, [m.timestamp - wanted[0].timestamp for m in wanted], atol=1e-9, rtol=0)
    assert len(log.rejected) == len(theirs) - len(wanted) == 6


def test_lines_read_together_equal_lines_read_one_by_one(tmp_path: Path) -> None:
    """Two blanks between two bytes keep a line from being read together with the others."""
    chance, lines = random.Random(4), []
    for number in range(500):
        data = chance.randbytes(chance.randrange(9))
        lines.append((f"{number / 8:.6f} {number % 3}  {chance.randrange(2048):X}  Rx d {len(data)} ", data))
    together = asc(tmp_path, HEAD + "".join(f"{head}{data.hex(' ')}\n" for head, data in lines), "together.asc")
    singly = asc(tmp_path, HEAD + "".join(f"{head} {data.hex(' ')}\n" for head, data in lines), "singly.asc")
    assert read(together)[1] == read(singly)[1]
    assert len(read(together)[1]) == 500


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("Sam Sep 30 15:06:13.191 2017", datetime(2017, 9, 30, 15, 6, 13, 191_000)),
        ("Mit Mär 4 08:00:00 2020", datetime(2020, 3, 4, 8)),
        ("Don Dez 31 23:59:59.5 2020", datetime(2020, 12, 31, 23, 59, 59, 500_000)),
        ("Tue May 27 04:09:35.000 pm 2014", datetime(2014, 5, 27, 16, 9, 35)),
        ("Tue May 27 12:09:35 AM 2014", datetime(2014, 5, 27, 0, 9, 35)),
        ("Tue May 27 12:09:35 PM 2014", datetime(2014, 5, 27, 12, 9, 35)),
        ("Tue Okt 7 10:00:00 2014", datetime(2014, 10, 7, 10)),
        ("Tue Foo 7 10:00:00 2014", None),
        ("Tue Feb 30 10:00:00 2014", None),
        ("27.05.2014", None),
    ],
)
def test_dates_are_read_in_english_and_german(text: str, wanted: datetime | None) -> None:
    assert parse_date(text) == wanted


def test_the_date_is_local_to_the_stated_zone(tmp_path: Path) -> None:
    path = asc(tmp_path, HEAD + "1.5 1 64 Rx d 1 0A\n")
    assert read(path)[1][0][0] == HEAD_NS + 1_500_000_000
    assert read(path, TimeSpec(zone="Europe/Berlin"))[1][0][0] == HEAD_NS + 1_500_000_000 - 7200 * S_NS
    assert read(path, TimeSpec(start_ns=31_622_400_000_000_000))[1][0][0] == 31_622_401_500_000_000


def test_a_date_in_the_code_page_of_the_machine_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.asc"
    path.write_bytes("date Mit Mär 4 08:00:00 2020\nbase hex timestamps absolute\n0.0 1 64 Rx d 0\n".encode("cp1252"))
    assert read(path)[1][0][0] == 1_583_308_800 * S_NS


def test_a_date_that_is_not_understood_is_said_and_time_counts_from_zero(tmp_path: Path) -> None:
    log, frames = read(asc(tmp_path, "date 27/05/2014\nbase hex timestamps absolute\n0.5 1 64 Rx d 0\n"))
    assert (frames[0][0], log.absolute) == (500_000_000, False)
    assert log.settings["date_not_understood"] == "27/05/2014"


def test_a_later_block_whose_date_is_far_behind_its_stamps_counts_from_that_date(tmp_path: Path) -> None:
    """Its first stamp is no earlier than the last one before it: both blocks are short."""
    block = "Begin Triggerblock Wed Mar 4 {:02}:00:00.000 am 2020\n0.25 1 64 Rx d 0\nEnd TriggerBlock\n"
    head = "date Wed Mar 4 08:00:00 am 2020\nbase hex timestamps absolute\n"
    _, frames = read(asc(tmp_path, head + block.format(8) + block.format(9)))
    assert [one[0] / S_NS for one in frames] == [1_583_308_800.25, 1_583_312_400.25]


def test_relative_stamps_count_from_the_line_before(tmp_path: Path) -> None:
    head = HEAD.replace("absolute", "relative")
    text = "0.5 1 64 Rx d 0\n0.25 1 Statistic: D 0 R 0\n0.25 1 65 Rx d 0\n0.001 1 66  Rx  r\n"
    log, frames = read(asc(tmp_path, head + text))
    assert [frame[0] - HEAD_NS for frame in frames] == [500_000_000, 1_000_000_000, 1_001_000_000]
    assert log.settings["stamps"] == "relative"


def test_decimal_logs_are_read_as_decimal(tmp_path: Path) -> None:
    log, frames = read(asc(tmp_path, "base dec timestamps absolute\n0.5 1 100x Rx d 3 10 255 0\n0.6 1 64 Rx d 1 256\n"))
    assert frames == [(500_000_000, 1, 100 | int(EXTENDED), 0, "0aff00")]
    assert [entry.why for entry in log.rejected] == ["holds 0 of its 1 bytes"]


def test_a_second_trigger_block_counts_from_its_own_date_only_where_its_stamps_begin_again(tmp_path: Path) -> None:
    block = "Begin Triggerblock Tue May 27 04:{}:00.000 pm 2014\n{} 1 64 Rx d 0\nEnd TriggerBlock\n"
    again = asc(tmp_path, HEAD + block.format("10", "5.0") + block.format("20", "1.0"), "again.asc")
    ten = HEAD_NS + 25 * S_NS
    assert [frame[0] for frame in read(again)[1]] == [ten + 5 * S_NS, ten + 601 * S_NS]
    on = asc(tmp_path, HEAD + block.format("10", "5.0") + block.format("20", "601.0"), "on.asc")
    assert [frame[0] for frame in read(on)[1]] == [ten + 5 * S_NS, ten + 601 * S_NS]
    stated = read(again, TimeSpec(start_ns=31_622_400_000_000_000))[1]
    assert [frame[0] for frame in stated] == [31_622_405 * S_NS, 31_623_001 * S_NS]


def test_fd_frames_on_classic_lines_keep_all_their_bytes(tmp_path: Path) -> None:
    """Some converters write the length code in decimal, some the length in hexadecimal."""
    long = bytes(range(64)).hex(" ")
    text = (
        f"0.1 1 1 Rx d 15 {long}\n0.2 1 2 Rx d 40 {long}\n0.3 1 3 Rx d 9 {bytes(12).hex(' ')}\n0.4 1 4 Rx d F {long}\n"
    )
    log, frames = read(asc(tmp_path, HEAD + text))
    assert [(frame[3], len(frame[4]) // 2) for frame in frames] == [(FD, 64), (FD, 64), (FD, 12), (FD, 64)]
    assert not log.rejected


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("0.1 1 64 Rx d 8 01 02", "holds 2 of its 8 bytes"),
        ("0.1 1 64 Rx d 2 01 2", "holds 1 of its 2 bytes"),
        ("0.1 1 64 Rx d 9 01 02 03", 'holds 3 bytes, which does not fit its data length code "9"'),
        ("0.1 1 EngineData Rx d 1 01", 'has the identifier "EngineData", which is no number of 29 bits'),
        ("0.1 1 FFFFFFFFx Rx d 1 01", 'has the identifier "FFFFFFFFx", which is no number of 29 bits'),
        ("0.1 256 64 Rx d 1 01", "its channel is above 255"),
        ("0.1 CANFD 1 Rx 64 1 0 f 65 00", "says it holds 65 bytes, more than the 64 of a frame"),
        ("0.1 CANFD 1 Rx 64 1 0 8 8 00 01", "holds 2 of its 8 bytes"),
        ("0.1 CANFD 1 Rx", "is a frame that is not complete"),
        ("0.1 1 ErrorFrame ECC: 10100010", "error frame"),
        ("0.1 CANFD 5 Tx ErrorFrame Not Acknowledge error", "error frame"),
        ("99999999999.0 1 64 Rx d 0", "has a stamp that no log can reach"),
        ("¤%&/ 12", "is no line of an ASC log"),
        ("0.1 00 1 64 Rx d 1 01", "has a damaged stamp"),
        ("0.1x 1 64 Rx d 1 01", "has a damaged stamp"),
        ("0.1001 64 Rx d 1 01", "has a damaged stamp"),
        ("0,1 1 64 Rx d 1 01", "has a damaged stamp"),
        ("\0\0\0 CANFD 1 Rx 64 1 0 1 1 00", "has a damaged stamp"),
        ("0.1 00 CANFD 1 Rx 64 1 0 1 1 00", "has a damaged stamp"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str) -> None:
    log, frames = read(asc(tmp_path, f"{HEAD}0.0 1 64 Rx d 0\n{line}\n\n9.0 1 64 Rx d 0\n"))
    assert len(frames) == 2
    assert [(entry.record, entry.where, entry.why) for entry in log.rejected] == [(1, "line 5", why)]


def test_a_packed_log_is_read_through(tmp_path: Path) -> None:
    path = tmp_path / "log.asc.gz"
    path.write_bytes(gzip.compress((LOGS / "sample.asc").read_bytes()))
    log, frames = read(path)
    assert frames == read(LOGS / "sample.asc")[1]
    assert log.settings["gz"] is True


def test_a_packed_log_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    chance = random.Random(5)
    text = HEAD + "".join(f"{n}.0 1 64 Rx d 8 {chance.randbytes(8).hex(' ')}\n" for n in range(2000))
    path = tmp_path / "log.asc.gz"
    packed = gzip.compress(text.encode())
    path.write_bytes(packed[: len(packed) // 2])
    log, frames = read(path)
    assert 500 < len(frames) < 1500
    assert log.cut == (
        f"ends inside its packed contents at byte {len(packed) // 2:,}: "
        f"{len(frames):,} frames were read and kept{COPY_AGAIN}"
    )


def test_a_log_without_the_end_of_its_trigger_block_is_cut(tmp_path: Path) -> None:
    log, _ = read(asc(tmp_path, HEAD + "Begin Triggerblock Tue May 27 04:09:35 pm 2014\n0.1 1 64 Rx d 0\n"))
    assert log.cut == f"ends in line 5, before the end of its trigger block: 1 frames were read and kept{COPY_AGAIN}"


def test_a_log_that_ends_inside_a_line_is_cut(tmp_path: Path) -> None:
    log, _ = read(asc(tmp_path, HEAD + "0.1 1 64 Rx d 0\n0.2 1 64 Rx d 8 0A 0"))
    assert log.cut == f"ends inside line 5: 1 frames were read and kept{COPY_AGAIN}"


def test_a_text_that_is_no_log_is_refused(tmp_path: Path) -> None:
    path = asc(tmp_path, "Dear all,\nplease find attached the log.\n" * 1000)
    with pytest.raises(
        UnreadableLogError, match=r"^log\.asc: no CAN frame is in it \(2,000 lines read\)\. Copy the file"
    ):
        read(path)


@pytest.mark.parametrize("stamps", ["absolute", "relative"])
@pytest.mark.parametrize(
    "damaged",
    [
        f"1.0 {'9' * 5000} 100 Rx d 1 AA",
        f"1.0 1 100 Rx d {'9' * 5000} AA",
        f"1.0 CANFD 1 Rx 100 1 0 8 {'9' * 5000} AA",
        f"1.0 CANFD {'9' * 5000} Rx 100 1 0 8 8 AA",
        "1.0 1 100 Rx d 2 AA\N{NO-BREAK SPACE}00",
        "1.0 1 100 Rx d 1 AA\N{NO-BREAK SPACE}",
        "999999999.5 1 100 Rx d 8 AA",
        "999999999.5 1 100 Rx d 1 AA",
        f"{'9' * 400}.0 1 100 Rx d 1 AA",
    ],
)
def test_a_damaged_line_costs_one_record_and_not_the_log(tmp_path: Path, damaged: str, stamps: str) -> None:
    whole = "".join(f"0.5 1 100 Rx d 1 {k:02X}\n" for k in range(10))
    head = HEAD.replace("absolute", stamps)
    log, frames = read(asc(tmp_path, f"{head}{whole}{damaged}\n{whole}"))
    kept = [frame[4] for frame in frames if frame[0] < HEAD_NS + 10**17 and not frame[4].startswith("aa")]
    assert kept == [f"{k:02x}" for k in range(10)] * 2
    assert len(frames) + len(log.rejected) == log.found <= 21
