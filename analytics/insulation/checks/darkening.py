"""What surfaces that darken do to a resistance by an iron sensor, and taking it back out of the course over checks.

The winding heads of a stator in free air give a share s of their heat to the air, so that (T_w - T_i) / (V I) at rest
is R (1 - s): surfaces that darken in an oven (emissivity 0.80 -> 0.90) raise s, and R seems to fall by 1 to 1.5 %
though the insulation is as it was. While the stator is as cold as the air nothing is lost, whatever its surface. With
D the drop, P the power and theta the iron's excess over the ambient, all else stored,

    D / P = R C_i / C - k theta / P,

between `FROM_S` and `TO_S` of the load (after the winding's own modes, before films change): the intercept is free of
the surface. A fall of the value at rest that the intercept does not share is the surface's:

    d_j = LEAN (ln R_j - ln R_1) - (ln(R_j / K_j) - ln(R_1 / K_1)),      0 <= d_j <= MOST,

K the intercept; both share the error of a check's thermocouples, so d does not have it. LEAN is what a change of the
insulation itself does to R / K: between 0 (no heat lost by the heads) and 0.2 (bare stator of 24 lumps).
"""

from __future__ import annotations

import numpy as np

from analytics.insulation.arrays import Floats

FROM_S, TO_S = 600.0, 2700.0
LEAN = 0.1
MOST = 0.02  # of ln R: darker than 0.9 there is little
LEAST_REACH = 1.0  # by what share of its least value theta / P has to grow: else the intercept lies far from the data


def cold_resistance(t_s: Floats, drop_K: Floats, excess_K: Floats, power_W: Floats) -> float | None:
    """The intercept K [K/W] of a load, from its samples (N,) since it was switched on: time [s], drop [K], the iron's
    excess over the ambient [K] and power [W]. None where the load is shorter than 45 min or the excess hardly rises
    in that time, as in a cooled motor."""
    since = t_s - t_s[0]
    used = (since > FROM_S) & (since <= TO_S)
    if since[-1] < TO_S or used.sum() < 3:
        return None
    x, y = excess_K[used] / power_W[used], drop_K[used] / power_W[used]
    intercept = np.polyfit(x, y, 1)[1]
    low, high = np.quantile(x, [0.05, 0.95])
    return float(intercept) if high - low > LEAST_REACH * low > 0.0 and intercept > 0.0 else None


def surface_shift(at_rest: Floats, cold: Floats) -> Floats:
    """What darker surfaces took from ln R of each check, to be added to it: d (n,). Checks are in the order of time:
    `at_rest` (n,) R and `cold` (n,) K [K/W], NaN where a check has none. A check that lacks one gets d between those
    of its neighbours; all get 0 where fewer than two checks have both."""
    both = np.flatnonzero(np.isfinite(at_rest) & np.isfinite(cold))
    if both.size < 2:
        return np.zeros(at_rest.size)
    rest = np.log(at_rest[both] / at_rest[both[0]])
    apart = np.log(at_rest[both] / cold[both])
    shift = np.clip(LEAN * rest - (apart - apart[0]), 0.0, MOST)
    return np.asarray(np.interp(np.arange(at_rest.size), both, shift))
