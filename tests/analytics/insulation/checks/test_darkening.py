"""Surfaces that lose more heat from check to check, beside insulation that changes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.darkening import MOST, cold_resistance, surface_shift

Floats = NDArray[np.float64]
CHECKS = 9
DARKER = 0.013 * (1.0 - np.exp(-np.arange(CHECKS) / 3.0))  # of the heat that no longer goes through the insulation


def test_a_fall_that_only_the_value_at_rest_shows_is_taken_back() -> None:
    rest, cold = 0.02 * np.exp(-DARKER), np.full(CHECKS, 0.036)
    assert surface_shift(rest, cold) == pytest.approx(DARKER, abs=0.0015)


def test_the_error_of_a_checks_thermocouples_is_not_taken_for_a_surface() -> None:
    factor = np.exp(np.random.default_rng(1).normal(0.0, 0.01, CHECKS))
    shift = surface_shift(0.02 * factor, 0.036 * factor)
    assert np.max(np.abs(shift)) < 0.003


def test_insulation_that_gets_worse_is_left_alone() -> None:
    worse = np.linspace(0.0, 0.3, CHECKS)
    assert surface_shift(0.02 * np.exp(worse), 0.036 * np.exp(0.81 * worse)) == pytest.approx(np.zeros(CHECKS))


def test_insulation_that_gets_better_keeps_nearly_all_of_its_fall() -> None:
    better = -np.linspace(0.0, 0.1, CHECKS)
    shift = surface_shift(0.02 * np.exp(better), 0.036 * np.exp(0.81 * better))
    assert np.max(shift) < 0.01
    assert surface_shift(0.02 * np.exp(4.0 * better), np.full(CHECKS, 0.036)).max() == MOST


def test_a_check_that_was_stopped_early_lies_between_its_neighbours() -> None:
    rest, cold = 0.02 * np.exp(-DARKER), np.full(CHECKS, 0.036)
    whole = surface_shift(rest, cold)
    cold[4] = np.nan
    assert surface_shift(rest, cold)[4] == pytest.approx((whole[3] + whole[5]) / 2.0)
    assert surface_shift(rest, np.full(CHECKS, np.nan)) == pytest.approx(np.zeros(CHECKS))


def heated(film: float) -> tuple[Floats, Floats]:
    """(times, excess of the iron) of a body of 9,000 J/K under 500 W."""
    t = np.arange(0.0, 7200.0, 10.0)
    return t, 500.0 / film * (1.0 - np.exp(-t * film / 9000.0))


def test_the_intercept_is_free_of_what_the_heads_lose() -> None:
    t, excess = heated(5.0)
    for loss in (1.0, 1.3):
        drop = 0.03 * (500.0 * 0.8 - loss * excess)
        found = cold_resistance(t, drop, excess, np.full(t.size, 500.0))
        assert found == pytest.approx(0.03 * 0.8)


def test_a_short_load_or_a_cooled_motor_has_no_intercept() -> None:
    t, excess = heated(5.0)
    power = np.full(t.size, 500.0)
    assert cold_resistance(t[:200], excess[:200], excess[:200], power[:200]) is None
    t, cooled = heated(60.0)
    assert cold_resistance(t, 10.0 - 0.1 * cooled, cooled, power) is None
