"""Profile likelihood of one parameter of a fit: what the data alone say of it, all else fitted anew at each value.

A standard deviation takes the likelihood for a parabola and adds what was known beforehand. The profile does neither:
it is the least misfit at each value, without the parameter's own prior, and its 95 % interval is where twice the misfit
has risen by 3.84 (S. S. Wilks, Ann. Math. Statist. 9 (1938) 60, doi:10.1214/aoms/1177732360). An end that is not
reached within the parameter's bounds is none: the data do not bound it there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from twin.errors import DivergedError
from twin.fitting.fit import NEAR_ENOUGH, Fit, Floats, fit

RISE = 3.84  # of twice the misfit at the ends of the interval: 95 % of chi squared with one degree of freedom
NO_PRIOR = 1e3  # sd of a logarithm that says nothing
NEAR = 0.1  # of the rise, where an end is found
STEPS = 12  # outwards and back, of the search for an end


@dataclass(frozen=True)
class Profile:
    """The profile of one logarithm: its `best` value; `low` and `high`, ends of the 95 % interval (None: the data do
    not bound it); all `values` (K,) tried, in order, and `rise` (K,), twice the misfit of each above the best's."""

    name: str
    best: float
    low: float | None
    high: float | None
    values: Floats
    rise: Floats


def profile(found: Fit, place: int) -> Profile:
    """The profile of the parameter at `place` of a fit's vector. Raises `DivergedError` where the model runs away at
    its best value."""
    free = found.model.with_priors(
        [replace(p, sd=NO_PRIOR) if i == place else p for i, p in enumerate(found.model.parameters)]
    )
    best = fit(free, found.beta, NEAR_ENOUGH)
    low, high = float(free.low[place]), float(free.high[place])
    tried: dict[float, tuple[float, Floats]] = {float(best.beta[place]): (best.cost, best.beta)}

    def rise(value: float) -> float:
        """Fitted from the nearest value tried so far; infinite where it runs away."""
        nearest = min(tried, key=lambda other: abs(other - value))
        start = tried[nearest][1].copy()
        start[place] = value
        held = [replace(p, low=value, high=value) if i == place else p for i, p in enumerate(free.parameters)]
        try:
            there = fit(free.with_priors(held), start, NEAR_ENOUGH)
        except DivergedError:
            return np.inf
        tried[value] = there.cost, there.beta
        return 2 * (there.cost - best.cost)

    sd = float(np.sqrt(np.linalg.inv(best.hessian)[place, place]))
    ends = [_end(rise, float(best.beta[place]), sign * 1.96 * sd, bound) for sign, bound in ((-1, low), (1, high))]
    least = min(cost for cost, _ in tried.values())  # a value tried on the way may fit better than the search had found
    values = np.array(sorted(tried))
    rises = np.array([2 * (tried[float(value)][0] - least) for value in values])
    return Profile(found.model.parameters[place].name, float(best.beta[place]), ends[0], ends[1], values, rises)


def _end(rise: Callable[[float], float], best: float, step: float, bound: float) -> float | None:
    """Where the misfit has risen enough, from the best value towards a bound: steps by the square root of what is
    missing."""
    inside, outside, reached = 0.0, None, 0.0
    offset = step
    for _ in range(STEPS):
        if abs(offset) >= abs(bound - best):
            offset = bound - best
        reached = rise(best + offset)
        if abs(reached - RISE) < NEAR * RISE:
            return best + offset
        if reached < RISE:
            if offset == bound - best:
                return None
            inside = offset
        else:
            outside = offset
        wanted = offset * float(np.sqrt(RISE / max(reached, RISE / 16))) if np.isfinite(reached) else offset / 2
        within = outside is None or abs(inside) < abs(wanted) < abs(outside)
        offset = wanted if within and abs(wanted) > abs(inside) else (inside + (outside or 2 * wanted)) / 2
    return best + offset
