"""GVRET: lines as SavvyCAN and the firmwares of that family write them."""

from pathlib import Path

import pytest

from ingest.formats import EXTENDED, FD, TRANSMIT
from made.frames import read
from made.places import LOGS

HEAD = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"


def log_of(folder: Path, text: str) -> Path:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_sample_gives_every_kind_of_frame() -> None:
    log, frames = read(LOGS / "sample.gvret")
    assert frames == [
        (39_747_828_000, 0, 0x5EB, 0, "e845854b4a283669"),
        (39_748_031_000, 1, 0x2AA, TRANSMIT, "0aff"),
        (39_748_500_000, 0, 0x18EBFF00 | int(EXTENDED), 0, "010203"),
        (39_749_000_000, 0, 0x100, FD, "0102030405060708090a0b0c"),
        (39_749_500_000, 0, 0x7FF, 0, ""),
    ]
    assert [(one.where, one.why) for one in log.rejected] == [("line 7", "holds 2 of its 8 bytes")]
    assert not log.absolute


def test_files_without_a_direction_are_read(tmp_path: Path) -> None:
    text = HEAD.replace("Dir,", "") + "166064000,0000021A,false,0,8,FE,36,12,FE,69,05,07,AD,\n"
    assert read(log_of(tmp_path, text))[1] == [(166_064_000_000, 0, 0x21A, 0, "fe3612fe690507ad")]


def test_stamps_since_1970_are_absolute(tmp_path: Path) -> None:
    log, frames = read(log_of(tmp_path, f"{HEAD}1700000000000123,00000001,0,Rx,2,1,0A,\n"))
    assert (log.absolute, frames) == (True, [(1_700_000_000_000_123_000, 2, 1, 0, "0a")])


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("2,00000001,false,Rx,0,2,0A,F,", "holds 1 of its 2 bytes"),
        ("2,00000001,false,Rx,0,65,0A", "says it holds 65 bytes, more than the 64 of a frame"),
        ("2,00000800,false,Rx,0,0,", 'has the identifier "800", which is no number of 11 bits'),
        ("2,00000001,false,Rx,300,0,", "its channel is above 255"),
        ("2,00000001,maybe,Rx,0,0,", "is no line of a GVRET log"),
        ("99999999999999999,00000001,false,Rx,0,0,", "has a stamp that no log can reach"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str) -> None:
    log, frames = read(log_of(tmp_path, f"{HEAD}1,00000001,false,Rx,0,0,\n{line}\n3,00000001,false,Rx,0,0,\n"))
    assert len(frames) == 2
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, "line 3", why)]
