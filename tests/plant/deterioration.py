"""What heat does to the slot insulation: a thermal resistance that changes over dose, in forms that a trial can hide.

The dose is damage in hours at 230 degC: every hour counts exp(E / k (1 / T_ref - 1 / T)) of one, with an activation
energy E that nobody outside knows and no threshold. A form says ln of the resistance over the start's at a dose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

BOLTZMANN_eV_per_K = 8.617333262e-5
ZERO_degC_K = 273.15
OVEN_degC = 230.0


def acceleration(temperature_degC: ArrayLike, activation_eV: float, at_degC: float = OVEN_degC) -> Floats:
    """Hours at `at_degC` that an hour at each temperature is worth, by Arrhenius."""
    kelvin = np.asarray(temperature_degC, np.float64) + ZERO_degC_K
    return np.exp(activation_eV / BOLTZMANN_eV_per_K * (1.0 / (at_degC + ZERO_degC_K) - 1.0 / kelvin))


class Form(Protocol):
    """`name` is the word for it: none, monotone, dip_then_rise, changepoint."""

    @property
    def name(self) -> str: ...

    @property
    def change_at_h(self) -> float | None:
        """Dose at which it turns; None where it has no such place."""

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """ln of the resistance over its start's, at doses of any shape."""


@dataclass(frozen=True)
class Unchanged:
    """Nothing happens."""

    name: str = "none"
    change_at_h: float | None = None

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        return np.zeros_like(np.asarray(dose_h, np.float64))


@dataclass(frozen=True)
class Monotone:
    """ln of the resistance rises by `total` at `full_h`, as (dose / full_h)^curvature: 1 straight, below 1 slower and
    slower, above 1 faster and faster."""

    total: float
    full_h: float
    curvature: float = 1.0
    name: str = "monotone"
    change_at_h: float | None = None

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        return self.total * (np.asarray(dose_h, np.float64) / self.full_h) ** self.curvature


@dataclass(frozen=True)
class DipThenRise:
    """Resin that cures on: a dip of `depth` with a time constant, under a steady rise of `rate` per 100 h."""

    depth: float
    time_constant_h: float
    rate: float
    name: str = "dip_then_rise"

    @property
    def change_at_h(self) -> float | None:
        """The dose of the lowest point."""
        ratio = self.depth / self.time_constant_h / (self.rate / 100.0)
        return self.time_constant_h * float(np.log(ratio)) if ratio > 1.0 else None

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        dose = np.asarray(dose_h, np.float64)
        return self.rate * dose / 100.0 + self.depth * np.expm1(-dose / self.time_constant_h)


@dataclass(frozen=True)
class Changepoint:
    """Nothing until `change_at_h`, then a step of `jump` and a steady rise of `rate` per 100 h."""

    change_at_h: float
    rate: float
    jump: float = 0.0
    name: str = "changepoint"

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        after = np.asarray(dose_h, np.float64) - self.change_at_h
        return np.where(after > 0.0, self.jump + self.rate * after / 100.0, 0.0)


@dataclass(frozen=True)
class PaperCourse:
    """Falls over eight cycles of 12 h, rises to the fifteenth past its start, then neither."""

    fall: float = 0.12
    above_start: float = 0.08
    cycle_h: float = 12.0
    name: str = "dip_then_rise"

    @property
    def change_at_h(self) -> float | None:
        """Where it turns."""
        return 8 * self.cycle_h

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        knots = self.cycle_h * np.array([0.0, 8.0, 15.0])
        return np.interp(np.asarray(dose_h, np.float64), knots, [0.0, -self.fall, self.above_start])


@dataclass(frozen=True)
class Faster:
    """Another form, and a steady rise of `rate` per 100 h on top, as in a bad batch."""

    form: Form
    rate: float

    @property
    def name(self) -> str:
        """The form's, "monotone" for one that is unchanged."""
        return "monotone" if self.form.name == "none" else self.form.name

    @property
    def change_at_h(self) -> float | None:
        """Where the sum of both turns."""
        if isinstance(self.form, DipThenRise):
            return replace(self.form, rate=self.form.rate + self.rate).change_at_h
        return self.form.change_at_h

    def ln_factor(self, dose_h: ArrayLike) -> Floats:
        """As `Form`."""
        return self.form.ln_factor(dose_h) + self.rate * np.asarray(dose_h, np.float64) / 100.0


FORMS = ("none", "monotone", "dip_then_rise", "changepoint", "paper")
CURVATURES = (0.5, 1.0, 2.0)


def draw(name: str, random: np.random.Generator, full_h: float, cycle_h: float) -> Form:
    """A form of that name (FORMS) over a campaign of `full_h` h in cycles of `cycle_h`, of a size worth telling: 0.2
    to 0.8 in ln of the insulation's resistance. Raises KeyError for a name that is none."""
    size = random.uniform(0.2, 0.8)
    dip = random.uniform(0.15, 0.35)
    turn = random.uniform(0.3, 0.6)
    curvature = float(random.choice(CURVATURES))
    forms: Mapping[str, Form] = {
        "none": Unchanged(),
        "monotone": Monotone(size, full_h, curvature),
        "dip_then_rise": DipThenRise(dip, 0.15 * full_h, (dip + 0.6 * size) * 100.0 / full_h),
        "changepoint": Changepoint(turn * full_h, 0.7 * max(size, 0.3) / (1.0 - turn) / full_h * 100.0),
        "paper": PaperCourse(fall=dip, above_start=0.6 * dip, cycle_h=cycle_h),
    }
    return forms[name]
