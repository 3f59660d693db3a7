"""The slope of every specimen's ln R over dose by itself, for many specimens at once.

A line is fitted to each by weighted least squares, where errors beyond 1.5 standard deviations count less (Huber,
Ann. Math. Statist. 35 (1964) 73, DOI 10.1214/aoms/1177703732). Standard deviations come from the given ones times one
factor for all; a specimen that scatters more still has a factor of its own. Both are of each check against the line
between its neighbours in dose (as in `repeatability.py`), not against the specimen's line: a bend is no error of a
slope.

A sensor that was exchanged makes a step, and a step in the middle looks like a slope: `step_or_slope` weighs both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from analytics.insulation.arrays import Floats, Ints
from analytics.insulation.checks.repeatability import CUT, CUT_SQUARE, OVERLAP

STEP_SD = 0.08  # of ln R, by an exchanged sensor
GIVEN_WEIGHT = 10.0  # in checks, of the given standard deviations against what residuals say
HUBER, ROUNDS, ROUNDS_OF_SCALE = 1.5, 10, 30


@dataclass(frozen=True)
class Slopes:
    """By specimen (m,): the slope and its standard deviation [1/h] (infinite without two different doses), the number
    of checks, and the factor on its checks' standard deviations. `scale`: the factor of all."""

    slope: Floats
    sd: Floats
    checks: Ints
    factor: Floats
    scale: float


def slopes(specimen: Ints, dose_h: Floats, y: Floats, sd: Floats) -> Slopes:
    """The slope of each specimen from rows in any order: place of the specimen (n,), from 0 to m - 1, each there;
    dose (n,) [h], y (n,) and its standard deviation (n,)."""
    least = np.full(1 + int(specimen.max(initial=-1)), np.inf)
    np.minimum.at(least, specimen, dose_h)
    lines = _Lines.of(specimen, dose_h - least[specimen], y, sd)  # equal doses are 0 then, and so is their spread
    for _ in range(ROUNDS):
        lines = lines.pulled()
    scale, factor = _factors(specimen, dose_h, y, sd, len(lines.counts))
    with np.errstate(divide="ignore"):
        return Slopes(lines.slope, factor / np.sqrt(lines.spread), lines.counts, factor, scale)


def _factors(who: Ints, dose: Floats, y: Floats, sd: Floats, specimens: int) -> tuple[float, Floats]:
    """By what the given standard deviations are too small: of all specimens, and of each (m,), at least that."""
    order = np.lexsort((dose, who))
    who, dose, y, variance = who[order], dose[order], y[order], sd[order] ** 2
    at = 1 + np.flatnonzero(who[2:] == who[:-2])  # checks between two others of their specimen
    apart = dose[at + 1] - dose[at - 1]
    later = np.divide(dose[at] - dose[at - 1], apart, out=np.full(len(at), 0.5), where=apart > 0.0)
    off = y[at] - (1.0 - later) * y[at - 1] - later * y[at + 1]
    square = off**2 / (variance[at] + (1.0 - later) ** 2 * variance[at - 1] + later**2 * variance[at + 1])
    scale = _scale(square, np.full(len(at), 1.0 / OVERLAP))
    own = np.bincount(who[at], square, specimens) / OVERLAP / scale**2
    freedom = np.bincount(who[at], minlength=specimens) / OVERLAP
    return scale, scale * np.sqrt(np.maximum((GIVEN_WEIGHT + own) / (GIVEN_WEIGHT + freedom), 1.0))


@dataclass(frozen=True)
class _Lines:
    """A line fitted to each specimen. Of rows: `root` 1 / sd, `left` of each one's variance once a line is fitted,
    and `residual` from the line over sd. Of specimens: the number of checks, the spread of the dose (sum of weighted
    squares about its mean), and the line's slope."""

    who: Ints
    dose: Floats
    y: Floats
    root: Floats
    left: Floats
    residual: Floats
    counts: Ints
    spread: Floats
    slope: Floats
    scale: float

    @classmethod
    def of(cls, who: Ints, dose: Floats, y: Floats, sd: Floats) -> _Lines:
        """The lines by least squares."""
        root = 1.0 / sd
        weight, centred, spread, slope, residual = _fitted(who, dose, y, root, np.ones_like(root))
        along = np.divide((root * centred) ** 2, spread[who], out=np.zeros_like(root), where=spread[who] > 0.0)
        left = 1.0 - root**2 / weight[who] - along
        counts = np.asarray(np.bincount(who), np.int64)
        return cls(who, dose, y, root, left, residual, counts, spread, slope, _scale_of_lines(residual, left))

    def pulled(self) -> _Lines:
        """The lines fitted once more, where residuals beyond 1.5 standard deviations count less."""
        off = np.abs(self.residual) / self.scale
        *_, slope, residual = _fitted(self.who, self.dose, self.y, self.root, np.minimum(1.0, HUBER / off.clip(HUBER)))
        return replace(self, slope=slope, residual=residual, scale=_scale_of_lines(residual, self.left))


def _fitted(
    who: Ints, dose: Floats, y: Floats, root: Floats, pull: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Lines with weights pull / sd^2: sums of weights, dose less its mean, its spread, slopes, and residuals over
    sd."""
    w = root**2 * pull
    weight = np.bincount(who, w)
    centred = dose - (np.bincount(who, w * dose) / weight)[who]
    level = y - (np.bincount(who, w * y) / weight)[who]
    spread = np.asarray(np.bincount(who, w * centred**2), np.float64)
    slope = np.divide(np.bincount(who, w * centred * level), spread, out=np.zeros_like(spread), where=spread > 0.0)
    return np.asarray(weight, np.float64), centred, spread, slope, root * (level - slope[who] * centred)


def _scale_of_lines(residual: Floats, left: Floats) -> float:
    good = left > 1e-6
    return _scale(residual[good] ** 2 / left[good], left[good])


def _scale(square: Floats, share: Floats) -> float:
    """By what the given standard deviations are too small, from squares over what they should be, cut at 2.5 standard
    deviations, which count as `share` of a check each; 1 has the weight of ten checks."""
    freedom, variance = float(share.sum()), 1.0
    for _ in range(ROUNDS_OF_SCALE):
        mean = float((share * np.minimum(square, CUT**2 * variance)).sum()) / CUT_SQUARE
        variance = (GIVEN_WEIGHT + mean) / (GIVEN_WEIGHT + freedom)
    return math.sqrt(variance)


@dataclass(frozen=True)
class Step:
    """A step that explains a specimen better than a slope of its own: the dose after it [h], and slope and standard
    deviation [1/h] beside it."""

    at_dose_h: float
    slope: float
    sd: float


def step_or_slope(
    dose_h: Floats, y: Floats, sd: Floats, usual: float, usual_sd: float, unusual_sd: float
) -> Step | None:
    """The step of one specimen where that explains it better than a slope unlike the others'; else None. Rows (n,) in
    any order; slopes in 1/h.

    Compared are the marginal likelihoods of a step N(0, 0.08^2) before any check but the first, with the slopes of
    others, N(usual, usual_sd^2); and of a slope further off, with N(0, unusual_sd^2) added, from the first check on
    or as probably from any other but the last. Both are equally probable before looking.
    """
    order = np.argsort(dose_h, kind="stable")
    dose, rest, sd = dose_h[order], (y - usual * dose_h)[order], sd[order]
    precision = np.linalg.inv(np.diag(sd**2) + usual_sd**2 * np.outer(dose, dose))
    level = precision.sum(axis=1)
    inverse = np.asarray(precision - np.outer(level, level) / level.sum(), np.float64)  # the start has a flat prior
    after = np.tril(np.ones((len(dose), len(dose))))[:, 1:]  # columns: 1 from the second check on, from the third, ...
    steps = _ln_gain(inverse, after, rest, STEP_SD)
    from_each = np.maximum(dose[:, None] - dose[: max(len(dose) - 1, 1)], 0.0)
    further = _ln_gain(inverse, from_each, rest, unusual_sd)
    weight = np.r_[0.5, np.full(len(further) - 1, 0.5 / max(len(further) - 1, 1))]
    if logsumexp(steps) - math.log(len(steps)) <= logsumexp(further, b=weight / weight.sum()):
        return None
    best = int(np.argmax(steps))
    design = np.column_stack([dose - dose.mean(), np.ones_like(dose), after[:, best]]) / sd[:, None]
    covariance = np.linalg.pinv(design.T @ design)
    slope = usual + float((covariance @ design.T @ (rest / sd))[0])
    return Step(float(dose[best + 1]), slope, math.sqrt(float(covariance[0, 0])))


def _ln_gain(inverse: Floats, columns: Floats, rest: Floats, prior_sd: float) -> Floats:
    """By how much each column, its amplitude N(0, prior_sd^2), raises the ln of the marginal likelihood."""
    information = (columns * (inverse @ columns)).sum(axis=0)
    score = columns.T @ inverse @ rest
    return np.asarray((score**2 / (information + prior_sd**-2) - np.log1p(prior_sd**2 * information)) / 2, np.float64)
