"""A heat that is there while the motor brakes, which no law can say: it has no name, and the extended motor file says
it as a map all the same, with its gain on a session that nothing was learnt from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.show.reports import diagnosis_text, two_models
from replay.studies.diagnosis.answer import Diagnosis
from replay.studies.diagnosis.diagnose import diagnose
from twin.motor.network import Map

SECONDS, LEARN, KEEP = 1800, ("1_learn", "2_learn", "3_learn", "4_learn"), "5_keep"
HIDDEN_W = 20.0  # at 20 A, while it brakes
HEAD = "time,MotorSpeed,MotorTorque,PhaseCurrent,TC_winding,TC_yoke,TC_magnet,TC_coolant"


def _write(path: Path, number: int) -> None:
    speed, current = (np.repeat(values[::10], 10) for values in can_bench.drive(SECONDS, number))
    brakes = np.repeat(np.random.default_rng(number).random(SECONDS // 20) < 0.4, 200)
    hidden = np.where(brakes, HIDDEN_W * current / 20.0, 0.0)
    shown = can_bench.truth(speed, current, 30.0, in_magnet_W=hidden)[:-1]
    noise = np.random.default_rng(100 + number).normal(0.0, 0.05, shown.shape)
    torque = np.where(brakes, -0.8, 0.8) * current
    start = can_bench.START + 86_400 * number
    driven = [np.arange(SECONDS) + start, speed[::10], torque[::10], current[::10]]
    table = np.column_stack([*driven, shown + noise, np.full(SECONDS, 30.0)])
    np.savetxt(path, table, fmt="%.3f", delimiter=",", header=HEAD, comments="")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with the sessions."""
    folder = tmp_path_factory.mktemp("braking")
    can_bench.write_files(folder)
    motor = can_bench.MOTOR.replace("current_A = 20.0", "current_A = 20.0\ntorque_Nm = 16.0")
    (folder / "motor.toml").write_text(motor, encoding="utf-8")
    for number, name in enumerate((*LEARN, KEEP), 1):
        _write(folder / f"{name}.csv", number)
    logs = [str(folder / f"{name}.csv") for name in (*LEARN, KEEP)]
    assert main(["ingest", *logs, "--bench", str(folder / "bench.toml"), "--store", str(folder / "store")]) == 0
    return folder / "store"


@pytest.fixture(scope="module")
def answer(store: Path) -> Diagnosis:
    with Store.open(store, write=True) as opened:
        known = facts.at(opened.ledger)
        train, kept = [known.session(name) for name in LEARN], [known.session(KEEP)]
        return diagnose(opened, known, train, kept, None, "testing")


def test_it_has_no_name_and_no_law_stands_in_for_it(answer: Diagnosis) -> None:
    assert not answer.causes
    (heat,) = answer.unknown
    assert (heat.node, heat.goes_with) == ("magnet", ["braking"])
    low, high = heat.watts
    assert 0.4 * HIDDEN_W < low < high < 1.5 * HIDDEN_W
    assert (heat.fitted, heat.extends) == (True, "loss.magnet.map")


def test_the_kept_session_is_nearer_with_it(answer: Diagnosis) -> None:
    magnet = next(gain for gain in answer.gain if gain.node == "magnet")
    assert magnet.mae_recorded_K["before"] > 0.5
    assert magnet.mae_recorded_K["after"] < 0.2
    assert magnet.mae_after_K < 0.2
    (heat,) = answer.unknown
    assert not heat.improved, "the only kept session is too short to judge by"
    assert heat.why_not_improved is not None and "too short to judge by" in heat.why_not_improved
    assert two_models.notes(answer)[0].startswith("The kept sessions are nearer with it, but the kept session is too")


def test_it_is_a_step_of_the_chain(answer: Diagnosis) -> None:
    recalibrated, last = answer.chain[-2:]
    assert (last.id, last.formula) == ("loss.magnet.map", "loss of magnet [W] += 1 map(n, M)")
    assert last.model == answer.extended_model and last.sessions_better == len(LEARN)
    assert last.left_out_mae_K["magnet"] < 0.5 * recalibrated.left_out_mae_K["magnet"]


def test_the_text_says_what_the_file_says(answer: Diagnosis) -> None:
    told = " ".join(diagnosis_text.diagnosis_text(answer).split())
    assert "while the motor brakes" in told and "In the extended motor file" in told


def test_once_accepted_the_motor_file_has_the_map(
    store: Path, answer: Diagnosis, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["accept", f"d-{answer.diagnosis}", "--json", "--store", str(store)]) == 0
    accepted: Mapping[str, Any] = json.loads(capsys.readouterr().out)
    assert (accepted["causes"], accepted["model"]) == (["loss.magnet.map"], answer.extended_model)
    with Store.open(store) as opened:
        motor = read_motor(opened.archive.read(accepted["model"]), "motor.toml")
    (source,) = (source for source in motor.sources if source.node == "magnet")
    table = source.terms[-1].shape
    assert isinstance(table, Map) and table.over == "torque" and table.load[0] < 0
    assert main(["replay", KEEP, "--json", "--store", str(store)]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["model"] == accepted["model"]
