"""`whyhot calibrate` on sessions of a whole motor and of the same motor on another rig: one motor file learns from
both."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.motor_file import read_motor

RIG = """\
[[configuration]]
name = "other_jacket"
[[configuration.link]]
between = ["yoke", "coolant"]
terms = [{coefficient = 12.0}]  # a first guess
"""  # the log of this rig has 25 W/K there, as the motor has in its own jacket
STATOR = """\
[[boundary]]
name = "air"
[[configuration]]
name = "stator_in_air"
remove = ["magnet", "coolant"]
[[configuration.link]]
between = ["yoke", "air"]
terms = [{coefficient = 3.0}]  # a first guess of 5
"""
CHECK = """\
schema = "whyhot.bench/1"
motor = "motor.toml"
configuration = "stator_in_air"
kind = "dc_check"
[[channel]]
signal = "I"
quantity = "current_dc"
unit = "A"
""" + "".join(
    f'[[channel]]\nsignal = "{node}"\nquantity = "temperature"\nunit = "degC"\nnode = "{node}"\n'
    for node in ("winding", "yoke", "air")
)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rigs")
    can_bench.write_files(folder)
    (folder / "motor.toml").write_text(can_bench.MOTOR + RIG, encoding="utf-8")
    rig = can_bench.BENCH.replace('motor = "motor.toml"', 'motor = "motor.toml"\nconfiguration = "other_jacket"')
    (folder / "bench_rig.toml").write_text(rig, encoding="utf-8")
    for day, (name, file) in enumerate((("1_whole", "bench.toml"), ("2_rig", "bench_rig.toml"))):
        log = folder / f"{name}.blf"
        can_bench.write_log(log, 700, day + 1, can_bench.START + day * 86_400, magnet_loss=90.0)
        words = ["ingest", str(log), "--bench", str(folder / file), "--dbc", str(folder / "bench.dbc")]
        assert main([*words, "--store", str(folder / "store")]) == 0
    return folder


@pytest.fixture(scope="module")
def answer(bench: Path) -> dict[str, Any]:
    target = bench / "answer.json"
    words = ["calibrate", "--on", "1_whole", "2_rig", "--json", str(target), "--store", str(bench / "store")]
    assert main(words) == 0
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


def test_the_order_of_the_sessions_does_not_matter(bench: Path, answer: dict[str, Any], tmp_path: Path) -> None:
    target = tmp_path / "again.json"
    words = ["calibrate", "--on", "2_rig", "1_whole", "--json", str(target), "--store", str(bench / "store")]
    assert main(words) == 0
    again = json.loads(target.read_text(encoding="utf-8"))
    assert {key: of for key, of in again.items() if key != "provenance"} == {
        key: of for key, of in answer.items() if key != "provenance"
    }


def test_both_rigs_are_learnt_from(answer: dict[str, Any]) -> None:
    found = {p["name"]: p for p in answer["parameters"]}
    assert answer["converged"] is True
    assert found["conductance.yoke-coolant.constant@other_jacket"]["value"] == pytest.approx(25.0, rel=0.05)
    assert found["conductance.yoke-coolant.constant"]["value"] == pytest.approx(25.0, rel=0.05)
    assert found["loss.magnet.speed2"]["value"] == pytest.approx(90.0, rel=0.1)
    assert found["conductance.yoke-coolant.constant@other_jacket"]["unit"] == "W/K"
    errors = {(e["session_name"], e["node"]): e for e in answer["errors"]}
    assert errors["2_rig", "yoke"]["before_K"] > 1.0
    assert all(one["after_K"] < 0.2 for one in errors.values())


def test_one_motor_file_says_what_was_learnt_of_both(bench: Path, answer: dict[str, Any]) -> None:
    with Store.open(bench / "store") as store:
        name = facts.at(store.ledger).models[answer["model"]].file
        data = store.archive.read(answer["model"])
    network = read_motor(data, name)
    (rig,) = network.configurations
    values = {p["name"]: p["value"] for p in answer["parameters"]}
    assert rig.links[0].terms[0].coefficient == pytest.approx(
        values["conductance.yoke-coolant.constant@other_jacket"], rel=1e-6
    )
    assert network.links[1].terms[0].coefficient == pytest.approx(values["conductance.yoke-coolant.constant"], rel=1e-6)
    assert "# Calibrated on 1_whole, 2_rig (other_jacket) from model" in data.decode()


def test_each_session_replays_better_in_its_own_rig(
    bench: Path, answer: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    words = ["replay", "1_whole", "2_rig", "--model", answer["model"], "--json", "--store", str(bench / "store")]
    assert main(words) == 0
    for run in json.loads(capsys.readouterr().out)["runs"]:
        assert max(run["mae_K"].values()) < 0.2


def test_a_profile_of_what_a_rig_says_itself_has_its_name(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "conductance.yoke-coolant.constant@other_jacket"
    capsys.readouterr()
    words = ["calibrate", "--on", "1_whole", "2_rig", "--profile", name, "--json", "--store", str(bench / "store")]
    assert main(words) == 0
    (one,) = json.loads(capsys.readouterr().out)["profiles"]
    assert one["ci95"][0] < 25.0 < one["ci95"][1]


def test_a_bare_stator_in_free_air_teaches_the_motor_in_a_dc_check(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ["--store", str(tmp_path / "store")]
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR + STATOR, encoding="utf-8")
    (tmp_path / "check.toml").write_text(CHECK, encoding="utf-8")
    (tmp_path / "bench.toml").write_text(can_bench.BENCH, encoding="utf-8")
    amps = np.where(np.arange(2400) < 1500, 18.0, 0.0)

    def slope(t: float, now: NDArray[np.float64]) -> list[float]:
        heat = 240.0 * (amps[min(int(t), 2399)] / 20.0) ** 2 * (1 + can_bench.ALPHA * (now[0] - 20.0))
        through = 12.0 * (now[0] - now[1])
        return [(heat - through) / 900.0, (through - 5.0 * (now[1] - 22.0)) / 3500.0]

    found = solve_ivp(slope, (0, 2399), [22.0, 22.0], t_eval=np.arange(2400.0), max_step=1.0)
    rows = [f"{t},{amps[t]},{w:.3f},{y:.3f},22.0" for t, (w, y) in enumerate(found.y.T)]
    (tmp_path / "dc.csv").write_text("\n".join(["Time,I,winding,yoke,air", *rows]) + "\n", encoding="utf-8")
    dbc = ["--dbc", str(bench / "bench.dbc"), *store]
    assert main(["ingest", str(bench / "1_whole.blf"), "--bench", str(tmp_path / "bench.toml"), *dbc]) == 0
    assert main(["ingest", str(tmp_path / "dc.csv"), "--bench", str(tmp_path / "check.toml"), *store]) == 0
    capsys.readouterr()
    assert main(["calibrate", "--on", "1_whole", "dc", "--json", *store]) == 0
    values = {p["name"]: p["value"] for p in json.loads(capsys.readouterr().out)["parameters"]}
    assert values["conductance.yoke-air.constant@stator_in_air"] == pytest.approx(5.0, rel=0.05)
    assert values["conductance.yoke-coolant.constant"] == pytest.approx(25.0, rel=0.05)
    assert values["conductance.winding-yoke.constant"] == pytest.approx(12.0, rel=0.05)
