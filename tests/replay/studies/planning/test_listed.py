"""`whyhot plan --tests`: tests that have not been run stand in place of recorded sessions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made import meters
from replay.cli import main
from replay.studies.planning.listed import listed_campaign, read_listed, unfitted

HEAD = "time_s,speed_rpm,current_A,coolant_degC\n"
POINT = f"{HEAD}0,0,0,30\n10,3000,12,30\n1500,3000,12,30\n"
HOT = f"{HEAD}0,6000,25,30\n1800,6000,25,30\n"


def _asked(bench: Path, folder: Path, text: str, *more: str) -> int:
    (folder / "point.csv").write_text(text, encoding="utf-8")
    words = ["--tests", str(folder / "point.csv"), "--bench", str(bench / "bench.toml"), "--hours", "0.7"]
    return main(["plan", *words, *more, "--store", str(folder / "none")])


def test_a_list_of_tests_is_planned_from_without_any_store(
    bench: Path, answer: Mapping[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "plan.json"
    assert _asked(bench, tmp_path, POINT, "--json", str(target)) == 0
    assert "Not run           nothing was measured yet" in capsys.readouterr().out
    found = json.loads(target.read_text(encoding="utf-8"))
    assert (found["sessions"], found["not_run"]) == ([], ["point"])
    assert found["model"] == answer["model"], "the motor file that the bench file names, as an ingest publishes it"
    assert answer["not_run"] == []
    assert found["chain"]
    assert not (tmp_path / "none").exists()
    usual = {one["id"]: one["usual_d"] for one in found["candidates"]}
    measured = {one["id"]: one["usual_d"] for one in answer["candidates"]}
    shared = usual.keys() & measured.keys()
    assert len(shared) > 20
    assert sum(usual[one] < measured[one] for one in shared) > len(shared) / 2, "two sessions have shown more"


def test_a_written_day_is_such_a_test_and_teaches_nothing_by_itself(bench: Path, answer: Mapping[str, Any]) -> None:
    assert answer["chain"]
    listed = read_listed([bench / "days" / "day.csv"], bench / "bench.toml", bench / "motor.toml")
    (test,) = listed_campaign(listed, "testing").tests
    assert len(test.frame.features) == pytest.approx(3600 * answer["day"]["hours"], abs=10)
    assert [channel.name for channel in test.channels] == ["TC_winding", "TC_yoke", "TC_magnet"]
    fit = unfitted(listed_campaign(listed, "testing"))
    assert not fit.beta.any()
    assert max(float(np.abs(series.y).max()) for series in fit.series) < 0.05  # K: readings are the file's own run


def test_meters_of_the_bench_file_are_read_in_a_list_of_tests(tmp_path: Path) -> None:
    meters.write(tmp_path)
    head = "time_s,speed_rpm,current_A,coolant_degC"
    rows = ("0,0,0,30", "10,3000,12,30", "1500,3000,12,30")
    (tmp_path / "with.csv").write_text(
        f"{head},torque_Nm\n" + "\n".join(f"{row},{9 if i else 0}" for i, row in enumerate(rows)), encoding="utf-8"
    )
    (tmp_path / "bare.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    listed = read_listed([tmp_path / "with.csv", tmp_path / "bare.csv"], tmp_path / "bench.toml", None)
    campaign = listed_campaign(listed, "testing")
    names = [[meter.name for meter in test.meters] for test in campaign.tests]
    assert names == [["P_el", "Q_cool", "R", "psi"], ["Q_cool", "R", "psi"]], "a power needs that of the shaft"
    power = campaign.tests[0].meters[0]
    assert power.measured.mean() == pytest.approx(9 * 3000 * 2 * np.pi / 60, rel=0.15), "shaft and losses"
    fit = unfitted(campaign)
    assert "meter.P_el.gain" in [parameter.name for parameter in fit.model.parameters]
    assert max(float(np.abs(series.y).max()) for series in fit.series) < 0.05  # K, or as much: the file's own run


def test_straight_lines_between_rows_are_driven(bench: Path, tmp_path: Path) -> None:
    file = tmp_path / "ramp.csv"
    file.write_text(f"{HEAD}100,0,0,30\n1100,6000,10,40\n2100,6000,10,40\n", encoding="utf-8")
    columns = read_listed([file], bench / "bench.toml", None).tests["ramp"]
    assert columns["speed_rpm"][[0, 500, 1000, 2000]].tolist() == [0.0, 3000.0, 6000.0, 6000.0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the first row names the columns"),
        ("time_s,speed_rpm,current_A\n0,1,1\n1800,1,1\n", "point: the motor file needs coolant_degC: add that column"),
        (
            POINT.replace("speed_rpm", "sped_rpm"),
            'column "sped_rpm" is nothing that this motor file is driven by. Nearest',
        ),
        (POINT.replace("3000,12,30\n1500", "x,12,30\n1500"), "row 3 does not hold 4 numbers: 10,x,12,30"),
        (POINT.replace(",", ";"), "columns are separated by commas, numbers have a decimal point"),
        (POINT.replace("1500,3000,12,30", "1500,3000,12,-300"), "coolant_degC falls to -300, below -273.15 °C"),
        (f"{HEAD}10,0,0,30\n0,0,0,30\n", "time_s must rise from row to row"),
        (POINT.replace("1500", "600"), "the tests last 10 min together, too short"),
        (HOT, "point: the winding is above its 70 °C after"),
        (HOT.replace(",25,", ",9000,"), "colder coolant or a shorter test would relax it"),
    ],
)
def test_a_list_that_cannot_be_planned_from_is_one_line(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, says: str
) -> None:
    assert _asked(bench, tmp_path, text) == 2
    error = capsys.readouterr().err.strip()
    assert says in error
    assert "\n" not in error


@pytest.mark.parametrize("written", ["point.csv", "../{}/point.csv"])
def test_a_test_is_not_written_over_by_the_day(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], written: str
) -> None:
    with pytest.raises(SystemExit):
        _asked(bench, tmp_path, POINT, "--out", str(tmp_path / written.format(tmp_path.name)))
    assert "is a file that the day is planned from: give --out another name" in capsys.readouterr().err
    assert (tmp_path / "point.csv").read_text(encoding="utf-8") == POINT


@pytest.mark.parametrize(
    "words",
    [
        ("--tests", "a.csv"),
        ("--sessions", "1_point", "--tests", "a.csv", "--bench", "bench.toml"),
        ("--tests", "a.csv", "--bench", "bench.toml", "--motor", "servo"),
    ],
)
def test_words_that_do_not_go_together_are_refused(words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["plan", *words])
    assert stopped.value.code == 2


def test_at_the_level_of_series_motors_a_thermometer_that_is_there_is_no_new_one(bench: Path, tmp_path: Path) -> None:
    text = (bench / "bench.toml").read_text(encoding="utf-8")
    signal = next(line for line in text.splitlines() if line.startswith("signal") and "winding" in line.lower())
    (tmp_path / "bench.toml").write_text(text.replace(signal, f'{signal}\nlevel = "production"'), encoding="utf-8")
    (tmp_path / "motor.toml").write_bytes((bench / "motor.toml").read_bytes())
    target = tmp_path / "plan.json"
    assert _asked(tmp_path, tmp_path, POINT, "--level", "production", "--json", str(target)) == 0
    observed = {one["what"]: one["node"] for one in json.loads(target.read_text(encoding="utf-8"))["observe"]}
    assert observed["TC_magnet, which is there"] == "magnet"
    assert not {"a sensor at magnet", "a sensor at yoke", "a sensor at winding"} & observed.keys()
    (channel,) = (
        listed_campaign(read_listed([tmp_path / "point.csv"], tmp_path / "bench.toml", None), "production")
        .tests[0]
        .channels
    )
    assert channel.name == "TC_winding"
