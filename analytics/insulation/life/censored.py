"""Maximum likelihood of log life on a straight line of regressors, for lives censored in any way.

ln t = x . beta + sigma Z, Z standard normal (log-normal lives) or smallest extreme value (Weibull lives, shape 1 /
sigma). With gamma = beta / sigma and delta = 1 / sigma every Z is linear in the parameters and the log-likelihood is
concave (J. W. Pratt, J. Am. Stat. Assoc. 76 (1981) 103, DOI 10.1080/01621459.1981.10477613; R. J. Olsen, Econometrica
46 (1978) 1211): Newton steps with halving reach the one maximum, or there is none, and that is found out. A linear
condition on (gamma, delta) keeps both, so that a profile of a quantile or of a slope is the same search with one
unknown less. Leading axes are separate data sets: a bootstrap is one call.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import log_ndtr, ndtri

from analytics.insulation.arrays import Flags, Floats

Distribution = Literal["lognormal", "weibull"]
DISTRIBUTIONS: tuple[Distribution, ...] = ("lognormal", "weibull")

NEAR_ENOUGH = 1e-11  # Newton decrement, in log-likelihood
STEPS, HALVINGS = 80, 40
FARTHEST = 1e5  # in units of the start's spread: beyond, the maximum is at infinity
SETTLED = 1e-6  # of the same, where the steps ran out
FLATTEST = 1e-9  # of an observation's information: below, a direction is not determined
SMALLEST_SPREAD = 1e-3  # of ln t at the start, where all lives lie on the line


@dataclass(frozen=True)
class Lives:
    """Log lives, batched: `x` (n, r) the regressors, `lower` and `upper` (..., n) ln hours, equal where exact, -inf and
    inf where open; `counts` (n,) how many specimens each stands for, or (..., n)."""

    x: Floats
    lower: Floats
    upper: Floats
    counts: Floats


@dataclass(frozen=True)
class LineFit:
    """The fitted line of each data set: `beta` (..., r) and `sigma` (...,) at the maximum, NaN where `found` (...,)
    says that there is none. `log_likelihood` (...,) of ln t (exact lives as densities per unit of ln t): the highest,
    or its limit where `settled` (...,), and without limit where not."""

    beta: Floats
    sigma: Floats
    log_likelihood: Floats
    settled: Flags
    found: Flags


@dataclass(frozen=True)
class Restriction:
    """A linear condition on theta = (gamma, delta): theta = `base` + phi @ `directions`, (r + 1,) and (free, r + 1)."""

    base: Floats
    directions: Floats


def standard_quantile(distribution: Distribution, p: float) -> float:
    """The z with P(Z <= z) = `p`."""
    return float(ndtri(p)) if distribution == "lognormal" else float(np.log(-np.log1p(-p)))


def maximise(lives: Lives, distribution: Distribution, restriction: Restriction | None = None) -> LineFit:
    """The maximum for each data set, under `restriction` on (gamma, delta) where one is given."""
    beta, sigma = _start(lives)
    size = lives.x.shape[1]
    if restriction is None:
        restriction = Restriction(np.zeros(size + 1), np.eye(size + 1))
    rows = _rows(lives.x, lives.lower), _rows(lives.x, lives.upper)
    first = np.concatenate([beta / sigma[..., None], 1.0 / sigma[..., None]], axis=-1)
    phi = np.asarray((first - restriction.base) @ np.linalg.pinv(restriction.directions))
    theta, value, settled, found = _climb(lives, distribution, restriction, rows, phi)
    delta = np.where(found, theta[..., -1], np.nan)
    return LineFit(theta[..., :-1] / delta[..., None], 1.0 / delta, value, settled, found)


def covariance(lives: Lives, distribution: Distribution, beta: Floats, sigma: float) -> Floats:
    """Inverse of the observed information of (beta, ln sigma), (r + 1, r + 1), at the maximum of one data set."""
    theta = np.append(beta, 1.0) / sigma
    rows = (_rows(lives.x, lives.lower), _rows(lives.x, lives.upper))
    hessian = _value(lives, distribution, rows, theta)[2]
    jacobian = np.eye(theta.size) / sigma  # of (gamma, delta) by (beta, ln sigma)
    jacobian[:, -1] = -theta
    return np.asarray(np.linalg.inv(-jacobian.T @ hessian @ jacobian))


def _rows(x: Floats, y: Floats) -> Floats:
    """Rows (..., n, r + 1) so that z = rows @ theta; 0 where `y` is not finite, as nothing then depends on theta."""
    finite = np.isfinite(y)[..., None]
    shape = (*y.shape, x.shape[1])
    return np.where(finite, np.concatenate([np.broadcast_to(-x, shape), y[..., None]], axis=-1), 0.0)


def _start(lives: Lives) -> tuple[Floats, Floats]:
    """A first beta and sigma by least squares of the middles of intervals; the spread is never nothing, and too wide
    rather than too narrow."""
    lower, upper = np.broadcast_arrays(lives.lower, lives.upper)
    one = np.where(np.isfinite(lower), lower, upper)
    middle = (one + np.where(np.isfinite(upper), upper, lower)) / 2
    beta = middle @ np.linalg.pinv(lives.x).T
    spread = np.sqrt(np.mean((middle - beta @ lives.x.T) ** 2, axis=-1))
    return beta, np.maximum(2 * spread, SMALLEST_SPREAD)


def _climb(
    lives: Lives, distribution: Distribution, restriction: Restriction, rows: tuple[Floats, Floats], phi: Floats
) -> tuple[Floats, Floats, Flags, Flags]:
    """theta (..., r + 1) and log-likelihood (...,) at the maximum, sought from `phi`; `settled` and `found` as
    `LineFit` has them."""
    directions, base = restriction.directions, restriction.base
    # Directions are scaled by the rows' size, so that steps, curvatures and distances below are comparable.
    seen = np.sqrt(np.mean((rows[0] @ directions.T) ** 2 + (rows[1] @ directions.T) ** 2, axis=-2))
    scale = np.where(seen > 0.0, seen, 1.0)

    def at(phi: Floats) -> tuple[Floats, Floats, Floats]:
        value, slope, hessian = _value(lives, distribution, rows, base + phi @ directions)
        slope, hessian = slope @ directions.T / scale, directions @ hessian @ directions.T
        return value, slope, hessian / (scale[..., :, None] * scale[..., None, :])

    phi = _finite(lives, distribution, rows, restriction, phi)
    value, slope, hessian = at(phi)
    total = np.broadcast_to(lives.counts, rows[0].shape[:-1]).sum(-1)
    done = np.zeros(value.shape, np.bool_)
    for _ in range(STEPS):
        step = _newton(slope, hessian, total)
        near = np.sum(slope * step, axis=-1) / 2 < NEAR_ENOUGH
        last = phi + step / scale  # so near, a whole step squares the error, where there is a maximum
        kept = near & ~done & (_value_only(lives, distribution, rows, base + last @ directions) > value - NEAR_ENOUGH)
        phi = np.where(kept[..., None], last, phi)
        done |= near
        if done.all():
            break
        length = np.where(done, 0.0, 1.0)
        for _ in range(HALVINGS):
            tried = phi + length[..., None] * step / scale
            better = done | (_value_only(lives, distribution, rows, base + tried @ directions) > value)
            if better.all():
                break
            length = np.where(better, length, length / 2)
        done |= ~better  # no length is better: rounding is all that is left
        phi = np.where(better[..., None], tried, phi)
        value, slope, hessian = at(phi)
    value, slope, hessian = at(phi)
    settled = np.isfinite(value) & (np.sum(slope * _newton(slope, hessian, total), axis=-1) < SETTLED)
    far = np.max(np.abs(phi * scale), axis=-1) > FARTHEST
    flattest = np.linalg.eigvalsh(np.where(settled[..., None, None], -hessian, 0.0))[..., 0] / total
    return base + phi @ directions, value, settled, settled & ~far & (flattest > FLATTEST)


def _newton(slope: Floats, hessian: Floats, total: Floats) -> Floats:
    """The step to where the slope is zero, along directions without any curvature too; NaN where a derivative is not
    finite."""
    finite: Flags = np.asarray(np.isfinite(slope).all(axis=-1) & np.isfinite(hessian).all(axis=(-1, -2)))
    slope, hessian = np.where(finite[..., None], slope, np.nan), np.where(finite[..., None, None], hessian, 0.0)
    least = 1e-14 * (total - np.trace(hessian, axis1=-2, axis2=-1))
    return np.asarray(
        np.linalg.solve(least[..., None, None] * np.eye(slope.shape[-1]) - hessian, slope[..., None])[..., 0]
    )


def _finite(
    lives: Lives, distribution: Distribution, rows: tuple[Floats, Floats], restriction: Restriction, phi: Floats
) -> Floats:
    """`phi` moved to where delta is above zero and the likelihood finite: it is halved until then, which brings every z
    near to what it is at phi = 0."""
    rise = restriction.directions[:, -1]
    lack = 1.0 - restriction.base[-1] - phi @ rise
    phi = phi + np.where(lack < 1.0, 0.0, lack)[..., None] * rise / (rise @ rise)
    for _ in range(HALVINGS):
        theta = restriction.base + phi @ restriction.directions
        poor = ~np.isfinite(_value_only(lives, distribution, rows, theta))
        if not poor.any():
            break
        phi = np.where(poor[..., None], phi / 2, phi)
    return phi


def _value_only(lives: Lives, distribution: Distribution, rows: tuple[Floats, Floats], theta: Floats) -> Floats:
    return _value(lives, distribution, rows, theta, slopes=False)[0]


def _value(
    lives: Lives, distribution: Distribution, rows: tuple[Floats, Floats], theta: Floats, slopes: bool = True
) -> tuple[Floats, Floats, Floats]:
    """Log-likelihood (...,) at `theta` (..., r + 1), its gradient and its Hessian; -inf where delta is not above
    zero."""
    low, high = rows
    lower, upper = np.broadcast_arrays(lives.lower, lives.upper)
    exact = lower == upper
    delta = theta[..., -1:]
    with np.errstate(all="ignore"):
        z_low = np.where(np.isfinite(lower), (low @ theta[..., None])[..., 0], -np.inf)
        z_high = np.where(np.isfinite(upper), (high @ theta[..., None])[..., 0], np.inf)
        log_density, log_between = _DENSITY[distribution], _BETWEEN[distribution]
        inside = log_between(z_low, z_high)
        each = np.where(exact, log_density(z_low) + np.log(delta), inside)
        value = np.sum(lives.counts * each, axis=-1)
        value = np.where((delta[..., 0] > 0.0) & np.isfinite(value), value, -np.inf)
        if not slopes:
            return value, value, value
        bend = _BEND[distribution]  # d ln f / dz and d2 ln f / dz2
        first, second = bend(np.where(np.isfinite(z_low), z_low, 0.0))
        at_low = np.where(np.isfinite(z_low), np.exp(log_density(z_low) - inside), 0.0)
        at_high = np.where(np.isfinite(z_high), np.exp(log_density(z_high) - inside), 0.0)
        rise_high = bend(np.where(np.isfinite(z_high), z_high, 0.0))[0]
        g_low = np.where(exact, first, -at_low)
        g_high = np.where(exact, 0.0, at_high)
        h_low = np.where(exact, second, -at_low * first - at_low**2)
        h_high = np.where(exact, 0.0, at_high * rise_high - at_high**2)
        h_both = np.where(exact, 0.0, at_low * at_high)
    n = lives.counts
    gradient = ((n * g_low)[..., None, :] @ low)[..., 0, :] + ((n * g_high)[..., None, :] @ high)[..., 0, :]
    turned = np.swapaxes(low, -1, -2)
    cross = turned @ ((n * h_both)[..., None] * high)
    hessian = turned @ ((n * h_low)[..., None] * low) + cross + np.swapaxes(cross, -1, -2)
    hessian = hessian + np.swapaxes(high, -1, -2) @ ((n * h_high)[..., None] * high)
    failures = np.sum(n * exact, axis=-1)
    gradient[..., -1] += failures / theta[..., -1]
    hessian[..., -1, -1] -= failures / theta[..., -1] ** 2
    return value, gradient, hessian


def _normal_log_density(z: Floats) -> Floats:
    return np.asarray(-(z**2) / 2 - 0.5 * np.log(2 * np.pi))


def _normal_log_between(low: Floats, high: Floats) -> Floats:
    """ln(Phi(high) - Phi(low)), from whichever tail is the shorter difference."""
    mirrored = low > 0.0
    small, large = np.where(mirrored, -high, low), np.where(mirrored, -low, high)
    top = log_ndtr(large)
    return np.asarray(top + np.log(-np.expm1(np.minimum(log_ndtr(small) - top, 0.0))))


def _normal_bend(z: Floats) -> tuple[Floats, Floats]:
    return -z, np.full_like(z, -1.0)


def _extreme_log_density(z: Floats) -> Floats:
    return np.asarray(z - _exp(z))


def _extreme_log_between(low: Floats, high: Floats) -> Floats:
    """ln(exp(-e^low) - exp(-e^high))."""
    return np.asarray(-_exp(low) + np.log(-np.expm1(_exp(low) - np.exp(high))))


def _extreme_bend(z: Floats) -> tuple[Floats, Floats]:
    return 1.0 - _exp(z), -_exp(z)


def _exp(z: Floats) -> Floats:
    """e^z kept finite, so that nothing times it is nothing: survival to e^600 is none."""
    return np.asarray(np.exp(np.minimum(z, 600.0)))


_DENSITY = {"lognormal": _normal_log_density, "weibull": _extreme_log_density}
_BETWEEN = {"lognormal": _normal_log_between, "weibull": _extreme_log_between}
_BEND = {"lognormal": _normal_bend, "weibull": _extreme_bend}
