"""A free heat at a node: its evidence is the Gaussian one, and its course is found back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from twin.diagnosis.evidence import Projector, score
from twin.diagnosis.unknown import (
    CORRELATION_S,
    SIZE_PRIOR,
    SIZES,
    Response,
    active_ranges,
    associations,
    correlation_in_time,
    free_heat,
    tent_times,
    tents,
)
from twin.errors import EvidenceError
from twin.fitting.noise import Array

TOTAL_W = 2000.0


def _impulse(t: Array, times: Array, capacity: float, tau: float) -> Array:
    """(N, q) response of one lump to 1 W at each tent, by small steps."""
    step = float(t[1] - t[0])
    heat, out, state = tents(t, times), np.zeros((len(t), len(times))), np.zeros(len(times))
    for i in range(len(t)):
        state = state + step * (heat[i] / capacity - state / tau)
        out[i] = state
    return out


def _campaign(sessions: int = 2, rows: int = 360, sd: float = 0.3) -> tuple[list[Response], Projector]:
    """Whitened responses of each session (`_times`), and what calibration can do as well."""
    t = 10.0 * np.arange(rows, dtype=np.float64)
    times = _times(rows)
    columns = _impulse(t, times, 800.0, 900.0) / sd
    alike = correlation_in_time(times)
    responses = [Response(slice(k * rows, (k + 1) * rows), alike, columns) for k in range(sessions)]
    start = np.exp(-t / 900.0)[:, None] / sd
    calibration = np.vstack([np.kron(np.eye(sessions), start).T, np.tile(columns.sum(axis=1), sessions)]).T
    return responses, Projector.of(calibration, np.array([*[1.0] * sessions, 1 / 50.0**2]))


def _times(rows: int = 360) -> Array:
    return tent_times(10.0 * (rows - 1))


def test_tents_stand_every_300_s_and_sum_to_one_between_the_first_and_the_last() -> None:
    np.testing.assert_array_equal(tent_times(700.0), [0.0, 300.0, 600.0, 900.0])
    np.testing.assert_allclose(tents(np.linspace(0, 700, 50), tent_times(700.0)).sum(axis=1), 1.0)


def test_the_evidence_is_the_gaussian_one_averaged_over_the_sizes() -> None:
    responses, projector = _campaign(rows=70)
    e0 = np.random.default_rng(0).standard_normal(140) * 3
    times = _times(70)
    x = np.zeros((140, 2 * len(times)))
    correlation = np.zeros((x.shape[1], x.shape[1]))
    for k, r in enumerate(responses):
        own = slice(k * len(times), (k + 1) * len(times))
        x[r.rows, own] = r.columns
        correlation[own, own] = np.exp(-np.abs(times[:, None] - times) / CORRELATION_S)
    without = np.eye(140) + (projector.columns / projector.precision) @ projector.columns.T
    heat = x @ correlation @ x.T
    base = multivariate_normal(cov=without).logpdf(e0)
    brute = [multivariate_normal(cov=without + (g * TOTAL_W) ** 2 * heat).logpdf(e0) - base for g in SIZES]
    log_prior = np.log(SIZES) - (SIZES / SIZE_PRIOR) ** 2 / 2
    expected = logsumexp(np.array(brute) + log_prior) - logsumexp(log_prior)
    assert free_heat("magnet", responses, e0, projector, TOTAL_W).log_bayes_factor == pytest.approx(expected, abs=1e-8)


def test_a_heat_of_any_course_is_found_back_within_its_band() -> None:
    responses, projector = _campaign()
    times = _times()
    truth = np.concatenate([100 * np.sin(times / 700.0), 80 * np.cos(times / 900.0)])
    signal = np.concatenate([r.columns @ truth[i * len(times) : (i + 1) * len(times)] for i, r in enumerate(responses)])
    e0 = signal + np.random.default_rng(1).standard_normal(len(signal))
    found = free_heat("magnet", responses, e0, projector, TOTAL_W)
    assert found.log_bayes_factor > 100
    assert np.corrcoef(found.watts, truth)[0, 1] > 0.95
    assert np.mean(np.abs(found.watts - truth) < 2 * found.sd) > 0.85


def test_healthy_residuals_hold_no_free_heat() -> None:
    responses, projector = _campaign()
    rng = np.random.default_rng(2)
    for _ in range(20):
        e0 = projector.columns @ rng.normal(0, projector.precision**-0.5) + rng.standard_normal(720)
        assert free_heat("magnet", responses, e0, projector, TOTAL_W).log_bayes_factor < 3


def test_a_named_law_beats_free_heat_on_its_own_effect_and_loses_on_another() -> None:
    responses, projector = _campaign()
    times = _times()
    law = np.tile(np.sin(times / 500.0) ** 2, 2)
    other = np.tile(np.where((times > 900) & (times < 1900), 1.0, 0.0), 2)
    q = len(times)
    columns = [
        np.concatenate([r.columns @ h[i * q : (i + 1) * q] for i, r in enumerate(responses)]) for h in (law, other)
    ]
    noise = np.random.default_rng(3).standard_normal(len(columns[0]))
    for column, named_wins in ((columns[0], True), (columns[1], False)):
        e0 = 60 * column + noise
        named = score(columns[0][:, None], e0, projector, np.array([0.05 * TOTAL_W]), np.zeros(1))
        free = free_heat("magnet", responses, e0, projector, TOTAL_W).log_bayes_factor
        assert (named.log_bayes_factor[0] > free) == named_wins


def test_a_free_heat_needs_a_loss_to_be_sized_by() -> None:
    responses, projector = _campaign(rows=70)
    with pytest.raises(EvidenceError, match="mean total loss 0 W: a free heat is sized by a loss above 0"):
        free_heat("magnet", responses, np.zeros(140), projector, 0.0)


def _features(seed: int, q: int = 80) -> dict[str, Array]:
    rng = np.random.default_rng(seed)
    smooth = {
        name: np.convolve(rng.random(q + 4), np.ones(5) / 5, "valid") for name in ("speed", "current", "temperature")
    }
    return {**smooth, "flow": np.full(q, 10.0)}


def test_the_heat_goes_with_the_feature_that_made_it() -> None:
    features = _features(0)
    heat = 30 + 200 * features["temperature"] + np.random.default_rng(1).normal(0, 2, 80)
    found = associations(heat, features, block=4)
    assert [a.feature for a in found if a.clear] == ["temperature"]
    assert found[0].watts == pytest.approx(200 * features["temperature"].std(), rel=0.05)
    assert found[0].low < found[0].watts < found[0].high
    assert "flow" not in {a.feature for a in found}  # it never moved


def test_the_band_holds_what_is_not_there_about_as_often_as_it_says() -> None:
    clear = [
        a.clear for seed in range(30) for a in associations(_features(seed + 100)["speed"], _features(seed), block=8)
    ]
    assert np.mean(clear) < 0.25  # 5 % with long data; runs of a tenth of the data are few


def test_runs_and_features_that_do_not_fit_are_refused() -> None:
    with pytest.raises(EvidenceError, match="80 tents in runs of 0: give each feature one mean a tent"):
        associations(np.zeros(80), _features(0), block=0)
    with pytest.raises(EvidenceError, match="79 tents in runs of 4"):
        associations(np.zeros(79), _features(0), block=4)


def test_where_the_heat_is_large_is_said_with_sign() -> None:
    temperature = np.linspace(20, 120, 101)
    features = {"current": temperature / 100, "flow": np.linspace(0.99, 1.0, 101)}
    watts, (low, high), among = active_ranges(np.where(temperature > 80, -40.0, 0.0), temperature, features)
    assert watts == (-40.0, -40.0)
    assert low > 80 and high <= 120
    assert list(among) == ["current"], "the flow is the same all the time"
    assert among["current"][0] > 0.8
