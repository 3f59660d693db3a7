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
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar, root_scalar
from scipy.special import ndtri
from scipy.stats import chi2

from analytics.insulation.arrhenius import Activation, Doubling, Rule
from analytics.insulation.life import NoFit

Floats = NDArray[np.float64]

ENERGIES_EV = (0.05, 5.0)
DOUBLINGS_K = (2.0, 60.0)
GRID = 60


@dataclass(frozen=True)
class Fall:
    """`start`: median strength before ageing, in the unit of the data; `per_h`: fall of ln strength an hour at
    `at_degC`; `rule`: what an hour is worth, its number with 95 % profile bounds in `between`; `sigma` of ln strength,
    by maximum likelihood; `log_likelihood` of the strengths. `criterion`: the strength that ends a life."""

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
    """Fit with an activation energy [eV]: specimens (n,) aged `hours` [h] at `temperature_degC`, broken at `strength`.
    `NoFit` where the strengths do not fall or the energy is not determined."""
    return _fitted(temperature_degC, hours, strength, criterion, at_degC, Activation, ENERGIES_EV)


def by_doubling(
    temperature_degC: ArrayLike, hours: ArrayLike, strength: ArrayLike, criterion: float, at_degC: float
) -> Fall | NoFit:
    """The same with the kelvin that double the rate (Nelson's own form, and NIST's reference problem)."""
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
    if np.any(broken <= 0.0) or not np.all(np.isfinite(temperature + aged + broken)):
        return NoFit("a strength is not above zero, or a value is missing: leave such rows out", named)
    aged_at = np.unique(temperature[aged > 0.0])
    if aged_at.size < 2 or np.unique(aged).size < 2:
        return NoFit("all ageing is of one temperature or one duration: a law of both needs two of each", named)
    y = np.log(broken)

    def line(number: float) -> tuple[Floats, float]:
        worth = aged * rule(number).acceleration(temperature, at_degC)
        scale = float(worth.max())
        x = np.stack([np.ones(y.size), -worth / scale], axis=-1)
        b, *_ = np.linalg.lstsq(x, y)
        return b / np.array([1.0, scale]), float(np.sum((y - x @ b) ** 2))

    def rest(number: float) -> float:
        return y.size * math.log(line(number)[1] / y.size)

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
        factor = rule(number).acceleration(temperature, at_degC)
        return float((y - b0 + b1 * aged * factor) @ (aged * factor * np.log(factor)))

    number = float(root_scalar(slope, x0=near, x1=near * (1 + 1e-6), xtol=1e-14).root)
    (b0, b1), squares = line(number)
    if b1 <= 0.0:
        return NoFit("strength does not fall with ageing", named)
    sigma = math.sqrt(squares / y.size)
    allowed = float(chi2.ppf(0.95, 1))
    return Fall(
        start=math.exp(b0),
        per_h=float(b1),
        at_degC=at_degC,
        rule=rule(number),
        between=_between(lambda n: rest(n) - rest(number) - allowed, number, range_),
        sigma=sigma,
        log_likelihood=float(-y.size * (math.log(sigma) + 0.5 * math.log(2 * math.pi) + 0.5) - y.sum()),
        criterion=criterion,
    )


def _between(excess: Callable[[float], float], best: float, range_: tuple[float, float]) -> tuple[float, float]:
    """Where `excess` is zero on either side; the end of the range where it is not."""
    lower, upper = (end if excess(end) <= 0.0 else float(brentq(excess, best, end)) for end in range_)
    return lower, upper
