"""The noise of a channel: its filter is the dense covariance, and its variances are recovered from data."""

from __future__ import annotations

import numpy as np
import pytest

from twin.diagnosis.reml import ObservedSeries, as_fast_as_slow, floor, log_evidence, reml, says_wrong_form
from twin.errors import EvidenceError
from twin.fitting.noise import Array, ChannelNoise, Series, floor_variance, log_det, whiten

NOISE = ChannelNoise(ar_sd=0.12, ar_tau_s=60.0, ou_sd=0.2, ou_tau_s=600.0)


def _series(blocks: int, seed: int = 0, session: int = 0, channel: str = "teeth", gaps: float = 0.05) -> Series:
    rng = np.random.default_rng(seed)
    t = np.cumsum(np.where(rng.random(blocks) < gaps, 470.0, 10.0))
    return Series(session, channel, t, np.zeros(blocks), rng.integers(5, 11, blocks).astype(float), 0.1, 0.1)


def _dense(series: Series, noise: ChannelNoise) -> Array:
    apart = np.abs(series.t_s[:, None] - series.t_s)
    slow = noise.ou_sd**2 * np.exp(-apart / noise.ou_tau_s)
    covariance: Array = np.diag(series.white_variance) + noise.ar_sd**2 * np.exp(-apart / noise.ar_tau_s) + slow
    return covariance


@pytest.mark.parametrize(
    "noise",
    [
        NOISE,
        ChannelNoise(0.0, 60.0, 0.0, 600.0),
        ChannelNoise(0.3, 20.0, 0.0, 200.0),
        ChannelNoise(0.0, 20.0, 1.0, 2000.0),
    ],
)
def test_whitening_across_gaps_is_that_of_the_dense_covariance(noise: ChannelNoise) -> None:
    series = _series(200)
    x = np.random.default_rng(1).standard_normal((200, 3))
    white = whiten(series, noise, x)
    dense = x.T @ np.linalg.solve(_dense(series, noise), x)
    np.testing.assert_allclose(white.T @ white, dense, rtol=1e-9, atol=1e-9 * np.abs(dense).max())
    assert log_det(series, noise) == pytest.approx(np.linalg.slogdet(_dense(series, noise))[1], rel=1e-9)


def test_whitened_rows_are_the_innovations_of_the_rows_before_them() -> None:
    series = _series(60)
    x = np.random.default_rng(2).standard_normal((60, 2))
    innovations = np.linalg.solve(np.linalg.cholesky(_dense(series, NOISE)), x)
    np.testing.assert_allclose(whiten(series, NOISE, x), innovations, atol=1e-9)


def test_whitening_is_linear_and_leaves_its_argument_alone() -> None:
    series = _series(50)
    x, y = np.random.default_rng(3).standard_normal((2, 50, 2))
    kept = x.copy()
    np.testing.assert_allclose(
        whiten(series, NOISE, 2 * x - y), 2 * whiten(series, NOISE, x) - whiten(series, NOISE, y), atol=1e-12
    )
    np.testing.assert_array_equal(x, kept)


def test_white_noise_counts_the_samples_of_a_block_and_the_rounding() -> None:
    series = Series(0, "teeth", np.array([0.0, 10.0]), np.zeros(2), np.array([10.0, 5.0]), 0.3, 0.12)
    np.testing.assert_allclose(series.white_variance, [(0.09 + 0.0012) / 10, (0.09 + 0.0012) / 5])


def test_what_cannot_be_whitened_is_refused_with_channel_and_session() -> None:
    series = _series(5)
    with pytest.raises(EvidenceError, match=r'channel "teeth" of session 0: columns of shape \(4, 2\) for 5 blocks'):
        whiten(series, NOISE, np.zeros((4, 2)))
    back = Series(3, "yoke", np.array([0.0, 10.0, 5.0]), np.zeros(3), np.ones(3), 0.1, 0.1)
    with pytest.raises(EvidenceError, match='channel "yoke" of session 3: block times do not rise'):
        log_det(back, NOISE)
    silent = Series(0, "yoke", np.array([0.0, 10.0]), np.zeros(2), np.ones(2), 0.0, 0.0)
    with pytest.raises(EvidenceError, match="its noise has no variance: give it a white noise or a resolution"):
        log_det(silent, ChannelNoise(0.0, 60.0, 0.0, 600.0))


def test_the_floor_is_white_and_autoregressive_noise() -> None:
    series = Series(0, "teeth", np.array([0.0, 10.0]), np.zeros(2), np.array([1.0, 1.0]), 0.3, 0.0)
    assert floor_variance(series, NOISE) == pytest.approx(0.09 + 0.0144)


# --- Restricted maximum likelihood -----------------------------------------------------------------------------------


def _campaign(seed: int, noises: dict[str, ChannelNoise], parameters: int = 12) -> list[ObservedSeries]:
    """Three sessions a channel; smooth parameter columns that hide part of the slow noise."""
    rng = np.random.default_rng(seed)
    beta = rng.standard_normal(parameters)
    observed = []
    for i, (channel, noise) in enumerate(noises.items()):
        for session in range(3):
            series = _series(300, 100 * seed + 10 * i + session, session, channel, gaps=0.01)
            phase = np.linspace(0, 1, 300)[:, None] * rng.uniform(0, 12, parameters) + rng.uniform(0, 6, parameters)
            columns = 0.5 * np.sin(phase)
            draw = np.linalg.cholesky(_dense(series, noise)) @ rng.standard_normal(300)
            observed.append(ObservedSeries(series, columns @ beta + draw, columns))
    return observed


def test_planted_variances_are_recovered_over_seeds_with_the_parameters_integrated_out() -> None:
    planted = {"teeth": ChannelNoise(0.1, 60.0, 0.25, 600.0), "magnet": ChannelNoise(0.2, 60.0, 0.1, 600.0)}
    ratios, times = [], []
    for seed in range(4):
        found = reml(_campaign(seed, planted), np.ones(12), 600.0, {"teeth": 20.0, "magnet": 20.0})
        ratios.append([[found[c].ar_sd / n.ar_sd, found[c].ou_sd / n.ou_sd] for c, n in planted.items()])
        times.append(found["teeth"].ar_tau_s)
    mean = np.mean(ratios, axis=0)
    np.testing.assert_allclose(mean[:, 0], 1.0, atol=0.1)  # the autoregression, on some 900 blocks a channel
    np.testing.assert_allclose(mean[:, 1], 1.0, atol=0.3)  # the slow one: three sessions of five correlation times each
    assert times == [60.0] * 4


def test_parameters_are_not_taken_for_noise_nor_noise_for_parameters() -> None:
    """A least-squares residual has lost what the parameters took: its variance is too small, the restricted one is
    not."""
    planted = {"teeth": ChannelNoise(0.1, 60.0, 0.25, 600.0)}
    many, few = [], []
    for seed in range(3):
        observed = _campaign(seed, planted, parameters=40)
        stacked, e0 = np.vstack([o.columns for o in observed]), np.concatenate([o.e0 for o in observed])
        residual = e0 - stacked @ np.linalg.lstsq(stacked, e0, rcond=None)[0]
        left = np.split(residual, 3)
        bare = [ObservedSeries(o.series, r, np.zeros((300, 1))) for o, r in zip(observed, left, strict=True)]
        many.append(reml(observed, np.ones(40), 600.0, {"teeth": 20.0})["teeth"].ou_sd)
        few.append(reml(bare, np.ones(1), 600.0, {"teeth": 20.0})["teeth"].ou_sd)
    assert np.mean(many) == pytest.approx(0.25, rel=0.4)
    assert np.mean(few) < 0.7 * np.mean(many)


def test_the_result_is_at_the_top_of_the_evidence_of_the_dense_covariance() -> None:
    observed = _campaign(7, {"teeth": NOISE}, parameters=5)
    result = reml(observed, np.full(5, 0.5), 600.0, {"teeth": 20.0})
    found = result["teeth"]

    def evidence(ar_sd: float, ou_sd: float) -> float:
        noise = ChannelNoise(ar_sd, found.ar_tau_s, ou_sd, found.ou_tau_s)
        r = np.zeros((900, 900))
        for i, o in enumerate(observed):
            r[300 * i : 300 * i + 300, 300 * i : 300 * i + 300] = _dense(o.series, noise)
        x, e0 = np.vstack([o.columns for o in observed]), np.concatenate([o.e0 for o in observed])
        total = r + x @ x.T / 0.5
        return float(-(np.linalg.slogdet(total)[1] + e0 @ np.linalg.solve(total, e0) + (ou_sd / 0.5) ** 2) / 2)

    best = evidence(found.ar_sd, found.ou_sd)
    assert log_evidence(observed, np.full(5, 0.5), result) == pytest.approx(best, abs=1e-6)
    around = [evidence(found.ar_sd * a, found.ou_sd * o) for a, o in ((1.1, 1), (0.9, 1), (1, 1.2), (1, 0.8))]
    assert max(around) < best + 0.01


def test_a_quiet_channel_keeps_a_slow_discrepancy_of_a_share_of_its_rise() -> None:
    observed = _campaign(1, {"teeth": ChannelNoise(0.1, 60.0, 0.0, 600.0)})
    assert reml(observed, np.ones(12), 600.0, {"teeth": 50.0})["teeth"].ou_sd >= 0.15


def test_series_that_do_not_fit_their_parameters_are_refused() -> None:
    observed = _campaign(1, {"teeth": NOISE})
    with pytest.raises(EvidenceError, match="give one column a parameter"):
        reml(observed, np.ones(11), 600.0, {"teeth": 50.0})
    with pytest.raises(EvidenceError, match='channel "teeth": no rise is given'):
        reml(observed, np.ones(12), 600.0, {})
    broken = [ObservedSeries(o.series, np.where(np.arange(300) == 7, np.nan, o.e0), o.columns) for o in observed]
    with pytest.raises(EvidenceError, match="residual or columns are not finite: leave their blocks out"):
        reml(broken, np.ones(12), 600.0, {"teeth": 50.0})
    with pytest.raises(EvidenceError, match="a parameter has no prior"):
        reml(observed, np.zeros(12), 600.0, {"teeth": 50.0})


def test_a_wrong_form_is_as_wrong_fast_as_it_is_slow() -> None:
    rise = {"A": 100.0, "B": 100.0, "C": 100.0}
    slow = floor(100.0)[1]
    noise = {
        "A": ChannelNoise(0.05, 20.0, slow, 600.0),
        "B": ChannelNoise(0.05, 20.0, 1.0, 600.0),
        "C": ChannelNoise(2.0, 20.0, 1.0, 600.0),
    }
    found = as_fast_as_slow(noise | {"P": noise["B"]}, rise | {"without samples": 100.0})
    assert found.keys() == noise.keys() | {"P"} and found["P"] == noise["B"], "a meter is no thermometer"
    assert found["A"] == noise["A"], "as slow as its floor: a lumped model is no better than that"
    assert found["B"] == ChannelNoise(np.sqrt(1.0 - slow**2), 60.0, 1.0, 600.0)
    assert found["C"] == noise["C"], "faster already"


def test_the_form_is_wrong_where_one_channel_is_beyond_twice_its_floor() -> None:
    slow = floor(100.0)[1]
    calm, wild = (ChannelNoise(0.05, 20.0, times * slow, 600.0) for times in (1.9, 2.1))
    assert not says_wrong_form({"A": calm, "B": calm}, {"A": 100.0, "B": 100.0})
    assert says_wrong_form({"A": calm, "B": wild}, {"A": 100.0, "B": 100.0})
    assert not says_wrong_form({"A": calm, "P": wild}, {"A": 100.0, "without samples": 100.0})
