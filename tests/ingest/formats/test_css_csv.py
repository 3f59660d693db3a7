"""CSV of CANedge's converter: each frame as its line says it, and every line that is none accounted for."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.formats import FD, TRANSMIT, recognise
from made.frames import read

HEAD = "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes\n"


def log_of(folder: Path, lines: str, head: str = HEAD) -> Path:
    path = folder / "log.txt"
    path.write_text(head + lines, encoding="utf-8")
    return path


def test_frames_have_their_time_bus_identifier_direction_and_bytes(tmp_path: Path) -> None:
    lines = "1581670628.161550;1;7FF;0;2;2;0;0;0;12AF\n1581670628.25;2;12345678;1;9;12;1;1;1;" + "0A" * 12 + "\n"
    path = log_of(tmp_path, lines)
    assert recognise(path).name == "css_csv"
    log, frames = read(path)
    assert log.absolute and not log.rejected
    assert frames == [
        (1_581_670_628_161_550_000, 1, 0x7FF, 0, "12af"),
        (1_581_670_628_250_000_000, 2, 0x12345678 | 1 << 31, FD | TRANSMIT, "0a" * 12),
    ]


def test_commas_separate_as_well(tmp_path: Path) -> None:
    path = log_of(tmp_path, "1581670628.1,1,7FF,0,1,1,0,0,0,12\n", HEAD.replace(";", ","))
    assert recognise(path).name == "css_csv" and len(read(path)[1]) == 1


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("1581670628.1;1;7FF;0;2;2;0;0;0;12", "holds 1 of its 2 bytes"),
        ("1581670628.1;1;800;0;0;0;0;0;0;", 'has the identifier "800", which is no number of 11 bits'),
        ("1581670628.1;1;7FF;0;2", "is no line of a CSV log of CANedge's converter"),
        ("1581670628.1;300;7FF;0;0;0;0;0;0;", "its channel is above 255"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str) -> None:
    good = "1581670628.1;1;7FF;0;0;0;0;0;0;\n"
    log, frames = read(log_of(tmp_path, f"{good}{line}\n{good}"))
    assert len(frames) == 2
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, "line 3", why)]
