"""Lives from courses: between which doses conductivity fell by half, and the Arrhenius law that they tell."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ingest.facts.events import SessionRecorded
from replay.engine.specimen.heat_history import HoursByTemperature
from replay.studies.ageing.assessment import AssessedLives, HotHours
from replay.studies.ageing.dc_checks import Evaluated
from replay.studies.ageing.history import History, Point
from replay.studies.ageing.lives import lives_of

BOLTZMANN = 8.617333262e-5
SESSION = SessionRecorded(
    session="s", name="dc", kind="dc_check", kind_why="", specimen="S", batch=None, bench=None, configuration=None,
    attributes={}, absolute=False, start_ns=0, end_ns=1, files=[],
)  # fmt: skip


def history(degC: float, life_h: float, checks: int = 30, span: float = 2.0) -> History:
    """ln R rises evenly and is up by ln 2 at `life_h`; checked until `span` times that."""
    doses = np.linspace(0.0, span * life_h, checks)
    points = [
        Point(
            SESSION,
            None,
            float(dose),
            None,
            Evaluated("s", None, 0.02 * 2.0 ** (dose / life_h), float(dose), None, None),
            None,
        )
        for dose in doses
    ]
    hot = HotHours("s", "oven", "W", HoursByTemperature(np.array([25.0, degC]), np.array([500.0, float(doses[-1])])))
    return History(points=points, hours=[hot])


def lives(histories: dict[str, History]) -> AssessedLives:
    sd = {name: [0.005] * len(history.points) for name, history in histories.items()}
    return lives_of(histories, sd, "conductivity -50 %")


def life_at(degC: float, factor: float, eV: float = 1.05) -> float:
    return factor * 1000.0 * math.exp(eV / BOLTZMANN * (1.0 / (degC + 273.15) - 1.0 / (230.0 + 273.15)))


def test_three_temperatures_tell_energy_and_index() -> None:
    factors = np.exp(0.15 * np.array([-1.2, -0.4, 0.4, 1.2]))
    given = {
        f"{degC}-{k}": history(degC, life_at(degC, f)) for degC in (200.0, 220.0, 240.0) for k, f in enumerate(factors)
    }
    found = lives(given)
    assert len(found.lives) == 12
    for one in found.lives:
        true = life_at(one.degC, float(factors[int(one.specimen[-1])]))
        assert one.lower_h <= true <= (one.upper_h or 0.0)
    assert found.law is not None
    energy = found.law.activation_energy_eV
    assert energy["ci95"][0] < 1.05 < energy["ci95"][1]
    assert energy["value"] == pytest.approx(1.05, abs=0.1)
    assert found.law.median_h_at_180degC["value"] == pytest.approx(life_at(180.0, 1.0), rel=0.3)
    assert found.law.temperature_index_degC is not None
    assert found.why is None


def test_two_temperatures_tell_an_energy_and_why_there_is_no_index() -> None:
    given = {
        f"{degC}-{k}": history(degC, life_at(degC, f)) for degC in (210.0, 230.0) for k, f in enumerate((0.9, 1.0, 1.1))
    }
    found = lives(given)
    assert found.law is not None
    assert found.law.temperature_index_degC is None
    assert "three" in str(found.law.why_no_index)


def test_where_nobody_has_reached_the_criterion_there_is_no_law() -> None:
    found = lives({"S": history(230.0, 1000.0, span=0.3)})
    assert found.lives[0].upper_h is None
    assert (found.law, found.why) == (None, "no specimen has reached the criterion yet")


def test_a_specimen_whose_temperature_is_not_known_has_no_life() -> None:
    some = history(230.0, 1000.0)
    assert lives({"S": History(points=some.points)}).lives == []


def test_rows_of_a_table_that_say_their_temperature_have_lives() -> None:
    whole = history(230.0, 400.0)
    said = [228.8, 231.2] * 15
    points = [at(one, degC) for one, degC in zip(whole.points, said, strict=True)]
    found = lives_of({"S": History(points=points)}, {"S": [0.02] * len(points)}, "half")
    logged = lives_of({"S": whole}, {"S": [0.02] * len(points)}, "half")
    assert found.lives == logged.lives and found.lives[0].degC == 230.0
    unsaid = History(points=[at(one, None) for one in points])
    assert lives_of({"S": unsaid}, {"S": [0.02] * len(points)}, "half").lives == []


def at(point: Point, degC: float | None) -> Point:
    assert isinstance(point.found, Evaluated)
    return replace(point, found=replace(point.found, degC=degC))
