"""Hours of discharge: counted from the logs of voltage tests and electrical checks, and weighed beside heat and
thermal cycles."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.bench.resolving import ResolvedChannel
from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from ingest.texts.quantities import Conversion
from plant import insulation_campaign
from plant.bare_stator import Rig
from plant.insulation_campaign import Campaign
from plant.timeline import Plan
from replay.cli import main
from replay.studies.ageing.discharge import Electrical, discharge_of, electrical_of

HOUR_NS = 3_600_000_000_000
SPEC = ResolvedChannel("U", "voltage", "V", conversion=Conversion(), signals=(), role="input")
RATE_PER_100H = 0.6
PLAN = Plan(
    stators=3,
    cycles=6,
    forms=("none",),
    early_stops=0.0,
    dead=0.0,
    period_s=60.0,
    rig=Rig(step_s=10.0),
    test_V=(1300.0, 1300.0, 1300.0, 600.0, 600.0, 600.0),  # the inception voltage is 980 V when new
    test_h=(10.0,),
    test_shift=3,
)


@dataclass(frozen=True)
class Asked:
    store: Path
    truth: Campaign
    answer: dict[str, Any]

    @property
    def stress(self) -> dict[str, dict[str, Any]]:
        return {one["name"]: one for one in self.answer["stress"]}


def _asked(folder: Path, plan: Plan) -> Asked:
    written = insulation_campaign.write(folder / "logs", 3, plan)
    store, target = folder / "store", folder / "answer.json"
    for words in written.ingest:
        assert main([*words, "--store", str(store)]) == 0
    assert main(["ageing", "--store", str(store), "--json", str(target)]) == 0
    return Asked(store, written.truth, json.loads(target.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Asked:
    return _asked(tmp_path_factory.mktemp("worn"), replace(PLAN, discharge_rate=RATE_PER_100H))


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Asked:
    return _asked(tmp_path_factory.mktemp("sound"), PLAN)


def test_hours_of_discharge_are_those_above_the_inception_voltage(worn: Asked) -> None:
    for stator, found in zip(worn.truth.stators, worn.answer["specimens"], strict=True):
        true = [check.discharge_h for check in stator.checks]
        assert true[3] == (0.0 if stator.name == "S02" else 30.0)
        assert true[-1] == 30.0
        assert [check["discharge_h"] for check in found["checks"]] == pytest.approx(true, abs=0.02 * len(true))
        assert [check["cycles"] for check in found["checks"]] == [check.cycle for check in stator.checks]


def true_percent(truth: Campaign) -> float:
    """What 100 h of discharge truly did to ln R beside the heat."""
    y, x = [], []
    for stator in truth.stators:
        of = np.array([(np.log(c.resistance_K_per_W), c.discharge_h / 100.0, c.dose_h / 100.0) for c in stator.checks])
        y.append((of - of.mean(axis=0))[:, 0])
        x.append((of - of.mean(axis=0))[:, 1:])
    return float(100.0 * np.linalg.lstsq(np.concatenate(x), np.concatenate(y), rcond=None)[0][0])


def test_what_discharge_does_is_told_from_heat_and_cycles(worn: Asked) -> None:
    discharge = worn.stress["discharge"]
    assert discharge["not_told_from"] == []
    assert abs(discharge["percent"] - true_percent(worn.truth)) < 3 * discharge["sd_percent"]
    assert discharge["percent"] > 4 * discharge["sd_percent"]
    assert worn.stress["heat"]["not_told_from"] == ["thermal cycles"], "all cycles are of one length"
    assert any("discharge did part of it" in note for note in worn.answer["notes"]), "the law counts heat alone"


def test_where_discharge_does_nothing_nothing_is_put_down_to_it(sound: Asked) -> None:
    discharge = sound.stress["discharge"]
    assert abs(discharge["percent"]) < 3 * discharge["sd_percent"]
    assert discharge["sd_percent"] < 100 * RATE_PER_100H / 4
    assert sound.answer["notes"] == []


def test_the_view_has_what_each_check_had_behind_it(worn: Asked, capsys: pytest.CaptureFixture[str]) -> None:
    query = (
        "SELECT max(discharge_h) AS discharge, max(cycles) AS cycles FROM conductivity_by_cycle WHERE specimen = 'S01'"
    )
    assert main(["sql", query, "--store", str(worn.store), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["discharge"] == pytest.approx(worn.truth.stators[0].checks[-1].discharge_h, abs=0.2)
    assert row["cycles"] == 6


# --- on sessions made by hand ----------------------------------------------------------------------------------------


def session(name: str, kind: str, start_h: float, hours: float = 10.0) -> SessionRecorded:
    return SessionRecorded(
        session=f"{name}-id", name=name, kind=kind, kind_why="", specimen="S01", batch=None, bench=None,
        configuration=None, attributes={}, absolute=True, start_ns=round(start_h * HOUR_NS),
        end_ns=round((start_h + hours) * HOUR_NS), files=[],
    )  # fmt: skip


def test_without_an_inception_voltage_before_it_a_test_counts_no_hours_and_says_so() -> None:
    sessions = [session("dc_1", "dc_check", 0), session("oven", "ageing", 10), session("ie", "insulation_check", 30)]
    sessions += [session("dc_2", "dc_check", 40)]
    said = {"oven-id": Electrical(a_test(sessions[1], 1000.0)), "ie-id": Electrical(None, ((30 * HOUR_NS, 900.0),))}
    found = discharge_of(sessions, True, said)
    assert [found.before[one.session] for one in sessions] == [0.0, 0.0, None, None]
    assert "session oven has a test voltage, and no inception voltage was measured before it" in (found.why or "")


def test_the_last_inception_voltage_counts_and_a_test_that_goes_on_counts_up_to_the_check() -> None:
    sessions = [
        session("ie_1", "insulation_check", 0),
        session("oven_1", "ageing", 10),
        session("dc_1", "dc_check", 14, 1.0),
        session("ie_2", "insulation_check", 30),
        session("oven_2", "ageing", 40),
        session("dc_2", "dc_check", 60),
    ]
    said = {"ie_1-id": Electrical(None, ((0, 1200.0),)), "ie_2-id": Electrical(None, ((30 * HOUR_NS, 900.0),))}
    quiet = said | {name: Electrical(a_test(one, 1000.0)) for name, one in ovens(sessions).items()}
    loud = said | {name: Electrical(a_test(one, 1300.0)) for name, one in ovens(sessions).items()}
    assert discharge_of(sessions, True, quiet).before["dc_2-id"] == pytest.approx(10.0), (
        "900 V was measured before oven_2"
    )
    before = discharge_of(sessions, True, loud).before
    assert before["dc_1-id"] == pytest.approx(4.0, abs=0.02)
    assert before["dc_2-id"] == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("kind", "volts", "asked"), [("ageing", 400.0, True), ("ageing", 200.0, False), ("wltp", 400.0, False)]
)
def test_a_voltage_that_cannot_discharge_in_air_asks_for_no_inception_voltage(
    kind: str, volts: float, asked: bool
) -> None:
    one = session("oven", kind, 0)
    t_ns, values = a_test(one, volts)
    channel = ChannelData(
        spec=SPEC, t_ns=t_ns, value=values, record=np.arange(len(t_ns)), raw=np.zeros(len(t_ns), np.int64), raws=("a",)
    )  # fmt: skip
    assert (electrical_of(one, [channel]).tested is not None) == asked
    checked = electrical_of(one, [replace(channel, spec=replace(SPEC, quantity="inception_voltage"))])
    assert checked.inceptions == ((0, volts),)


def test_of_a_table_of_checks_each_test_has_the_inception_voltage_that_was_measured_before_it() -> None:
    table, after = session("ie", "insulation_check", 0, 50), session("dc", "dc_check", 60)
    first, second = session("oven_1", "ageing", 10), session("oven_2", "ageing", 40)
    values = [1210.0, 1190.0, 900.0, 910.0, 905.0]
    t_ns = np.array([0, 0.1, 30, 30.1, 30.2]) * HOUR_NS
    channel = ChannelData(
        spec=replace(SPEC, quantity="inception_voltage"), t_ns=t_ns.astype(np.int64), value=np.array(values),
        record=np.arange(5), raw=np.zeros(5, np.int64), raws=("a",),
    )  # fmt: skip
    said = {table.session: electrical_of(table, [channel])}
    assert said[table.session].inceptions == ((0, 1200.0), (30 * HOUR_NS, 905.0))
    said |= {one.session: Electrical(a_test(one, 1000.0)) for one in (first, second)}
    assert discharge_of([table, first, second, after], True, said).before[after.session] == pytest.approx(10.0)


def ovens(sessions: list[SessionRecorded]) -> dict[str, SessionRecorded]:
    return {one.session: one for one in sessions if one.kind == "ageing"}


def a_test(of: SessionRecorded, volts: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    t_ns = np.arange(of.start_ns, of.end_ns + 1, 60_000_000_000, dtype=np.int64)
    return t_ns, np.full(len(t_ns), volts)
