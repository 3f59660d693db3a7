"""Sensors that died, stuck or fell off, among sensors that are right."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.sensors import unusable

Floats = NDArray[np.float64]
NAMES = ("A", "B", "C", "D")


def right() -> Floats:
    """(N, 4) rising by about 100 K, in steps of 0.1 K."""
    t = np.arange(0.0, 10_800.0, 10.0)
    rise = 100.0 * (1.0 - np.exp(-t / 2000.0))
    values = 20.0 + rise[:, None] * [1.0, 0.9, 1.1, 0.8] + np.random.default_rng(1).normal(0.0, 0.05, (t.size, 4))
    return np.asarray(np.round(values, 1))


def test_right_sensors_are_all_used() -> None:
    assert unusable(NAMES, right()) == {}


def test_a_sensor_without_a_tenth_of_its_samples_is_left_out() -> None:
    values = right()
    values[:150, 1] = np.nan
    assert unusable(NAMES, values) == {"B": "14 % of its samples are missing or impossible"}


def test_an_open_thermocouple_is_left_out() -> None:
    values = right()
    values[300:, 2] = 1372.0
    assert unusable(NAMES, values) == {"C": "72 % of its samples are missing or impossible"}


def test_a_sensor_that_sticks_while_the_others_move_is_left_out() -> None:
    values = right()
    values[100:400, 0] = values[100, 0]
    found = unusable(NAMES, values)
    assert list(found) == ["A"]
    assert found["A"].startswith(f"stuck at {values[100, 0]:.1f} degC while the others move by ")


def test_a_sensor_that_fell_off_is_left_out() -> None:
    values = right()
    values[:, 3] = 22.0 + 0.1 * (np.arange(len(values)) % 3)
    assert unusable(NAMES, values)["D"].startswith("moves by 0.2 K while the others move by ")


def test_sensors_of_a_whole_kelvin_repeat_themselves_rightly() -> None:
    assert unusable(NAMES, np.round(right())) == {}


def test_sensors_of_a_motor_that_is_at_its_temperature_repeat_themselves_rightly() -> None:
    values = np.round(60.0 + np.random.default_rng(2).normal(0.0, 0.2, (500, 4)))
    values[:, 0] = 60.0
    assert unusable(NAMES, values) == {}


@pytest.mark.parametrize("count", [0, 1, 2])
def test_of_fewer_than_three_sensors_only_missing_samples_are_seen(count: int) -> None:
    values = right()[:, :count]
    assert unusable(NAMES[:count], values) == {}
    values[:] = np.nan
    assert list(unusable(NAMES[:count], values)) == list(NAMES[:count])
