"""How far two checks of one specimen differ: from repeats, from smooth courses, or assumed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analytics.insulation.checks.repeatability import (
    ASSUMED,
    ASSUMED_SD,
    BOTH,
    CUT,
    CUT_SQUARE,
    REPEATS,
    SCATTER,
    Repeatability,
    estimate,
)

DOSES = np.arange(16) * 12.0


def _campaign(
    seed: int, repeats: int, day_sd: float = 0.0, sd: float = 0.01
) -> tuple[list[str], list[float], list[float]]:
    """Six specimens of 16 doses whose courses have a corner; `repeats` checks at each dose share the error of their
    day."""
    random = np.random.default_rng(seed)
    rows = [
        (f"S{k}", dose, 0.1 * max(0.0, dose - 96.0) / 96.0 + day + sd * random.standard_normal())
        for k in range(6)
        for dose in DOSES
        for day in [day_sd * random.standard_normal()]
        for _ in range(repeats)
    ]
    who, dose, y = zip(*rows, strict=True)
    return list(who), list(dose), list(y)


def test_repeats_alone_are_pooled_about_their_own_means() -> None:
    found = estimate(["a"] * 3 + ["b"] * 3, [0.0, 0.0, 0.0, 24.0, 24.0, 24.0], [1.0, 1.1, 1.2, 5.0, 5.0, 5.3])
    assert found.source == REPEATS
    assert found.degrees_of_freedom == 4.0
    assert found.sd == pytest.approx(math.sqrt((0.02 + 0.06) / 4))


def test_the_scatter_about_smooth_courses_serves_where_nothing_was_repeated() -> None:
    found = [estimate(*_campaign(seed, 1)) for seed in range(40)]
    assert {f.source for f in found} == {SCATTER}
    assert np.mean([f.sd for f in found]) == pytest.approx(0.01, rel=0.04)
    spread = np.std([f.sd for f in found]) / 0.01
    assert spread == pytest.approx(1.0 / math.sqrt(2.0 * found[0].degrees_of_freedom), rel=0.3)


def test_a_line_however_steep_and_however_spaced_does_not_scatter() -> None:
    dose = np.array([0.0, 1.0, 7.0, 30.0, 31.0, 90.0, 100.0, 130.0, 131.0, 180.0, 200.0, 260.0])
    noise = 0.01 * np.random.default_rng(0).standard_normal(12)
    level = estimate(["a"] * 12, dose, noise)
    steep = estimate(["a"] * 12, dose, noise + 0.01 * dose)
    assert steep.sd == pytest.approx(level.sd, rel=1e-9)


def test_repeats_and_scatter_that_agree_make_one_estimate() -> None:
    found = estimate(*_campaign(0, 2))
    assert found.source == BOTH
    assert found.sd == pytest.approx(0.01, rel=0.15)
    assert found.degrees_of_freedom > 96.0


def test_repeats_of_one_day_do_not_hide_what_days_differ_by() -> None:
    found = estimate(*_campaign(1, 2, day_sd=0.03))
    assert found.source == SCATTER
    assert found.sd > 0.025


def test_repeats_stay_where_days_differ_by_less() -> None:
    who, dose, y = _campaign(2, 2, sd=0.0)
    away = [value + 0.05 * (-1) ** k for k, value in enumerate(y)]  # the mean of each pair is on the course
    assert estimate(who, dose, away).source == REPEATS


def test_one_wild_check_counts_little() -> None:
    who, dose, y = _campaign(3, 1)
    wild = list(y)
    wild[40] += 1.0
    assert estimate(who, dose, wild).sd == pytest.approx(estimate(who, dose, y).sd, rel=0.15)


@pytest.mark.parametrize("rows", [([], [], []), (["a", "a"], [0.0, 12.0], [0.0, 0.1]), (["a"], [math.nan], [0.0])])
def test_three_percent_are_assumed_where_nothing_can_be_had(rows: tuple[list[str], list[float], list[float]]) -> None:
    found = estimate(*rows)
    assert (found.sd, found.source, found.degrees_of_freedom) == (ASSUMED_SD, ASSUMED, math.inf)


def test_the_cut_takes_what_it_should_from_a_normal_variable() -> None:
    z = np.linspace(-12.0, 12.0, 200_001)
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi)
    assert np.trapezoid(np.minimum(z**2, CUT**2) * density, z) == pytest.approx(CUT_SQUARE, rel=1e-7)


def test_each_check_is_uncertain_by_what_the_others_are_and_its_own_evaluation() -> None:
    random = np.random.default_rng(4)
    own = np.where(np.arange(4000) % 16 == 4, 0.02, 0.004)  # a log of each was cut short
    who, dose = [k // 16 for k in range(4000)], np.tile(DOSES, 250)
    y = np.hypot(0.008, own) * random.standard_normal(4000)
    sd = estimate(who, dose, y).of_checks(own)
    assert sd[0] == pytest.approx(np.hypot(0.008, 0.004), rel=0.15)
    assert sd[4] == pytest.approx(np.hypot(0.008, 0.02), rel=0.15)


def test_a_check_that_was_evaluated_as_most_is_uncertain_by_the_repeatability() -> None:
    found = Repeatability(0.01, 50.0, SCATTER)
    assert found.of_checks([0.003, 0.003, 0.003]) == pytest.approx([0.01] * 3)
    assert found.of_checks([0.0, 0.0]) == pytest.approx([0.01] * 2)
    assert found.of_checks([]).shape == (0,)


def test_what_evaluations_have_in_common_is_not_counted_where_checks_repeat_better() -> None:
    evaluations = [0.02, 0.02, 0.04]
    assert Repeatability(0.01, 50.0, SCATTER).of_checks(evaluations) == pytest.approx([0.01, 0.01, 0.02])
    assert Repeatability(0.01, math.inf, ASSUMED).of_checks(evaluations) == pytest.approx(evaluations)
