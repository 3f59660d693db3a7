"""Everything that checks of many specimens say: how well they repeat, each one's form, and who is not as the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from analytics.insulation.arrays import Floats
from analytics.insulation.checks import repeatability
from analytics.insulation.checks.repeatability import Repeatability
from analytics.insulation.courses import forms
from analytics.insulation.courses.forms import Form
from analytics.insulation.fleet import outlying, remaining
from analytics.insulation.fleet.outlying import FleetAssessment
from analytics.insulation.fleet.remaining import RemainingLife

FALSE_DISCOVERY_RATE = 0.05


@dataclass(frozen=True)
class Assessed:
    """What checks say of many specimens. `sd` (n,) of ln R of each check, as all that follows weighs it
    (`Repeatability.of_checks`); `forms` and `remaining` by specimen, where it has a check. Fewer than three specimens
    leave nothing to say of what remains."""

    repeatability: Repeatability
    sd: Floats
    forms: Mapping[str, Form]
    fleet: FleetAssessment
    remaining: Mapping[str, RemainingLife]


def assess(
    specimen: Sequence[str],
    batch: Sequence[str | None],
    dose_h: ArrayLike,
    resistance_K_per_W: ArrayLike,
    sd_K_per_W: ArrayLike,
) -> Assessed:
    """Everything that the checks of many specimens say. Arguments have one entry for each check, in any order:
    specimen and batch (n,), dose (n,) [h], R (n,) [K/W] above zero, and what one evaluation leaves uncertain of it
    (n,) [K/W]; how checks repeat comes on top."""
    resistance, dose = np.asarray(resistance_K_per_W, np.float64), np.asarray(dose_h, np.float64)
    ln_r = np.log(resistance)
    repeats = repeatability.estimate(specimen, dose, ln_r)
    sd = repeats.of_checks(np.asarray(sd_K_per_W, np.float64) / resistance)
    rows: dict[str, list[int]] = {}
    for i, name in enumerate(specimen):
        rows.setdefault(name, []).append(i)
    found = {
        name: forms.assess(dose[at], ln_r[at], sd[at], degrees_of_freedom=repeats.degrees_of_freedom)
        for name, at in rows.items()
    }
    left = {one.specimen: one for one in remaining.remaining(specimen, batch, dose, ln_r, sd)}
    return Assessed(repeats, sd, found, outlying.assess(specimen, batch, dose, ln_r, sd, FALSE_DISCOVERY_RATE), left)
