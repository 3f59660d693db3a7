"""Does the law hold for the lives it was fitted to? One line over temperature, and one spread at all of them.

Likelihood-ratio tests against separate locations, and separate locations and spreads, at each temperature (Nelson
1990, chapter 5; Meeker & Escobar 1998, chapter 19). IEC 60216-3 asks for both, as an F test of linearity and a
chi-squared test of equal variances. The chi-squared distribution of large samples calls too much with ten specimens a
temperature, so that the distribution of the ratio is simulated under the law.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.life.censored import Distribution, Lives, maximise
from analytics.insulation.life.life import LifeFit, LifeTable, NoFit, fit, regressors
from analytics.insulation.life.simulation import drawn

Ratio = Callable[[Floats, Floats], Floats]  # of ln h between which lives ended, (..., n) twice

DRAWS = 999
LEVEL = 0.05
TOLD = 0.5  # of the draws that must have a ratio, else the rest stand for none
ALIKE = "too few or too equal lives at each temperature: nothing to hold the law against"


@dataclass(frozen=True)
class LawCheck:
    """Whether the law passed one question: `asks` what was tested, `ratio` 2 (l - l_0), `p_value` the share of
    simulated ratios that are as large, `passed` where that is above 0.05. `says`: what was found, for a person;
    `left_out_degC`: temperatures that say nothing about it. Where it could not be tested `p_value` is NaN, `passed`
    False, and `says` has why."""

    asks: str
    ratio: float
    degrees: int
    p_value: float
    passed: bool
    says: str
    left_out_degC: tuple[float, ...]


def linearity(law: LifeFit, draws: int = DRAWS, seed: int = 0) -> LawCheck:
    """Is ln life a straight line over 1 / T? Against a location of its own at each temperature where a life ended."""
    asks = "one activation energy at all temperatures"
    chosen = np.isin(law.tested.temperature_degC, law.temperatures_degC)
    tested, left_out = law.tested.at(chosen).units(), law.tested.at(~chosen).temperatures_degC
    line = _line_through(tested, law)
    if len(law.temperatures_degC) < 3 or isinstance(line, NoFit):
        return _untested(asks, "lives ended at fewer than three temperatures: any two lie on a line", left_out)
    simulated = drawn(tested, line.log_life(tested.temperature_degC), line.sigma, law.distribution, draws, seed)
    straight, groups = regressors(tested, law.centre_degC), _groups(tested)

    def ratio(low: Floats, high: Floats) -> Floats:
        null = maximise(Lives(straight, low, high, tested.counts), law.distribution)
        own = maximise(Lives(groups, low, high, tested.counts), law.distribution)
        return np.where(null.settled & own.settled, 2 * (own.log_likelihood - null.log_likelihood), np.nan)

    found = _tested(asks, ratio, tested, simulated, len(law.temperatures_degC) - 2, left_out)
    return replace(found, says=found.says or ("straight within its scatter" if found.passed else _bend(tested, law)))


def common_spread(law: LifeFit, draws: int = DRAWS, seed: int = 0) -> LawCheck:
    """Is the spread of ln life the same at all temperatures? A location each, one spread against one each. Temperatures
    that do not determine a spread are left out."""
    asks = "one spread at all temperatures"
    spreads = {t: s for t in law.temperatures_degC if np.isfinite(s := _spread(law.tested, t, law.distribution))}
    chosen = np.isin(law.tested.temperature_degC, list(spreads))
    tested, left_out = law.tested.at(chosen).units(), law.tested.at(~chosen).temperatures_degC
    if len(spreads) < 2:
        return _untested(asks, "fewer than two temperatures tell a spread", left_out)
    groups, distribution = _groups(tested), law.distribution
    null = maximise(tested.logs(groups), distribution)
    simulated = drawn(tested, groups @ null.beta, float(null.sigma), distribution, draws, seed)

    def ratio(low: Floats, high: Floats) -> Floats:
        common = maximise(Lives(groups, low, high, tested.counts), distribution)
        own = [
            maximise(Lives(np.ones((int(g.sum()), 1)), low[..., g], high[..., g], np.ones(int(g.sum()))), distribution)
            for g in groups.T.astype(np.bool_)
        ]
        total = sum((one.log_likelihood for one in own), np.zeros(low.shape[:-1]))
        settled = np.logical_and.reduce([common.settled, *(one.settled for one in own)])
        return np.where(settled, 2 * (total - common.log_likelihood), np.nan)

    found = _tested(asks, ratio, tested, simulated, len(spreads) - 1, left_out)
    least, most = min(spreads, key=spreads.__getitem__), max(spreads, key=spreads.__getitem__)
    differ = (
        f"sigma of ln life is {spreads[most]:.2g} at {most:g} degC and {spreads[least]:.2g} at {least:g} degC:"
        " bounds of early failures hold for neither"
    )
    return replace(found, says=found.says or ("equal within their scatter" if found.passed else differ))


def _line_through(tested: LifeTable, law: LifeFit) -> LifeFit | NoFit:
    return fit(tested.temperature_degC, tested.lower_h, tested.upper_h, law.distribution, criterion=law.criterion)


def _tested(
    asks: str, ratio: Ratio, tested: LifeTable, draws: tuple[Floats, Floats], degrees: int, left_out: tuple[float, ...]
) -> LawCheck:
    """The check by the share of draws whose ratio is as large, of those that have one and the data themselves; what it
    says is left open. Untested where the data or most draws have no ratio, as a likelihood without limit has none."""
    lives = tested.logs(_level(tested))
    seen = float(ratio(lives.lower, lives.upper))
    simulated = ratio(*draws)
    told = simulated[np.isfinite(simulated)]
    if not math.isfinite(seen) or told.size < TOLD * simulated.size:
        return _untested(asks, ALIKE, left_out)
    p_value = float((1 + np.sum(told >= seen)) / (1 + told.size))
    return LawCheck(asks, seen, degrees, p_value, p_value >= LEVEL, "", left_out)


def _bend(tested: LifeTable, law: LifeFit) -> str:
    """Which way the line bends: the energy between the two coolest temperatures, and between the two hottest."""
    degC = np.unique(tested.temperature_degC)
    ends = [_line_through(tested.at(np.isin(tested.temperature_degC, pair)), law) for pair in (degC[:2], degC[-2:])]
    told = [f"{end.eV:.2f} eV" if isinstance(end, LifeFit) else "an energy that is not determined" for end in ends]
    return (
        f"not straight: {told[0]} between {degC[0]:g} and {degC[1]:g} degC,"
        f" {told[1]} between {degC[-2]:g} and {degC[-1]:g} degC:"
        " lives at cooler temperatures do not follow from it"
    )


def _spread(tested: LifeTable, degC: float, distribution: Distribution) -> float:
    """sigma of the lives at `degC` alone; NaN where they do not tell it."""
    here = tested.at(tested.temperature_degC == degC)
    return float(maximise(here.logs(_level(here)), distribution).sigma)


def _level(tested: LifeTable) -> Floats:
    """The regressor 1 (n, 1)."""
    return np.ones((tested.counts.size, 1))


def _groups(tested: LifeTable) -> Floats:
    """A regressor for each temperature (n, temperatures)."""
    return np.equal.outer(tested.temperature_degC, np.unique(tested.temperature_degC)).astype(np.float64)


def _untested(asks: str, why: str, left_out: tuple[float, ...]) -> LawCheck:
    return LawCheck(asks, math.nan, 0, math.nan, False, why, left_out)
