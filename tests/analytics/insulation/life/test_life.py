"""Lives on an Arrhenius line: published fits to the digits printed, closed forms, likelihoods by brute force."""

from __future__ import annotations

import doctest
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K
from analytics.insulation.life import first_passage, life
from analytics.insulation.life.censored import (
    DISTRIBUTIONS,
    Distribution,
    Lives,
    Restriction,
    covariance,
    maximise,
    standard_quantile,
)
from analytics.insulation.life.life import LifeFit, NoFit, fit
from made.published_lives import circuits, class_b, class_h, mylar

Floats = NDArray[np.float64]

BOTH = pytest.mark.parametrize("distribution", ["lognormal", "weibull"])


def fitted(
    degC: Floats, lower: Floats, upper: Floats, distribution: Distribution, counts: Floats | None = None
) -> LifeFit:
    found = fit(degC, lower, upper, distribution, counts, criterion="breakdown")
    assert isinstance(found, LifeFit), found
    return found


def refused(degC: object, lower: object, upper: object, distribution: Distribution = "lognormal") -> str:
    found = fit(np.array(degC), np.array(lower), np.array(upper), distribution, criterion="breakdown")
    assert isinstance(found, NoFit)
    assert found.criterion == "breakdown"
    return found.reason


def some_lives(seed: int, distribution: Distribution, eV: float = 0.9) -> tuple[Floats, Floats, Floats]:
    """Exact, right-, left- and interval-censored lives at four temperatures."""
    random = np.random.default_rng(seed)
    degC = np.repeat([170.0, 190.0, 210.0, 230.0], 6)
    z = random.standard_normal(24) if distribution == "lognormal" else -random.gumbel(size=24)
    life = np.exp(7.0 + eV / BOLTZMANN_EV_PER_K * (1 / (degC + ZERO_DEGC_IN_K) - 1 / 473.15) + 0.4 * z)
    lower, upper = life.copy(), life.copy()
    lower[1::6], upper[1::6] = 0.8 * life[1::6], np.inf
    lower[2::6], upper[2::6] = 0.7 * life[2::6], 1.2 * life[2::6]
    lower[3], upper[3] = 0.0, 1.5 * life[3]
    return degC, lower, upper


def brute(distribution: Distribution, degC: Floats, lower: Floats, upper: Floats, at: Floats) -> float:
    """ln p(lives) for (ln h at 200 degC, eV, ln sigma), by scipy's distributions."""
    location = at[0] + at[1] / BOLTZMANN_EV_PER_K * (1 / (degC + ZERO_DEGC_IN_K) - 1 / 473.15)
    sigma = float(np.exp(at[2]))
    if distribution == "lognormal":
        life = stats.lognorm(sigma, scale=np.exp(location))
    else:
        life = stats.weibull_min(1 / sigma, scale=np.exp(location))
    exact = lower == upper
    with np.errstate(all="ignore"):
        each = np.where(exact, life.logpdf(lower), np.log(life.cdf(upper) - life.cdf(lower)))
    return float(np.sum(each))


def test_class_b_weibull_over_temperature_is_what_r_prints() -> None:
    """survreg(Surv(time, cens) ~ temp, motors): tests/Examples/MASS-Ex.Rout.save of MASS 7.3-65, survreg1.Rout.save of
    survival 3.8-6."""
    degC, lower, upper = class_b()
    lives = Lives(np.stack([np.ones(40), degC], axis=1), np.log(lower), np.log(upper), np.ones(40))
    line = maximise(lives, "weibull")
    errors = np.sqrt(np.diag(covariance(lives, "weibull", line.beta, float(line.sigma))))
    assert np.round([*line.beta, np.log(line.sigma)], 5).tolist() == [16.31852, -0.04531, -1.09564]
    assert np.round(errors, 5).tolist() == [0.62296, 0.00319, 0.21480]
    per_hour = np.log(lower[np.isfinite(upper)]).sum()
    assert round(float(line.log_likelihood - per_hour), 1) == -147.4
    at_130 = line.beta @ [1.0, 130.0]
    assert round(float(np.exp(at_130)), 2) == 33813.06
    quantiles = [at_130 + line.sigma * standard_quantile("weibull", p) for p in (0.5, 0.1)]
    assert np.round(quantiles, 6).tolist() == [10.306068, 9.676248]


def test_class_b_lognormal_above_150_degc_is_what_r_and_sas_print() -> None:
    """r_sas.Rout.save of R's survival 3.8-6, which repeats output 48.1.5 of the SAS 9.2 manual; 1000 / (273.2 +
    temp)."""
    degC, lower, upper = (v[class_b()[0] > 150.0] for v in class_b())
    lives = Lives(np.stack([np.ones(30), 1000 / (273.2 + degC)], axis=1), np.log(lower), np.log(upper), np.ones(30))
    line = maximise(lives, "lognormal")
    spread = covariance(lives, "lognormal", line.beta, float(line.sigma))
    assert np.round([*line.beta, np.log(line.sigma), line.sigma], 3).tolist() == [-10.471, 8.322, -0.504, 0.604]
    assert np.round(np.sqrt(np.diag(spread)), 3).tolist() == [2.772, 1.284, 0.183]
    assert round(float(line.log_likelihood - np.log(lower[np.isfinite(upper)]).sum()), 1) == -145.9
    printed = {130.0: ([12033.185, 26095.677, 56592.20], [5482.338, 11359.450, 26036.917])}
    printed |= {150.0: ([4536.877, 9838.864, 21336.98], [1443.072, 2901.155, 7172.343])}
    for temperature, (lifetimes, errors) in printed.items():
        for p, printed_h, error in zip((0.1, 0.5, 0.9), lifetimes, errors, strict=True):
            z = standard_quantile("lognormal", p)
            by = np.array([1.0, 1000 / (273.2 + temperature), float(line.sigma) * z])
            value = float(np.exp(by[:2] @ line.beta + line.sigma * z))
            assert value == pytest.approx(printed_h, rel=5e-7)
            assert value * np.sqrt(by @ spread @ by) == pytest.approx(error, rel=5e-6)


def test_class_b_lognormal_is_what_wei_and_tanner_print() -> None:
    """J. Am. Stat. Assoc. 85 (1990) 699, section 4, agreeing with Aitkin, Technometrics 23 (1981) 161: log10 h, 1000 /
    (T + 273.2)."""
    degC, lower, upper = class_b()
    lives = Lives(np.stack([np.ones(40), 1000 / (273.2 + degC)], axis=1), np.log(lower), np.log(upper), np.ones(40))
    line = maximise(lives, "lognormal")
    assert np.round(line.beta / np.log(10), 2).tolist() == [-6.02, 4.31]
    assert round(float((line.sigma / np.log(10)) ** 2), 3) == 0.067


def test_lives_between_two_looks_have_the_errors_that_meeker_and_escobar_print() -> None:
    """Statistical Methods for Reliability Data, Example 19.11, over 11605 / T: as reliawiki.com repeats it."""
    degC, lower, upper, counts = circuits()
    x = np.stack([np.ones(degC.size), 11605.0 / (degC + ZERO_DEGC_IN_K)], axis=1)
    lives = Lives(x, np.log(lower), np.log(upper), counts)
    line = maximise(lives, "lognormal")
    errors = np.sqrt(np.diag(covariance(lives, "lognormal", line.beta, float(line.sigma))))
    assert [f"{errors[0]:.1f}", f"{errors[1]:.2f}", f"{float(line.sigma) * errors[2]:.2f}"] == ["1.5", "0.07", "0.06"]
    law = fitted(degC, lower, upper, "lognormal", counts)
    assert law.eV == pytest.approx(line.beta[1], rel=1e-4)  # k is 1 / 11604.518
    assert law.covariance[1, 1] == pytest.approx(errors[1] ** 2, rel=1e-3)


def test_another_regressor_gives_what_meeker_and_escobar_print_of_it() -> None:
    """Example 19.10, ln minutes over ln (kV/mm), 95 % bounds by standard errors: as help.reliasoft.com repeats it."""
    field, life = mylar()
    x = np.stack([np.ones(field.size), np.log(field)], axis=1)
    lives = Lives(x, np.log(life), np.log(life), np.ones(field.size))
    line = maximise(lives, "lognormal")
    reach = 1.959964 * np.sqrt(np.diag(covariance(lives, "lognormal", line.beta, float(line.sigma))))
    assert f"{float(line.log_likelihood) - np.log(life).sum():.1f}" == "-271.4"
    assert [f"{line.beta[0] + way * reach[0]:.1f}" for way in (-1, 1)] == ["21.6", "33.4"]
    assert [f"{line.beta[1] + way * reach[1]:.2f}" for way in (-1, 1)] == ["-5.46", "-3.11"]
    assert [f"{line.sigma * np.exp(way * reach[2]):.2f}" for way in (-1, 1)] == ["0.83", "1.32"]


def test_complete_lognormal_lives_are_least_squares() -> None:
    degC, life = class_h()
    law = fitted(degC, life, life, "lognormal")
    x = np.stack([np.ones(40), 1 / (BOLTZMANN_EV_PER_K * (degC + ZERO_DEGC_IN_K))], axis=1)
    beta, squares, *_ = np.linalg.lstsq(x, np.log(life))
    assert law.eV == pytest.approx(beta[1], rel=1e-10)
    assert law.sigma == pytest.approx(np.sqrt(squares[0] / 40), rel=1e-10)
    median = np.exp(beta @ [1.0, 1 / (BOLTZMANN_EV_PER_K * (180.0 + ZERO_DEGC_IN_K))])
    assert law.quantile(0.5, 180.0) == pytest.approx(median, rel=1e-9)
    assert law.covariance[1, 1] == pytest.approx(squares[0] / 40 * np.linalg.inv(x.T @ x)[1, 1], rel=1e-7)


@BOTH
def test_every_kind_of_censoring_counts_as_scipy_counts_it(distribution: Distribution) -> None:
    degC, lower, upper = some_lives(1, distribution)
    law = fitted(degC, lower, upper, distribution)
    at = np.array([float(law.log_life(200.0)), law.eV, np.log(law.sigma)])
    assert law.log_likelihood == pytest.approx(brute(distribution, degC, lower, upper, at), abs=1e-9)
    found = minimize(
        lambda v: -brute(distribution, degC, lower, upper, v),
        at + np.array([0.1, 0.05, -0.1]),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000},
    )
    assert law.log_likelihood == pytest.approx(-found.fun, abs=1e-8)
    assert at == pytest.approx(found.x, abs=1e-4)


@BOTH
def test_standard_errors_are_the_curvature_of_the_likelihood(distribution: Distribution) -> None:
    degC, lower, upper = some_lives(2, distribution)
    law = fitted(degC, lower, upper, distribution)
    shift = 1 / BOLTZMANN_EV_PER_K * (1 / 473.15 - 1 / (law.centre_degC + ZERO_DEGC_IN_K))
    to_centre = np.array([[1.0, -shift, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    at = np.array([law.location, law.eV, np.log(law.sigma)])
    h = 1e-3

    def value(v: Floats) -> float:
        return brute(distribution, degC, lower, upper, np.linalg.solve(to_centre, v))

    curvature = np.array(
        [
            [
                (value(at + a + b) - value(at + a - b) - value(at - a + b) + value(at - a - b)) / (4 * h * h)
                for b in h * np.eye(3)
            ]
            for a in h * np.eye(3)
        ]
    )
    assert np.linalg.inv(-curvature) == pytest.approx(law.covariance, rel=2e-3, abs=1e-5)


@BOTH
def test_a_restricted_maximum_is_the_best_of_its_restriction(distribution: Distribution) -> None:
    degC, lower, upper = some_lives(3, distribution)
    x = np.stack([np.ones(24), 1 / (BOLTZMANN_EV_PER_K * (degC + ZERO_DEGC_IN_K)) - 24.5], axis=1)
    with np.errstate(divide="ignore"):
        lives = Lives(x, np.log(lower), np.log(upper), np.ones(24))
    energy = 1.4
    line = maximise(lives, distribution, Restriction(np.zeros(3), np.array([[1.0, 0.0, 0.0], [0.0, energy, 1.0]])))
    assert bool(line.found)
    assert line.beta[1] == pytest.approx(energy, rel=1e-12)
    offset = energy * (1 / (BOLTZMANN_EV_PER_K * 473.15) - 24.5)
    found = minimize(
        lambda v: -brute(distribution, degC, lower, upper, np.array([v[0], energy, v[1]])),
        [7.0, 0.0],
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000},
    )
    exact = lower == upper
    assert line.log_likelihood - np.log(lower[exact]).sum() == pytest.approx(-found.fun, abs=1e-8)
    assert line.beta[0] + offset == pytest.approx(found.x[0], abs=1e-4)


@BOTH
def test_counts_are_as_many_rows(distribution: Distribution) -> None:
    degC, lower, upper = some_lives(4, distribution)
    many = np.arange(24.0) % 3
    counted = fitted(degC, lower, upper, distribution, many)
    times = many.astype(np.int64)
    spelled = fitted(np.repeat(degC, times), np.repeat(lower, times), np.repeat(upper, times), distribution)
    assert counted.log_likelihood == pytest.approx(spelled.log_likelihood, rel=1e-12)
    assert counted.eV == pytest.approx(spelled.eV, rel=1e-9)
    assert counted.tested.units().counts.size == spelled.tested.counts.size


@BOTH
def test_rows_that_say_nothing_change_nothing(distribution: Distribution) -> None:
    """Watched for 0 h, or standing for no specimen, whatever else they hold."""
    degC, lower, upper = some_lives(4, distribution)
    plain = fitted(degC, lower, upper, distribution)
    longer = fitted(
        np.append(degC, [180.0, np.nan, -300.0]),
        np.append(lower, [0.0, 1.0, np.nan]),
        np.append(upper, [np.inf, 1.0, -1.0]),
        distribution,
        np.append(np.ones(24), [1.0, 0.0, 0.0]),
    )
    assert (longer.eV, longer.sigma, longer.log_likelihood) == (plain.eV, plain.sigma, plain.log_likelihood)
    assert longer.tested.counts.size == 24


@BOTH
def test_a_life_too_long_for_a_number_is_infinite(distribution: Distribution) -> None:
    assert fitted(*some_lives(6, distribution), distribution).quantile(0.5, -265.0) == np.inf


@BOTH
def test_lives_of_other_hours_move_the_line_and_nothing_else(distribution: Distribution) -> None:
    degC, lower, upper = some_lives(5, distribution)
    one, longer = fitted(degC, lower, upper, distribution), fitted(degC, 24 * lower, 24 * upper, distribution)
    assert longer.eV == pytest.approx(one.eV, rel=1e-8)
    assert longer.sigma == pytest.approx(one.sigma, rel=1e-8)
    assert longer.quantile(0.1, 180.0) == pytest.approx(24 * one.quantile(0.1, 180.0), rel=1e-8)


@BOTH
def test_narrow_intervals_are_exact_lives(distribution: Distribution) -> None:
    degC, life = class_h()
    exact = fitted(degC, life, life, distribution)
    close = fitted(degC, life * (1 - 1e-5), life * (1 + 1e-5), distribution)
    assert close.eV == pytest.approx(exact.eV, rel=1e-6)
    assert close.sigma == pytest.approx(exact.sigma, rel=1e-6)


@BOTH
def test_intervals_too_narrow_to_compute_with_are_exact_lives(distribution: Distribution) -> None:
    degC, life = class_h()
    exact = fitted(degC, life, life, distribution)
    for width in (1e-7, 1e-12, 4e-16):
        close = fitted(degC, life, life * (1 + width), distribution)
        assert (close.eV, close.sigma, close.log_likelihood) == (exact.eV, exact.sigma, exact.log_likelihood)


@BOTH
def test_half_of_the_specimens_live_longer_than_the_median(distribution: Distribution) -> None:
    law = fitted(*some_lives(6, distribution), distribution)
    sigma, scale = law.sigma, np.exp(law.log_life(185.0))
    life = (
        stats.lognorm(sigma, scale=scale) if distribution == "lognormal" else stats.weibull_min(1 / sigma, scale=scale)
    )
    for p in (0.01, 0.5, 0.9):
        assert law.quantile(p, 185.0) == pytest.approx(life.ppf(p), rel=1e-9)


@BOTH
def test_a_known_law_comes_back_from_many_lives(distribution: Distribution) -> None:
    random = np.random.default_rng(7)
    degC = np.repeat([190.0, 210.0, 230.0], 2000)
    z = random.standard_normal(6000) if distribution == "lognormal" else -random.gumbel(size=6000)
    life = np.exp(6.0 + 1.1 / BOLTZMANN_EV_PER_K * (1 / (degC + ZERO_DEGC_IN_K) - 1 / 483.15) + 0.3 * z)
    look = 100.0
    lower, upper = look * np.floor(life / look), look * np.ceil(life / look)
    law = fitted(degC, lower, np.where(life > 2000.0, np.inf, upper), distribution)
    assert law.eV == pytest.approx(1.1, abs=0.03)
    assert law.sigma == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize("module", [life, first_passage])
def test_examples_in_the_docstrings_hold(module: ModuleType) -> None:
    found = doctest.testmod(module)
    assert found.attempted
    assert not found.failed


def test_what_the_data_do_not_determine_is_refused_with_the_reason() -> None:
    assert "one temperature" in refused([200, 200], [100, 200], [100, 200])
    assert "no life has ended" in refused([200, 220], [100, 100], [np.inf, np.inf])
    assert "ended at one temperature only" in refused([180, 220, 220], [500, 90, 110], [np.inf, 90, 110])
    assert "without any spread" in refused([200, 200, 240, 240], [100, 100, 10, 10], [100, 100, 10, 10])
    assert "without any spread" in refused([200, 200, 240, 240], [100, 100, 10, 10], [200, 200, 20, 20], "weibull")
    assert "first look" in refused([200, 200, 240, 240], [80, 100, 0, 0], [80, 100, 20, 20])
    assert "missing" in refused([200, np.nan], [100, 10], [100, 10])
    assert "below zero" in refused([200, 240], [100, 20], [100, 10])
    assert "absolute zero" in refused([200, -300], [100, 20], [100, 20])
    assert "not gamma" in refused([200, 240], [100, 10], [100, 10], "gamma")  # type: ignore[arg-type]
    broken = fit([200, 240], [100, 10], [100, 10], "weibull", [1.5, 1.0], criterion="breakdown")
    assert isinstance(broken, NoFit)
    assert "whole number" in broken.reason


def test_the_first_row_that_cannot_be_is_named() -> None:
    lives, ended = np.array([900.0, 1100.0, 90.0, 110.0]), np.array([900.0, 1100.0, 90.0, 110.0])
    degC = np.array([200.0, 200.0, 240.0, 240.0])
    assert refused(degC, lives, np.where(lives == 90.0, 80.0, ended)).startswith("row 3: a life is below zero")
    assert refused(np.where(lives == 110.0, np.nan, degC), lives, ended).startswith("row 4: a temperature")
    assert refused(degC, np.where(lives == 90.0, np.inf, lives), np.where(lives == 90.0, np.inf, ended)).startswith(
        "row 3"
    )
    for counts, what in (([1, -1, 1, 1], "whole number"), ([1, np.nan, 1, 1], "missing")):
        found = fit(degC, lives, ended, "weibull", np.array(counts, np.float64), criterion="breakdown")
        assert isinstance(found, NoFit)
        assert found.reason.startswith("row 2: ")
        assert what in found.reason


def test_a_table_that_says_nothing_is_refused_as_such() -> None:
    assert "no row says anything" in refused([], [], [])
    assert "no row says anything" in refused([200, 220], [0, 0], [np.inf, np.inf])


@pytest.mark.parametrize("seed", range(30))
def test_a_table_of_any_kind_gives_a_law_or_a_reason(seed: int) -> None:
    """Few specimens, no spread or a wide one, every censoring, a slope of either sign: a maximum, or a sentence, and no
    warning."""
    random = np.random.default_rng(seed)
    size = int(random.integers(2, 12))
    degC = random.choice([180.0, 200.0, 220.0], size)
    life = np.exp(
        random.normal(7.0, random.choice([0.0, 0.01, 0.5, 2.0]), size) - (degC - 200) * random.choice([-0.02, 0.0, 0.2])
    )
    kind = random.integers(0, 4, size)
    look = 200.0 * np.floor(life / 200.0)
    lower = np.choose(kind, [life, 0.5 * life, look, np.zeros(size)])
    upper = np.choose(kind, [life, np.full(size, np.inf), look + 200.0, life])
    for distribution in DISTRIBUTIONS:
        found = fit(degC, lower, upper, distribution, criterion="breakdown")
        if isinstance(found, NoFit):
            assert found.reason
            continue
        step = 1e-4 * np.array([1.0, 1.0 / (BOLTZMANN_EV_PER_K * 473.15), 1.0])
        at = np.array([float(found.log_life(200.0)), found.eV, np.log(found.sigma)])
        around = [
            brute(distribution, degC, lower, upper, at + way * step * unit) for unit in np.eye(3) for way in (-1, 1)
        ]
        assert max(v for v in around if np.isfinite(v)) <= found.log_likelihood + 1e-9
