"""The observer of insulation: against the joint Gaussian of a whole course, and by hand where that is short."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.insulation.ageing_state import WALK, Check, State, by_law, filtered, onwards
from twin.motor.ageing_law import Ageing

Floats = NDArray[np.float64]

LAW = Ageing(above_degC=180.0, percent_per_100h=-3.0, sd=2.0, from_h=20.0)
DOSES = (0.0, 0.0, 12.0, 24.0, 24.0, 60.0, 140.0)


def course(doses: tuple[float, ...], seed: int = 3) -> list[Check]:
    random = np.random.default_rng(seed)
    return [Check(dose, -3.0 + 0.0005 * dose + 0.02 * random.standard_normal(), 0.024) for dose in doses]


def conditioned(checks: list[Check], law: Ageing, upto: int) -> tuple[Floats, Floats]:
    """Mean and covariance of (g at each of the checks, r) given the first `upto` checks, m eliminated by
    differences."""
    size = len(checks)
    dose = np.array([check.dose_h for check in checks])
    counts = np.array([law.counting_100h(0.0, d) for d in dose])
    mean = np.append(law.rate * counts, law.rate)
    covariance = law.rate_sd**2 * np.outer(np.append(counts, 1.0), np.append(counts, 1.0))
    covariance[:size, :size] += WALK**2 * np.minimum.outer(dose, dose) / 100.0
    if upto < 2:
        return mean, covariance
    reads = np.zeros((upto - 1, size + 1))
    reads[:, 0] = 1.0
    reads[np.arange(upto - 1), np.arange(1, upto)] = -1.0
    noise = np.diag([check.sd**2 for check in checks[1:upto]]) + checks[0].sd ** 2
    read = np.array([check.ln_resistance - checks[0].ln_resistance for check in checks[1:upto]])
    gain = covariance @ reads.T @ np.linalg.inv(reads @ covariance @ reads.T + noise)
    return mean + gain @ (read - reads @ mean), covariance - gain @ reads @ covariance


def as_state(mean: Floats, covariance: Floats, at: int, dose_h: float) -> tuple[float, ...]:
    return (
        dose_h,
        mean[at],
        math.sqrt(max(covariance[at, at], 0.0)),
        mean[-1],
        math.sqrt(covariance[-1, -1]),
        covariance[at, -1],
    )


def told(state: State) -> tuple[float, ...]:
    shared = state.correlation * state.ln_factor_sd * state.rate_sd
    return state.dose_h, state.ln_factor, state.ln_factor_sd, state.rate_per_100h, state.rate_sd, shared


@pytest.mark.parametrize("doses", [DOSES, (30.0, 42.0, 90.0)])
def test_each_state_is_the_gaussian_of_the_checks_so_far(doses: tuple[float, ...]) -> None:
    checks = course(doses)
    for k, state in enumerate(filtered([checks], LAW)[0]):
        expected = as_state(*conditioned(checks, LAW, k + 1), k, doses[k])
        assert told(state) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_specimens_side_by_side_have_the_states_that_each_has_alone() -> None:
    many = [course(DOSES), [], course((30.0, 42.0, 90.0), seed=4), course(DOSES[:2], seed=5)]
    assert filtered(many, LAW) == [filtered([checks], LAW)[0] for checks in many]
    assert filtered([], LAW) == []


def test_a_first_check_when_new_says_nothing_of_a_factor() -> None:
    ((state,),) = filtered([[Check(0.0, -2.5, 0.024)]], LAW)
    assert (state.factor, state.ln_factor_sd) == (1.0, 0.0)
    assert (state.rate_per_100h, state.rate_sd) == pytest.approx((LAW.rate, LAW.rate_sd))


def test_two_sure_checks_give_the_factor_that_lies_between_them() -> None:
    law = Ageing(180.0, 0.0, sd=10.0)
    ((first, last),) = filtered([[Check(0.0, math.log(0.050), 1e-6), Check(100.0, math.log(0.055), 1e-6)]], law)
    assert first.factor == 1.0
    assert last.factor == pytest.approx(0.050 / 0.055, rel=1e-6)
    share = 0.1**2 / (0.1**2 + WALK**2)
    assert last.rate_per_100h == pytest.approx(share * math.log(0.050 / 0.055), rel=1e-6)


def test_between_checks_the_state_goes_on_by_its_own_rate_and_gets_less_sure() -> None:
    state = State(40.0, -0.02, 0.01, -0.05, 0.02, 0.5)
    later = onwards(state, 90.0, replace(LAW, from_h=60.0))
    assert later.dose_h == 90.0
    assert later.ln_factor == pytest.approx(-0.02 - 0.3 * 0.05)
    variance = 0.01**2 + 2 * 0.3 * 0.5 * 0.01 * 0.02 + 0.3**2 * 0.02**2 + 0.5 * WALK**2
    assert later.ln_factor_sd == pytest.approx(math.sqrt(variance))
    assert told(onwards(state, 10.0, LAW)) == pytest.approx(told(state))


def test_the_law_alone_is_a_course_without_checks() -> None:
    state = by_law(120.0, LAW)
    assert state.ln_factor == pytest.approx(math.log(0.97))
    assert state.ln_factor_sd == pytest.approx(math.hypot(LAW.rate_sd, math.sqrt(1.2) * WALK))


def test_falling_doses_and_sure_checks_are_refused() -> None:
    with pytest.raises(ValueError, match="check 2: dose 5 h after 12 h"):
        filtered([[Check(12.0, 0.0, 0.02), Check(5.0, 0.0, 0.02)]], LAW)
    with pytest.raises(ValueError, match="sd 0"):
        filtered([[Check(12.0, 0.0, 0.0)]], LAW)
