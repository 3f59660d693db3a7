"""candump: equal to what python-can wrote, and every line that is no frame accounted for."""

import gzip
from pathlib import Path

import can
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, TimeSpec, recognise
from ingest.formats._text import place_of
from made.frames import as_frames, messages, read, write
from made.places import LOGS

FIRST = "(1436509052.249713) can1 044#2A366C2BBA\n"


def log_of(folder: Path, text: str) -> Path:
    path = folder / "log.txt"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def test_the_sample_gives_every_kind_of_frame() -> None:
    log, frames = read(LOGS / "sample.candump")
    assert frames == [
        (1436509052249713000, 1, 0x44, 0, "2a366c2bba"),
        (1436509052449847000, 1, 0xF6, TRANSMIT, "7adfe07bd2"),
        (1436509052650004000, 100, 0x18EBFF00 | int(EXTENDED), 0, "01a00fa6603bd140"),
        (1436509052850119000, 0, 0x123, REMOTE, ""),
        (1436509053050257000, 1, 0x123, FD, "112233445566778899aabbcc"),
        (1436509053250390000, 1, 0xC3, 0, "d7"),
    ]
    assert [(one.where, one.why) for one in log.rejected] == [
        ("line 4", "error frame"),
        ("line 8", "its data are no bytes of two hexadecimal digits each"),
    ]
    assert log.settings["buses"] == {"can1": 1, "vcan1": 100, "can0": 0}
    assert log.absolute and log.cut is None


def test_frames_equal_those_that_python_can_wrote(tmp_path: Path) -> None:
    path, some = tmp_path / "log.log", messages(400)
    write(can.CanutilsLogWriter(path), some)
    log, frames = read(path)
    assert frames == as_frames(some)
    assert len(log.rejected) == 8 and {one.why for one in log.rejected} == {"error frame"}


@pytest.mark.parametrize(
    ("frame", "found"),
    [
        ("5A1#11.2233.44556677.88", (0x5A1, 0, "1122334455667788")),
        ("5AA#", (0x5AA, 0, "")),
        ("1F334455#1122334455667788_B", (0x1F334455 | int(EXTENDED), 0, "1122334455667788")),
        ("00000123#R3", (0x123 | int(EXTENDED), REMOTE, "")),
        ("333#R8_E", (0x333, REMOTE, "")),
        ("123##1", (0x123, FD, "")),
        ("213##311223344", (0x213, FD, "11223344")),
    ],
)
def test_frames_are_read_as_can_utils_describe_them(tmp_path: Path, frame: str, found: tuple[int, int, str]) -> None:
    _, frames = read(log_of(tmp_path, f"{FIRST}(1436509052.300000) can0 {frame}\n"))
    assert frames[1][2:] == found


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("(1436509052.3) can0 123#11223344556677889", "its data are no bytes of two hexadecimal digits each"),
        ("(1436509052.3) can0 123#112233445566778899", "holds 9 bytes, more than the 8 of a frame"),
        ("(1436509052.3) can0 123##1" + "00" * 65, "holds 65 bytes, more than the 64 of a frame"),
        ("(1436509052.3) can0 8FF#00", 'has the identifier "8FF", which is no number of 11 bits'),
        ("(1436509052.3) can0 45123#81:00:12345678#11223344", "is a CAN XL frame"),
        ("(99999999999.3) can0 123#00", "has a stamp that no log can reach"),
        ("(1436509052.3) can256 123#00", "its channel is above 255"),
        ("(1436509052.3) can0 1", "is no line of a candump log"),
        ("¤%&/ 12", "is no line of a candump log"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str) -> None:
    log, frames = read(log_of(tmp_path, f"{FIRST}{line}\r\n\r\n{FIRST}"))
    assert len(frames) == 2
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, "line 2", why)]


def test_a_last_line_without_its_end_is_cut(tmp_path: Path) -> None:
    log, frames = read(log_of(tmp_path, FIRST + FIRST[:-3]))
    assert len(frames) == 1
    assert log.cut == "ends inside line 2: 1 frames were read and kept; copy the file again if the original is whole."


def test_stamps_without_a_date_count_from_the_stated_start(tmp_path: Path) -> None:
    path = log_of(tmp_path, "(000.000001) can0 123#00\n")
    log, frames = read(path)
    assert (log.absolute, frames[0][0]) == (False, 1000)
    log, frames = read(path, TimeSpec(start_ns=5_000_000_000))
    assert (log.absolute, frames[0][0]) == (True, 5_000_001_000)


def test_a_log_is_known_by_its_lines_whatever_it_is_called_and_packed(tmp_path: Path) -> None:
    path = tmp_path / "night.csv"
    path.write_bytes(gzip.compress((LOGS / "sample.candump").read_bytes()))
    assert recognise(path).name == "candump"
    assert read(path)[1] == read(LOGS / "sample.candump")[1]


def test_a_log_without_one_frame_is_refused(tmp_path: Path) -> None:
    path = log_of(tmp_path, "(1436509052.300000) can0 123#0\n" * 1000)
    with pytest.raises(
        UnreadableLogError, match=r"^log\.txt: no CAN frame is in it \(1,000 lines read\)\. Copy the file"
    ):
        read(path)


def test_what_candump_shows_is_what_it_writes(tmp_path: Path) -> None:
    written = [
        "(1436509052.249713) can0 044#2A366C2BBA",
        "(1436509052.249800) can1 18FEF1D5##1" + "11" * 12 + " T",
        "(1436509052.249900) can0 123#R",
        "(1436509052.250000) can0 20000004#0004000000000000",
    ]
    shown = [
        " (1436509052.249713)  can0  044   [5]  2A 36 6C 2B BA",
        " (1436509052.249800)  can1  TX B -  18FEF1D5  [12]  " + " ".join(["11"] * 12),
        " (1436509052.249900)  can0  123   [0]  remote request",
        " (1436509052.250000)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME",
        " (1436509052.250100)  can0  044   [8]  2A 36",
    ]
    paths = [tmp_path / name for name in ("written", "shown")]
    for path, lines in zip(paths, (written, shown), strict=True):
        path.write_text("\n".join(lines) + "\n")
        assert recognise(path).name == "candump"
    (one, frames), (other, same) = (read(path) for path in paths)
    assert same == frames and len(frames) == 3
    assert [entry.why for entry in other.rejected] == [
        *(entry.why for entry in one.rejected),
        "holds 2 of its 8 bytes",
    ]


@pytest.mark.parametrize("above", [0, 1])
def test_an_overlong_line_costs_one_record(tmp_path: Path, above: int) -> None:
    overlong = FIRST.strip() + "0" * 9_000_000 + "\n"
    log, frames = read(log_of(tmp_path, FIRST * above + overlong + FIRST))
    assert len(frames) == above + 1
    assert [(one.record, one.where) for one in log.rejected] == [(above, f"line {above + 1}")]
    begin = len(FIRST) * above + len(overlong)
    assert place_of(log.path, above + 2) == f"line {above + 2}, byte {begin:,}"


def test_a_log_is_known_below_an_overlong_first_line(tmp_path: Path) -> None:
    log, frames = read(log_of(tmp_path, "x" * 10_000 + "\n" + FIRST))
    assert (len(frames), [one.where for one in log.rejected]) == (1, ["line 1"])


def test_stamps_since_the_frame_before_are_added_up(tmp_path: Path) -> None:
    lines = [f" (000.{part:06})  can0  123   [1]  01\n" for part in (0, 100_000, 99_990, 100_020, 99_980)]
    lines.insert(3, " (000.050000)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n")
    log, frames = read(log_of(tmp_path, "".join(lines)))
    assert [frame[0] // 1000 for frame in frames] == [0, 100_000, 199_990, 350_010, 449_990]
    assert not log.absolute and log.settings["time"] == "s since the frame before"
    log, frames = read(log_of(tmp_path, "".join(sorted(line for line in lines if "ERROR" not in line))))
    assert [frame[0] // 1000 for frame in frames] == [0, 99_980, 99_990, 100_000, 100_020]


def test_stamps_may_be_dates_of_a_local_clock(tmp_path: Path) -> None:
    path = log_of(tmp_path, " (2024-03-01 10:00:00.123456)  can0  RX - -  123   [1]  01\n")
    assert recognise(path).name == "candump"
    log, frames = read(path, TimeSpec(zone="Europe/Rome"))
    assert (log.absolute, frames[0][0]) == (True, 1_709_283_600_123_456_000)
    log, frames = read(log_of(tmp_path, f"{FIRST} (2024-02-30 10:00:00.1)  can0  123   [1]  01\n"))
    assert [one.why for one in log.rejected] == ['has the stamp "2024-02-30 10:00:00.1", which is no date of a log']
