"""Remaining dose: exact where it is known exactly, borrowed where it is not, and inside its interval as often as
said."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.fleet.remaining import RemainingLife, remaining

Floats = NDArray[np.float64]


def _fleet(
    rates: Floats, checks: NDArray[np.int64], sd: float, seed: int = 0, bent: Callable[[Floats], Floats] = np.zeros_like
) -> tuple[RemainingLife, ...]:
    random = np.random.default_rng([seed, 3])
    who = np.repeat(np.arange(len(rates)), checks)
    dose = np.concatenate([np.arange(n, dtype=np.float64) * 12.0 for n in checks])
    y = -3.8 + 0.05 * random.standard_normal(len(rates))[who] + rates[who] * dose + bent(dose)
    y += sd * random.standard_normal(len(who))
    return remaining([f"M{k:03d}" for k in who], [f"B{k % 3}" for k in who], dose, y, sd)


def test_without_errors_the_end_is_where_the_line_reaches_the_criterion() -> None:
    rates = 3e-3 + 1e-3 * np.linspace(-1.0, 1.0, 9)
    for life, rate in zip(_fleet(rates, np.full(9, 10), 1e-7), rates, strict=True):
        assert life.dose_h == 108.0
        assert life.end_dose_h == pytest.approx(np.log(2.0) / rate, rel=1e-3)
        assert life.remaining_h == pytest.approx(np.log(2.0) / rate - 108.0, rel=2e-3)
        assert life.slope_percent_per_100h == pytest.approx(1e4 * rate, rel=1e-4)
        low, high = life.end_ci95_dose_h
        assert low is not None
        assert high is not None
        assert low <= np.log(2.0) / rate <= high


def test_one_that_is_over_has_nothing_left() -> None:
    lives = _fleet(np.full(9, 0.02), np.full(9, 10), 1e-4)
    assert {life.remaining_h for life in lives} == {0.0}


def test_one_that_does_not_age_has_no_end() -> None:
    lives = _fleet(np.full(9, -1e-3), np.full(9, 10), 1e-4)
    assert all(life.end_dose_h is None and life.remaining_h is None for life in lives)


def test_few_checks_borrow_and_have_the_wider_interval() -> None:
    random = np.random.default_rng(1)
    rates = 3e-3 + 3e-4 * random.standard_normal(40)
    lives = _fleet(rates, np.array([20] * 39 + [3]), 0.03)
    few, many = lives[-1], lives[:-1]
    assert few.end_dose_h == pytest.approx(np.log(2.0) / 3e-3, rel=0.25)
    assert few.slope_sd > 1.5 * np.median([life.slope_sd for life in many])


def test_a_part_of_the_fleet_at_a_time_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rates, checks = np.linspace(2e-3, 4e-3, 9), np.arange(3, 12)
    whole = _fleet(rates, checks, 0.03)
    monkeypatch.setattr("analytics.insulation.fleet.remaining.AT_ONCE", 4)
    for part, one in zip(_fleet(rates, checks, 0.03), whole, strict=True):
        assert part.specimen == one.specimen
        assert part.end_dose_h == pytest.approx(one.end_dose_h, rel=1e-12)


def test_ends_lie_in_their_intervals_as_often_as_said() -> None:
    inside, total = 0, 0
    for seed in range(6):
        random = np.random.default_rng([seed, 4])
        rates = 3e-3 + 8e-4 * random.standard_normal(60)
        for life, rate in zip(_fleet(rates, random.integers(3, 22, 60), 0.03, seed), rates, strict=True):
            low, high = life.end_ci95_dose_h
            end = np.log(2.0) / rate
            inside += (low is not None and low <= end) and (high is None or end <= high)
            total += 1
    assert inside / total == pytest.approx(0.95, abs=0.03)


def test_a_course_that_levels_off_lasts_longer_than_its_first_slope_says() -> None:
    def level(dose: Floats) -> Floats:
        return np.asarray(0.2 * -np.expm1(-dose / 30.0), np.float64)

    lives = _fleet(np.full(30, 1e-3), np.full(30, 18), 0.01, bent=level)
    ends = np.array([life.end_dose_h for life in lives], np.float64)
    assert np.median(ends) == pytest.approx((np.log(2.0) - 0.2) / 1e-3, rel=0.12)


def test_two_specimens_are_too_few_and_one_dose_says_nothing() -> None:
    assert remaining(["a", "a", "b"], [None] * 3, [0.0, 12.0, 0.0], [0.0, 0.1, 0.0], 0.01) == ()
    assert remaining(["a", "b", "c"], [None] * 3, [0.0, 0.0, 0.0], [0.0, 0.1, 0.0], 0.01) == ()
