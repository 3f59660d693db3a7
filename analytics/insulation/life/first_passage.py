"""The life of one specimen from its checks: between which doses its path first passes the criterion.

A check says more or less than its own error. The life therefore begins where the path was last surely below the
criterion, and has ended where it was first surely above; a check too near to tell widens the interval instead of
deciding it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from analytics.insulation.arrays import HALVED, Floats, usable

SURE = 1.6449  # standard errors: 5 % on the one side that counts


@dataclass(frozen=True)
class Passage:
    """The life lies between `lower_h` and `upper_h` [h] of dose; `upper_h` inf: not yet over. Where no life can be
    told both are None and `why` says so."""

    lower_h: float | None
    upper_h: float | None
    why: str


def first_passage(dose_h: ArrayLike, ln_resistance: ArrayLike, sd: ArrayLike, rise: float = HALVED) -> Passage:
    """When ln R had first risen by `rise` over its value at the start, from checks (n,) at `dose_h` [h] with
    `ln_resistance` (R in K/W) and its standard error `sd`, in any order; checks of one dose are averaged, those with
    NaN left out.

    >>> first_passage([0, 100, 200, 300], [0.0, 0.3, 0.68, 0.9], 0.03)
    Passage(lower_h=100.0, upper_h=300.0, why='passed for sure by 300 h, not yet at 100 h')
    """
    _, dose, value, error = usable(dose_h, ln_resistance, sd)
    if np.unique(dose).size < 2:
        return Passage(None, None, "checked at fewer than two doses with a resistance and its standard error")
    dose, value, error = _by_dose(dose, value, error)
    risen, spread = value[1:] - value[0], SURE * np.hypot(error[1:], error[0])
    later = dose[1:]
    above = np.flatnonzero(risen - spread > rise)
    end = int(above[0]) if above.size else later.size
    below = np.flatnonzero(risen[:end] + spread[:end] < rise)
    lower = float(later[below[-1]]) if below.size else float(dose[0])
    if not above.size:
        return Passage(lower, math.inf, f"not passed for sure by {later[-1]:g} h, not yet at {lower:g} h")
    upper = float(later[end])
    return Passage(lower, upper, f"passed for sure by {upper:g} h, not yet at {lower:g} h")


def _by_dose(dose: Floats, value: Floats, error: Floats) -> tuple[Floats, Floats, Floats]:
    """One value for each dose, checks weighted by their errors."""
    doses, place = np.unique(dose, return_inverse=True)
    weight = np.bincount(place, 1.0 / error**2)
    return doses, np.bincount(place, value / error**2) / weight, 1.0 / np.sqrt(weight)
