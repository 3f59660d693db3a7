"""What channels other than thermometers read of a motor's temperatures and heats.

A resistance or a flux linkage goes with the mean temperature of nodes (`Thermometric`). A power or a heat is a sum of
the motor's heats over a step, through the meter's own first-order lag (`lagged_means`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.powers import exp
from twin.motor.network import Copper

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Thermometric:
    """A reading `reference (1 + slope_per_K (T - reference_degC))`, T [degC] what the sensor follows: the resistance of
    a winding (slope: copper's), the flux linkage of magnets (slope: that of their remanence, below 0)."""

    reference: float
    slope_per_K: float
    reference_degC: float

    @property
    def per_K(self) -> float:
        """What the reading changes by for each K."""
        return self.reference * self.slope_per_K

    def reading(self, degC: Floats) -> Floats:
        """What is read at temperatures (N,) [degC]."""
        return self.reference + self.per_K * (degC - self.reference_degC)

    def temperature(self, reading: Floats) -> Floats:
        """The temperatures (N,) [degC] that readings stand for."""
        return self.reference_degC + (reading - self.reference) / self.per_K

    def through(self, reading: float, degC: float) -> Thermometric:
        """The same law with the reference with which it reads `reading` at a temperature."""
        return replace(self, reference=reading / (1 + self.slope_per_K * (degC - self.reference_degC)))


@dataclass(frozen=True)
class Measurand:
    """What a meter measures, in `unit`. `quantity`: power (mechanical power and all losses), heat (that `boundary`
    takes), resistance or flux (`law`, its reference 1 where only the first samples say it). `gain_sd`: of the share by
    which it reads too much."""

    quantity: str
    unit: str
    gain_sd: float
    boundary: str | None = None
    law: Thermometric | None = None
    referenced: bool = True  # the reference is known


def copper_slope(copper: Copper, reference_degC: float) -> float:
    """The slope [1/K] about a reference temperature of a resistance that goes with `1 + alpha (T - copper's
    reference)`."""
    return copper.alpha_per_K / (1 + copper.alpha_per_K * (reference_degC - copper.reference_degC))


def lagged_means(means: Floats, tau_s: float, step_s: float) -> Floats:
    """Means over the steps (..., N) of what is constant within each step, through a first-order lag; in equilibrium
    at the first."""
    if tau_s <= 0.0:
        return means
    from scipy.signal import lfilter  # brings all of scipy.stats along, a third of a second that few need

    kept, edge = _lag(tau_s, step_s)
    before = lfilter([0.0, 1.0 - kept], [1.0, -kept], means - means[..., :1]) + means[..., :1]
    found: Floats = means + edge * (before - means)
    return found


def _lag(tau_s: float, step_s: float) -> tuple[float, float]:
    """What is left of a difference after a step, and its mean over the step."""
    kept = float(exp(np.array([-step_s / tau_s]))[0])
    return kept, (1.0 - kept) * tau_s / step_s
