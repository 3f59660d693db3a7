"""The slope of every specimen's ln R over dose by itself, for many specimens at once.

A line is fitted to each by weighted least squares, where errors beyond 1.5 standard deviations count less (Huber, Ann. Math.
Statist. 35 (1964) 73, DOI 10.1214/aoms/1177703732). Standard deviations come from the given ones times one factor for all,
which the lines' own residuals tell; a specimen whose residuals are larger still has a factor of its own.

A sensor that was exchanged makes a step, and a step in the middle looks like a slope: `step_or_slope` weighs both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import chi2

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP_SD = 0.08  # of ln R, by an exchanged sensor
GIVEN_WEIGHT = 10.0  # in checks, of the given standard deviations against what residuals say
CUT = 2.5
HUBER, HUBER_ROUNDS = 1.5, 8
CUT_SQUARE = float(chi2.cdf(CUT**2, 3) + CUT**2 * chi2.sf(CUT**2, 1))


@dataclass(frozen=True)
class Slopes:
    """By specimen (m,): slope and its standard deviation [1/h] (infinite without two different doses), number of checks, and the
    factor on its checks' standard deviations. `scale`: that of all."""

    slope: Floats
    sd: Floats
    checks: Ints
    factor: Floats
    scale: float


def slopes(specimen: Ints, dose_h: Floats, y: Floats, sd: Floats) -> Slopes:
    """`specimen` (n,): places from 0 to m - 1, each there; dose [h], y and its standard deviation (n,), rows in any order."""
    rows = _Rows.of(specimen, dose_h, y, sd)
    scale = rows.scale()
    factor = rows.factor(scale)
    with np.errstate(divide="ignore"):
        error = factor / np.sqrt(rows.spread)
    return Slopes(rows.robust_slope(scale), error, rows.counts, factor, scale)


@dataclass(frozen=True)
class _Rows:
    """Rows, with `root` 1 / sd, `centred` the dose less the specimen's weighted mean, and the `residual` from its line over sd; by
    specimen the sums of weights and of weighted squares of `centred`, and the line's slope."""

    who: Ints
    dose: Floats
    y: Floats
    root: Floats
    counts: Ints
    centred: Floats
    weight: Floats
    spread: Floats
    slope: Floats
    residual: Floats

    @classmethod
    def of(cls, who: Ints, dose: Floats, y: Floats, sd: Floats) -> _Rows:
        root = 1.0 / sd
        counts = np.asarray(np.bincount(who), np.int64)
        weight = np.asarray(np.bincount(who, root**2), np.float64)
        centred = dose - (np.bincount(who, root**2 * dose) / weight)[who]
        level = y - (np.bincount(who, root**2 * y) / weight)[who]
        spread = np.asarray(np.bincount(who, (root * centred) ** 2), np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.where(spread > 0.0, np.bincount(who, root**2 * centred * level) / spread, 0.0)
        residual = root * (level - slope[who] * centred)
        return cls(who, dose, y, root, counts, centred, weight, spread, slope, residual)

    @property
    def freedom(self) -> Floats:
        return np.asarray(np.maximum(self.counts - 1.0 - (self.spread > 0.0), 0.0), np.float64)

    def scale(self) -> float:
        """By which the given standard deviations are too small, from residuals cut at 2.5 of them, with the weight of ten checks on 1."""
        with np.errstate(invalid="ignore", divide="ignore"):
            along = np.where(self.spread[self.who] > 0.0, (self.root * self.centred) ** 2 / self.spread[self.who], 0.0)
        left = 1.0 - self.root**2 / self.weight[self.who] - along
        good = left > 1e-6
        square, freedom = self.residual[good] ** 2 / left[good], float(self.freedom.sum())
        variance = 1.0
        for _ in range(50):
            mean = float((left[good] * np.minimum(square, CUT**2 * variance)).sum()) / max(freedom, 1.0) / CUT_SQUARE
            variance = (GIVEN_WEIGHT + freedom * mean) / (GIVEN_WEIGHT + freedom)
        return math.sqrt(variance)

    def robust_slope(self, scale: float) -> Floats:
        rows = self
        for _ in range(HUBER_ROUNDS):
            level = self.y - (np.bincount(self.who, rows.root**2 * self.y) / rows.weight)[self.who]
            residual = self.root / scale * (level - rows.slope[self.who] * rows.centred)
            pull = np.minimum(1.0, HUBER / np.maximum(np.abs(residual), HUBER))
            rows = _Rows.of(self.who, self.dose, self.y, 1.0 / (self.root * np.sqrt(pull)))
        return rows.slope

    def factor(self, scale: float) -> Floats:
        square = np.bincount(self.who, self.residual**2) / scale**2
        return np.asarray(scale * np.sqrt(np.maximum((GIVEN_WEIGHT + square) / (GIVEN_WEIGHT + self.freedom), 1.0)))


@dataclass(frozen=True)
class Step:
    """A step that explains a specimen better than a slope of its own: the dose after it [h], and slope and standard deviation
    [1/h] beside it."""

    at_dose_h: float
    slope: float
    sd: float


def step_or_slope(
    dose_h: Floats, y: Floats, sd: Floats, usual: float, usual_sd: float, unusual_sd: float
) -> Step | None:
    """The step of one specimen with the slopes of others, N(usual, usual_sd^2), where that has the higher marginal likelihood than
    a slope further off, with N(0, unusual_sd^2) added; both equally probable before looking, steps N(0, 0.08^2) before any check
    but the first. Else None. Rows (n,) in any order; slopes in 1/h."""
    order = np.argsort(dose_h, kind="stable")
    dose, rest, sd = dose_h[order], (y - usual * dose_h)[order], sd[order]
    precision = np.linalg.inv(np.diag(sd**2) + usual_sd**2 * np.outer(dose, dose))
    level = precision.sum(axis=1)
    inverse = np.asarray(precision - np.outer(level, level) / level.sum(), np.float64)  # the start has a flat prior
    after = np.tril(np.ones((len(dose), len(dose))))[:, 1:]  # columns: 1 from the second check on, from the third, ...
    steps = _ln_gain(inverse, after, rest, STEP_SD)
    if logsumexp(steps) - math.log(len(steps)) <= _ln_gain(inverse, dose[:, None], rest, unusual_sd)[0]:
        return None
    best = int(np.argmax(steps))
    design = np.column_stack([dose - dose.mean(), np.ones_like(dose), after[:, best]]) / sd[:, None]
    covariance = np.linalg.pinv(design.T @ design)
    slope = usual + float((covariance @ design.T @ (rest / sd))[0])
    return Step(float(dose[best + 1]), slope, math.sqrt(float(covariance[0, 0])))


def _ln_gain(inverse: Floats, columns: Floats, rest: Floats, prior_sd: float) -> Floats:
    """Of the marginal likelihood by each column, its amplitude N(0, prior_sd^2)."""
    information = np.einsum("ij,ik,kj->j", columns, inverse, columns)
    score = columns.T @ inverse @ rest
    return np.asarray((score**2 / (information + prior_sd**-2) - np.log1p(prior_sd**2 * information)) / 2, np.float64)
