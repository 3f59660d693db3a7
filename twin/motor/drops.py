"""What drives the heat of a link, and its slopes: the difference of two temperatures as each law sees it.

    linear             T_b - T_a
    radiation          (T_b^4 - T_a^4) / (4 (293.15 K)^3), absolute temperatures: the difference itself about 20 degC
    free convection    |T_b - T_a|^(1/4) (T_b - T_a) / (10 K)^(1/4): the difference itself where it is 10 K

Free convection is that of laminar films, Nu ~ Ra^(1/4) (S. W. Churchill, H. H. S. Chu, Int. J. Heat Mass Transfer 18 (1975)
1323, doi:10.1016/0017-9310(75)90243-4); below about 0.1 K its power is rounded off, so that it is smooth where the heat
turns round. Everything is made of sums, products and square roots, for the reason given in `twin.arithmetic.powers`.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LINEAR, RADIATION, FREE_CONVECTION = 0, 1, 2
LAWS = {"radiation": RADIATION, "free_convection": FREE_CONVECTION}  # as `twin.motor.network.Term` names them


# Numbers are written into the function: its text is compiled on its own (`twin.compiled.kernel`).
@numba.njit(error_model="numpy", nogil=True, cache=True)
def drop(law: int, a: float, b: float) -> tuple[float, float, float]:
    """The drop [K] between a and b [degC] as a law sees it, and its slopes with both."""
    if law == 1:
        unit = 4.0 * 293.15 * 293.15 * 293.15
        cold, warm = a + 273.15, b + 273.15
        value = (warm * warm + cold * cold) * (warm + cold) * (b - a) / unit
        return value, -4.0 * cold * cold * cold / unit, 4.0 * warm * warm * warm / unit
    if law == 2:
        unit = np.sqrt(np.sqrt(np.sqrt(100.01)))
        square = (b - a) * (b - a) + 0.01
        share = np.sqrt(np.sqrt(np.sqrt(square))) / unit
        slope = share * (1.0 + 0.25 * (b - a) * (b - a) / square)
        return share * (b - a), -slope, slope
    return b - a, -1.0, 1.0


@numba.njit(error_model="numpy", nogil=True, cache=True)
def between(at: float, knots: Floats, values: Floats) -> tuple[float, float]:
    """A table (K,) over rising knots (K,), linear between them and constant beyond, and its slope."""
    last = len(knots) - 1
    if at <= knots[0]:
        return values[0], 0.0
    if at > knots[last]:
        return values[last], 0.0
    i = 1
    while at > knots[i]:
        i += 1
    slope = (values[i] - values[i - 1]) / (knots[i] - knots[i - 1])
    return values[i - 1] + slope * (at - knots[i - 1]), slope
