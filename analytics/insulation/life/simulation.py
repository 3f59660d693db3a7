"""Lives drawn anew from a law, watched as the real ones were."""

from __future__ import annotations

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.life.censored import Distribution
from analytics.insulation.life.life import LifeTable


def drawn(
    tested: LifeTable, log_life: Floats, sigma: float, distribution: Distribution, draws: int, seed: int
) -> tuple[Floats, Floats]:
    """Between which ln h each drawn life ended, two arrays (draws, n), for the n specimens of `tested.units()`, whose
    ln h have the locations `log_life` (n,) and the spread `sigma`.

    How a specimen was watched is read from those of its temperature: to the longest time seen there if any was
    right-censored, else to its end; looked at whenever any of them was (the ends of their intervals) if any is
    interval-censored, else always.
    """
    units = tested.units()
    shape = (draws, units.counts.size)
    random = np.random.default_rng(seed)
    z = random.standard_normal(shape) if distribution == "lognormal" else -random.gumbel(size=shape)
    life = np.exp(log_life + sigma * z)
    lower, upper = life.copy(), life.copy()
    for degC in np.unique(units.temperature_degC):
        here = units.temperature_degC == degC
        looks, end = _watched(units.at(here))
        lower[:, here], upper[:, here] = _seen(life[:, here], looks, end)
    with np.errstate(divide="ignore"):
        return np.log(lower), np.log(upper)


def _watched(units: LifeTable) -> tuple[Floats, float]:
    """The times of looks [h], none where they are watched always, and until when [h]; inf: to their end."""
    between = units.ended & (units.lower_h < units.upper_h)
    looks = np.unique(np.concatenate([units.lower_h[between], units.upper_h[between]]))
    seen = np.concatenate([units.lower_h, units.upper_h[units.ended]])
    open_end = not units.ended.all() or between.any()
    return looks[looks > 0.0], float(seen.max()) if open_end else np.inf


def _seen(life: Floats, looks: Floats, end: float) -> tuple[Floats, Floats]:
    lower, upper = life, life
    if looks.size:
        edges = np.concatenate([[0.0], looks[looks < end], [end]])
        place = np.clip(np.searchsorted(edges, life, side="left"), 1, edges.size - 1)
        lower, upper = edges[place - 1], edges[place]
    survived = life > end
    return np.where(survived, end, lower), np.where(survived, np.inf, upper)
