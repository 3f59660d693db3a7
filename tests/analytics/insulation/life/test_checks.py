"""Is it one line, and one spread? Against the exact tests of complete log-normal lives, and on lives that break the
law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K
from analytics.insulation.life.censored import Distribution
from analytics.insulation.life.checks import common_spread, linearity
from analytics.insulation.life.life import LifeFit, fit
from made.published_lives import circuits, class_b, class_h

Floats = NDArray[np.float64]


def fitted(degC: Floats, lower: Floats, upper: Floats, distribution: Distribution = "lognormal") -> LifeFit:
    found = fit(degC, lower, upper, distribution, criterion="breakdown")
    assert isinstance(found, LifeFit), found
    return found


def lives(eV: Floats, sigma: Floats, seed: int, each: int = 10) -> tuple[Floats, Floats]:
    """Log-normal at 190, 210, 230, 250 degC; `eV` (3,) between neighbours, `sigma` (4,)."""
    degC = np.array([190.0, 210.0, 230.0, 250.0])
    inverse = 1 / (BOLTZMANN_EV_PER_K * (degC + ZERO_DEGC_IN_K))
    location = 9.0 + np.concatenate([[0.0], np.cumsum(eV * np.diff(inverse))])
    z = np.random.default_rng(seed).standard_normal((4, each))
    return np.repeat(degC, each), np.exp(location[:, None] + sigma[:, None] * z).ravel()


def test_linearity_of_complete_lognormal_lives_is_the_f_test() -> None:
    degC, life = class_h()
    found = linearity(fitted(degC, life, life), draws=4999)
    y = np.log(life)
    means = np.array([y[degC == t].mean() for t in degC])
    x = np.stack([np.ones(40), 1 / (degC + ZERO_DEGC_IN_K)], axis=1)
    straight = x @ np.linalg.lstsq(x, y)[0]
    f = np.sum((means - straight) ** 2) / 2 / (np.sum((y - means) ** 2) / 36)
    assert found.ratio == pytest.approx(40 * math.log1p(f * 2 / 36), abs=1e-8)
    assert found.degrees == 2
    assert found.p_value == pytest.approx(stats.f.sf(f, 2, 36), abs=0.015)


def test_equal_spread_of_complete_lognormal_lives_is_bartletts_test() -> None:
    degC, life = class_h()
    found = common_spread(fitted(degC, life, life), draws=4999)
    groups = [np.log(life[degC == t]) for t in np.unique(degC)]
    pooled = math.log(np.mean([g.var() for g in groups]))
    assert found.ratio == pytest.approx(40 * pooled - sum(10 * math.log(g.var()) for g in groups), abs=1e-8)
    assert found.p_value == pytest.approx(stats.bartlett(*groups).pvalue, abs=0.01)
    assert "0.37 at 260 degC" in found.says


def test_the_ratio_of_spreads_of_lives_between_looks_is_what_meeker_and_escobar_print() -> None:
    """Example 19.11 of Statistical Methods for Reliability Data, as reliawiki.com repeats it: 4.7, of one degree."""
    degC, lower, upper, counts = circuits()
    law = fit(degC, lower, upper, "lognormal", counts, criterion="failure")
    assert isinstance(law, LifeFit)
    found = common_spread(law, draws=199)
    assert f"{found.ratio:.1f}" == "4.7"
    assert found.degrees == 1
    assert found.p_value == pytest.approx(stats.chi2.sf(found.ratio, 1), abs=0.04)
    assert found.left_out_degC == (150.0, 175.0, 200.0)


def test_a_line_through_one_life_a_temperature_is_not_tested_rather_than_bent() -> None:
    degC, life = np.array([190.0, 210.0, 230.0]), np.array([9000.0, 2400.0, 1000.0])
    for found in (check(fitted(degC, life, life)) for check in (linearity, common_spread)):
        assert not found.passed
        assert math.isnan(found.p_value)
        assert "straight" not in found.says


def test_equal_lives_at_each_temperature_leave_nothing_to_test_by() -> None:
    degC = np.repeat([190.0, 210.0, 230.0], 4)
    found = linearity(fitted(degC, np.repeat([9000.0, 2400.0, 1000.0], 4), np.repeat([9000.0, 2400.0, 1000.0], 4)))
    assert not found.passed
    assert math.isnan(found.p_value)
    assert "too equal" in found.says


def test_lives_that_follow_the_law_pass() -> None:
    degC, life = lives(np.full(3, 1.0), np.full(4, 0.3), 6)
    law = fitted(degC, life, life)
    assert linearity(law).passed
    assert common_spread(law).passed


def test_an_energy_that_changes_is_told_with_both_values() -> None:
    degC, life = lives(np.array([1.4, 0.9, 0.5]), np.full(4, 0.2), 2)
    found = linearity(fitted(degC, life, life))
    assert not found.passed
    assert "between 190 and 210 degC" in found.says
    assert "between 230 and 250 degC" in found.says


@pytest.mark.parametrize("distribution", ["lognormal", "weibull"])
def test_a_spread_that_changes_is_told_with_censored_lives_too(distribution: Distribution) -> None:
    degC, life = lives(np.full(3, 1.0), np.array([0.1, 0.1, 0.1, 0.9]), 3)
    until = np.repeat([np.quantile(life[degC == t], 0.7) for t in np.unique(degC)], 10)
    law = fitted(degC, np.minimum(life, until), np.where(life > until, np.inf, life), distribution)
    found = common_spread(law)
    assert not found.passed
    assert "at 250 degC" in found.says


def test_a_temperature_where_no_life_ended_is_left_out_and_said() -> None:
    law = fitted(*class_b())
    assert linearity(law, draws=99).left_out_degC == (150.0,)
    assert common_spread(law, draws=99).left_out_degC == (150.0,)


def test_two_temperatures_cannot_be_tested_and_do_not_pass() -> None:
    degC, life = lives(np.full(3, 1.0), np.full(4, 0.3), 4)
    two = degC < 220.0
    found = linearity(fitted(degC[two], life[two], life[two]))
    assert not found.passed
    assert math.isnan(found.p_value)
    assert "fewer than three" in found.says


def test_healthy_lives_rarely_fail_with_five_specimens_a_temperature() -> None:
    """The simulated null is what keeps this: by chi-squared 5 specimens a temperature would fail twice as often as
    said."""
    failed = 0
    for seed in range(40):
        degC, life = lives(np.full(3, 1.0), np.full(4, 0.3), 100 + seed, each=5)
        failed += not common_spread(fitted(degC, life, life), draws=199, seed=seed).passed
    assert failed <= 5  # 2 expected; more than 5 in 1.4 % of such tests
