"""Which stresses the checks of all specimens had behind them, and what each did to R beside the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from replay.studies.ageing.assessment import StressEffect
from replay.studies.ageing.history import Point
from twin.motor.ageing_law import HUNDRED_H

Floats = NDArray[np.float64]

HEAT, CYCLES, DISCHARGE = "heat", "thermal cycles", "discharge"
UNITS = {HEAT: "100 h above 180 degC", CYCLES: "cycle", DISCHARGE: "100 h above the inception voltage"}
SEEN_SD = 2.576  # 1 in 100 by chance


def stress_of(rows: Sequence[tuple[str, Point]], sd: Floats) -> list[StressEffect]:
    """What each stress did, from usable points with their specimens and the sd of ln R of each (n,): heat beside all
    else that any of them had, by the points of which everything is known. Empty where there was nothing but heat."""
    from analytics.insulation.courses import stress

    amounts = [_amounts(point) for _, point in rows]
    names = [HEAT, CYCLES, *dict.fromkeys(name for had in amounts for name, amount in had.items() if amount)]
    names = [name for name in dict.fromkeys(names) if any(name in had for had in amounts)]
    whole = [k for k, had in enumerate(amounts) if all(name in had for name in names)]
    if len(names) < 2 or not whole:
        return []
    found = stress.effects(
        [rows[k][0] for k in whole],
        np.log(np.array([rows[k][1].resistance for k in whole], np.float64)),
        sd[whole],
        {name: [amounts[k][name] for k in whole] for name in names},
    )
    return [
        StressEffect(
            name=one.name,
            unit=UNITS.get(one.name, "count"),
            percent=None if one.effect is None else 100.0 * one.effect,
            sd_percent=None if one.sd is None else 100.0 * one.sd,
            not_told_from=list(one.not_told_from),
        )
        for one in found
    ]


def _amounts(point: Point) -> Mapping[str, float]:
    """How much of each stress was before a check, in the units of `UNITS`, what a table counted as it counted; what
    is not known is not there."""
    had = {
        HEAT: None if point.dose_h is None else point.dose_h / HUNDRED_H,
        CYCLES: None if point.cycles is None else float(point.cycles),
        DISCHARGE: None if point.discharge_h is None else point.discharge_h / HUNDRED_H,
    }
    return {name: amount for name, amount in had.items() if amount is not None} | dict(point.counters)


def beside_heat(stress: Sequence[StressEffect]) -> list[str]:
    """The stresses that did something to R that heat did not, beyond chance."""
    return [
        one.name
        for one in stress
        if one.name != HEAT
        and not one.not_told_from
        and one.percent is not None
        and one.sd_percent is not None
        and abs(one.percent) > SEEN_SD * one.sd_percent
    ]
