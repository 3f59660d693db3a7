"""What a motor that stands is fed with: no flux of its magnets in the iron, and in a DC check neither torque nor q
current."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts import facts
from ingest.facts.store import Store
from replay.cli import main
from replay.engine.files.configurations import network_of
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame

Floats = NDArray[np.float64]

SECONDS = 600
TURNS = np.arange(SECONDS) >= 300

HEAD = """\
schema = "whyhot.bench/1"
motor = "motor.toml"
[time]
column = "t"
unit = "s"
"""


def channel(signal: str, quantity: str, unit: str, more: str = "") -> str:
    return f'[[channel]]\nsignal = "{signal}"\nquantity = "{quantity}"\nunit = "{unit}"\n{more}'


YOKE = channel("T_yoke", "temperature", "degC", 'node = "yoke"\n')
AIR = channel("T_air", "temperature", "degC", 'node = "air"\n')
SPEED, FLUX = channel("n", "speed", "rpm"), channel("psi", "flux", "Wb")


def ingested(folder: Path, motor: str, bench: str, columns: Mapping[str, Floats], kind: str) -> list[str]:
    """`--store` and its folder, where the table was ingested."""
    rows = [",".join(columns), *(",".join(f"{v:.6g}" for v in row) for row in zip(*columns.values(), strict=True))]
    files = {"motor.toml": motor, "bench.toml": bench, "1_run.csv": "\n".join(rows) + "\n"}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    store = ["--store", str(folder / "store")]
    log = ["ingest", str(folder / "1_run.csv"), "--bench", str(folder / "bench.toml"), "--kind", kind]
    assert main([*log, *store]) == 0
    return store


def frame_of(store: Sequence[str]) -> InputFrame:
    with Store.open(Path(store[1])) as opened:
        known = facts.at(opened.ledger)
        session = known.session("1_run")
        network = network_of(opened, known, session, next(iter(known.models)))
        return session_frame(session, load(opened, known, session), network)


# --- Flux ------------------------------------------------------------------------------------------------------------

IRON = """\
schema = "whyhot.motor/1"
name = "iron"
[scale]
flux_Wb = 0.1
[[node]]
name = "yoke"
capacity = 600.0
[[boundary]]
name = "air"
[[link]]
between = ["yoke", "air"]
terms = [{coefficient = 2.0}]
[[source]]
node = "yoke"
terms = [{coefficient = 60.0, flux = 2.0}]
"""


def turned(start_s: float = 300.0) -> dict[str, Floats]:
    """A rotor that begins to turn, with the magnets' flux linkage as an observer gives it all along; a reading of its
    speed that trembles at standstill."""
    t = np.arange(SECONDS, dtype=np.float64)
    speed = np.where(t >= start_s, 3000.0, np.where(np.arange(SECONDS) % 2, 2.0, -2.0))
    return {"t": t, "n": speed, "psi": np.full(SECONDS, 0.2), "T_yoke": np.full(SECONDS, 20.0), "T_air": 20.0 + 0 * t}


def test_flux_is_zero_at_standstill_and_as_measured_when_it_turns(tmp_path: Path) -> None:
    store = ingested(tmp_path, IRON, HEAD + SPEED + FLUX + YOKE + AIR, turned(), "drive")
    frame = frame_of(store)
    turns = frame.inputs["speed_rpm"] > 100
    (squared,) = frame.features.T
    assert squared[turns] == pytest.approx(4.0)
    assert not squared[~turns].any() and np.count_nonzero(~turns) == pytest.approx(300 / frame.step_s, abs=1)
    assert frame.inputs["flux_Wb"] == pytest.approx(0.2)  # what was recorded is shown


def test_flux_begins_with_the_first_turn_within_a_step(tmp_path: Path) -> None:
    columns = {name: np.interp(np.arange(0, SECONDS, 0.25), np.arange(SECONDS), v) for name, v in turned().items()}
    columns["n"] = np.where(columns["t"] >= 300.25, 3000.0, 0.0)
    store = ingested(tmp_path, IRON, HEAD + SPEED + FLUX + YOKE + AIR, columns, "drive")
    frame = frame_of(store)
    at = int(np.flatnonzero(frame.features[:, 0])[0])
    assert frame.step_s == 0.5
    assert frame.features[at - 1 : at + 2, 0] == pytest.approx([0.0, 2.0, 4.0])


def test_a_motor_at_rest_is_not_heated_by_the_flux_of_its_magnets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ingested(tmp_path, IRON, HEAD + SPEED + FLUX + YOKE + AIR, turned(start_s=SECONDS), "drive")
    capsys.readouterr()
    assert main(["replay", "--json", *store]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["mae_K"]["yoke"] < 0.01


def test_without_a_speed_nothing_says_where_the_flux_is_zero(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ingested(tmp_path, IRON, HEAD + FLUX + YOKE + AIR, turned(), "drive")
    capsys.readouterr()
    assert main(["replay", *store]) == 2
    assert capsys.readouterr().err.strip() == (
        'session 1_run: the motor file uses "flux", which is 0 at standstill, and no channel of this session gives '
        'speed: add a [[channel]] or [[derived]] with quantity = "speed" to the bench file.'
    )


# --- A DC check of a bare stator -------------------------------------------------------------------------------------

STATOR = """\
schema = "whyhot.motor/1"
name = "stator"
[scale]
speed_rpm = 6000.0
current_A = 20.0
torque_Nm = 30.0
flux_Wb = 0.1
[[node]]
name = "yoke"
capacity = 600.0
[[node]]
name = "rotor"
capacity = 900.0
[[boundary]]
name = "air"
[[link]]
between = ["yoke", "air"]
terms = [{coefficient = 2.0}]
[[link]]
between = ["rotor", "yoke"]
terms = [{coefficient = 1.0}]
[[source]]
node = "yoke"
terms = [{coefficient = 40.0, current = 2.0}, IRON]
[[configuration]]
name = "bare"
remove = ["rotor"]
"""
FED = {"t": np.arange(SECONDS, dtype=np.float64), "I": np.full(SECONDS, 20.0), "T_air": np.full(SECONDS, 20.0)}
RISE = 20.0 * (1 - np.exp(-FED["t"] / 300.0))  # 40 W through 2 W/K, 600 J/K
IRON_LAWS = {
    "a map": '{coefficient = 1.0, map = "iron.csv"}',
    "q current": "{coefficient = 50.0, current_q = 2.0}",
    "torque": "{coefficient = 50.0, torque = 1.0}",
    "flux": "{coefficient = 50.0, flux = 2.0}",
}
CHECK = HEAD.replace("[time]", 'configuration = "bare"\n[time]') + channel("I", "current_dc", "A") + AIR + YOKE


def checked(folder: Path, law: str, more: str = "", **columns: Floats) -> list[str]:
    (folder / "iron.csv").write_text("rpm/Nm,0,30\n0,0,0\n6000,200,300\n", encoding="utf-8")
    return ingested(
        folder, STATOR.replace("IRON", law), CHECK + more, {**FED, "T_yoke": 20.0 + RISE, **columns}, "dc_check"
    )


def replayed(store: Sequence[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["replay", "--json", *store]) == 0, capsys.readouterr().err
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    return dict(run)


@pytest.mark.parametrize("law", list(IRON_LAWS))
def test_a_stator_without_a_rotor_needs_no_channel_of_what_it_cannot_have(
    law: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = replayed(checked(tmp_path, IRON_LAWS[law]), capsys)
    assert run["mae_K"]["yoke"] < 0.1


def test_what_is_measured_in_a_dc_check_comes_before_what_is_supposed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = checked(tmp_path, IRON_LAWS["torque"], channel("M", "torque", "Nm"), M=np.full(SECONDS, 6.0))
    assert replayed(store, capsys)["mae_K"]["yoke"] > 1.0  # 10 W more
    frame = frame_of(store)
    assert frame.inputs["torque_Nm"] == pytest.approx(6.0)


def test_a_frame_shows_no_torque_that_nobody_asks_for(tmp_path: Path) -> None:
    frame = frame_of(checked(tmp_path, "{coefficient = 50.0, speed = 1.5}"))
    assert "speed_rpm" in frame.inputs and "torque_Nm" not in frame.inputs and "flux_Wb" not in frame.inputs


def test_the_power_that_feeds_a_standing_stator_is_its_heat(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    meter = channel("P", "power", "W", 'role = "observed"\n')
    store = checked(tmp_path, IRON_LAWS["a map"], meter, P=40.0 + 0.1 * np.sin(FED["t"]))
    (one,) = replayed(store, capsys)["meters"]
    assert one["channel"] == "P" and one["mae"] < 0.2
