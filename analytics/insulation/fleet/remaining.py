"""How much dose each specimen has left until its insulation is at its end, with what the others tell about it.

End of life is ln R above its value at dose 0 by ln(factor): a factor of 2 is a conductivity of half. The course is the
mixed model's (`mixed.py`): what all specimens share, which is straight beyond the last bend, and a slope of the
specimen's own, shrunk towards that of its batch and the fleet as far as its checks leave it open, so that one with
three checks borrows from the rest.

By dose D it is over with probability P(y(D) - y(0) > ln(factor)), where y(D) - y(0) is normal (Student's t with one
degree of freedom less than there are specimens) with the model's mean and with the variance of prediction and fixed
effects together. Where even far out the probability stays below what a bound asks for, there is no bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from analytics.insulation.arrays import PERCENT_PER_100_H, Floats, usable
from analytics.insulation.fleet import mixed

HALF_CONDUCTIVITY = 2.0
BAND = (0.025, 0.5, 0.975)
FARTHEST = 1000.0  # times the highest dose of all
DOSES = 600  # at which the probability is computed, in equal ratios: 4 %, interpolated
AT_ONCE = 1000  # specimens whose courses are in memory together: 5 MB an array of them


@dataclass(frozen=True)
class RemainingLife:
    """What a specimen has left. `dose_h`: at its last check. `end_dose_h`: the dose at which it meets the criterion,
    and `remaining_h`: from the last check to there, each with the interval of 95 %; None where no dose has that
    probability. `slope_percent_per_100h`: of its course beyond the last check, with its standard deviation [%/100
    h]."""

    specimen: str
    dose_h: float
    slope_percent_per_100h: float
    slope_sd: float
    end_dose_h: float | None
    end_ci95_dose_h: tuple[float | None, float | None]
    remaining_h: float | None
    remaining_ci95_h: tuple[float | None, float | None]


def remaining(
    specimen: Sequence[str],
    batch: Sequence[str | None],
    dose_h: ArrayLike,
    ln_resistance: ArrayLike,
    sd: ArrayLike,
    factor: float = HALF_CONDUCTIVITY,
) -> tuple[RemainingLife, ...]:
    """What each specimen has left, in the order of names. Arguments have one entry for each check, in any order, as
    for `outlying.assess`. Rows that are not finite are left out, and specimens without any left. Empty below three
    specimens or where all checks are at one dose."""
    good, dose, y, s = usable(dose_h, ln_resistance, sd)
    known, who = np.unique(np.asarray(specimen, np.str_)[good], return_inverse=True)
    if len(known) < 3 or not np.ptp(dose):
        return ()
    batch_of = dict(zip(specimen, batch, strict=True))
    batches = sorted({b for b in batch_of.values() if b is not None})
    places = np.array([-1 if (b := batch_of[str(n)]) is None else batches.index(b) for n in known], np.int64)
    fit, knots = mixed.fit_course(who, dose, y, s, places)
    last = np.zeros(len(known))
    np.maximum.at(last, who, dose)
    at = float(dose.max()) * np.geomspace(1e-4, FARTHEST, DOSES)
    quantiles = student.ppf(BAND, len(known) - 1)
    found: list[RemainingLife] = []
    for first in range(0, len(known), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        part = replace(fit, effect=fit.effect[some], joint=fit.joint[some])
        over, slope, slope_sd = _courses(part, knots, at, math.log(factor))
        ends = [[_dose_of(q, at, row) for q in quantiles] for row in over]
        found += [
            _life(str(name), float(now), PERCENT_PER_100_H * float(b), PERCENT_PER_100_H * float(e), end)
            for name, now, b, e, end in zip(known[some], last[some], slope, slope_sd, ends, strict=True)
        ]
    return tuple(found)


def _courses(fit: mixed.MixedFit, knots: Floats, at: Floats, limit: float) -> tuple[Floats, Floats, Floats]:
    """By how many standard deviations each course is over the limit at each dose (m, n); the slope far out of each
    and its standard deviation (m,)."""
    columns = mixed.bent_line(at, knots) - mixed.bent_line([0.0], knots)
    ways = np.column_stack([columns, np.zeros_like(at), at])  # beta, start, slope
    far = np.concatenate([[0.0], np.ones(1 + len(knots)), [0.0, 1.0]])
    coefficients = np.column_stack([np.tile(fit.fixed, (len(fit.effect), 1)), fit.effect])
    sd = np.sqrt(np.einsum("np,mpq,nq->mn", ways, fit.joint, ways, optimize=True).clip(1e-300))
    over = (coefficients @ ways.T - limit) / sd
    return over, coefficients @ far, np.sqrt(np.einsum("p,mpq,q->m", far, fit.joint, far))


def _dose_of(quantile: float, at: Floats, over: Floats) -> float | None:
    """The first dose at which the course is `quantile` standard deviations over the limit."""
    beyond = np.flatnonzero(over >= quantile)
    if not len(beyond):
        return None
    k = int(beyond[0])
    if k == 0:
        return float(at[0])
    share = (quantile - over[k - 1]) / (over[k] - over[k - 1])
    return float(at[k - 1] * (at[k] / at[k - 1]) ** share)


def _life(name: str, now: float, slope: float, slope_sd: float, ends: Sequence[float | None]) -> RemainingLife:
    low, middle, high = ends
    left = [None if end is None else max(end - now, 0.0) for end in ends]
    return RemainingLife(name, now, slope, slope_sd, middle, (low, high), left[1], (left[0], left[2]))
