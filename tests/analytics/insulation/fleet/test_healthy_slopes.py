"""What slopes of healthy specimens are like: learnt from normal and from log-normal ones, whatever their errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from analytics.insulation.fleet.healthy_slopes import HealthySlopes, healthy_slopes

Floats = NDArray[np.float64]

CENTRE, TAU = 3.0, 1.2


def _learnt(off: Floats, variance: Floats) -> HealthySlopes:
    everybody = np.ones(len(off), np.bool_)
    return healthy_slopes(off, variance, everybody, CENTRE, 1.4826 * float(np.median(np.abs(off))), 0.6, 2.0)


def _log_normal(random: np.random.Generator, size: int) -> Floats:
    """Off their median, with the standard deviation of the logarithm that TAU is of CENTRE."""
    return CENTRE * np.expm1(TAU / CENTRE * random.standard_normal(size))


def _population(name: str, seed: int, error: float, size: int = 600) -> tuple[Floats, Floats]:
    random = np.random.default_rng([seed, 21])
    true = _log_normal(random, size) if name == "log-normal" else TAU * random.standard_normal(size)
    return true + error * random.standard_normal(size), np.full(size, error**2)


@pytest.mark.parametrize("population", ["normal", "log-normal"])
@pytest.mark.parametrize("error", [0.02, 0.6, 3.0])
def test_scores_of_healthy_slopes_are_standard_normal(population: str, error: float) -> None:
    off, variance = _population(population, 0, error)
    scores = np.sort(_learnt(off, variance).scores(off, variance))
    at = np.array([0.05, 0.25, 0.5, 0.75, 0.95, 0.99])
    assert np.quantile(scores, at) == pytest.approx(norm.ppf(at), abs=0.35)


@pytest.mark.parametrize("error", [0.02, 0.6, 3.0])
def test_one_far_off_is_as_rare_as_it_is_in_the_population(error: float) -> None:
    """Of log-normal slopes with errors, from two million drawn ones."""
    off, variance = _population("log-normal", 1, error)
    random = np.random.default_rng(22)
    drawn = np.sort(_log_normal(random, 2_000_000) + error * random.standard_normal(2_000_000))
    far = drawn[[-20_000, -400]]
    alone = HealthySlopes(np.zeros(1), np.array([TAU]), np.array([TAU / CENTRE]), np.zeros(1), np.zeros((1, 0)))
    assert alone.scores_of_newcomers(far, np.full(2, error**2)) == pytest.approx(norm.isf([0.01, 0.0002]), abs=0.06)
    assert _learnt(off, variance).scores_of_newcomers(far, np.full(2, error**2)) == pytest.approx(
        norm.isf([0.01, 0.0002]), abs=0.7
    )


def test_the_data_choose_between_normal_and_log_normal() -> None:
    def skew(population: str) -> float:
        found = _learnt(*_population(population, 2, 0.1))
        weight = np.exp(found.ln_weight - found.ln_weight.max())
        return float(weight @ found.g / weight.sum())

    assert skew("normal") < 0.1
    assert skew("log-normal") == pytest.approx(TAU / CENTRE, abs=0.1)


def test_what_stands_out_does_not_hide_itself_nor_others() -> None:
    off, variance = _population("normal", 3, 0.3, 200)
    before = _learnt(off, variance).scores(off, variance)
    off[:4] = 12.0
    after = _learnt(off, variance).scores(off, variance)
    assert after[:4].min() > 5.0
    assert np.abs(after[4:] - before[4:]).max() < 0.6


def test_of_a_few_the_usual_spread_counts() -> None:
    off, variance = np.array([0.0, 0.001, -0.001, 0.5]), np.full(4, 1e-8)
    everybody = np.ones(4, np.bool_)
    usual, narrow = (healthy_slopes(off, variance, everybody, CENTRE, 0.3, usual, 2.0) for usual in (0.6, 0.15))
    assert usual.scores(off, variance)[3] < narrow.scores(off, variance)[3]


def test_a_batch_that_takes_no_part_changes_nothing() -> None:
    off, variance = _population("normal", 4, 0.3, 100)
    takes_part = np.arange(100) < 60
    tau = 1.2
    one = healthy_slopes(off, variance, takes_part, CENTRE, tau, 0.6, 2.0)
    off[60:] += 5.0
    other = healthy_slopes(off, variance, takes_part, CENTRE, tau, 0.6, 2.0)
    assert other.ln_weight == pytest.approx(one.ln_weight)


def test_one_of_those_learnt_from_has_the_score_that_it_has_as_a_newcomer_to_the_others() -> None:
    off, variance = _population("normal", 5, 0.3, 50)
    off[7] = 4.0
    found = _learnt(off, variance)
    alone = found.without(7)
    assert alone.scores_of_newcomers(off[[7]], variance[[7]])[0] == pytest.approx(found.scores(off, variance)[7])
    assert alone.ln_brought.shape == (len(found.tau), 49)
    assert found.scores_of_newcomers(off[[7]], variance[[7]])[0] < alone.scores_of_newcomers(off[[7]], variance[[7]])[0]
