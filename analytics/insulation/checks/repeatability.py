"""How far two checks of one specimen differ where nothing has happened in between: the standard deviation of ln R.

Two ways lead to it, both pooled over specimens:

- repeats: checks of one specimen at the same dose, each group about its own mean;
- scatter about smooth courses: each check against the straight line between its neighbours in dose, which is normal
  with a known multiple of the standard deviation where the course is smooth (Gasser, Sroka and Jennen-Steinmetz,
  Biometrika 73 (1986) 625, DOI 10.1093/biomet/73.3.625); squares are cut at (2.5 sd)^2, so that corners and steps count
  little.

Where both are there and agree, one standard deviation comes from both. Repeats on one day may share what changes from
day to day (a clamp, a paste, the air): where the scatter of the courses is larger than theirs by more than chance (1 in
100), it is what two checks truly differ by, and is taken alone; where it is smaller by more than chance, the repeats
are.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2, f

from analytics.insulation.arrays import Floats, Ints

REPEATS, SCATTER, BOTH, ASSUMED = "repeats", "scatter about smooth courses", "repeats and scatter", "assumed"
ASSUMED_SD = 0.03  # the paper of the stator campaign: "under 3 %"
SAME_DOSE_H = 0.01
LEAST_DEGREES = 4.0  # of freedom: below that an estimate can be off by half
CUT = 2.5  # in standard deviations
CUT_SQUARE = float(chi2.cdf(CUT**2, 3) + CUT**2 * chi2.sf(CUT**2, 1))  # mean of min(z^2, CUT^2) of a normal z
OVERLAP = 1.0 + 2.0 * ((2 / 3) ** 2 + (1 / 6) ** 2)  # neighbours' differences are correlated: that many count as one
CHANCE = 0.01


@dataclass(frozen=True)
class Repeatability:
    """How checks repeat: `sd` of ln R between repeats (0.03: 3 %), known with `degrees_of_freedom` (infinite where
    assumed); `source`: "repeats", "scatter about smooth courses", "repeats and scatter" or "assumed"."""

    sd: float
    degrees_of_freedom: float
    source: str

    def of_checks(self, evaluation_sd: ArrayLike) -> Floats:
        """The sd of ln R of each check (n,), from what its own evaluation leaves uncertain of ln R (n,).

        `sd` is that of checks as they were evaluated, so the usual evaluation is in it already: its variance, the
        median over the checks, comes off and that of each check on. So a check whose log was cut short counts less,
        and the others as they repeat. Where checks repeat better than their evaluations say, the rest of what these
        leave uncertain is common to all checks and moves no course: all are smaller by one factor then, unless how
        checks repeat is assumed.
        """
        own = np.asarray(evaluation_sd, np.float64) ** 2
        usual = float(np.median(own)) if own.size else 0.0
        if usual > self.sd**2 and math.isfinite(self.degrees_of_freedom):
            own *= self.sd**2 / usual
            usual = self.sd**2
        return np.asarray(np.sqrt(max(self.sd**2 - usual, 0.0) + own), np.float64)


def estimate(specimen: Sequence[Hashable], dose_h: ArrayLike, ln_resistance: ArrayLike) -> Repeatability:
    """How checks repeat, from all checks of all specimens in any order: `specimen` (n,), dose (n,) [h], ln R (n,).
    Rows that are not finite are left out. 3 % is assumed where both ways have fewer than four degrees of freedom."""
    groups: list[tuple[float, int]] = []
    scatters: list[Floats] = []
    for doses, values in _of_each(specimen, dose_h, ln_resistance):
        starts = np.flatnonzero(np.diff(doses, prepend=-math.inf) > SAME_DOSE_H)
        sizes = np.diff(np.append(starts, len(doses)))
        means = np.add.reduceat(values, starts) / sizes
        off = values - np.repeat(means, sizes)
        groups.append((float(off @ off), len(doses) - len(starts)))
        scatters.append(_against_neighbours(doses[starts], means, sizes))
    repeats = _pooled(sum(square for square, _ in groups), sum(degrees for _, degrees in groups))
    scatter = _cut(np.concatenate(scatters)) if scatters else None
    if repeats and scatter:
        return _agreed(repeats, scatter)
    return repeats or scatter or Repeatability(ASSUMED_SD, math.inf, ASSUMED)


def _of_each(specimen: Sequence[Hashable], dose_h: ArrayLike, ln_resistance: ArrayLike) -> list[tuple[Floats, Floats]]:
    """Doses, ascending, and ln R of every specimen that has checks."""
    dose, y = np.asarray(dose_h, np.float64), np.asarray(ln_resistance, np.float64)
    places: dict[Hashable, int] = {}
    code = np.array([places.setdefault(name, len(places)) for name in specimen], np.int64)
    good = np.isfinite(dose) & np.isfinite(y)
    code, dose, y = code[good], dose[good], y[good]
    order = np.lexsort((dose, code))
    code, dose, y = code[order], dose[order], y[order]
    cuts = np.flatnonzero(np.diff(code)) + 1
    return [pair for pair in zip(np.split(dose, cuts), np.split(y, cuts), strict=True) if len(pair[0])]


def _against_neighbours(dose: Floats, mean: Floats, size: Ints) -> Floats:
    """How far each inner check is off the line between its neighbours, divided so that the standard deviation is one
    check's."""
    if len(dose) < 3:
        return np.empty(0)
    share = (dose[1:-1] - dose[:-2]) / (dose[2:] - dose[:-2])  # of the later neighbour
    off = mean[1:-1] - (1.0 - share) * mean[:-2] - share * mean[2:]
    multiple = 1.0 / size[1:-1] + (1.0 - share) ** 2 / size[:-2] + share**2 / size[2:]
    return np.asarray(off / np.sqrt(multiple), np.float64)


def _pooled(square: float, degrees: float) -> Repeatability | None:
    if degrees < LEAST_DEGREES or square <= 0.0:
        return None
    return Repeatability(math.sqrt(square / degrees), float(degrees), REPEATS)


def _cut(off: Floats) -> Repeatability | None:
    """The standard deviation at which the mean of the cut squares is what it is for a normal variable."""
    degrees = len(off) / OVERLAP
    if degrees < LEAST_DEGREES:
        return None
    variance = float(np.median(off**2)) / float(chi2.ppf(0.5, 1))
    for _ in range(50):
        if variance <= 0.0:
            return None
        variance = float(np.minimum(off**2, CUT**2 * variance).mean()) / CUT_SQUARE
    return Repeatability(math.sqrt(variance), degrees, SCATTER)


def _agreed(repeats: Repeatability, scatter: Repeatability) -> Repeatability:
    degrees = scatter.degrees_of_freedom, repeats.degrees_of_freedom
    ratio = (scatter.sd / repeats.sd) ** 2
    if f.sf(ratio, *degrees) < CHANCE:
        return scatter
    if f.cdf(ratio, *degrees) < CHANCE:
        return repeats
    square = scatter.sd**2 * degrees[0] + repeats.sd**2 * degrees[1]
    return Repeatability(math.sqrt(square / sum(degrees)), sum(degrees), BOTH)
