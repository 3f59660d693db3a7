"""BUSMASTER: frames a line, with times of the day, since the beginning or since the frame before."""

from pathlib import Path

import pytest

from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, TimeSpec
from made.frames import read
from made.places import LOGS
from made.tables import DECEMBER_NS, S_NS

MIDNIGHT_NS = DECEMBER_NS + 16 * 3600 * S_NS  # after 24 December 2025
HEAD = "***BUSMASTER Ver 3.2.2***\n***START DATE AND TIME 24:12:2025 8:00:00:250***\n***HEX***\n***{} MODE***\n"


def log_of(folder: Path, text: str) -> Path:
    path = folder / "bus.log"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_sample_gives_every_kind_of_frame_and_goes_on_over_midnight() -> None:
    log, frames = read(LOGS / "sample.busmaster")
    assert frames == [
        (MIDNIGHT_NS - S_NS - S_NS // 2, 1, 0x123, 0, "0102030405060708"),
        (MIDNIGHT_NS - 100_000, 2, 0x18FEDF00 | int(EXTENDED), TRANSMIT, "0aff"),
        (MIDNIGHT_NS + 100_000, 1, 0x200, REMOTE, ""),
        (MIDNIGHT_NS + 2 * S_NS, 1, 0x7FF, 0, ""),
    ]
    assert [(one.where, one.why) for one in log.rejected] == [("line 17", "holds 3 of its 8 bytes")]
    assert (log.absolute, log.settings["stamps"]) == (True, "SYSTEM")


@pytest.mark.parametrize(("mode", "seconds"), [("ABSOLUTE", [1, 2]), ("RELATIVE", [1, 3])])
def test_times_count_from_the_beginning_or_from_the_frame_before(tmp_path: Path, mode: str, seconds: list[int]) -> None:
    lines = "0:00:01:0000 Rx 1 0x1 s 1 0A\n0:00:02:0000 Rx 1 0x1 s 1 0B\n"
    log, frames = read(log_of(tmp_path, HEAD.format(mode) + lines))
    assert [one[0] for one in frames] == [DECEMBER_NS + S_NS // 4 + second * S_NS for second in seconds]
    assert log.absolute


def test_the_date_is_local_where_the_bench_file_says_a_zone(tmp_path: Path) -> None:
    path = log_of(tmp_path, HEAD.format("SYSTEM") + "8:00:01:0000 Rx 1 0x1 s 1 0A\n")
    _, frames = read(path, TimeSpec(zone="Europe/Rome"))
    assert frames[0][0] == DECEMBER_NS - 3600 * S_NS + S_NS


def test_numbers_may_be_decimal_and_frames_long(tmp_path: Path) -> None:
    head = HEAD.format("SYSTEM").replace("HEX", "DEC")
    cells = " ".join(f"{k:03d}" for k in range(244, 256))
    lines = f"8:00:01:0000 Rx 1 291 s 12 {cells}\n8:00:02:0000 Rx 1 419356416 x 1 010\n8:00:03:0000 Rx 1 1A s 0\n"
    log, frames = read(log_of(tmp_path, head + lines))
    assert [one[2:] for one in frames] == [
        (0x123, FD, bytes(range(244, 256)).hex()),
        (0x18FEDF00 | int(EXTENDED), 0, "0a"),
    ]
    assert [one.why for one in log.rejected] == ["is no line of a log of BUSMASTER"]


@pytest.mark.parametrize("date", ["***START DATE AND TIME 31:2:2025 8:0:0:0***", "***[START LOGGING SESSION]***"])
def test_without_a_date_times_count_from_the_logs_own_start(tmp_path: Path, date: str) -> None:
    text = f"***BUSMASTER Ver 3.2.2***\n{date}\n0:00:01:0000 Rx 1 0x1 s 1 0A\n"
    log, frames = read(log_of(tmp_path, text))
    assert (log.absolute, frames[0][0]) == (False, S_NS)


def test_a_second_log_in_the_file_has_its_own_date(tmp_path: Path) -> None:
    one = HEAD.format("SYSTEM") + "8:00:01:0000 Rx 1 0x1 s 1 0A\n"
    _, frames = read(log_of(tmp_path, one + one.replace("24:12", "25:12")))
    assert frames[1][0] - frames[0][0] == 86_400 * S_NS
