"""Sensors that are off by another amount in each check, taken out by what they read before the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.resistance import evaluate_together
from analytics.insulation.checks.trace import CheckTrace
from analytics.insulation.checks.zero import of_one_zero

Floats = NDArray[np.float64]

R, POWER_W, ROOM_degC = 0.02, 150.0, 22.0
STEP_S, REST, LOAD = 10.0, 30, 1080  # samples
NOTHING: dict[str, str] = {}


def check(offset_K: float, lead_K: float = 0.0, seed: int = 0, step_K: float = 0.1) -> CheckTrace:
    """Two lumps, four copper sensors and one in the iron that reads less by `offset_K`; it begins `lead_K` over the
    room with its heads 5 % of that colder than the iron, as they cool faster."""
    since = (np.arange(REST + LOAD) - REST).clip(0) * STEP_S
    rise = 1.0 - np.exp(-since / 1500.0)
    on = np.arange(REST + LOAD) >= REST
    iron = ROOM_degC + lead_K * np.exp(-np.arange(REST + LOAD) * STEP_S / 3000.0) + 60.0 * rise
    copper = iron - 0.05 * lead_K * ~on + R * POWER_W * (1.0 - np.exp(-since / 60.0))
    noise = 0.05 * np.random.default_rng(seed).standard_normal((5, REST + LOAD))
    read = np.round((np.vstack([copper] * 4 + [iron - offset_K]) + noise) / step_K) * step_K
    return CheckTrace(
        t_s=np.asarray(np.arange(REST + LOAD) * STEP_S, np.float64),
        copper_degC=read[:4].T,
        copper_names=("a", "b", "c", "d"),
        iron_degC=read[4:].T,
        iron_names=("yoke",),
        ambient_degC=np.full((REST + LOAD, 1), ROOM_degC),
        power_W=np.where(on, POWER_W, 0.0),
    )


def moved(checks: list[CheckTrace]) -> Floats:
    """By how many kelvins the iron of each was moved."""
    after = of_one_zero(checks, [NOTHING] * len(checks))
    return np.array([float((a.iron_degC - b.iron_degC).mean()) for a, b in zip(after, checks, strict=True)])


OFFSETS_K = (0.3, -0.2, 0.5, 0.1, -0.4)


def test_what_each_check_is_off_by_from_the_others_is_taken_out() -> None:
    found = moved([check(k, seed=i) for i, k in enumerate(OFFSETS_K)])
    assert found == pytest.approx(np.array(OFFSETS_K) - np.mean(OFFSETS_K), abs=0.05)


def test_resistances_repeat_then() -> None:
    found = evaluate_together([check(k, seed=i) for i, k in enumerate(OFFSETS_K)])
    values = np.array([one.resistance_K_per_W or np.nan for one in found])
    assert np.ptp(values) < 0.04 * R  # 0.9 K of 3 K without
    assert values.mean() == pytest.approx(R + np.mean(OFFSETS_K) / POWER_W, rel=0.02)


def test_what_all_checks_share_stays() -> None:
    assert moved([check(1.0, seed=i) for i in range(5)]) == pytest.approx(np.zeros(5), abs=0.02)


def test_rounding_is_no_offset() -> None:
    """Thermometers that show whole kelvins differ at rest by what has nothing to do with the difference under load."""
    checks = [check(0.02 * i, seed=i, step_K=1.0) for i in range(5)]
    assert np.abs(moved(checks)).max() < 0.15


def test_a_specimen_that_is_still_warm_has_a_drop_of_its_own() -> None:
    checks = [check(0.0, lead_K=lead) for lead in (0.0, 0.0, 0.0, 25.0, 12.0)]
    assert moved(checks) == pytest.approx(np.zeros(5), abs=0.02)


def test_two_checks_and_checks_without_rest_or_iron_are_as_they_were() -> None:
    two = [check(0.5), check(-0.5)]
    assert of_one_zero(two, [NOTHING] * 2) == two
    loaded_at_once = [replace(one, power_W=np.full_like(one.power_W, POWER_W)) for one in [*two, check(0.1)]]
    assert of_one_zero(loaded_at_once, [NOTHING] * 3) == loaded_at_once
    without_iron = [replace(one, iron_degC=np.empty((REST + LOAD, 0)), iron_names=()) for one in [*two, check(0.1)]]
    assert of_one_zero(without_iron, [NOTHING] * 3) == without_iron
