"""Bounds: their definition by brute force, their closed form for complete log-normal lives, and how they go
together."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K
from analytics.insulation.life.bounds import (
    ActivationEnergy,
    HalvingInterval,
    Quantile,
    Quantity,
    TemperatureIndex,
    bootstrap,
    profile,
)
from analytics.insulation.life.censored import DISTRIBUTIONS, Distribution
from analytics.insulation.life.life import LifeFit, fit
from made.published_lives import class_b, class_h
from plant.life import CENSORING, lives

Floats = NDArray[np.float64]
ALLOWED = float(stats.chi2.ppf(0.95, 1))


def law_b(distribution: Distribution = "lognormal") -> LifeFit:
    found = fit(*class_b(), distribution, criterion="breakdown")
    assert isinstance(found, LifeFit)
    return found


def law_h() -> LifeFit:
    degC, life = class_h()
    found = fit(degC, life, life, "lognormal", criterion="breakdown")
    assert isinstance(found, LifeFit)
    return found


def likelihood(law: LifeFit, location: float, eV: float, sigma: float) -> float:
    """ln p(class B) by scipy; `location` at the law's centre."""
    degC, lower, upper = class_b()
    u = (1 / (degC + ZERO_DEGC_IN_K) - 1 / (law.centre_degC + ZERO_DEGC_IN_K)) / BOLTZMANN_EV_PER_K
    scale = np.exp(location + eV * u)
    life = (
        stats.lognorm(sigma, scale=scale)
        if law.distribution == "lognormal"
        else stats.weibull_min(1 / sigma, scale=scale)
    )
    return float(np.sum(np.where(np.isfinite(upper), life.logpdf(lower), life.logsf(lower))))


@pytest.mark.parametrize("distribution", ["lognormal", "weibull"])
@pytest.mark.parametrize("end", ["lower", "upper"])
def test_at_a_bound_of_the_energy_the_best_law_is_just_too_unlikely(distribution: Distribution, end: str) -> None:
    law = law_b(distribution)
    eV = getattr(profile(law, ActivationEnergy()), end)
    best = minimize(
        lambda v: -likelihood(law, v[0], eV, math.exp(v[1])),
        [law.location, math.log(law.sigma)],
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10},
    )
    assert 2 * (law.log_likelihood + best.fun) == pytest.approx(ALLOWED, abs=1e-5)


@pytest.mark.parametrize("end", ["lower", "upper"])
def test_at_a_bound_of_the_halving_interval_too(end: str) -> None:
    law = law_b()
    halving = getattr(profile(law, HalvingInterval()), end)

    def best(v: Floats) -> float:
        index_K = v[0] + ZERO_DEGC_IN_K
        eV = math.log(2) * BOLTZMANN_EV_PER_K / (1 / index_K - 1 / (index_K + halving))
        location = math.log(20_000.0) - eV / BOLTZMANN_EV_PER_K * (1 / index_K - 1 / (law.centre_degC + ZERO_DEGC_IN_K))
        return -likelihood(law, location, eV, math.exp(v[1]))

    found = minimize(best, [144.0, math.log(0.6)], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-10})
    assert 2 * (law.log_likelihood + found.fun) == pytest.approx(ALLOWED, abs=1e-5)


@pytest.mark.parametrize("quantity", [ActivationEnergy(), Quantile(0.5, 180.0)])
def test_complete_lognormal_lives_have_the_bounds_of_least_squares(quantity: Quantity) -> None:
    """2 (l - l(psi)) = n ln(1 + ((psi - psi_0) / s)^2 / n), s^2 = c' (X'X)^-1 c RSS / n."""
    law, (degC, life) = law_h(), class_h()
    x = np.stack([np.ones(40), 1 / (BOLTZMANN_EV_PER_K * (degC + ZERO_DEGC_IN_K))], axis=1)
    beta, squares, *_ = np.linalg.lstsq(x, np.log(life))
    energy = isinstance(quantity, ActivationEnergy)
    by = np.array([0.0, 1.0]) if energy else np.array([1.0, 1 / (BOLTZMANN_EV_PER_K * (180.0 + ZERO_DEGC_IN_K))])
    error = math.sqrt(by @ np.linalg.inv(x.T @ x) @ by * squares[0] / 40)
    reach = error * math.sqrt(40 * math.expm1(ALLOWED / 40))
    found = profile(law, quantity)
    got = (found.lower, found.upper) if energy else (math.log(found.lower), math.log(found.upper))
    assert got == pytest.approx((by @ beta - reach, by @ beta + reach), abs=1e-7)


def test_the_bounds_of_the_index_are_where_those_of_the_median_meet_its_hours() -> None:
    law = law_b()
    index = profile(law, TemperatureIndex(20_000.0))
    assert law.quantile(0.5, index.value) == pytest.approx(20_000.0, rel=1e-9)
    assert profile(law, Quantile(0.5, index.lower)).lower == pytest.approx(20_000.0, rel=1e-6)
    assert profile(law, Quantile(0.5, index.upper)).upper == pytest.approx(20_000.0, rel=1e-6)


def test_half_the_hours_are_lived_one_halving_interval_above_the_index() -> None:
    law = law_b("weibull")
    index, halving = profile(law, TemperatureIndex()), profile(law, HalvingInterval())
    assert law.quantile(0.5, index.value + halving.value) == pytest.approx(10_000.0, rel=1e-9)
    assert halving.lower < halving.value < halving.upper


def test_more_confidence_is_wider() -> None:
    law = law_b()
    narrow, wide = (profile(law, Quantile(0.1, 180.0), confidence) for confidence in (0.5, 0.99))
    assert wide.lower < narrow.lower < narrow.value < narrow.upper < wide.upper


def test_what_the_lives_do_not_bound_is_infinite() -> None:
    """Lives that hardly depend on temperature: a line without slope is likely, so any index below is."""
    degC, life = np.repeat([200.0, 210.0, 220.0], 4), np.tile([900.0, 1100.0, 1500.0, 600.0], 3)
    life = life * np.repeat([1.05, 1.0, 0.95], 4)
    law = fit(degC, life, life, "lognormal", criterion="breakdown")
    assert isinstance(law, LifeFit)
    index = profile(law, TemperatureIndex(20_000.0))
    assert index.lower == -math.inf
    energy = profile(law, ActivationEnergy())
    assert energy.lower < 0.0 < energy.upper


def test_a_law_that_gets_better_with_heat_has_no_index() -> None:
    degC, life = np.repeat([200.0, 220.0], 3), np.array([100.0, 120.0, 90.0, 200.0, 220.0, 190.0])
    law = fit(degC, life, life, "lognormal", criterion="breakdown")
    assert isinstance(law, LifeFit)
    index = profile(law, TemperatureIndex())
    assert math.isnan(index.value)
    assert (index.lower, index.upper) == (-math.inf, math.inf)


def test_every_bound_names_its_criterion_and_how_it_was_found() -> None:
    law = law_b()
    found, drawn = profile(law, Quantile(0.5, 130.0)), bootstrap(law, Quantile(0.5, 130.0), draws=200)
    assert (found.criterion, found.method, found.unit) == ("breakdown", "profile", "h")
    assert (drawn.criterion, drawn.method, drawn.confidence) == ("breakdown", "bootstrap", 0.95)
    assert found.quantity == drawn.quantity == "life of the share 0.5 at 130 degC"


def test_the_bootstrap_repeats_itself_and_agrees_with_the_profile() -> None:
    law = law_b()
    one, again = (bootstrap(law, ActivationEnergy(), draws=1000, seed=3) for _ in range(2))
    assert one == again
    other = profile(law, ActivationEnergy())
    assert (one.lower, one.upper) == pytest.approx((other.lower, other.upper), abs=0.04)


def test_the_bootstrap_watches_specimens_as_they_were_watched() -> None:
    """Half of the specimens looked at twice: the bounds are wider than with lives known to the hour."""
    degC, life = class_h()
    coarse = fit(degC, 1500 * np.floor(life / 1500), 1500 * np.ceil(life / 1500), "lognormal", criterion="breakdown")
    assert isinstance(coarse, LifeFit)
    wide, narrow = (bootstrap(law, Quantile(0.1, 220.0), draws=500) for law in (coarse, law_h()))
    assert math.log(wide.upper / wide.lower) > 1.05 * math.log(narrow.upper / narrow.lower)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize("censoring", CENSORING)
def test_the_law_of_the_plant_is_within_the_bounds_however_it_was_watched(
    distribution: Distribution, censoring: str
) -> None:
    table = lives(1, n=30, distribution=distribution, censoring=censoring)
    law = fit(table.temperature_degC, table.lower_h, table.upper_h, distribution, criterion="breakdown")
    assert isinstance(law, LifeFit)
    truth: dict[Quantity, float] = {
        ActivationEnergy(): table.law.activation_eV,
        Quantile(0.1, 180.0): float(table.law.quantile_h(180.0, 0.1)),
        TemperatureIndex(): table.law.temperature_index_degC(),
        HalvingInterval(): table.law.halving_interval_K(),
    }
    for quantity, true in truth.items():
        found = profile(law, quantity, 0.99)
        assert found.lower < true < found.upper, quantity.name
        if quantity.unit == "h":
            assert found.upper / found.lower < 2.0
