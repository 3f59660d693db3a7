"""Centres of groups and the spread about them, of values with errors of their own, robust to the few that stand out.

Values v_i = centre of the group + N(0, tau^2) + N(0, error_i^2). Centres are Huber's estimate with weights 1 / (tau^2 +
error_i^2); tau^2 solves the score equation of the restricted likelihood with squares cut at (2.5 sd)^2, plus that of a
scaled inverse chi-square prior (Gelman et al., Bayesian Data Analysis, 3rd ed., 2013, section 2.6): where few values
are there, tau is what is usual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from analytics.insulation.arrays import Floats, Ints
from analytics.insulation.checks.repeatability import CUT, CUT_SQUARE

HUBER = 1.5
ROUNDS = 15
SHARE = 1e-7  # of tau^2, to which it is found


@dataclass(frozen=True)
class Spread:
    """`centre` (g,) of each group and its variance (g,), NaN and infinite for a group without values; `tau`^2 of
    all."""

    centre: Floats
    variance: Floats
    tau_square: float


def spread(
    value: Floats, variance: Floats, group: Ints, groups: int, usual_share: float, least: float, weight: float
) -> Spread:
    """Centres of groups and the spread about them, from each `value` (n,), the `variance` of its error (n,) and its
    `group` (n,). The usual tau is `usual_share` of the median centre, or `least`, with the weight of `weight` values.
    Needs one value at least."""
    present = np.unique(group)
    centre = np.full(groups, np.nan)
    centre[present] = [np.median(value[group == k]) for k in present]
    usual = np.hypot(usual_share * np.median(centre[present]), least) ** 2
    tau_square = max(usual, float(np.median((value - centre[group]) ** 2)) / float(chi2.ppf(0.5, 1)))
    for _ in range(ROUNDS):
        before = tau_square
        total = tau_square + variance
        off = np.abs(value - centre[group]) / np.sqrt(total)
        pull = np.minimum(1.0, HUBER / np.maximum(off, HUBER)) / total
        centre[present] = (np.bincount(group, pull * value, groups) / np.bincount(group, pull, groups).clip(1e-300))[
            present
        ]
        tau_square = _tau_square(value - centre[group], variance, group, groups, float(usual), weight)
        if abs(tau_square - before) < 1e-5 * before:
            break
    information = np.bincount(group, 1.0 / (tau_square + variance), groups)
    with np.errstate(divide="ignore"):
        return Spread(centre, 1.0 / information, tau_square)


def _tau_square(off: Floats, variance: Floats, group: Ints, groups: int, usual: float, weight: float) -> float:
    """tau^2: the root of the score, between a millionth of the largest value it could have and that value."""

    off_square = off**2

    def score(ln_tau_square: float) -> float:
        tau_square = math.exp(ln_tau_square)
        a = 1.0 / (tau_square + variance)
        free = 1.0 - a / np.bincount(group, a, groups)[group]
        square = np.minimum(off_square * a, CUT**2) / CUT_SQUARE
        return float((a * (square - free)).sum()) + weight * (usual / tau_square - 1.0) / tau_square

    high = 10.0 * max(usual, float(off_square.max()))
    low = min(usual, high) * 1e-6
    return math.exp(brentq(score, math.log(low), math.log(high), xtol=SHARE))
