"""How far the slope of a healthy specimen lies from the centre of its batch: as a normal variable does, as a log-normal
one, or in between.

It is off by shift + tau (exp(g z) - 1) / g with z normal (Tukey's g distribution, Hoaglin and Peters, Software for
Exploring Distribution Shape, MIT LIDS-P-909, 1979: normal at g = 0, log-normal where g is tau over the centre), and
read with a normal error of its own. The data choose shift, tau and g; as rates of one cause multiply, g is at most a
quarter more than a log-normal of that spread has. What stands out takes no part: each slope is with probability 0.02
one of a Cauchy density three times as wide. Of few specimens tau leans on what is usual, by the prior that
`spread.py` has.

z is cut into cells, each a narrow normal, so that densities and probabilities are sums in closed form however small or
large errors are beside tau. What is not known of shift, tau and g counts: probabilities are means over their posterior
on a grid, for each specimen over the one that the others make.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from analytics.insulation.arrays import Flags, Floats

SHIFTS = np.linspace(-0.45, 0.15, 5)  # of tau: a robust centre is above the median where slopes are skewed
SPREADS = np.geomspace(0.2, 5.0, 19)  # tau, of the robust one, which among few is often too wide or too narrow
SKEWS = np.linspace(0.0, 1.25, 6)  # g, of a log-normal's
MOST_SKEWED = 1.0
STANDS_OUT, WIDTH = 0.02, 3.0
CELL = 0.35
CELLS = np.arange(-3.5, 6.0 + CELL / 2, CELL)
SHARES = np.exp(-(CELLS**2) / (1.0 - CELL**2 / 4.0) / 2.0)
SHARES /= SHARES.sum()
IGNORED = 0.01  # of the highest weight: points of the grid that are left out
FEW_AT_ONCE = 1000  # specimens whose scores are in memory at all points of the grid together
AT_ONCE = 30_000  # numbers of an array on the way


@dataclass(frozen=True)
class HealthySlopes:
    """The posterior of shift, tau and g as points (k,) with `ln_weight` (k,), not normalised, and what each of m
    specimens added to that (k, m)."""

    shift: Floats
    tau: Floats
    g: Floats
    ln_weight: Floats
    ln_brought: Floats

    def scores(self, off: Floats, variance: Floats) -> Floats:
        """How each specimen's slope compares with healthy ones (m,): the normal quantile of the probability that a
        healthy slope is less than `off` (m,) from its centre, read with an error of `variance` (m,), by all other
        specimens."""
        parts = [slice(first, first + FEW_AT_ONCE) for first in range(0, max(len(off), 1), FEW_AT_ONCE)]
        return np.concatenate(
            [
                self._quantiles(off[some], variance[some], self.ln_weight[:, None] - self.ln_brought[:, some])
                for some in parts
            ]
        )

    def scores_of_newcomers(self, off: Floats, variance: Floats) -> Floats:
        """Scores of specimens (any number,) that nothing was learnt from."""
        return self._quantiles(off, variance, self.ln_weight[:, None])

    def without(self, place: int) -> HealthySlopes:
        """The posterior without the specimen at `place`; centres and points stay what they were with it."""
        rest = np.delete(self.ln_brought, place, axis=1)
        return HealthySlopes(self.shift, self.tau, self.g, self.ln_weight - self.ln_brought[:, place], rest)

    def _quantiles(self, off: Floats, variance: Floats, ln_weight: Floats) -> Floats:
        ln_beyond = _of_points(_ln_beyond, off, variance, np.column_stack([self.shift, self.tau, self.g]))
        ln_p = logsumexp(ln_beyond + ln_weight, axis=0) - logsumexp(ln_weight, axis=0)
        return np.asarray(-ndtri_exp(np.minimum(ln_p, -1e-15)), np.float64)


def healthy_slopes(
    off: Floats, variance: Floats, takes_part: Flags, centre: float, tau: float, usual: float, weight: float
) -> HealthySlopes:
    """The posterior from slopes less their centres (m,), the variances of both (m,), and which of them are of healthy
    batches (m,). `centre` of all slopes, `tau`: a robust spread about it, `usual`: the spread expected before
    looking, with the weight of `weight` specimens; all in one unit."""
    points = np.array(_grid(tau, tau / max(abs(centre), 1e-6 * tau)))
    wide = WIDTH * np.sqrt(tau**2 + variance)
    outlying = STANDS_OUT / (math.pi * wide * (1.0 + (off / wide) ** 2))
    each = _of_points(_density, off, variance, points)
    each *= 1.0 - STANDS_OUT
    each += outlying
    np.log(each, out=each)
    each *= takes_part
    ln_weight = each.sum(axis=1) - weight * (np.log(points[:, 1]) + (usual / points[:, 1]) ** 2 / 2.0)
    kept = ln_weight > ln_weight.max() + math.log(IGNORED)
    shift, taus, g = points[kept].T
    return HealthySlopes(shift, taus, g, ln_weight[kept], each[kept])


def _grid(tau: float, share: float) -> list[tuple[float, float, float]]:
    """Points (shift, tau, g) of the grid; `share`: the robust tau as a share of the centre."""
    return [
        (shift * tau * spread, tau * spread, skew * min(share * spread, MOST_SKEWED))
        for spread, shift, skew in product(SPREADS, SHIFTS, SKEWS)
    ]


def _of_points(what: Callable[[Floats, Floats], Floats], off: Floats, variance: Floats, points: Floats) -> Floats:
    """`what` (k, m) at each of k points (k, 3) of m slopes, as many points at a time as fit into the cache."""
    at_once = max(1, AT_ONCE // max(1, off.size * CELLS.size))
    parts = [points[first : first + at_once] for first in range(0, len(points), at_once)]
    return np.concatenate([what(*_cells(off, variance, part)) for part in parts])


def _cells(off: Floats, variance: Floats, points: Floats) -> tuple[Floats, Floats]:
    """At each point, by how many standard deviations each of m slopes is above each cell (k, m, cells), and these
    (k, m, cells)."""
    shift, tau, g = points.T[:, :, None]
    middle = shift + tau * np.where(g > 0.0, np.expm1(g * CELLS) / np.where(g > 0.0, g, 1.0), CELLS)
    own = (CELL / 2.0 * tau * np.exp(g * CELLS)) ** 2
    sd = np.sqrt(variance[:, None] + own[:, None, :])
    return (off[:, None] - middle[:, None, :]) / sd, sd


def _density(z: Floats, sd: Floats) -> Floats:
    return np.asarray((np.exp(-(z**2) / 2.0) / sd) @ SHARES / math.sqrt(2.0 * math.pi), np.float64)


def _ln_beyond(z: Floats, _: Floats) -> Floats:
    """ln of the probability of a healthy slope that is further off than each."""
    ln_each = log_ndtr(-z) + np.log(SHARES)
    top = ln_each.max(axis=-1)
    return np.asarray(top + np.log(np.exp(ln_each - top[..., None]).sum(axis=-1)), np.float64)
