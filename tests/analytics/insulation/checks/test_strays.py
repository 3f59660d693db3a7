"""A thermocouple that strays in one check is seen against the checks before and after, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.resistance import CheckTrace
from analytics.insulation.checks.strays import strayed

Floats = NDArray[np.float64]

CHECKS, SENSORS, SAMPLES = 8, 6, 200
NAMES = tuple("abcdef")
NOTHING: dict[str, str] = {}


def checks(stray: Floats, ages: float = 0.0, seed: int = 0) -> list[CheckTrace]:
    """Sensors at places of their own under 400 W for half an hour; `stray` (checks, sensors) [K] grows over the load.
    By the last check the places are apart by `ages` times more."""
    random = np.random.default_rng(seed)
    place = random.normal(0.0, 4.0, SENSORS)
    t = np.asarray(np.arange(SAMPLES) * 10.0, np.float64)
    rise = np.where(t < 200.0, 0.0, 1.0 - np.exp(-(t - 200.0) / 500.0))
    made = []
    for k in range(CHECKS):
        far = place * (1.0 + ages * k / (CHECKS - 1))
        copper = random.uniform(18.0, 28.0) + rise[:, None] * (90.0 + far + stray[k])
        made.append(
            CheckTrace(
                t_s=t,
                copper_degC=np.asarray(copper + 0.1 * random.standard_normal(copper.shape), np.float64),
                copper_names=NAMES,
                iron_degC=np.empty((SAMPLES, 0)),
                iron_names=(),
                ambient_degC=np.empty((SAMPLES, 0)),
                power_W=np.where(t < 200.0, 0.0, 400.0),
            )
        )
    return made


def found(made: list[CheckTrace]) -> list[set[str]]:
    return [set(names) for names in strayed(made, [NOTHING] * len(made))]


@pytest.mark.parametrize(("check", "by_K"), [(0, 8.0), (3, -8.0), (CHECKS - 1, 15.0)])
def test_the_sensor_and_the_check_are_named(check: int, by_K: float) -> None:
    stray = np.zeros((CHECKS, SENSORS))
    stray[check, 2] = by_K
    assert found(checks(stray)) == [{"c"} if k == check else set() for k in range(CHECKS)]


def test_why_says_how_far_it_is() -> None:
    stray = np.zeros((CHECKS, SENSORS))
    stray[3, 2] = -10.0
    said = strayed(checks(stray), [NOTHING] * CHECKS)[3]["c"]
    assert said.endswith("K below where it is in the checks before and after")


@pytest.mark.parametrize("seed", range(5))
def test_places_that_move_apart_as_insulation_ages_are_no_strays(seed: int) -> None:
    assert not any(found(checks(np.zeros((CHECKS, SENSORS)), ages=0.4, seed=seed)))


def test_nothing_is_said_of_three_checks() -> None:
    stray = np.zeros((CHECKS, SENSORS))
    stray[1, 2] = 15.0
    assert not any(found(checks(stray)[:3]))
