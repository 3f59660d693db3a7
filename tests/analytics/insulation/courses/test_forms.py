"""Forms of deterioration: told where they are there, none where there is nothing, and both by the odds that are
stated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import log_ndtr
from scipy.stats import halfnorm, multivariate_normal

from analytics.insulation.courses import courses, forms
from analytics.insulation.courses.orthant import log_both_positive

Floats = NDArray[np.float64]

DOSE_h: Floats = np.arange(17, dtype=np.float64) * 12.0
SD = 0.008


def _assess(course: Callable[[Floats], Floats], seed: int = 0, sd: float = SD, dose_h: Floats = DOSE_h) -> forms.Form:
    noise = sd * np.random.default_rng([seed, 9]).standard_normal(len(dose_h))
    return forms.assess(dose_h, -3.85 + course(dose_h) + noise, sd)


def _paper(dose: Floats) -> Floats:
    return np.interp(dose, [0.0, 96.0, 180.0], [0.0, -0.08, 0.06])


# ---- what is there -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(
    ("name", "course"),
    [
        ("monotone", lambda d: 0.2 * d / 192.0),
        ("monotone", lambda d: 0.2 * np.sqrt(d / 192.0)),
        ("monotone", lambda d: -0.2 * d / 192.0),
        ("monotone", lambda d: 1.4 * d / 192.0),  # a quarter of its conductivity: past the end of life
        ("monotone", lambda d: 2.5 * d / 192.0),
        ("dip_then_rise", lambda d: 0.15 * np.expm1(-d / 30.0) + 0.3 * d / 192.0),
        ("dip_then_rise", lambda d: np.interp(d, [0.0, 72.0, 192.0], [0.0, -0.06, 0.15])),
        ("changepoint", lambda d: 0.25 * np.maximum(d - 90.0, 0.0) / 102.0),
        ("changepoint", lambda d: 0.05 * d / 192.0 + 0.3 * np.maximum(d - 110.0, 0.0) / 82.0),
    ],
)
def test_forms_are_told_from_seventeen_checks(name: str, course: Callable[[Floats], Floats], seed: int) -> None:
    found = _assess(course, seed)
    assert found.name == name
    assert found.significant
    assert found.probability == max(found.probabilities.values()) > 0.5
    assert sum(found.probabilities.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["none", "monotone", "changepoint"])
def test_the_fitted_course_holds_the_true_one_in_its_band(name: str) -> None:
    truth: Callable[[Floats], Floats] = {
        "none": lambda d: 0.0 * d,
        "monotone": lambda d: 0.2 * d / 192.0,
        "changepoint": lambda d: 0.25 * np.maximum(d - 90.0, 0.0) / 102.0,
    }[name]
    held, of = 0, 0
    for seed in range(4):
        found = _assess(truth, seed)
        assert found.name == name and found.course is not None
        course = found.course
        true = -3.85 + truth(np.array(course.dose_h))
        assert (course.dose_h[0], course.dose_h[-1]) == (0.0, 192.0)
        assert course.ln_middle == pytest.approx(true, abs=4 * SD)
        held += int(((course.ln_low <= true) & (true <= course.ln_high)).sum())
        of += len(true)
    assert held > 0.8 * of


def test_slope_and_change_are_found_with_intervals_that_hold_them() -> None:
    rate, held_slope, held_change = 0.25 / 102.0, 0, 0
    found = [_assess(lambda d: rate * np.maximum(d - 90.0, 0.0), seed) for seed in range(20)]
    for form in found:
        assert form.name == "changepoint"
        assert form.change_at_dose_h == pytest.approx(90.0, abs=15.0)
        assert form.branch_dose_h == (form.change_at_dose_h, 192.0)
        held_slope += form.ci95[0] <= 1e4 * rate <= form.ci95[1] if form.ci95 else 0
        held_change += (
            form.change_ci95_dose_h[0] <= 90.0 <= form.change_ci95_dose_h[1] if form.change_ci95_dose_h else 0
        )
    assert held_slope >= 17
    assert held_change >= 17


def test_the_slope_of_a_monotone_course_is_that_of_the_whole() -> None:
    found = _assess(lambda d: 0.2 * np.sqrt(d / 192.0))
    assert found.slope_percent_per_100h == pytest.approx(1e4 * 0.2 / 192.0, rel=0.1)
    assert found.branch_dose_h == (0.0, 192.0)
    assert found.change_at_dose_h is None


def test_a_course_that_falls_rises_and_then_stays_comes_out_as_that() -> None:
    """Twenty cycles of 12 h and one of 60 h."""
    found = _assess(_paper, dose_h=np.append(np.arange(21) * 12.0, 300.0))
    assert found.name == "dip_then_rise"
    assert found.change_at_dose_h == pytest.approx(96.0, abs=10.0)
    assert found.level_probability > 0.95
    assert found.level_from_dose_h == pytest.approx(180.0, abs=20.0)
    assert found.slope_percent_per_100h == pytest.approx(1e4 * 0.14 / 84.0, rel=0.2)


# ---- what is not ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("checks", [3, 5, 17])
def test_series_with_nothing_in_them_are_called_none(checks: int) -> None:
    found = [_assess(np.zeros_like, seed, 0.03, np.arange(checks, dtype=np.float64) * 12.0) for seed in range(150)]
    named = [f for f in found if f.name != "none"]
    assert len(named) <= 6  # 1 in 100 is meant: more than 6 of 150 in 1 of 1000
    assert all(f.significant for f in named)
    for form in found:
        if form.name == "none":
            assert not form.significant
            assert form.ci95 is not None
            assert form.ci95[0] < form.slope_percent_per_100h < form.ci95[1]  # type: ignore[operator]
    assert np.mean([f.p_value <= 0.05 for f in found]) == pytest.approx(0.05, abs=0.055)


def test_one_check_that_is_off_is_no_form() -> None:
    """The first one looks like a course that levels off at once, or like a dip; nearly all would be named one."""
    found = [
        _assess(course, seed)
        for seed in range(20)
        for course in (lambda d: 5.0 * SD * (d == 0.0), lambda d: -5.0 * SD * (d == 0.0))
    ]
    assert sum(form.name != "none" for form in found) <= 4


@pytest.mark.parametrize("place", [5, 16])
def test_a_form_is_told_beside_a_check_that_is_off(place: int) -> None:
    found = _assess(lambda d: 0.2 * d / 192.0 + 5.0 * SD * (np.arange(17) == place), seed=3)
    assert found.name == "monotone"
    assert found.ci95 is not None
    assert found.ci95[0] < 100.0 * 20.0 / 192.0 < found.ci95[1]


def test_what_surfaces_do_slowly_is_no_form_however_well_checks_repeat() -> None:
    noise = 0.001 * np.random.default_rng(4).standard_normal(17)
    assert forms.assess(DOSE_h, 0.007 * DOSE_h / 192.0 + noise, 0.001).name == "none"
    assert forms.assess(DOSE_h, 0.05 * DOSE_h / 192.0 + noise, 0.001).name == "monotone"


def test_a_standard_deviation_known_from_few_repeats_makes_the_null_wider() -> None:
    noise = SD * np.random.default_rng(3).standard_normal(17)
    y = noise + 0.03 * DOSE_h / 192.0
    sure, unsure = forms.assess(DOSE_h, y, SD), forms.assess(DOSE_h, y, SD, degrees_of_freedom=3.0)
    assert sure.p_value < unsure.p_value


def test_the_standard_deviation_decides() -> None:
    y = 0.1 * DOSE_h / 192.0 + SD * np.random.default_rng(1).standard_normal(17)
    assert forms.assess(DOSE_h, y, SD).name == "monotone"
    assert forms.assess(DOSE_h, y, 0.15).name == "none"


@pytest.mark.parametrize("degrees_of_freedom", [3.0, np.inf])
def test_series_that_are_passed_over_are_those_that_show_less(degrees_of_freedom: float) -> None:
    """What the bounds leave over is counted in full, wherever the limit lies."""
    x = np.sort(np.random.default_rng(5).uniform(size=9))
    x = (x - x[0]) / (x[-1] - x[0])
    errors = forms._Errors.of(x, np.full(9, SD))
    given = courses.courses_of_all(x, x, forms.COARSE_TURNS)
    evidence = forms._Evidence(np.log(given.weight), errors.whitened(given))
    white = errors.root @ forms._unchanged(errors, 0, degrees_of_freedom)
    shown = evidence.of(white)
    for least in np.quantile(shown, [0.0, 0.3, 0.9, 0.99, 1.0]) - 1e-9:
        assert evidence.reached(white, least).tolist() == np.flatnonzero(shown >= least).tolist()


def test_the_null_stops_at_the_tenth_series_that_shows_as_much() -> None:
    """The share is that of the tenth's place in the order in which series are drawn; below the limit that of all."""
    for rise, weak in [(0.0, True), (0.02, True), (0.08, False)]:
        y = rise * DOSE_h / 192.0 + SD * np.random.default_rng(7).standard_normal(17)
        x = DOSE_h / 192.0
        errors = forms._Errors.of(x, np.full(17, SD))
        given = courses.courses_of_all(x, x, forms.COARSE_TURNS)
        evidence = forms._Evidence(np.log(given.weight), errors.whitened(given))
        null = evidence.of(errors.root @ forms._unchanged(errors, 0, np.inf))
        as_much = np.flatnonzero(null >= evidence.of(errors.root @ y[:, None])[0])
        assert (len(as_much) >= 10) == weak
        expected = 10 / (1 + as_much[9]) if weak else (1 + len(as_much)) / 1000
        assert forms._p_value(given, errors, y, 0, np.inf) == pytest.approx(expected)


# ---- what does not matter ------------------------------------------------------------------------------------------


def test_order_of_rows_level_unit_and_missing_rows_do_not_matter() -> None:
    y = _paper(DOSE_h) + SD * np.random.default_rng(2).standard_normal(17)
    first = forms.assess(DOSE_h, y, SD)
    turned = np.random.default_rng(0).permutation(17)
    again = forms.assess(np.append(DOSE_h[turned], [50.0, np.nan]), np.append(y[turned] + 7.0, [np.nan, 1.0]), SD)
    assert again.probabilities == pytest.approx(first.probabilities, rel=1e-6)
    assert again.p_value == first.p_value
    scaled = forms.assess(100.0 * DOSE_h, y, SD)
    assert scaled.change_at_dose_h == pytest.approx(100.0 * (first.change_at_dose_h or 0.0))
    assert scaled.slope_percent_per_100h == pytest.approx((first.slope_percent_per_100h or 0.0) / 100.0)


def test_the_same_checks_have_the_same_answer() -> None:
    y = _paper(DOSE_h)
    assert forms.assess(DOSE_h, y, SD, seed=4) == forms.assess(DOSE_h, y, SD, seed=4)


@pytest.mark.parametrize("dose", [[], [5.0], [0.0, 0.0, 12.0, 12.0]])
def test_nothing_is_said_below_three_doses(dose: list[float]) -> None:
    found = forms.assess(dose, np.zeros(len(dose)), SD)
    assert (found.name, found.significant, found.slope_percent_per_100h) == ("none", False, None)
    assert "3 are needed" in found.why


# ---- the odds ------------------------------------------------------------------------------------------------------


def test_marginal_likelihoods_are_those_of_numerical_integration() -> None:
    """Of every tenth course of each form, over both amplitudes, the start integrated out by a very wide prior."""
    dose = np.array([0.0, 20.0, 55.0, 60.0, 90.0, 120.0])
    x, sd = dose / 120.0, np.array([0.03, 0.05, 0.03, 0.04, 0.03, 0.06])
    y = np.array([0.05, -0.02, 0.01, 0.0, 0.06, 0.04])
    start = 30.0
    nodes, share = np.polynomial.legendre.leggauss(100)
    amplitudes = np.stack(np.meshgrid(1.5 * (nodes + 1.0) / 2, 1.5 * (nodes + 1.0) / 2, indexing="ij"), -1).reshape(
        -1, 2
    )
    weights = np.outer(0.75 * share, 0.75 * share).ravel()
    errors = forms._Errors.of(x, sd)
    density = multivariate_normal(cov=_covariance(x, sd) + start**2)
    for form in courses.CHANGING:
        given = courses.courses(form, x, x, 4)
        assert given is not None
        ln = (
            forms._Evidence(np.log(given.weight), errors.whitened(given))
            .amplitudes(errors.root @ y[:, None])
            .ln_factor[:, 0]
        )
        for k in range(0, len(ln), 10):
            first, second = given.columns[k].T
            rest = y - amplitudes[:, :1] * first - amplitudes[:, 1:] * second
            prior = np.prod(
                [halfnorm(scale=s).pdf(column) for s, column in zip(given.sds[k], amplitudes.T, strict=True)], 0
            )
            total = (density.pdf(rest) / density.pdf(y) * prior) @ weights
            assert ln[k] == pytest.approx(np.log(total), abs=2e-4), (form, k)


def _ln_factors(given: courses.Courses, errors: forms._Errors, y: Floats) -> Floats:
    evidence = forms._Evidence(np.log(given.weight), errors.whitened(given))
    return evidence.amplitudes(errors.root @ y[:, None]).ln_factor[:, 0]


def _covariance(x: Floats, sd: Floats) -> Floats:
    return np.asarray(np.diag(sd**2) + forms.SLOW_SD**2 * np.minimum(x[:, None], x), np.float64)


def test_an_odd_check_is_one_with_a_larger_standard_deviation() -> None:
    """All weights at once are those of one series after the other, each with the error of that check larger."""
    x, start = DOSE_h / DOSE_h[-1], 30.0
    sd = SD * np.random.default_rng(1).uniform(0.8, 1.4, 17)
    y = 0.1 * x + sd * np.random.default_rng(2).standard_normal(17)
    given = courses.courses("dip_then_rise", x, x, 5)
    assert given is not None
    odd = forms._OddCheck.of(forms._Errors.of(x, sd), y)
    found = odd.ln_weights(given)
    plain = multivariate_normal(cov=_covariance(x, sd) + start**2).logpdf(y)
    for case in range(18):
        larger = np.where(np.arange(17) == case, forms.ODD_TIMES, 1.0) * sd
        constant = multivariate_normal(cov=_covariance(x, larger) + start**2).logpdf(y) - plain
        prior = (
            np.log(forms.ODD_SHARE) + 16 * np.log(1 - forms.ODD_SHARE)
            if case < 17
            else 17 * np.log(1 - forms.ODD_SHARE)
        )
        assert odd.ln_none[case] == pytest.approx(prior + constant, abs=1e-5)
        errors = forms._Errors.of(x, larger)
        factor = (
            forms._Evidence(np.log(given.weight), errors.whitened(given))
            .amplitudes(errors.root @ y[:, None])
            .ln_factor[:, 0]
        )
        assert found[:, case] == pytest.approx(np.log(given.weight) + factor + prior + constant, abs=1e-5)


@pytest.mark.parametrize("form", courses.CHANGING)
def test_courses_do_what_their_form_says(form: str) -> None:
    x = np.arange(9) / 8.0
    at = np.linspace(0.0, 1.0, 401)
    given = courses.courses(form, x, at, 12)
    assert given is not None
    assert given.weight.sum() == pytest.approx(1.0)
    assert (np.abs(given.columns) <= 1.0 + 1e-12).all()
    curves = given.columns @ np.array([1.0, 0.5])
    steps = np.diff(curves, axis=1)
    if form == courses.MONOTONE:
        assert ((steps >= -1e-12).all(axis=1) | (steps <= 1e-12).all(axis=1)).all()
    elif form == courses.DIP_THEN_RISE:
        assert (steps[:, 0] < 0.0).all()
        assert (curves[:, -1] > curves.min(axis=1)).all()
    else:
        assert not ((steps[:, 0] < 0.0) & (steps[:, -1] > 0.0)).any()
        slopes = np.diff(given.columns, axis=1) / np.diff(at)[:, None]
        for curve, turn in zip(slopes, given.turn, strict=True):
            for side in (curve[at[1:] < turn], curve[at[:-1] > turn]):
                assert np.ptp(side, axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_both_positive_has_the_probability_of_simulation_and_of_the_tail() -> None:
    rho = -0.6
    pairs = np.random.default_rng(0).multivariate_normal([0.4, -0.3], [[1.0, rho], [rho, 1.0]], 400_000)
    near = log_both_positive(np.array([0.4]), np.array([-0.3]), np.array([rho]))[0]
    assert np.exp(near) == pytest.approx((pairs > 0.0).all(axis=1).mean(), abs=3e-3)
    for a, b, rho in [(-9.0, 2.0, 0.5), (-30.0, -25.0, 0.9), (-8.0, 8.0, -0.95), (-12.0, -1.0, -0.3)]:
        r = np.sqrt(1.0 - rho**2)
        z = np.linspace(-a, -a + 40.0, 800_001)
        ln_f = -(z**2) / 2 + log_ndtr((b + rho * z) / r)
        top = ln_f.max()
        exact = top + np.log(np.trapezoid(np.exp(ln_f - top), z) / np.sqrt(2.0 * np.pi))
        found = log_both_positive(np.array([a]), np.array([b]), np.array([rho]))[0]
        assert found == pytest.approx(exact, abs=1e-6)
