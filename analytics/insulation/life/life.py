"""Life against temperature: Arrhenius with log-normal or Weibull lives, by maximum likelihood.

ln t_p(T) = mu + E (1 / k) (1 / T - 1 / T_c) + sigma z_p

with E the activation energy [eV], k Boltzmann's constant, T_c a temperature amid the data and z_p the standard normal
quantile (log-normal) or ln(-ln(1 - p)) (Weibull of shape 1 / sigma). W. Nelson, Accelerated Testing, Wiley 1990, DOI
10.1002/9780470316795, chapters 2 and 5; W. Q. Meeker, L. A. Escobar, Statistical Methods for Reliability Data, Wiley
1998, chapter 19. A life ends by a criterion that a person chose; every result carries its name.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from analytics.insulation.arrays import Flags, Floats, Ints
from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K
from analytics.insulation.life.censored import (
    DISTRIBUTIONS,
    Distribution,
    Lives,
    covariance,
    maximise,
    standard_quantile,
)

CLOSE = 1e-6  # of a life: ends no further apart are one, as the probability between them is lost in rounding


@dataclass(frozen=True)
class LifeTable:
    """What is known of each life (n,): it ended between `lower_h` and `upper_h` [h] at `temperature_degC`; exactly
    then where these are equal. `upper_h` inf: it had not ended (right-censored); `lower_h` 0: it ended before the
    first look. `counts`: how many specimens are alike."""

    temperature_degC: Floats
    lower_h: Floats
    upper_h: Floats
    counts: Floats

    @property
    def ended(self) -> Flags:
        """Whose life ended, (n,)."""
        return np.isfinite(self.upper_h)

    def at(self, chosen: Flags | Ints) -> LifeTable:
        """The rows that are `chosen`: flags (n,), or places of any number."""
        return LifeTable(self.temperature_degC[chosen], self.lower_h[chosen], self.upper_h[chosen], self.counts[chosen])

    def units(self) -> LifeTable:
        """The table with one row for each specimen."""
        each = self.at(np.repeat(np.arange(self.counts.size), self.counts.astype(np.int64)))
        return replace(each, counts=np.ones(each.counts.size))

    def logs(self, x: Floats) -> Lives:
        """The lives as `censored` takes them, with regressors `x` (n, r)."""
        with np.errstate(divide="ignore"):
            return Lives(x, np.log(self.lower_h), np.log(self.upper_h), self.counts)

    @property
    def temperatures_degC(self) -> tuple[float, ...]:
        """Each temperature once, coolest first."""
        return tuple(np.unique(self.temperature_degC).tolist())


@dataclass(frozen=True)
class LifeFit:
    """The fitted law. `location` is mu: ln h at `centre_degC`. `covariance` (3, 3) of (mu, E, ln sigma): inverse of the
    observed information. `log_likelihood` of the lives in h (densities per h)."""

    distribution: Distribution
    criterion: str
    tested: LifeTable
    centre_degC: float
    location: float
    eV: float
    sigma: float
    covariance: Floats
    log_likelihood: float

    @property
    def temperatures_degC(self) -> tuple[float, ...]:
        """Temperatures at which a life ended, coolest first."""
        return self.tested.at(self.tested.ended).temperatures_degC

    def quantile(self, p: float, degC: float) -> float:
        """Life [h] at `degC` [degC] that the share `p`, between 0 and 1, of specimens does not reach; inf where it is
        longer than a number can be."""
        with np.errstate(over="ignore"):
            return float(np.exp(self.log_life(degC) + self.sigma * standard_quantile(self.distribution, p)))

    def log_life(self, degC: ArrayLike) -> Floats:
        """Location of ln h at `degC` [degC]."""
        return np.asarray(self.location + self.eV * reciprocal(degC, self.centre_degC))


@dataclass(frozen=True)
class NoFit:
    """Why no law can be fitted, as a sentence for a person; `criterion` as in the question."""

    reason: str
    criterion: str


def reciprocal(degC: ArrayLike, centre_degC: float) -> Floats:
    """The regressor (1 / k)(1 / T - 1 / T_c) [1/eV]."""
    absolute = np.asarray(degC, np.float64) + ZERO_DEGC_IN_K
    return np.asarray((1.0 / absolute - 1.0 / (centre_degC + ZERO_DEGC_IN_K)) / BOLTZMANN_EV_PER_K)


def fit(
    temperature_degC: ArrayLike,
    lower_h: ArrayLike,
    upper_h: ArrayLike,
    distribution: Distribution,
    counts: ArrayLike | None = None,
    *,
    criterion: str,
) -> LifeFit | NoFit:
    """The law of the lives (n,), see `LifeTable`; `criterion` names what ended a life. `NoFit` where the data do not
    determine it, or a row cannot be (the first such is named, counted from 1). Rows of no specimen, and those that
    say nothing (from 0 h to inf), are left out; ends closer than a millionth are one. Lives at one temperature are
    those whose `temperature_degC` is equal.

    >>> lives = [900.0, 1100.0, 90.0, 110.0]
    >>> two = fit([200.0, 200.0, 240.0, 240.0], lives, lives, "lognormal", criterion="breakdown")
    >>> f"{two.eV:.2f} eV, {two.quantile(0.5, 180.0):.0f} h"
    '1.20 eV, 3665 h'
    """
    given = (temperature_degC, lower_h, upper_h, 1.0 if counts is None else counts)
    rows = LifeTable(*np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, np.float64)) for v in given)))
    reason = _faulty(rows, distribution)
    if reason is not None:
        return NoFit(reason, criterion)
    tested = _exact_where_close(rows.at((rows.counts > 0.0) & ((rows.lower_h > 0.0) | rows.ended)))
    reason = _too_little(tested)
    if reason is None:
        centre = _centre(tested)
        lives = tested.logs(regressors(tested, centre))
        line = maximise(lives, distribution)
        if line.found:
            return LifeFit(
                distribution=distribution,
                criterion=criterion,
                tested=tested,
                centre_degC=centre,
                location=float(line.beta[0]),
                eV=float(line.beta[1]),
                sigma=float(line.sigma),
                covariance=covariance(lives, distribution, line.beta, float(line.sigma)),
                log_likelihood=float(line.log_likelihood) - density_per_hour(tested),
            )
        reason = _why_no_maximum(tested)
    return NoFit(reason, criterion)


def regressors(tested: LifeTable, centre_degC: float) -> Floats:
    """The columns (n, 2) of the law's line: 1 and the reciprocal temperature."""
    return np.stack([np.ones(tested.counts.size), reciprocal(tested.temperature_degC, centre_degC)], axis=-1)


def density_per_hour(tested: LifeTable) -> float:
    """What a log-likelihood of ln h is above that of h: the sum of ln h over the exact lives."""
    exact = tested.lower_h == tested.upper_h
    return float(np.sum(tested.counts[exact] * np.log(tested.lower_h[exact])))


def _exact_where_close(tested: LifeTable) -> LifeTable:
    close = tested.upper_h - tested.lower_h < CLOSE * tested.upper_h
    return replace(tested, upper_h=np.where(close, tested.lower_h, tested.upper_h))


def _centre(tested: LifeTable) -> float:
    weights = tested.counts / tested.counts.sum()
    return float(1.0 / np.sum(weights / (tested.temperature_degC + ZERO_DEGC_IN_K)) - ZERO_DEGC_IN_K)


def _faulty(rows: LifeTable, distribution: str) -> str | None:
    """What is wrong with the question or with a row that stands for a specimen; None where nothing is."""
    if distribution not in DISTRIBUTIONS:
        return f"lives are {' or '.join(DISTRIBUTIONS)}, not {distribution}"
    degC, lower, upper, counts = rows.temperature_degC, rows.lower_h, rows.upper_h, rows.counts
    known = np.isfinite(degC) & np.isfinite(lower) & np.isfinite(counts) & ~np.isnan(upper)
    faults = (
        (~known, "a temperature, a life or a count is missing: leave it out"),
        (
            (lower < 0.0) | (upper <= 0.0) | (upper < lower),
            "a life is below zero, or ends before it begins: lower_h is at least 0, upper_h above 0 and not below it",
        ),
        ((counts < 0.0) | (counts != np.round(counts)), "the count is not a whole number of specimens"),
        (degC <= -ZERO_DEGC_IN_K, "the temperature is below absolute zero"),
    )
    for wrong, what in faults:
        if (wrong & (counts != 0.0)).any():
            return f"row {int(np.argmax(wrong & (counts != 0.0))) + 1}: {what}"
    return None


def _too_little(tested: LifeTable) -> str | None:
    """What all lives together lack; None where nothing."""
    if not tested.counts.size:
        return "no row says anything of a life: each is watched for 0 h, or stands for no specimen"
    if np.unique(tested.temperature_degC).size < 2:
        return "all lives are of one temperature: an activation energy needs two"
    if not tested.ended.any():
        return "no life has ended: nothing bounds them from above"
    return None


def _why_no_maximum(tested: LifeTable) -> str:
    if np.unique(tested.temperature_degC[tested.ended]).size < 2:
        return (
            "lives ended at one temperature only, and nothing bounds them at the others: an activation energy needs two"
        )
    bounded = np.intersect1d(tested.temperature_degC[tested.ended], tested.temperature_degC[tested.lower_h > 0.0])
    if bounded.size < 2:
        return "lives are known from both sides at fewer than two temperatures: look earlier than the first look was"
    return "the lives fit a line without any spread, so that it is not known: look more often, or test more specimens"
