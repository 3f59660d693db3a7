"""Thermocouples that stray in one check: warm and moving, but not where they were against the others before and after.

In one check such a sensor looks like a hot or a cold place. Over checks the places of a winding keep their order: what
a sensor is above the median of all at the end of the load changes by tenths of a kelvin from check to check, more only
as slowly as insulation ages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.checks.trace import CheckTrace, loaded

LAST_S = 600.0  # of the load
MOST_STRAY_K = 3.0
MOST_SPREADS = 8.0  # of what all sensors do from check to check
AROUND = 2  # checks before and after
LEAST_SENSORS, LEAST_CHECKS = 4, 4


def strayed(traces: Sequence[CheckTrace], left_out: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Copper sensors of each check of one specimen, in the order of time, that stray there: name -> why. `left_out`:
    those that are not used anyway. Nothing is said with fewer than four sensors or checks."""
    places = [_places(trace, out) for trace, out in zip(traces, left_out, strict=True)]
    names = sorted({name for found in places for name in found})
    if len(names) < LEAST_SENSORS or len(traces) < LEAST_CHECKS:
        return [{} for _ in traces]
    above = np.array([[found.get(name, np.nan) for name in names] for found in places])
    off = above - np.array([_around(above, k) for k in range(len(above))])
    known = np.abs(off[np.isfinite(off)])
    limit = max(MOST_STRAY_K, MOST_SPREADS * float(np.median(known))) if known.size else np.inf
    return [
        {
            name: f"{abs(by):.0f} K {'above' if by > 0.0 else 'below'} where it is in the checks before and after"
            for name, by in zip(names, row, strict=True)
            if abs(by) > limit
        }
        for row in off.tolist()
    ]


def _places(trace: CheckTrace, left_out: Mapping[str, str]) -> dict[str, float]:
    """Sensor -> how far it is above their median at the end of the load [K]."""
    check = loaded(trace, left_out)
    if isinstance(check, str):
        return {}
    t = check.t_s[check.on]
    last = check.sensors[check.on][t > t[-1] - LAST_S].mean(axis=0)
    return dict(zip(check.names, (last - np.median(last)).tolist(), strict=True))


def _around(above: Floats, k: int) -> Floats:
    """Median of each sensor over the checks around check `k`, without `k`; NaN where there is none."""
    near = np.delete(above, k, axis=0)[max(k - AROUND, 0) : k + AROUND]
    there = np.isfinite(near).any(axis=0)
    result = np.full(above.shape[1], np.nan)
    result[there] = np.nanmedian(near[:, there], axis=0)
    return result
