"""Evidence for one more term: it is the Gaussian evidence itself, and what is made of it adds up."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from twin.diagnosis.evidence import (
    TOLD_APART,
    Projector,
    log_bayes_factor,
    null_quantile,
    posterior,
    prior_masses,
    score,
    separation,
    told_apart_class,
)
from twin.errors import EvidenceError
from twin.fitting.noise import Array
from twin.motor.causes import parse


def _problem(seed: int, rows: int = 40, parameters: int = 6, candidates: int = 5) -> tuple[Array, Array, Array, Array]:
    """A, precision, V, e0 of a problem whose candidates are in part what calibration can do as well."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((rows, parameters))
    v = rng.standard_normal((rows, candidates)) + 2 * a @ rng.standard_normal((parameters, candidates))
    precision = rng.uniform(0.2, 5, parameters)
    e0 = a @ rng.normal(0, precision**-0.5) + 0.5 * v[:, 0] + rng.standard_normal(rows)
    return a, precision, v, e0


def _mean(a: Array, precision: Array, e0: Array) -> Array:
    """The parameters of the mode of e0."""
    return np.asarray(np.linalg.solve(a.T @ a + np.diag(precision), a.T @ e0), np.float64)


def _log_density(e: Array, covariance: Array) -> float:
    return float(multivariate_normal(cov=covariance).logpdf(e))


@pytest.mark.parametrize("seed", range(6))
def test_the_bayes_factor_is_the_ratio_of_two_gaussian_evidences(seed: int) -> None:
    a, precision, v, e0 = _problem(seed)
    sigma = np.random.default_rng(seed).uniform(0.05, 3, 5)
    scores = score(v, e0, Projector.of(a, precision), sigma, np.zeros(5))
    without = np.eye(len(e0)) + (a / precision) @ a.T
    for c in range(5):
        brute = _log_density(e0, without + sigma[c] ** 2 * np.outer(v[:, c], v[:, c])) - _log_density(e0, without)
        assert scores.log_bayes_factor[c] == pytest.approx(brute, abs=1e-8)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_known_sign_integrates_over_half_of_the_prior(sign: float) -> None:
    a, precision, v, e0 = _problem(3, candidates=1)
    sigma = 0.3
    scores = score(v, e0, Projector.of(a, precision), np.array([sigma]), np.array([sign]))
    without = multivariate_normal(cov=np.eye(len(e0)) + (a / precision) @ a.T)

    def integrand(size: float) -> float:
        prior = 2 * np.exp(-(size**2) / (2 * sigma**2)) / (sigma * np.sqrt(2 * np.pi))
        return float(prior * np.exp(without.logpdf(e0 - sign * size * v[:, 0]) - without.logpdf(e0)))

    brute = np.log(quad(integrand, 0, 8 * sigma, epsabs=0, epsrel=1e-11, limit=200)[0])
    assert scores.log_bayes_factor[0] == pytest.approx(brute, abs=1e-8)


def test_an_amplitude_is_that_of_the_joint_fit() -> None:
    a, precision, v, e0 = _problem(1, candidates=1)
    scores = score(v, e0, Projector.of(a, precision), np.array([0.7]), np.zeros(1))
    joint = _mean(np.column_stack([a, v]), np.append(precision, 0.7**-2), e0)
    assert scores.amplitude[0] == pytest.approx(joint[-1])


def test_a_residual_at_the_calibrated_mode_is_referred_back_to_the_prior_mean_before_it_is_scored() -> None:
    """s = v'P e0 = v'e at the mode. P applied to e counts the calibration twice and loses the hard candidates."""
    a, precision, v, _ = _problem(2)
    projector = Projector.of(a, precision)
    hard = a @ np.ones(6) + 0.3 * v[:, 1]  # mostly what calibration does as well
    e0 = 20 * hard
    beta = _mean(a, precision, e0)
    at_mode = e0 - a @ beta
    assert projector.inner(hard, at_mode + a @ beta) == pytest.approx(hard @ at_mode)
    j, one, unsigned = projector.inner(hard[:, None], hard), np.ones(1), np.zeros(1)
    right = log_bayes_factor(projector.inner(hard[:, None], e0), j, one, unsigned)[0]
    twice = log_bayes_factor(projector.inner(hard[:, None], at_mode), j, one, unsigned)[0]
    brute = np.eye(40) + (a / precision) @ a.T
    assert right == pytest.approx(_log_density(e0, brute + np.outer(hard, hard)) - _log_density(e0, brute), abs=1e-8)
    assert twice < right - 10


def test_the_projector_is_the_marginal_precision_and_not_idempotent() -> None:
    a, precision, v, e0 = _problem(4)
    projector = Projector.of(a, precision)
    dense = np.linalg.inv(np.eye(40) + (a / precision) @ a.T)
    np.testing.assert_allclose(projector.inner(v, v), v.T @ dense @ v, atol=1e-9)
    at_mode = e0 - a @ _mean(a, precision, e0)
    np.testing.assert_allclose(at_mode, dense @ e0, atol=1e-10)
    assert not np.allclose(dense @ at_mode, at_mode, atol=1e-3)


def test_rows_that_are_zero_elsewhere_need_not_be_given() -> None:
    a, precision, v, _ = _problem(6)
    projector, part = Projector.of(a, precision), np.zeros((40, 5))
    part[10:20] = v[10:20]
    np.testing.assert_allclose(projector.seen(v[10:20], slice(10, 20)), projector.seen(part), atol=1e-12)


def test_what_calibration_explains_wholly_scores_nothing() -> None:
    a, _, _, e0 = _problem(0)
    free = Projector.of(a, np.full(6, 1e-12))
    scores = score(a[:, :1], e0, free, np.ones(1), np.zeros(1))
    assert scores.J[0] == pytest.approx(0, abs=1e-9)
    assert scores.log_bayes_factor[0] == pytest.approx(0, abs=1e-6)


def test_columns_and_priors_that_do_not_fit_are_refused() -> None:
    a, precision, v, e0 = _problem(0)
    with pytest.raises(EvidenceError, match=r"columns of shape \(40, 6\) with precision \(5,\): give one a column"):
        Projector.of(a, precision[:5])
    with pytest.raises(EvidenceError, match="parameter 2 has no prior: give it a standard deviation"):
        Projector.of(a, np.where(np.arange(6) == 2, 0.0, precision))
    with pytest.raises(EvidenceError, match="column 3 is not finite: mask its gaps first"):
        Projector.of(np.where(np.arange(6) == 3, np.nan, a), precision)
    projector = Projector.of(a, precision)
    with pytest.raises(EvidenceError, match=r"candidates of shape \(40, 5\) for 40 rows, 4 sigmas"):
        score(v, e0, projector, np.ones(4), np.zeros(4))
    with pytest.raises(EvidenceError, match="candidate 1 has sigma 0: give a size above 0"):
        score(v, e0, projector, np.array([1.0, 0, 1, 1, 1]), np.zeros(5))


# --- Told apart and probabilities ------------------------------------------------------------------------------------


def test_the_expected_separation_is_the_lead_that_noise_free_data_give() -> None:
    a, precision, v, _ = _problem(8)
    projector = Projector.of(a, precision)
    gram = projector.inner(v, v)
    size = 0.9
    s, j = projector.inner(v, size * v[:, 2]), np.diag(gram)
    lead = s[2] ** 2 / (2 * j[2]) - s**2 / (2 * j)
    np.testing.assert_allclose(separation(np.full(5, size), gram)[2], lead, atol=1e-9)


def test_a_column_that_is_another_times_a_number_is_never_told_apart() -> None:
    gram = np.array([[4.0, -8.0], [-8.0, 16.0]])
    np.testing.assert_allclose(separation(np.array([5.0, 5.0]), gram), 0.0, atol=1e-12)


def test_a_candidate_that_the_data_cannot_see_is_not_expected_to_lead() -> None:
    gram = np.diag([4.0, -1e-13])  # rounding may leave a J just below 0
    np.testing.assert_allclose(separation(np.array([2.0, 2.0]), gram), [[0.0, 8.0], [0.0, 0.0]], atol=1e-12)


def test_the_class_holds_what_is_within_ln_20_of_the_leader_and_close_to_it() -> None:
    log_bf = np.array([50.0, 49.0, 48.5, 40.0, 49.5, 49.8])
    expected = np.array([0.0, 1.0, 100.0, 0.5, 100.0, 0.1])
    refitted = np.array([True, False, True, False, False, True])
    possible = np.array([True, True, True, True, True, False])
    # 2 was refitted and is near; 3 is far behind; 4 only seems near, for its column is another; 5 cannot be so large
    assert told_apart_class(0, log_bf, expected, refitted, possible) == (0, 1, 2)
    assert told_apart_class(0, log_bf, expected, refitted, possible)[0] == 0


def test_two_are_told_apart_from_exactly_twenty_to_one_on() -> None:
    none, yes = np.zeros(2, bool), np.ones(2, bool)
    just_below, just_above = np.array([10.0, 10 - TOLD_APART + 1e-9]), np.array([10.0, 10 - TOLD_APART - 1e-9])
    assert told_apart_class(0, just_below, np.zeros(2), none, yes) == (0, 1)
    assert told_apart_class(0, just_above, np.zeros(2), none, yes) == (0,)


IDS = ("loss.magnet.scale", "loss.magnet.speed2", "loss.teeth.scale", "sensor.magnet.lag")


def test_prior_mass_is_split_by_kind_then_place_then_law() -> None:
    np.testing.assert_allclose(prior_masses([parse(i) for i in IDS]), [0.05, 0.05, 0.1, 0.2])


def test_writing_more_laws_for_one_place_takes_nothing_from_another() -> None:
    more = [parse(i) for i in (*IDS, "loss.magnet.speed3", "loss.magnet.current2")]
    masses = prior_masses(more)
    assert masses.sum() == pytest.approx(0.4)
    np.testing.assert_allclose(masses[2:4], [0.1, 0.2])


def test_probabilities_sum_to_one_and_classes_share_them() -> None:
    prior = prior_masses([parse(i) for i in IDS])
    result = posterior(np.array([1000.0, 999.0, 3.0, -2.0]), prior, 5.0)
    assert result.none + result.unknown + result.candidates.sum() == pytest.approx(1.0)
    assert result.of_class((0, 1)) == pytest.approx(1.0)
    assert result.of_member(0, (0, 1)) == pytest.approx(1 / (1 + np.exp(-1)))
    assert result.of_member(2, (2,)) == 1.0


def test_data_that_say_nothing_leave_the_prior_as_it_is() -> None:
    prior = prior_masses([parse(i) for i in IDS])
    result = posterior(np.zeros(4), prior, 0.0)
    assert [result.none, result.unknown] == pytest.approx([0.5, 0.1])
    np.testing.assert_allclose(result.candidates, prior)


def test_the_null_quantile_is_that_of_simulated_healthy_motors() -> None:
    a, precision, v, _ = _problem(9, candidates=8)
    projector, sigma, sign = Projector.of(a, precision), np.full(8, 0.5), np.array([0.0, 1, -1, 0, 0, 0, 1, 0])
    quantile = null_quantile(projector.inner(v, v), sigma, sign)
    rng = np.random.default_rng(0)
    largest = []
    for _ in range(3000):
        e0 = a @ rng.normal(0, precision**-0.5) + rng.standard_normal(40)
        largest.append(score(v, e0, projector, sigma, sign).log_bayes_factor.max())
    assert np.mean(np.array(largest) > quantile) == pytest.approx(0.05, abs=0.015)


def test_twin_columns_count_once_in_the_null_quantile() -> None:
    one = np.array([[4.0]])
    many = np.full((6, 6), 4.0)
    assert null_quantile(many, np.ones(6), np.zeros(6)) == pytest.approx(
        null_quantile(one, np.ones(1), np.zeros(1)), abs=0.35
    )
