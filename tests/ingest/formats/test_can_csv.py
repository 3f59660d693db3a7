"""CSV of python-can: equal to what it wrote, and every line that is no frame accounted for."""

from pathlib import Path

import can
import pytest

from ingest.formats import recognise
from made.frames import as_frames, messages, read, write

HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


def log_of(folder: Path, text: str) -> Path:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_frames_equal_those_that_python_can_wrote(tmp_path: Path) -> None:
    path, some = tmp_path / "log.csv", messages(400)
    short = [one for one in some if one.is_fd and len(one.data) <= 8]
    write(can.CSVWriter(path), some)
    assert recognise(path).name == "can_csv"
    log, frames = read(path)
    assert not short  # such a one would be told as a classic frame
    assert frames == as_frames(some, without_bus=True, ways=False)
    assert len(log.rejected) == 8 and {one.why for one in log.rejected} == {"error frame"}


def test_stamps_from_zero_are_read_however_python_writes_them(tmp_path: Path) -> None:
    log, frames = read(log_of(tmp_path, f"{HEAD}0.0,0x1,0,0,0,0,\n1.5e-05,0x1,0,0,0,0,\n0.25,0x1,0,0,0,0,\n"))
    assert [frame[0] for frame in frames] == [0, 15_000, 250_000_000]
    assert not log.absolute


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("1.0,0x1,0,0,0,8,AAAA", "holds 3 of its 8 bytes"),
        ("1.0,0x1,0,0,0,3,AAA", "its data are no base64"),
        ("1.0,0x800,0,0,0,0,", 'has the identifier "800", which is no number of 11 bits'),
        ("1.0,0x1,0,0,0,0", "is no line of a CSV log of python-can"),
        ("None,0x1,0,0,0,0,", "is no line of a CSV log of python-can"),
        ("99999999999.0,0x1,0,0,0,0,", "has a stamp that no log can reach"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str) -> None:
    log, frames = read(log_of(tmp_path, f"{HEAD}0.5,0x1,0,0,0,0,\n{line}\n1.5,0x1,0,1,0,4,\n"))
    assert len(frames) == 2
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, "line 3", why)]
