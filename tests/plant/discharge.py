"""Voltage tests in the oven: while the voltage is above the inception voltage, discharges wear the insulation beside
the heat.

ln of the resistance grows by a share for each 100 h of discharge; as it grows the inception voltage falls, so that a
voltage that did nothing at first may do harm later.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from plant import insulation_check
from plant.oven import Trace
from plant.tables import Column

Floats = NDArray[np.float64]

NEAR_K = 5.0  # of its hottest the oven has to be before the voltage comes on
NOISE = 0.002  # of the voltage


def hours(ln_insulation: Sequence[float], tests: Sequence[tuple[float, float]], rate: float) -> list[float]:
    """Hours of discharge in each of N cycles. `ln_insulation` (N + 1,): ln of the slots' resistance without
    discharge, before the first cycle and after each; `tests`: voltage and hours of each cycle; `rate`: per 100 h."""
    found: list[float] = []
    for alone, (test_V, on_h) in zip(ln_insulation, tests, strict=False):
        inception_V = insulation_check.inception_V(alone + rate * sum(found) / 100.0)
        found.append(on_h if test_V > inception_V else 0.0)
    return found


def volts(trace: Trace, volts: float, on_h: float) -> Floats:
    """The test voltage, rms, over a cycle: on for `on_h` from when the oven is hot."""
    since_s = float(trace.t_s[int(np.argmax(trace.oven > trace.oven.max() - NEAR_K))])
    return np.where((trace.t_s >= since_s) & (trace.t_s < since_s + 3600.0 * on_h), volts, 0.0)


def column(random: np.random.Generator, volts: Floats) -> Column:
    """The test voltage as it is logged."""
    return Column("U_test", "V", np.round(volts * (1.0 + NOISE * random.standard_normal(len(volts)))), 0)


def bench_toml() -> str:
    """The bench file of such a log."""
    return '\n[[channel]]\nsignal = "U_test"\nquantity = "voltage"\nunit = "V"\n'
