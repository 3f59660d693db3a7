"""The variances of the channels' noise by restricted maximum likelihood, calibration integrated out.

The variances sought make `-(ln|R| + ln|A'A + Lambda| - ln|Lambda| + e0' P e0) / 2` largest: the evidence of the
residual with every parameter of the calibration (and the leading candidates, whose columns are among A) integrated out
under its prior, plus a half-normal prior on the slow discrepancy. Patterson and Thompson, Biometrika 58 (1971) 545, DOI
10.1093/biomet/58.3.545.

The search is expectation maximisation over the parameters (Dempster, Laird and Rubin 1977): given their posterior, each
channel's two variances have a likelihood of their own, of the residual at the mode and of what the parameters' spread
does to it (a few orthogonal draws), which costs O(B).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize

from twin.errors import EvidenceError
from twin.fitting.noise import Array, ChannelNoise, Series, deviance, log_det, whiten

AR_TAUS_S = (20.0, 60.0, 180.0)
OU_SHARES = (1 / 3, 1.0)  # of the slowest mode
OU_PRIOR_K = 0.5  # half-normal, on ou_sd
OU_FLOOR_SHARE = 0.003  # of the channel's rise over the coolant: a lumped model is no better than that
AR_FLOOR_SHARE = 0.0005  # of the same rise: the least fast discrepancy
START = (0.15, 0.15)  # ar_sd, ou_sd [K]
BOUNDS_K = (1e-3, 5.0)
DRAWS = 16
FIRST_PASS, SECOND_PASS = 2, 10  # steps of expectation maximisation
CONVERGED = 0.01  # largest change of ln sd
WRONG_IN_FORM = 2.0  # times the floor of the slow part: from there on a channel says that the model's form is wrong
FORM_TAU_S = 60.0  # of the fast part of what a wrong form leaves


@dataclass(frozen=True)
class ObservedSeries:
    """One series: its residual `e0` (B,) [K], referred back to the prior mean, and its parameters' `columns` (B, p)."""

    series: Series
    e0: Array
    columns: Array


Every = Sequence[ObservedSeries]
Noise = Mapping[str, ChannelNoise]  # by channel
Floors = Mapping[str, tuple[float, float]]  # channel -> least fast and slow sd [K]


def reml(
    observed: Every, precision: Array, slowest_mode_s: float, rise_K: Mapping[str, float]
) -> dict[str, ChannelNoise]:
    """Noise of every channel of `observed`, a channel's variances shared by its sessions.

    `precision` (p,): 1 / sd^2 of each parameter's prior. `rise_K`: channel -> its rise over the coolant [K], of which
    0.3 % is the least slow discrepancy. The two times are the same for all channels: the best pair of three and two.
    Raises `EvidenceError` where columns and precision do not fit, are not finite, or a channel has no rise.
    """
    _check(observed, precision, rise_K)
    channels = dict.fromkeys(o.series.channel for o in observed)
    floors = {c: floor(rise_K[c]) for c in channels}
    z = _orthogonal_draws(len(precision))
    tried: list[dict[str, ChannelNoise]] = []
    for tau_a, share in itertools.product(AR_TAUS_S, OU_SHARES):
        start = {
            c: ChannelNoise(max(START[0], ar), tau_a, max(START[1], ou), share * slowest_mode_s)
            for c, (ar, ou) in floors.items()
        }
        tried.append(_climb(observed, precision, start, floors, z, FIRST_PASS))
    best = max(tried, key=lambda noise: log_evidence(observed, precision, noise))
    return _climb(observed, precision, best, floors, z, SECOND_PASS)


def floor(rise_K: float) -> tuple[float, float]:
    """Least fast and slow sd [K] of a channel that rises so far."""
    return max(BOUNDS_K[0], AR_FLOOR_SHARE * rise_K), max(BOUNDS_K[0], OU_FLOOR_SHARE * rise_K)


def says_wrong_form(noise: Noise, rise_K: Mapping[str, float]) -> bool:
    """Whether any channel of `rise_K` is so far off that the model's form must be wrong, not its numbers."""
    known = rise_K.keys() & noise.keys()  # a channel without samples has no noise
    return any(noise[channel].ou_sd > WRONG_IN_FORM * floor(rise_K[channel])[1] for channel in known)


def as_fast_as_slow(noise: Noise, rise_K: Mapping[str, float]) -> dict[str, ChannelNoise]:
    """The noise with the fast part of each channel of `rise_K` at least as large as its slow one is beyond the floor.

    A slow discrepancy above its floor is the form of the model that is wrong, and a wrong form is wrong at every step
    of an input too. Likelihood sees little of that, as steps are few among quiet hours, and would let tenths of a
    kelvin at a stop outweigh kelvins that are held for an hour.
    """
    rises = {channel: rise_K[channel] for channel in noise if channel in rise_K}
    return {**noise, **{channel: _with_fast(noise[channel], floor(rise)[1]) for channel, rise in rises.items()}}


def _with_fast(noise: ChannelNoise, slow_floor: float) -> ChannelNoise:
    of_form = float(np.sqrt(max(0.0, noise.ou_sd**2 - slow_floor**2)))
    return noise if of_form <= noise.ar_sd else replace(noise, ar_sd=of_form, ar_tau_s=FORM_TAU_S)


def _check(observed: Every, precision: Array, rise_K: Mapping[str, float]) -> None:
    for o in observed:
        if o.columns.shape != (len(o.e0), len(precision)):
            raise EvidenceError(
                f'channel "{o.series.channel}" of session {o.series.session}: columns of shape {o.columns.shape} for'
                f" {len(o.e0)} blocks and {len(precision)} parameters: give one column a parameter"
            )
        if o.series.channel not in rise_K:
            raise EvidenceError(
                f'channel "{o.series.channel}": no rise is given: say how far it rises over the coolant'
            )
        if not (np.isfinite(o.e0).all() and np.isfinite(o.columns).all()):
            raise EvidenceError(
                f'channel "{o.series.channel}" of session {o.series.session}: residual or columns are not finite:'
                " leave their blocks out"
            )
    if not (precision > 0).all():
        raise EvidenceError("a parameter has no prior: give each a standard deviation")


def _orthogonal_draws(p: int) -> Array:
    """(p, q) whose mean outer product is the identity on average, and exactly so from q = p on."""
    q, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((p, min(p, DRAWS))))
    result: Array = q * np.sqrt(p)
    return result


def _climb(
    observed: Every, precision: Array, noise: Noise, floors: Floors, z: Array, steps: int
) -> dict[str, ChannelNoise]:
    current = dict(noise)
    for _ in range(steps):
        spread = _posterior_columns(observed, precision, current, z)
        better = {c: _channel_noise(observed, spread, c, n, floors[c]) for c, n in current.items()}
        change = max(_change(current[c], better[c]) for c in current)
        current = better
        if change < CONVERGED:
            break
    return current


def _change(a: ChannelNoise, b: ChannelNoise) -> float:
    return float(max(abs(np.log(a.ar_sd / b.ar_sd)), abs(np.log(a.ou_sd / b.ou_sd))))


def _normal_equations(observed: Every, precision: Array, noise: Noise) -> tuple[Array, Array, float, float]:
    """Lower Cholesky factor of A'A + Lambda, A'e, e'e, ln|R|."""
    gram, right, square, log_r = np.diag(precision), np.zeros(len(precision)), 0.0, 0.0
    for _, group in itertools.groupby(observed, key=lambda o: o.series.session):
        of_session = list(group)
        used = np.flatnonzero(np.any([o.columns.any(axis=0) for o in of_session], axis=0))  # not other sessions' starts
        white = np.concatenate(
            [whiten(o.series, noise[o.series.channel], np.column_stack([o.e0, o.columns[:, used]])) for o in of_session]
        )
        e, a = white[:, 0], white[:, 1:]
        gram[np.ix_(used, used)] += a.T @ a
        right[used] += a.T @ e
        square += float(e @ e)
        log_r += sum(log_det(o.series, noise[o.series.channel]) for o in of_session)
    return cholesky(gram, lower=True), right, square, log_r


def log_evidence(observed: Every, precision: Array, noise: Noise) -> float:
    """ln evidence, the prior on the slow discrepancy included, without -N ln(2 pi) / 2."""
    lower, right, square, log_r = _normal_equations(observed, precision, noise)
    fitted = solve_triangular(lower, right, lower=True)
    log_parameters = 2 * np.log(np.diag(lower)).sum() - np.log(precision).sum()
    log_prior = -sum((n.ou_sd / OU_PRIOR_K) ** 2 for n in noise.values()) / 2
    return float(log_prior) - 0.5 * float(log_r + log_parameters + square - fitted @ fitted)


def _posterior_columns(observed: Every, precision: Array, noise: Noise, z: Array) -> list[Array]:
    """For each series (B, 1 + q): the residual at the posterior mean and q columns of the posterior's spread."""
    lower, right, _, _ = _normal_equations(observed, precision, noise)
    beta = solve_triangular(lower, solve_triangular(lower, right, lower=True), lower=True, trans="T")
    draws = solve_triangular(lower, z, lower=True, trans="T") / np.sqrt(z.shape[1])
    return [np.column_stack([o.e0 - o.columns @ beta, o.columns @ draws]) for o in observed]


def _channel_noise(
    observed: Every, columns: Sequence[Array], channel: str, start: ChannelNoise, floor: tuple[float, float]
) -> ChannelNoise:
    """The two standard deviations that maximise the channel's expected likelihood."""
    own = [(o.series, x) for o, x in zip(observed, columns, strict=True) if o.series.channel == channel]
    packed = [(s.t_s, s.white_variance, np.ascontiguousarray(x)) for s, x in own]

    def cost(ln_sd: Array) -> float:
        v_a, v_o = np.exp(2 * ln_sd)
        total = sum(deviance(t, white, x, v_a, start.ar_tau_s, v_o, start.ou_tau_s) for t, white, x in packed)
        return float(total + v_o / OU_PRIOR_K**2) / 2

    bounds = [(np.log(least), np.log(max(BOUNDS_K[1], 2 * least))) for least in floor]
    found = minimize(cost, np.log([start.ar_sd, start.ou_sd]), method="L-BFGS-B", bounds=bounds)
    ar_sd, ou_sd = np.exp(found.x)
    return replace(start, ar_sd=float(max(ar_sd, floor[0])), ou_sd=float(max(ou_sd, floor[1])))
