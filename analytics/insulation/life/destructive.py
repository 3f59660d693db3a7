"""Breakdown strength against ageing, each specimen broken once: how it falls, and when it is too low.

ln V = b0 - b1 (hours at `at_degC` that the ageing is worth) + sigma Z, Z standard normal: the performance-degradation
model of W. Nelson, IEEE Trans. Reliab. R-30 (1981) 149, DOI 10.1109/TR.1981.5221010; with an activation energy that of
Meeker & Escobar's accelerated destructive degradation tests. What an hour is worth follows from one number of a rule,
an activation energy or the kelvin that double the rate; with it given the rest is a straight line, so the likelihood
has one unknown to search.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ndtri
from scipy.stats import chi2

from analytics.insulation.arrays import Floats
from analytics.insulation.dose.arrhenius import ZERO_DEGC_IN_K, Activation, Doubling, Rule
from analytics.insulation.life.life import NoFit

ENERGIES_EV = (0.05, 5.0)
DOUBLINGS_K = (2.0, 60.0)
GRID = 60
NEAR = 1e-4  # of the number: where the minimum's slope is sought
SMALLEST_SPREAD = 1e-9  # of ln strength: below, the law goes through every specimen


@dataclass(frozen=True)
class Fall:
    """How strength falls. `start`: median strength before ageing, in the unit of the data; `per_h`: fall of ln
    strength an hour at `at_degC`; `rule`: what an hour is worth, its number with 95 % profile bounds in `between`;
    `sigma` of ln strength, by maximum likelihood; `log_likelihood` of the strengths. `criterion`: the strength that
    ends a life."""

    start: float
    per_h: float
    at_degC: float
    rule: Rule
    between: tuple[float, float]
    sigma: float
    log_likelihood: float
    criterion: float

    def quantile(self, p: float, degC: float) -> float:
        """Hours at `degC` [degC] after which the share `p` of specimens is at or below the criterion; 0 where it was so
        from the start."""
        margin = math.log(self.start / self.criterion) + self.sigma * float(ndtri(p))
        rate = self.per_h * float(self.rule.acceleration(degC, self.at_degC))
        return max(margin / rate, 0.0)


def by_energy(
    temperature_degC: ArrayLike, hours: ArrayLike, strength: ArrayLike, criterion: float, at_degC: float
) -> Fall | NoFit:
    """The fall where an hour is worth what an activation energy [eV] makes it: specimens (n,) aged `hours` [h] at
    `temperature_degC`, broken at `strength`, above 0, in any unit. `criterion`: the strength that ends a life, above 0;
    the hours of the result are at `at_degC`. `NoFit` where a row cannot be (the first such is named, counted from 1),
    where the strengths do not fall, or do not determine the energy."""
    return _fitted(temperature_degC, hours, strength, criterion, at_degC, Activation, ENERGIES_EV)


def by_doubling(
    temperature_degC: ArrayLike, hours: ArrayLike, strength: ArrayLike, criterion: float, at_degC: float
) -> Fall | NoFit:
    """As `by_energy`, with the kelvin that double the rate instead (Nelson's own form, and NIST's reference
    problem)."""
    return _fitted(temperature_degC, hours, strength, criterion, at_degC, Doubling, DOUBLINGS_K)


def _fitted(
    temperature_degC: ArrayLike,
    hours: ArrayLike,
    strength: ArrayLike,
    criterion: float,
    at_degC: float,
    rule: Callable[[float], Rule],
    range_: tuple[float, float],
) -> Fall | NoFit:
    temperature, aged, broken = (np.asarray(v, np.float64) for v in (temperature_degC, hours, strength))
    named = f"strength at or below {criterion:g}"
    reason = _faulty(temperature, aged, broken, criterion, at_degC)
    if reason is not None:
        return NoFit(reason, named)
    if np.unique(temperature[aged > 0.0]).size < 2 or np.unique(aged).size < 2:
        return NoFit("all ageing is of one temperature or one duration: a law of both needs two of each", named)
    if np.ptp(broken) == 0.0:
        return NoFit("all strengths are equal: nothing falls with ageing", named)
    y = np.log(broken)
    hottest = float(temperature.max())  # an hour there is worth the most, so that no number gets too large

    def line(number: float) -> tuple[Floats, float]:
        worth = aged * rule(number).acceleration(temperature, hottest)
        scale = float(worth.max())
        x = np.stack([np.ones(y.size), -worth / scale], axis=-1)
        b, *_ = np.linalg.lstsq(x, y)
        return b / np.array([1.0, scale]), float(np.sum((y - x @ b) ** 2))

    def rest(number: float) -> float:
        return y.size * math.log(max(line(number)[1] / y.size, SMALLEST_SPREAD**2))

    numbers = np.geomspace(*range_, GRID)
    best = int(np.argmin([rest(n) for n in numbers]))
    if best in (0, GRID - 1):
        return NoFit(
            f"no {'energy' if rule is Activation else 'doubling'} from {range_[0]:g} to {range_[1]:g} fits best", named
        )
    near = minimize_scalar(rest, bracket=(numbers[best - 1], numbers[best], numbers[best + 1]), method="brent").x

    def slope(number: float) -> float:
        """d squares / d number, up to a factor: what an hour is worth is a power of one number by either rule, and the
        line's own coefficients need not move, as the squares do not depend on them there."""
        (b0, b1), _ = line(number)
        factor = rule(number).acceleration(temperature, hottest)
        return float((y - b0 + b1 * aged * factor) @ (aged * factor * np.log(factor)))

    ends = (near * (1.0 - NEAR), near * (1.0 + NEAR))
    crosses = (slope(ends[0]) < 0.0) != (slope(ends[1]) < 0.0)
    number = float(brentq(slope, *ends, xtol=1e-14) if crosses else near)
    (b0, b1), squares = line(number)
    if b1 <= 0.0:
        return NoFit("strength does not fall with ageing", named)
    sigma = math.sqrt(squares / y.size)
    if sigma <= SMALLEST_SPREAD:
        return NoFit("the law goes through every strength, so that its error is not known: break more specimens", named)
    allowed = float(chi2.ppf(0.95, 1))
    return Fall(
        start=math.exp(b0),
        per_h=float(b1) / float(rule(number).acceleration(hottest, at_degC)),
        at_degC=at_degC,
        rule=rule(number),
        between=_between(lambda n: rest(n) - rest(number) - allowed, number, range_),
        sigma=sigma,
        log_likelihood=float(-y.size * (math.log(sigma) + 0.5 * math.log(2 * math.pi) + 0.5) - y.sum()),
        criterion=criterion,
    )


def _faulty(degC: Floats, hours: Floats, strength: Floats, criterion: float, at_degC: float) -> str | None:
    """What is wrong with the question or with a row; None where nothing is."""
    if not (math.isfinite(criterion) and criterion > 0.0 and at_degC > -ZERO_DEGC_IN_K):
        return "a life ends at a strength above zero, and hours are at a temperature above absolute zero"
    faults = (
        (~(np.isfinite(degC) & np.isfinite(hours) & np.isfinite(strength)), "a value is missing: leave the row out"),
        (strength <= 0.0, "the strength is not above zero: leave the row out"),
        (hours < 0.0, "the hours of ageing are below zero"),
        (degC <= -ZERO_DEGC_IN_K, "the temperature is below absolute zero"),
    )
    for wrong, what in faults:
        if wrong.any():
            return f"row {int(np.argmax(wrong)) + 1}: {what}"
    return None


def _between(excess: Callable[[float], float], best: float, range_: tuple[float, float]) -> tuple[float, float]:
    """Where `excess` is zero on either side; the end of the range where it is not."""
    lower, upper = (end if excess(end) <= 0.0 else float(brentq(excess, best, end)) for end in range_)
    return lower, upper
