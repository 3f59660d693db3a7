"""What an hour at one temperature is worth at another, under one stated rule.

Two rules are in use, and they are not the same: the activation energy of one chemical reaction (Arrhenius; IEEE Std
98, IEC 60216), and the rule of thumb that life halves every 10 K (of the kind of V. M. Montsinger, Trans. AIEE 49
(1930) 776, who found 8 K for class A). At 180 degC the latter equals 1.2 eV, at 230 degC 1.5 eV. A number here is
always by one rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from analytics.insulation.arrays import Floats

BOLTZMANN_EV_PER_K = 8.617333262e-5  # CODATA 2018, exact
ZERO_DEGC_IN_K = 273.15

THRESHOLD_DEGC = 180.0  # limit of class H: hours above it are the dose
LIFE_H = 20_000.0  # of class H at its limit


class Rule(Protocol):
    """What an hour is worth at another temperature."""

    @property
    def name(self) -> str:
        """As answers call it: "10 K rule", "0.9 eV"."""

    def acceleration(self, temperature_degC: ArrayLike, at_degC: float) -> Floats:
        """Hours at `at_degC` [degC] that an hour at `temperature_degC` [degC] is worth."""


@dataclass(frozen=True)
class Doubling:
    """Life halves every `kelvin` [K], at every temperature."""

    kelvin: float = 10.0

    @property
    def name(self) -> str:
        return f"{self.kelvin:g} K rule"

    def acceleration(self, temperature_degC: ArrayLike, at_degC: float) -> Floats:
        """2^((T - T_at) / kelvin)."""
        return np.asarray(np.exp2((np.asarray(temperature_degC, np.float64) - at_degC) / self.kelvin))


@dataclass(frozen=True)
class Activation:
    """One reaction of activation energy `eV` [eV]."""

    eV: float

    @property
    def name(self) -> str:
        return f"{self.eV:g} eV"

    def acceleration(self, temperature_degC: ArrayLike, at_degC: float) -> Floats:
        """exp(E / k (1 / T_at - 1 / T)), temperatures absolute."""
        inverse = 1.0 / (np.asarray(temperature_degC, np.float64) + ZERO_DEGC_IN_K)
        return np.asarray(np.exp(self.eV / BOLTZMANN_EV_PER_K * (1.0 / (at_degC + ZERO_DEGC_IN_K) - inverse)))


ASSUMED = Activation(1.0)  # where no lives were measured
ASSUMED_BAND = (Activation(0.9), Activation(1.1))
RULES: tuple[Rule, ...] = (*ASSUMED_BAND, Doubling())  # whose least and most an answer gives


def equivalent_hours(
    temperature_degC: ArrayLike, hours: ArrayLike, at_degC: float, rule: Rule, above_degC: float = THRESHOLD_DEGC
) -> float:
    """Hours at `at_degC` [degC] that `hours` (N,) at `temperature_degC` (N,) [degC] are worth under `rule`. Only what
    is hotter than `above_degC` [degC] counts; -inf counts all.

    >>> round(equivalent_hours([230.0], [300.0], 180.0, Activation(0.9)))
    2963
    """
    temperature, duration = np.broadcast_arrays(np.asarray(temperature_degC, np.float64), np.asarray(hours, np.float64))
    counts = temperature > above_degC
    return float(np.sum(rule.acceleration(temperature[counts], at_degC) * duration[counts]))
