"""`whyhot calibrate` on logs of a bench whose truth is integrated by scipy: its magnets lose three times what the
file says."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from ingest.facts import facts
from ingest.facts.events import CalibrationCompleted, ModelPublished
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.show.verbs.calibration import calibration_text


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
    *lines, following = text.splitlines()
    assert following.startswith(f"Next              whyhot replay --store {bench / 'store'} --model ")
    assert max(map(len, lines)) <= 100


def test_many_parameters_that_the_data_leave_free_are_counted_and_not_listed() -> None:
    parameter = {"before": 1.0, "value": 1.0, "log_change": 0.0, "sd": 0.5, "prior_sd": 0.5, "held": False, "unit": "W"}
    names = [*(f"conductance.a-b{k}.constant" for k in range(7)), "loss.a.current2", "loss.b.current2"]
    data: dict[str, Any] = {
        "motor": "servo",
        "on": [{"name": "1_s1"}],
        "converged": True,
        "iterations": 3,
        "errors": [],
        "profiles": [],
        "model": "a" * 64,
        "parent": "b" * 64,
        "parameters": [parameter | {"name": name} for name in names],
    }
    (line,) = [line for line in calibration_text(data).splitlines() if line.startswith("Left free")]
    assert line.endswith("9 of 9 parameters keep over 90 % of their prior sd: 7 of conductance and 2 of")
    moved = parameter | {"name": "capacity.a.scale", "before": 1370.2, "value": 999.92, "log_change": -0.9, "sd": 0.089}
    (row,) = [line for line in calibration_text(data | {"parameters": [moved]}).splitlines() if "capacity.a" in line]
    assert row.split()[1:] == ["1,370", "1,000", "W", "9.3", "%"], "no digit more than 1 sd leaves"
    meter = {"session_name": "1_s1", "place": "shaft", "channel": "P", "unit": "W", "before": 90.0, "after": 20.0}
    assert "meter reads 1.2 % too little" in calibration_text(data | {"errors": [meter | {"gain": -0.012}]})
    few = calibration_text(data | {"parameters": data["parameters"][-2:]})
    assert "2 of 2 parameters keep over 90 % of their prior sd: loss.a.current2," in few


def test_a_session_that_is_not_there_is_refused_in_one_line(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "calibrate", "--on", "3_lost", code=2)
    assert "session '3_lost': is not in this store." in answer["error"]
    assert "\n" not in answer["error"]


def test_a_profile_says_what_the_data_alone_know(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "calibrate", "--on", "1_learn", "--profile", "loss.magnet.speed2")
    (one,) = answer["profiles"]
    low, high = one["ci95"]
    assert low < 90.0 < high
    assert low < one["value"] < high
    assert min(rise for _, rise in one["course"]) == 0.0
    text = calibration_text(answer)
    assert (
        f"loss.magnet.speed2 is {one['value']:.4g} W, 95 %: {low:.4g} to {high:.4g} W, by the data alone"
        in " ".join(text.split())
    )


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("loss.magnet.speed3", "loss.magnet.speed2"), ("loss.foo", "loss."), ("nothing", "")],
)
def test_a_profile_of_what_is_not_there_is_refused(
    bench: Path, capsys: pytest.CaptureFixture[str], name: str, nearest: str
) -> None:
    """With a name of the same kind however far that is, and where to find all of them."""
    capsys.readouterr()
    assert main(["calibrate", "--on", "1_learn", "--profile", name, "--store", str(bench / "store")]) == 2
    said = capsys.readouterr().err
    assert f"--profile {name}: the motor has no such parameter. Nearest: {nearest}" in said
    assert (
        "Names are kind.place.law; `whyhot calibrate --on S --json` lists those of this motor as `parameters`." in said
    )
