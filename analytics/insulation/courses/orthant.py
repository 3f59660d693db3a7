"""The probability that two correlated normal variables are both positive, accurate far into its tail.

P(X > 0, Y > 0) is what a half-normal prior on two amplitudes makes of a Gaussian marginal likelihood. Where it is not
small it comes from Owen's T function (Owen, Ann. Math. Statist. 27 (1956) 1075, DOI 10.1214/aoms/1177728074); in the
tail that formula cancels, and the integral over the more improbable of the two is done by Gauss-Legendre quadrature
around its highest point.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, ndtr, owens_t

from analytics.insulation.arrays import Floats

TAIL = 1e-6  # below it Owen's formula has lost too many digits
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
REACH = 9.0  # of the quadrature, in widths of the integrand
NEWTON_STEPS, SETTLED = 30, 1e-9
ROOT_TWO_PI = 2.5066282746310002


def log_both_positive(a: Floats, b: Floats, correlation: Floats) -> Floats:
    """ln P(X > 0, Y > 0) of normal variables with means `a` and `b` and standard deviations 1, element by element, to
    1e-8 relative. The means have one shape; the correlations, between -1 and 1 and neither of them, broadcast."""
    r = np.sqrt((1.0 - correlation) * (1.0 + correlation))
    a_, b_ = np.where(a == 0.0, 1e-300, a), np.where(b == 0.0, 1e-300, b)
    with np.errstate(over="ignore"):
        both = (ndtr(a) + ndtr(b)) / 2 - owens_t(a, (b - correlation * a) / (a_ * r))
        both -= owens_t(b, (a - correlation * b) / (b_ * r)) + 0.5 * (a_ * b_ < 0.0)
    tail = both < TAIL
    result = np.log(np.where(tail, 1.0, both))
    if tail.any():
        rho, r = (np.broadcast_to(given, tail.shape)[tail] for given in (correlation, r))
        result[tail] = _in_the_tail(np.minimum(a, b)[tail], np.maximum(a, b)[tail], rho, r)
    return np.asarray(result, np.float64)


def _in_the_tail(a: Floats, b: Floats, rho: Floats, r: Floats) -> Floats:
    """ln of the integral over u > 0 of phi(a - u) Phi((b - rho (a - u)) / r), whose logarithm is concave in u."""
    slope, start = rho / r, (b - rho * a) / r
    u = np.maximum(a, 0.0)
    for _ in range(NEWTON_STEPS):
        ratio = _hazard(start + slope * u)
        rise = a - u + slope * ratio
        bend = -1.0 - slope**2 * ratio * (start + slope * u + ratio)
        before, u = u, np.maximum(u - rise / bend, 0.0)
        if np.abs(u - before).max() < SETTLED:
            break
    ratio = _hazard(start + slope * u)
    rise = a - u + slope * ratio  # 0 inside, negative where the highest point is at u = 0
    bend = 1.0 + slope**2 * ratio * (start + slope * u + ratio)
    width = 1.0 / np.sqrt(bend)
    low = np.maximum(u - REACH * width, 0.0)
    high = u + np.minimum(REACH * width, 40.0 / np.maximum(-rise, 1e-12))
    middle, half = (low + high) / 2, (high - low) / 2
    at = middle[:, None] + half[:, None] * NODES
    ln_f = -((a[:, None] - at) ** 2) / 2 + log_ndtr(start[:, None] + slope[:, None] * at)
    top = ln_f.max(axis=1)
    area = (np.exp(ln_f - top[:, None]) * WEIGHTS).sum(axis=1) * half
    return np.asarray(top + np.log(area / ROOT_TWO_PI), np.float64)


def _hazard(x: Floats) -> Floats:
    """phi(x) / Phi(x)."""
    return np.asarray(np.exp(-(x**2) / 2 - log_ndtr(x)) / ROOT_TWO_PI, np.float64)
