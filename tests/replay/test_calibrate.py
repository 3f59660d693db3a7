"""`whyhot calibrate` on logs of a bench whose truth is integrated by scipy: its magnets lose three times what the file says."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import can_bench
import pytest

from ingest import facts
from ingest.events import CalibrationCompleted, ModelPublished
from ingest.store import Store
from replay.cli import main
from replay.engine.motor_file import read_motor
from replay.engine.motor_text import rewritten
from replay.errors import MotorFileError


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_learn.blf", seconds=900, seed=1, magnet_loss=90.0)
    can_bench.write_log(folder / "2_kept.blf", 500, 2, can_bench.START + 86_400, magnet_loss=90.0)
    logs = [str(folder / name) for name in ("1_learn.blf", "2_kept.blf")]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    return folder


def _json(folder: Path, capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*words, "--json", "--store", str(folder / "store")]) == code
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def test_calibration_finds_what_the_magnets_lose(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "calibrate", "--on", "1_learn")
    assert answer["schema"] == "whyhot.calibration/1"
    assert answer["converged"] is True
    found = {p["name"]: p for p in answer["parameters"]}
    magnet = found["loss.magnet.speed2"]
    assert abs(math.log(magnet["value"] / 90.0)) < 3 * magnet["sd"]
    assert magnet["before"] == 30.0
    assert magnet["unit"] == "W"
    assert answer["moved"] == ["loss.magnet.speed2"]
    assert set(answer["left_free"]) < set(found)
    rows = {entry["node"]: entry for entry in answer["errors"]}
    assert rows["magnet"]["before_K"] > 1.0
    assert rows["magnet"]["after_K"] < 0.2


def test_a_kept_session_replays_better_with_the_calibrated_model(
    bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = _json(bench, capsys, "calibrate", "--on", "1_learn")["model"]
    (before,) = _json(bench, capsys, "replay", "2_kept")["runs"]
    (after,) = _json(bench, capsys, "replay", "2_kept", "--model", model)["runs"]
    assert before["mae_K"]["magnet"] > 1.0
    assert after["mae_K"]["magnet"] < 0.2
    assert max(after["mae_K"].values()) < 0.2


def test_the_same_calibration_again_writes_nothing(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = _json(bench, capsys, "calibrate", "--on", "1_learn")
    head = _json(bench, capsys, "head")["root"]
    again = _json(bench, capsys, "calibrate", "--on", "1_learn")
    assert again["model"] == first["model"]
    assert again["calibration"] == first["calibration"]
    assert _json(bench, capsys, "head")["root"] == head


def test_the_new_model_is_a_fact_with_its_parent(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "calibrate", "--on", "1_learn")
    with Store.open(bench / "store") as store:
        published: ModelPublished = facts.at(store.ledger).models[answer["model"]]
        assert published.parent == answer["parent"]
        (event,) = [r.event for r in store.ledger.events() if isinstance(r.event, CalibrationCompleted)]
        text = store.archive.read(answer["model"]).decode()
    assert event.model == answer["model"]
    assert event.sessions == [answer["on"][0]["session"]]
    first, second, *_ = text.splitlines()
    assert first == 'schema = "whyhot.motor/1"'
    assert second.startswith(f"# Calibrated on 1_learn from model {answer['parent'][:12]}")


def test_the_text_says_what_moved_and_what_to_do_next(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["calibrate", "--on", "1_learn", "--store", str(bench / "store")]) == 0
    text = capsys.readouterr().out
    assert "servo-5kW on 1_learn: converged" in text
    assert "loss.magnet.speed2" in text
    assert "Left free" in text
    assert "whyhot replay --model " in text
    assert max(map(len, text.splitlines())) <= 100


def test_a_session_that_is_not_there_is_refused_in_one_line(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "calibrate", "--on", "3_lost", code=2)
    assert "session '3_lost': is not in this store." in answer["error"]
    assert "\n" not in answer["error"]


def test_numbers_are_replaced_where_they_stand_and_comments_stay() -> None:
    motor = can_bench.MOTOR.replace("coefficient = 12.0}]", "coefficient = 12.0}]  # coefficient = 7 in an older file")
    network = read_motor(motor.replace("12.0", "13.5").replace("900.0", "1e3").encode(), "motor.toml")
    text = rewritten(motor.encode(), "motor.toml", network, "Calibrated.\nBy a test.").decode()
    assert "terms = [{coefficient = 13.5}]  # coefficient = 7 in an older file" in text
    assert "terms = [{coefficient = 1}, {coefficient = 2, speed = 0.8}]" in text
    assert text.splitlines()[1:3] == ["# Calibrated.", "# By a test."]
    assert read_motor(text.encode(), "motor.toml") == network


def test_a_number_that_cannot_be_found_in_its_place_is_refused() -> None:
    motor = can_bench.MOTOR.replace('name = "winding"\ncapacity = 900.0', 'name = "winding"\n"capacity" = 900.0')
    network = read_motor(motor.replace("900.0", "950.0").encode(), "motor.toml")
    with pytest.raises(MotorFileError) as refused:
        rewritten(motor.encode(), "motor.toml", network, "Calibrated.")
    assert str(refused.value) == (
        "motor.toml: [[node]] number 1: its capacity cannot be replaced in its place: write capacity = and the number "
        "side by side on one line."
    )
