"""Breakdown strength against ageing: NIST's certified numbers, Meeker and Escobar's, and what they mean for a life."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K, Activation, Doubling
from analytics.insulation.life.destructive import Fall, by_doubling, by_energy
from analytics.insulation.life.life import NoFit
from made.published_lives import breakdown

Floats = NDArray[np.float64]


def fall(found: Fall | NoFit) -> Fall:
    assert isinstance(found, Fall), found
    return found


def test_nelsons_data_give_what_nist_certifies() -> None:
    """Statistical Reference Datasets, Nelson.dat: log[y] = b1 - b2 x1 exp(-b3 x2), x1 weeks, x2 degC; certified to 11
    digits."""
    found = fall(by_doubling(*breakdown(), criterion=2.0, at_degC=0.0))
    assert isinstance(found.rule, Doubling)
    assert math.log(found.start) == pytest.approx(2.5906836021, abs=5e-10)
    assert found.per_h == pytest.approx(5.6177717026e-09, rel=5e-9)
    assert -math.log(2) / found.rule.kelvin == pytest.approx(-5.7701013174e-02, rel=5e-10)
    assert 128 * found.sigma**2 == pytest.approx(3.7976833176, abs=5e-10)
    assert found.sigma * math.sqrt(128 / 125) == pytest.approx(1.7430280130e-01, abs=5e-11)


def test_the_same_with_an_activation_energy_is_what_meeker_and_escobar_print() -> None:
    """Maximum likelihood estimates 2.589, -4.769e11, 1.418 eV, 0.1726 (their 7.3 kV for NIST's 7.27): echapter24.Rmd of
    the R package SMRD."""
    degC, weeks, kV = breakdown()
    found = fall(by_energy(degC, weeks, np.where(kV == 7.27, 7.3, kV), criterion=2.0, at_degC=200.0))
    assert isinstance(found.rule, Activation)
    per_week = found.per_h * math.exp(found.rule.eV / (BOLTZMANN_EV_PER_K * (200.0 + ZERO_DEGC_IN_K)))
    assert (
        f"{math.log(found.start):.3f} {-per_week:.3e} {found.rule.eV:.3f} {found.sigma:.4f}"
        == "2.589 -4.769e+11 1.418 0.1726"
    )


def test_the_best_energy_and_its_bounds_are_those_of_the_likelihood() -> None:
    degC, weeks, kV = breakdown()
    found = fall(by_energy(degC, weeks, kV, criterion=2.0, at_degC=200.0))

    def worst(eV: float) -> float:
        worth = weeks * Activation(eV).acceleration(degC, 200.0)

        def cost(v: Floats) -> float:
            sigma = math.exp(v[2])
            return -float(np.sum(stats.norm.logpdf(np.log(kV), v[0] - math.exp(v[1]) * worth, sigma) - np.log(kV)))

        start = [math.log(found.start), math.log(found.per_h), math.log(found.sigma)]
        return float(
            minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 2000}).fun
        )

    assert isinstance(found.rule, Activation)
    assert -worst(found.rule.eV) == pytest.approx(found.log_likelihood, abs=1e-7)
    for end in found.between:
        assert 2 * (found.log_likelihood + worst(end)) == pytest.approx(stats.chi2.ppf(0.95, 1), abs=1e-5)


def test_a_life_is_over_when_the_strength_is_at_the_criterion() -> None:
    found = fall(by_energy(*breakdown(), criterion=10.0, at_degC=200.0))
    half, few = found.quantile(0.5, 225.0), found.quantile(0.1, 225.0)
    location = math.log(found.start) - found.per_h * float(found.rule.acceleration(225.0, 200.0)) * half
    assert math.exp(location) == pytest.approx(10.0)
    at_few = math.log(found.start) - found.per_h * float(found.rule.acceleration(225.0, 200.0)) * few
    assert stats.norm.cdf(math.log(10.0), at_few, found.sigma) == pytest.approx(0.1)
    assert found.quantile(0.001, 225.0) == 0.0  # so weak from the start


def test_what_the_strengths_do_not_determine_is_refused() -> None:
    degC, weeks, kV = breakdown()

    def reason(found: Fall | NoFit) -> str:
        assert isinstance(found, NoFit)
        assert "10" in found.criterion
        return found.reason

    one = degC == 225.0
    assert "one temperature" in reason(by_energy(degC[one], weeks[one], kV[one], 10.0, 200.0))
    assert "above zero" in reason(by_energy(degC, weeks, kV - 20.0, 10.0, 200.0))
    assert "equal" in reason(by_energy(degC, weeks, np.full(kV.size, 12.0), 10.0, 200.0))
    assert "one duration" in reason(by_energy([], [], [], 10.0, 200.0))
    assert "does not fall" in reason(by_energy(degC, weeks, 1 / kV, 10.0, 200.0))


def test_the_first_row_that_cannot_be_is_named() -> None:
    degC, weeks, kV = breakdown()
    second = np.arange(kV.size) == 1
    for temperature, aged, strength, what in (
        (np.where(second, -300.0, degC), weeks, kV, "absolute zero"),
        (degC, np.where(second, -1.0, weeks), kV, "hours of ageing"),
        (degC, weeks, np.where(second, np.nan, kV), "missing"),
    ):
        found = by_doubling(temperature, aged, strength, criterion=10.0, at_degC=200.0)
        assert isinstance(found, NoFit)
        assert found.reason.startswith("row 2: ")
        assert what in found.reason


@pytest.mark.parametrize(("criterion", "at_degC"), [(0.0, 200.0), (math.nan, 200.0), (10.0, -280.0)])
def test_a_question_that_cannot_be_is_refused(criterion: float, at_degC: float) -> None:
    found = by_energy(*breakdown(), criterion=criterion, at_degC=at_degC)
    assert isinstance(found, NoFit)
    assert "strength above zero" in found.reason


def test_a_law_through_every_strength_claims_no_exactness() -> None:
    """Three specimens and three coefficients: bounds of no width would be a lie."""
    found = by_energy([180.0, 180.0, 225.0], [0.0, 10.0, 10.0], [15.0, 14.0, 10.0], 5.0, 200.0)
    assert isinstance(found, NoFit)
    assert "break more specimens" in found.reason


@pytest.mark.parametrize("unit", [1e-300, 1e300])
def test_hours_in_any_unit_give_the_same_energy(unit: float) -> None:
    degC, weeks, kV = breakdown()
    plain, scaled = (fall(by_energy(degC, weeks * u, kV, 10.0, 200.0)) for u in (1.0, unit))
    assert isinstance(plain.rule, Activation)
    assert isinstance(scaled.rule, Activation)
    assert scaled.rule.eV == pytest.approx(plain.rule.eV, rel=1e-9)
    assert scaled.per_h * unit == pytest.approx(plain.per_h, rel=1e-9)
