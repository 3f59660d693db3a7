"""`whyhot plan` on two logs of a small bench: its answer, and the day as a file that the bench reads back."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made.onward import next_commands
from replay.cli import main

BENCH = """schema = "whyhot.bench/1"
motor = "motor.toml"
[time]
column = "time_s"
"""
CHANNELS = {"speed_rpm": "speed", "current_A": "current", "torque_Nm": "torque", "flow_lpm": "flow"}
UNITS = {"speed": "rpm", "current": "A", "torque": "Nm", "flow": "l/min"}


def test_every_candidate_says_from_where_it_shows_and_what_it_looks_like(answer: Mapping[str, Any]) -> None:
    assert answer["schema"] == "whyhot.plan/1"
    ids = [one["id"] for one in answer["candidates"]]
    assert len(ids) == len(set(ids)) > 20
    for one in answer["candidates"]:
        assert set(one["indistinguishable_from"]) <= set(ids) - {one["id"]}
        assert one["smallest"] is None or one["smallest"] > 0
        assert one["usual_d_after"] >= one["usual_d"] * (1 - 1e-6)
        if one["smallest"] is not None:
            assert one["usual_d"] == pytest.approx(answer["stands_out_d"] / one["times_usual"], rel=1e-6)


def test_the_day_keeps_to_its_hours_and_below_the_limit(answer: Mapping[str, Any]) -> None:
    assert 0 < sum(step["hours"] for step in answer["chain"]) <= 2.0
    day = answer["day"]
    assert day["limits"] == "motor file"
    assert day["hottest_node"] == "winding"
    assert day["hottest_degC"] < day["hottest_high_degC"] <= 70.0  # limit_degC of the winding
    assert answer["tests_weighed"] > 100


def test_the_file_is_as_long_as_the_day_and_says_which_step_it_is_in(bench: Path, answer: Mapping[str, Any]) -> None:
    table = np.genfromtxt(bench / "days" / "day.csv", delimiter=",", names=True)
    assert table["time_s"][-1] + 1.0 == pytest.approx(3600 * answer["day"]["hours"])
    steps = set(table["step"].tolist())
    assert steps == {0.0, *(float(step["step"]) for step in answer["chain"])}
    at_rest = table["step"] == 0
    middle_of_rest = at_rest & np.roll(at_rest, 10) & np.roll(at_rest, -10)
    assert (table["speed_rpm"][middle_of_rest] == 0).all()
    assert table["speed_rpm"].max() > 0
    assert np.abs(np.diff(table["speed_rpm"])).max() <= table["speed_rpm"].max() / 10 + 1


def test_the_file_is_taken_in_with_a_bench_file(bench: Path, answer: Mapping[str, Any]) -> None:
    assert answer["chain"]
    columns = (bench / "days" / "day.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    text = BENCH
    for column in columns[1:-1]:
        quantity = CHANNELS.get(column, "temperature")
        unit = UNITS.get(quantity, "degC")
        node = f'node = "{column.removesuffix("_degC")}"\n' if quantity == "temperature" else ""
        text += f'[[channel]]\nsignal = "{column}"\nquantity = "{quantity}"\nunit = "{unit}"\n{node}'
    (bench / "set_values.toml").write_text(text, encoding="utf-8")
    store, target = ["--store", str(bench / "back")], bench / "back.json"
    assert main(["ingest", str(bench / "days" / "day.csv"), "--bench", str(bench / "set_values.toml"), *store]) == 0
    assert main(["sessions", *store, "--json", str(target)]) == 0
    sessions = json.loads(target.read_text(encoding="utf-8"))["sessions"]
    assert [one["duration_s"] for one in sessions] == pytest.approx([3600 * answer["day"]["hours"]], abs=2.0)


def test_the_text_says_what_may_hide_what_to_run_and_the_command_that_writes_the_day(
    bench: Path,
    answer: Mapping[str, Any],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["--sessions", "1_point", "2_drive", "--hours", "1", "--cause", answer["candidates"][0]["id"]]
    assert main(["plan", *words, "--store", str(bench / "store")]) == 0
    text = capsys.readouterr().out
    for part in ("Answer", "candidate causes", "The next bench day", "Heat", "of rest after each test"):
        assert part in text
    (command,) = next_commands(text)
    assert main(shlex.split(command)[1:]) == 0
    written = capsys.readouterr().out
    assert written.startswith(text[: text.index("next: ")])
    assert next_commands(written) == [f"whyhot ingest --store {bench / 'store'} FILE --bench FILE"]
    assert (tmp_path / "day.csv").exists() and (tmp_path / "plan.json").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--cause", "loss.nowhere.speed"), "loss.nowhere.speed: no candidate"),
        (("--hours", "0.1"), "0.1 h are too few"),
    ],
)
def test_what_cannot_be_planned_is_one_line(
    bench: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    asked = ["plan", "--sessions", "1_point", "2_drive", *words, "--store", str(bench / "store")]
    assert main(asked) == 2
    error = capsys.readouterr().err
    assert says in error


def test_sessions_are_planned_from_with_the_bench_file_that_they_are_read_with(
    bench: Path, answer: Mapping[str, Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asked = ["plan", "--sessions", "1_point", "2_drive", "--hours", "2", "--store", str(bench / "store"), "--bench"]
    assert main([*asked, str(bench / "bench.toml"), "--json", str(tmp_path / "plan.json")]) == 0
    assert json.loads((tmp_path / "plan.json").read_text())["candidates"] == answer["candidates"]
    (other := tmp_path / "other.toml").write_bytes((bench / "bench.toml").read_bytes() + b"# another\n")
    capsys.readouterr()
    assert main([*asked, str(other)]) == 2
    assert "session 1_point is read with another bench file than" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--hours", "0"), ("--hours", "x"), ("--out", "day.xlsx")])
def test_wrong_words_are_refused(bench: Path, words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["plan", "--sessions", "1_point", *words, "--store", str(bench / "store")])
    assert stopped.value.code == 2
