"""What all rooms say of arrays: their types, and which checks can be used."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

HALVED = math.log(2.0)  # ln R rises by so much where the conductivity falls by half
PERCENT_PER_100_H = 1e4  # of a slope of ln R in 1/h


def usable(dose_h: ArrayLike, ln_resistance: ArrayLike, sd: ArrayLike) -> tuple[Flags, Floats, Floats, Floats]:
    """Which of n checks can be used (n,): dose [h], ln R and its standard deviation (one for all, or (n,)) are finite
    and the last is above zero. Then these three of the checks that can (m,)."""
    dose, y = np.asarray(dose_h, np.float64), np.asarray(ln_resistance, np.float64)
    s = np.broadcast_to(np.asarray(sd, np.float64), dose.shape)
    good = np.isfinite(dose) & np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    return good, dose[good], y[good], s[good]
