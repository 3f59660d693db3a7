"""Maps in files beside a motor file: read, and written into what the store keeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from replay.engine.files.models import for_intake
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_maps import read_motor_file, whole
from replay.engine.files.motor_text import written
from replay.errors import MotorFileError
from twin.motor.network import Map

MOTOR = """\
schema = "whyhot.motor/1"
name = "mapped"
[scale]
speed_rpm = 8000.0
torque_Nm = 50.0
[[node]]
name = "iron"
capacity = 100.0
[[boundary]]
name = "coolant"
[[link]]
between = ["iron", "coolant"]
terms = [{coefficient = 4.0}]
[[source]]
node = "iron"
terms = [
  {coefficient = 1.0, map = "iron.csv", sd = 0.2},  # W, from the maker
]
"""
CSV = "rpm \\ Nm,0,25,50\n0,0,1,2.5\n4000,10,12,15\n8000,40,45,60\n"
TABLE = Map((0.0, 0.5, 1.0), (0.0, 0.5, 1.0), ((0.0, 1.0, 2.5), (10.0, 12.0, 15.0), (40.0, 45.0, 60.0)))


def _file(folder: Path, csv: str | None = CSV, motor: str = MOTOR) -> Path:
    path = folder / "motor.toml"
    path.write_bytes(motor.encode())
    if csv is not None:
        (folder / "iron.csv").write_text(csv, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "csv", [CSV, CSV.replace(",", ";"), CSV.replace(",", "\t"), "\ufeff" + CSV.replace("\n", "\r\n"), CSV + "\n\n"]
)
def test_a_map_is_read_from_its_file(tmp_path: Path, csv: str) -> None:
    (term,) = read_motor_file(_file(tmp_path, csv)).sources[0].terms
    assert (term.shape, term.coefficient, term.sd) == (TABLE, 1.0, 0.2)


@pytest.mark.parametrize("corner", ["rpm \\ A", "rpm/A", "A"])
def test_a_map_goes_over_the_current_where_its_corner_says_so(tmp_path: Path, corner: str) -> None:
    motor = MOTOR.replace("torque_Nm = 50.0", "current_A = 50.0")
    path = _file(tmp_path, CSV.replace("rpm \\ Nm", corner), motor)
    (term,) = read_motor_file(path).sources[0].terms
    assert term.shape == replace(TABLE, over="current")
    kept = whole(path)
    assert b"current_A = [0.0, 25.0, 50.0]" in kept
    more = read_motor(kept.replace(b"coefficient = 4.0", b"coefficient = 5.0"), "motor.toml")
    assert read_motor(written(kept, "motor.toml", more, "fitted"), "motor.toml").sources[0].terms[0].shape == term.shape


def test_a_map_goes_over_one_of_torque_and_current(tmp_path: Path) -> None:
    both = "{speed_rpm = [0, 1], torque_Nm = [0, 1], current_A = [0, 1], values = [[0, 0], [0, 0]]}"
    motor = MOTOR.replace('"iron.csv"', both).replace("torque_Nm = 50.0", "torque_Nm = 50.0\ncurrent_A = 50.0")
    with pytest.raises(MotorFileError, match="over the torque or over the current: leave one of them out"):
        read_motor(motor.encode(), "motor.toml")


def test_what_is_kept_holds_its_maps_line_by_line_and_comments_stay(tmp_path: Path) -> None:
    path = _file(tmp_path)
    kept = whole(path)
    assert b"iron.csv" not in kept
    assert b"# W, from the maker" in kept
    assert len(kept.splitlines()) == len(MOTOR.splitlines())
    (tmp_path / "iron.csv").unlink()
    assert read_motor(kept, "motor.toml").sources[0].terms[0].shape == TABLE
    path.write_bytes(kept)
    assert whole(path) == kept


def test_an_intake_keeps_the_whole_file(tmp_path: Path) -> None:
    path = _file(tmp_path)
    assert for_intake(path).data == whole(path)


def test_a_file_without_maps_is_kept_as_it_is(tmp_path: Path) -> None:
    plain = ("\ufeff" + MOTOR.replace('map = "iron.csv"', "speed = 2")).replace("\n", "\r\n")
    assert whole(_file(tmp_path, None, plain)) == plain.encode()


def test_numbers_change_around_a_map(tmp_path: Path) -> None:
    kept = whole(_file(tmp_path))
    more = read_motor(kept.replace(b"coefficient = 4.0", b"coefficient = 5.0"), "motor.toml")
    assert written(kept, "motor.toml", more, "fitted").count(b"values = [[0.0, 1.0, 2.5]") == 1


REFUSED = {
    "no file": (None, MOTOR,
        r'^motor\.toml:17: \[\[source\]\] 1 \(node "iron"\), terms 1: map "iron\.csv" is not there'),
    "no number": (CSV.replace("45", "4x"), MOTOR, r'^iron\.csv:4: "4x" is not a number: decimals take a point\.$'),
    "a hole": (CSV.replace("4000,10,12,15", "4000,10,12"), MOTOR,
        r"^iron\.csv:3: has 3 cells, the first row 4: fill the table"),
    "nothing": ("\n", MOTOR, r"^iron\.csv: holds no table: the first row"),
    "falling": (CSV.replace("4000,", "9000,"), MOTOR, r"^motor\.toml:14: .*term 1: map: its speeds do not rise"),
    "shape beside": (CSV, MOTOR.replace("sd = 0.2", "shape = {speed_rpm = [0, 1], factor = [0, 0]}"),
        "leave the shape out"),
    "no torque": (CSV, MOTOR.replace("torque_Nm = 50.0\n", ""),
        r"a map needs what 1 means for torque: say torque_Nm in \[scale\]"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_map_is_refused_by_file_and_line(tmp_path: Path, case: str) -> None:
    csv, motor, says = REFUSED[case]
    with pytest.raises(MotorFileError, match=says) as caught:
        read_motor_file(_file(tmp_path, csv, motor))
    assert "\n" not in str(caught.value)
