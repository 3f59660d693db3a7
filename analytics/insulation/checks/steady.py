"""Where temperatures under a constant load settle: reached, extrapolated, or not to be had.

Every series y of one check approaches its end with the same rates,

    y(t) - a(t) = Y - B exp(-t / tau) - C exp(-t / (r tau)),        tau da/dt = T_ambient - a,

the slowest time tau of the whole body and a faster one that bends the curve (films get better as it warms); a is the
ambient as slow bodies feel it. tau and r are on a grid, for each the rest is linear; the answer is their mean,
weighed by likelihood with noise that is correlated from minute to minute. C has a prior of `BEND_SHARE` of the rise,
else a slow end and a strong bend fit as well as a fast end. Two exponentials are not the law of a film that goes with
the temperature: `MODEL_SHARE` of what is extrapolated is the error of that, and `COUPLING_SHARE` of what the ambient
did in the last tau that of its coupling.

Steady: what is left and its sd are each under `STEADY_SHARE` of the rise; then the mean of the last 10 min is the
answer. Not reached: the sd is over `LOST_SHARE` of the rise.

The drop over a resistance settles otherwise. While the body behind it still warms, more heat goes through it than at
rest; with D the drop, P the power and T the body's temperature

    D / P = R + k (dT/dt) / P,

as the winding's own modes are over after minutes and the body's balance ties its excess over the ambient to P and
dT/dt. The intercept is R at rest, also of a load that was stopped after an hour, and whatever the ambient does to
dT/dt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analytics.insulation.arrays import Flags, Floats
from analytics.insulation.checks.estimate import ResistanceEstimate

LAST_S = 600.0  # the mean over these is what was reached
LEAST_S = 1200.0  # of load, below which nothing is said
SKIPPED_S = 600.0  # of the load's begin: modes of the winding itself
BLOCK_S = 60.0
TAU_S = np.geomspace(600.0, 8000.0, 24)
FASTER = (0.15, 0.25, 0.4, 0.6)  # r
BEND_SHARE = 0.15
MODEL_SHARE = 0.15
COUPLING_SHARE = 0.2
STEADY_SHARE, LOST_SHARE = 0.01, 0.05
RATE_S = 300.0  # either side of a moment, for the body's rate
REST_SHARE = 0.002  # of a resistance at rest: what its straight line leaves, on a bare stator of 24 lumps
PARAMETERS = 5  # Y, B, C, tau and r
MOST_LAG = 0.98


@dataclass(frozen=True)
class Settled:
    """Where each of k series goes: `last` (k,) its mean over the last 10 min, `final` (k,) where it settles at the
    ambient of these, `sd` (k,) of that, and `rise` (k,) how far it has come. `tau_s` [s]: the slowest mode."""

    last: Floats
    final: Floats
    sd: Floats
    rise: Floats
    tau_s: float

    @property
    def steady(self) -> Flags:
        """Which series have nearly reached their end."""
        return np.asarray(np.maximum(np.abs(self.final - self.last), self.sd) < STEADY_SHARE * np.abs(self.rise))

    @property
    def lost(self) -> Flags:
        """Whether the end of each series cannot be told."""
        return np.asarray(self.sd > LOST_SHARE * np.abs(self.rise))


def settle(t_s: Floats, series: Floats, ambient: Floats | None, follows: Floats) -> Settled | None:
    """Where `series` (N, k) of a stretch of constant load settle, `t_s` (N,) [s] rising from its begin.

    `ambient` (N,) in the unit of the series, None where it is not measured; `follows` (k,) how much of the ambient's
    change each series takes part in at last: 1 for temperatures, 0 for their differences. None where the stretch is
    under 20 min.
    """
    if t_s.size < 2 or t_s[-1] - t_s[0] < LEAST_S:
        return None
    t, y, air = _blocks(t_s, series, np.zeros_like(t_s) if ambient is None else ambient)
    used, late = t > t_s[0] + SKIPPED_S, t > t_s[-1] - LAST_S
    if used.sum() <= 2 * PARAMETERS or not late.any():
        return None
    last = series[t_s > t_s[-1] - LAST_S].mean(axis=0)
    rise = last - series[0]
    noise = np.std(np.diff(y[used], n=2, axis=0), axis=0) / np.sqrt(6.0)
    bend = float(np.median(noise / np.maximum(np.abs(rise), 1e-12)) / BEND_SHARE) ** 2
    beside = ((tau, y - _felt(t, air, tau)[:, None] * follows) for tau in TAU_S)
    fits = [_fit(t[used], left[used], bend, tau, ratio) for tau, left in beside for ratio in FASTER]
    final = np.array([fit.asymptote for fit in fits]) + air[late].mean() * follows  # (m, k)
    squares = np.array([fit.squares for fit in fits])
    best = fits[int(np.argmin(np.sum(squares / np.maximum(squares.min(axis=0), 1e-300), axis=1)))]
    variance = _inflated(best.residual)
    weight = np.exp(-0.5 * np.mean((squares - best.squares) / variance, axis=1))
    onward = np.array([float(fit.slow @ rise) <= 0.0 for fit in fits])  # what rose goes on rising, however slowly
    weight = np.where(onward, weight, 0.0) if onward.any() else weight
    weight /= weight.sum()
    mean = weight @ final
    spread = weight @ (final - mean) ** 2 + weight @ np.array([fit.unit_variance for fit in fits]) * variance
    model = MODEL_SHARE * np.abs(mean - last)
    tau_s = float(np.exp(weight @ np.repeat(np.log(TAU_S), len(FASTER))))
    coupling = COUPLING_SHARE * np.ptp(air[t > t_s[-1] - tau_s]) * follows
    return Settled(last, mean, np.sqrt(spread + model**2 + coupling**2), rise, tau_s)


def resistance_at_rest(t_s: Floats, drop_K: Floats, body_degC: Floats, power_W: Floats) -> ResistanceEstimate | None:
    """R at rest from a stretch of load from its begin: samples (N,), `power_W` above zero. None where it is under 20
    min.

    The sd holds the noise, correlated from minute to minute, half the difference to the same fit over the later half,
    where the early modes are surely over, and `REST_SHARE`.
    """
    if t_s.size < 2 or t_s[-1] - t_s[0] < LEAST_S:
        return None
    t, values, body = _blocks(t_s, np.column_stack([drop_K, power_W]), body_degC)
    ratio, rate = values[:, 0] / values[:, 1], _rate(t, body) / values[:, 1]
    fits = [
        _intercept(rate[t > begin], ratio[t > begin])
        for begin in (t_s[0] + SKIPPED_S, max(t_s[0] + SKIPPED_S, float(t_s[0] + t_s[-1]) / 2.0))
    ]
    (value, noise), (later, _) = fits
    sd = np.linalg.norm([noise, (value - later) / 2.0, REST_SHARE * value])
    return ResistanceEstimate(value, float(sd))


def _rate(t_s: Floats, value: Floats) -> Floats:
    """Slope of straight lines through the samples within `RATE_S` of each."""
    slopes = np.zeros_like(value)
    for k, here in enumerate(t_s):
        near = np.abs(t_s - here) <= RATE_S
        x = t_s[near] - t_s[near].mean()
        slopes[k] = x @ value[near] / max(x @ x, 1e-300)
    return slopes


def _intercept(x: Floats, y: Floats) -> tuple[float, float]:
    """The intercept of a straight line through y over x (n,), with its sd; the mean where x does not vary."""
    scale = float(np.abs(x).max()) or 1.0
    design = np.column_stack([np.ones_like(x), x / scale])
    inverse = np.linalg.pinv(design.T @ design, rcond=1e-12)
    coefficients = inverse @ design.T @ y
    variance = float(_inflated((y - design @ coefficients)[:, None])[0])
    return float(coefficients[0]), float(np.sqrt(inverse[0, 0] * variance))


@dataclass(frozen=True)
class _Fit:
    """The fit of k series for one tau and r: `asymptote` (k,) Y, `slow` (k,) -B, `squares` (k,) with the prior's,
    `residual` (n, k), and the variance of Y for noise of 1."""

    asymptote: Floats
    slow: Floats
    squares: Floats
    residual: Floats
    unit_variance: float


def _fit(x: Floats, left: Floats, bend: float, tau: float, ratio: float) -> _Fit:
    """Y, B and C of each series for given rates, `left` (n, k) over times x (n,) less the ambient as it is felt; C with
    prior precision `bend` in squares of the noise."""
    since = x - x[0]
    design = np.stack([np.ones_like(x), np.exp(-since / tau), np.exp(-since / (ratio * tau))], axis=1)
    inverse = np.linalg.inv(design.T @ design + np.diag([0.0, 0.0, bend]))
    coefficients = inverse @ design.T @ left
    residual = left - design @ coefficients
    squares = np.sum(residual**2, axis=0) + bend * coefficients[2] ** 2
    return _Fit(coefficients[0], coefficients[1], squares, residual, float(inverse[0, 0]))


def _felt(t_s: Floats, air: Floats, tau_s: float) -> Floats:
    """The ambient as a body of time constant `tau_s` feels it that has felt its first value for ever."""
    kept = np.exp(-np.diff(t_s) / tau_s)
    came = (1.0 - kept) * (air[1:] + air[:-1]) / 2.0
    felt = [float(air[0])]
    for share, more in zip(kept.tolist(), came.tolist(), strict=True):
        felt.append(share * felt[-1] + more)
    return np.array(felt)


def _inflated(residual: Floats) -> Floats:
    """Variance (k,) of the noise, larger by as much as its correlation from block to block makes a mean less
    certain."""
    squares = np.sum(residual**2, axis=0)
    lag = np.clip(np.sum(residual[1:] * residual[:-1], axis=0) / np.maximum(squares, 1e-300), 0.0, MOST_LAG)
    return np.asarray(np.maximum(squares, 1e-300) / max(len(residual) - PARAMETERS, 1) * (1.0 + lag) / (1.0 - lag))


def _blocks(t_s: Floats, series: Floats, ambient: Floats) -> tuple[Floats, Floats, Floats]:
    """Means over whole minutes, or over five samples where these are further apart."""
    length = max(BLOCK_S, 5.0 * float(np.median(np.diff(t_s))))
    number = ((t_s - t_s[0]) // length).astype(np.int64)
    _, place, count = np.unique(number, return_inverse=True, return_counts=True)
    table = np.column_stack([t_s, ambient, series])
    means = np.zeros((count.size, table.shape[1]))
    np.add.at(means, place, table)
    means /= count[:, None]
    return means[:, 0], means[:, 2:], means[:, 1]
