"""Lives of insulation specimens at several temperatures, as a laboratory finds them: exactly, between two checks, or
not yet ended.

ln of a life is its location + E / k (1 / T - 1 / T_180) + scatter: normal (lognormal lives) or smallest extreme value
(Weibull).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import ndtri

from plant.deterioration import BOLTZMANN_eV_per_K, ZERO_degC_K

Floats = NDArray[np.float64]

AT_degC = 180.0
DISTRIBUTIONS = ("lognormal", "weibull")
CENSORING = ("none", "right", "interval", "both")


@dataclass(frozen=True)
class Law:
    """`median_h` at 180 degC; `sigma`: scale of the scatter of ln life, for Weibull one over the shape."""

    distribution: str = "lognormal"
    median_h: float = 20_000.0
    activation_eV: float = 1.0
    sigma: float = 0.35

    def quantile_h(self, temperature_degC: ArrayLike, probability: ArrayLike = 0.5) -> Floats:
        """Life by which that share has failed. Raises KeyError for a distribution that is none of DISTRIBUTIONS."""
        kelvin = np.asarray(temperature_degC, np.float64) + ZERO_degC_K
        slope = self.activation_eV / BOLTZMANN_eV_per_K * (1.0 / kelvin - 1.0 / (AT_degC + ZERO_degC_K))
        standard = self._standard(np.asarray(probability, np.float64)) - self._standard(np.asarray(0.5))
        return np.asarray(np.exp(np.log(self.median_h) + slope + self.sigma * standard))

    def _standard(self, probability: Floats) -> Floats:
        quantiles = {"lognormal": ndtri, "weibull": lambda p: np.log(-np.log1p(-p))}
        return np.asarray(quantiles[self.distribution](probability))

    def temperature_index_degC(self, life_h: float = 20_000.0) -> float:
        """Temperature at which the median life is `life_h`."""
        return float(brentq(lambda degC: np.log(self.quantile_h(degC) / life_h), 20.0, 400.0, xtol=1e-10))

    def halving_interval_K(self, life_h: float = 20_000.0) -> float:
        """How much hotter than the temperature index halves the median life."""
        return self.temperature_index_degC(life_h / 2.0) - self.temperature_index_degC(life_h)


@dataclass(frozen=True)
class Lives:
    """One row for each specimen: it failed after `lower_h` and not after `upper_h` (N,). Equal: seen to the hour;
    infinite: had not failed."""

    temperature_degC: Floats
    lower_h: Floats
    upper_h: Floats
    life_h: Floats  # true
    law: Law


def lives(
    seed: int,
    temperatures_degC: Sequence[float] = (190.0, 220.0, 240.0, 260.0),
    n: int = 10,
    distribution: str = "lognormal",
    censoring: str = "none",
    *,
    law: Law | None = None,
    ended: float = 0.7,
    checks: int = 8,
) -> Lives:
    """`n` specimens at each temperature. `censoring`: one of CENSORING. `right`: the tests end when the share `ended`
    of all such specimens would have failed; `interval`: specimens are looked at `checks` times, evenly, until the
    median life, and so on at that pace. The lives of a seed do not depend on the censoring. Raises ValueError for a
    name that is none."""
    if censoring not in CENSORING:
        raise ValueError(f"censoring {censoring!r} is none of {', '.join(CENSORING)}")
    law = law or Law(distribution)
    random = np.random.default_rng([seed, 71])
    temperature = np.repeat(np.asarray(temperatures_degC, np.float64), n)
    life = law.quantile_h(temperature, random.uniform(size=len(temperature)))
    lower, upper = life.copy(), life.copy()
    if censoring in ("interval", "both"):
        pace = law.quantile_h(temperature) / checks
        passed = np.ceil(life / pace) - 1.0  # checks that it survived
        lower, upper = passed * pace, (passed + 1.0) * pace
    if censoring in ("right", "both"):
        end = law.quantile_h(temperature, ended)
        if censoring == "both":
            end = np.floor(end / pace) * pace  # a test ends with a check
        going = life > end
        lower, upper = np.where(going, end, lower), np.where(going, np.inf, upper)
    return Lives(temperature, lower, upper, life, law)
