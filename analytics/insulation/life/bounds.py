"""Bounds of what a law of life says: by the profile of the likelihood, or by parametric bootstrap.

A value psi of a quantity lies within the bounds if the best law that has it is not too much less likely than the best
of all: 2 (l_max - l(psi)) <= chi2_1 (Meeker & Escobar 1998, chapters 8 and 19). For a quantile, the activation energy
and the temperature index, to have psi is a linear condition on (gamma, delta), see `censored`, so that each l(psi) is
one concave search.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2

from analytics.insulation.arrays import Floats
from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, LIFE_H, ZERO_DEGC_IN_K
from analytics.insulation.life.censored import Lives, Restriction, maximise, standard_quantile
from analytics.insulation.life.life import LifeFit, density_per_hour, reciprocal, regressors
from analytics.insulation.life.simulation import drawn

Method = Literal["profile", "bootstrap"]

WIDENINGS = 60  # of the first guess of a bound, each by half
IMPOSSIBLE = 1e9  # a deviance: finite, as searches compute with it
COLDEST_DEGC = -272.0  # below, a temperature index is not bounded


@dataclass(frozen=True)
class Bounds:
    """`value` lies between `lower` and `upper` with `confidence`, in `unit`. An end of -inf or inf (of a life 0 or
    inf): the data do not bound it there. `lost`: draws of the bootstrap that gave no value."""

    quantity: str
    unit: str
    value: float
    lower: float
    upper: float
    confidence: float
    method: Method
    criterion: str
    lost: int = 0


class Quantity(ABC):
    """Something that a law says, in `unit`. psi is its value, or where it is a life the logarithm of that."""

    unit: ClassVar[str]

    @property
    @abstractmethod
    def name(self) -> str:
        """As answers call it."""

    @abstractmethod
    def psi(self, fit: LifeFit, location: Floats, eV: Floats, sigma: Floats) -> Floats:
        """psi (...,) by laws with these locations, energies [eV] and spreads (...,)."""

    @abstractmethod
    def deviance(self, fit: LifeFit, psi: float) -> float:
        """2 (l_max - l(psi)): how much less likely than the fitted law the best one is that has this psi."""

    def value(self, psi: float) -> float:
        """The value that a psi stands for."""
        return psi


@dataclass(frozen=True)
class Quantile(Quantity):
    """The life [h] at `degC` that the share `p` does not reach."""

    p: float
    degC: float
    unit = "h"

    @property
    def name(self) -> str:
        return f"life of the share {self.p:g} at {self.degC:g} degC"

    def psi(self, fit: LifeFit, location: Floats, eV: Floats, sigma: Floats) -> Floats:
        u = reciprocal(self.degC, fit.centre_degC)
        return np.asarray(location + eV * u + sigma * standard_quantile(fit.distribution, self.p))

    def deviance(self, fit: LifeFit, psi: float) -> float:
        return _deviance(fit, _through(fit, self.p, self.degC, psi))

    def value(self, psi: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.exp(psi))


@dataclass(frozen=True)
class ActivationEnergy(Quantity):
    """The activation energy E [eV]."""

    name = "activation energy"
    unit = "eV"

    def psi(self, fit: LifeFit, location: Floats, eV: Floats, sigma: Floats) -> Floats:
        return eV

    def deviance(self, fit: LifeFit, psi: float) -> float:
        return _deviance(fit, Restriction(np.zeros(3), np.array([[1.0, 0.0, 0.0], [0.0, psi, 1.0]])))


@dataclass(frozen=True)
class TemperatureIndex(Quantity):
    """The temperature [degC] at which half of the specimens reach `life_h` [h] (IEC 60216-1)."""

    life_h: float = LIFE_H
    unit = "degC"

    @property
    def name(self) -> str:
        return f"temperature index at {self.life_h:g} h"

    def psi(self, fit: LifeFit, location: Floats, eV: Floats, sigma: Floats) -> Floats:
        return _temperature(fit, location, eV, sigma, self.life_h)

    def deviance(self, fit: LifeFit, psi: float) -> float:
        return _deviance(fit, _through(fit, 0.5, psi, math.log(self.life_h))) if psi > COLDEST_DEGC else 0.0


@dataclass(frozen=True)
class HalvingInterval(Quantity):
    """How many kelvin above the temperature index the median life is half of `life_h` (IEC 60216-1)."""

    life_h: float = LIFE_H
    unit = "K"

    @property
    def name(self) -> str:
        return f"halving interval at {self.life_h:g} h"

    def psi(self, fit: LifeFit, location: Floats, eV: Floats, sigma: Floats) -> Floats:
        hotter = _temperature(fit, location, eV, sigma, self.life_h / 2)
        return np.asarray(hotter - _temperature(fit, location, eV, sigma, self.life_h))

    def deviance(self, fit: LifeFit, psi: float) -> float:
        """The least over all temperature indices."""
        if psi <= 0.0:
            return IMPOSSIBLE
        index = estimate(fit, TemperatureIndex(self.life_h))

        def given(degC: float) -> float:
            return _deviance(fit, self._line(fit, degC, psi)) if degC > COLDEST_DEGC else IMPOSSIBLE

        return float(minimize_scalar(given, bracket=(index - psi / 2, index + psi / 2), tol=1e-7).fun)

    def _line(self, fit: LifeFit, degC: float, halving_K: float) -> Restriction:
        """The laws with this index and halving interval, free in their spread only."""
        eV = math.log(2.0) / float(reciprocal(degC, degC + halving_K))
        u = float(reciprocal(degC, fit.centre_degC))
        base = np.array([-standard_quantile(fit.distribution, 0.5), 0.0, 0.0])
        return Restriction(base, np.array([[math.log(self.life_h) - eV * u, eV, 1.0]]))


def estimate(fit: LifeFit, quantity: Quantity) -> float:
    """psi of `quantity` by the fitted law; NaN where it has none (an index where lives do not get shorter with
    heat)."""
    return float(quantity.psi(fit, np.array(fit.location), np.array(fit.eV), np.array(fit.sigma)))


def profile(fit: LifeFit, quantity: Quantity, confidence: float = 0.95) -> Bounds:
    """Bounds of `quantity` by the likelihood's profile; infinite both where the fitted law has no value of it."""
    psi = estimate(fit, quantity)
    allowed = float(chi2.ppf(confidence, 1))
    lower, upper = (
        _edge(lambda v: quantity.deviance(fit, v) - allowed, psi, _step(fit, quantity, psi, s)) for s in (-1, 1)
    )
    return _bounds(fit, quantity, lower, upper, confidence, "profile")


def bootstrap(fit: LifeFit, quantity: Quantity, draws: int = 2000, seed: int = 0, confidence: float = 0.95) -> Bounds:
    """Bounds of `quantity`: quantiles of its values in `draws` data sets that are drawn from the law and watched as the
    real one was (`simulation`)."""
    units = fit.tested.units()
    lower, upper = drawn(units, fit.log_life(units.temperature_degC), fit.sigma, fit.distribution, draws, seed)
    line = maximise(Lives(regressors(units, fit.centre_degC), lower, upper, units.counts), fit.distribution)
    found = line.found
    said = quantity.psi(fit, line.beta[found, 0], line.beta[found, 1], line.sigma[found])
    said = said[np.isfinite(said)]
    tail = (1.0 - confidence) / 2
    low, high = np.quantile(said, [tail, 1.0 - tail]) if said.size else (-math.inf, math.inf)
    return _bounds(fit, quantity, float(low), float(high), confidence, "bootstrap", draws - said.size)


def _bounds(
    fit: LifeFit, quantity: Quantity, lower: float, upper: float, confidence: float, method: Method, lost: int = 0
) -> Bounds:
    """From the ends of psi."""
    value, low, high = (quantity.value(psi) for psi in (estimate(fit, quantity), lower, upper))
    return Bounds(quantity.name, quantity.unit, value, low, high, confidence, method, fit.criterion, lost)


def _temperature(fit: LifeFit, location: Floats, eV: Floats, sigma: Floats, life_h: float) -> Floats:
    """The temperature [degC] at which the median life is `life_h` [h]; NaN where lives do not get shorter with heat
    or none is that long."""
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (math.log(life_h) - location - sigma * standard_quantile(fit.distribution, 0.5)) / eV
    inverse = 1.0 / (fit.centre_degC + ZERO_DEGC_IN_K) + BOLTZMANN_EV_PER_K * u
    possible = (eV > 0.0) & (inverse > 0.0)
    return np.where(possible, 1.0 / np.where(possible, inverse, 1.0) - ZERO_DEGC_IN_K, np.nan)


def _through(fit: LifeFit, p: float, degC: float, log_h: float) -> Restriction:
    """The laws whose quantile `p` at `degC` is `log_h` (ln h): gamma_0 + u gamma_1 - log_h delta = - z_p."""
    u = float(reciprocal(degC, fit.centre_degC))
    base = np.array([-standard_quantile(fit.distribution, p), 0.0, 0.0])
    return Restriction(base, np.array([[-u, 1.0, 0.0], [log_h, 0.0, 1.0]]))


def _deviance(fit: LifeFit, restriction: Restriction) -> float:
    line = maximise(fit.tested.logs(regressors(fit.tested, fit.centre_degC)), fit.distribution, restriction)
    best = fit.log_likelihood + density_per_hour(fit.tested)
    return float(2.0 * (best - line.log_likelihood)) if line.settled else IMPOSSIBLE


def _step(fit: LifeFit, quantity: Quantity, psi: float, sign: int) -> float:
    """A first guess of the distance to a bound: two standard errors by the delta method."""
    if math.isnan(psi):
        return sign * math.inf
    at = np.array([fit.location, fit.eV, math.log(fit.sigma)])
    h = 1e-5
    slope = np.array(
        [
            float(quantity.psi(fit, *_natural(at + h * e)) - quantity.psi(fit, *_natural(at - h * e))) / (2 * h)
            for e in np.eye(3)
        ]
    )
    return sign * 2.0 * math.sqrt(float(slope @ fit.covariance @ slope))


def _natural(at: Floats) -> tuple[Floats, Floats, Floats]:
    return np.array(at[0]), np.array(at[1]), np.array(math.exp(at[2]))


def _edge(excess: Callable[[float], float], psi: float, step: float) -> float:
    """Where `excess` gets above zero on the way from `psi` past `psi + step`; infinite where it does not."""
    inner, outer = psi, psi + step
    if not math.isfinite(outer):
        return math.copysign(math.inf, step)
    for _ in range(WIDENINGS):
        if excess(outer) > 0.0:
            return float(brentq(excess, inner, outer, xtol=1e-10, rtol=1e-10))
        inner, outer = outer, outer + (outer - psi) / 2
    return math.copysign(math.inf, step)
