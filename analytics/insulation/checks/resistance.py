"""DC checks as arrays -> the thermal resistance from winding to iron, its sd and the route it came by, or why none.

The sd is what one evaluation leaves uncertain in the course of one specimen's checks; how well checks repeat takes
several (`repeatability`). Where the winding heads lose heat to the air, surfaces that darken from 0.80 to 0.90 make
the iron sensor's value fall by 1 to 1.5 %, that of the first minutes by 0.1 %; `evaluate_together` takes it back out of
the former (`darkening`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analytics.insulation.checks.darkening import cold_resistance, surface_shift
from analytics.insulation.checks.estimate import ResistanceEstimate
from analytics.insulation.checks.routes import (
    ROUTES,
    CheckResistance,
    Read,
    Route,
    Together,
    answered,
    evaluate_by,
    read,
)
from analytics.insulation.checks.strays import strayed
from analytics.insulation.checks.trace import CheckTrace, Loaded, unusable_sensors
from analytics.insulation.checks.zero import of_one_zero

__all__ = ["CheckResistance", "CheckTrace", "ResistanceEstimate", "Together", "evaluate_together"]

LEAST_SENSORS_SHARE = 0.5  # of the copper sensors that all checks of a specimen have to keep
ENOUGH_SHARE = 0.75  # of the checks of a specimen that a route has to serve
LEAST_COURSE = 8  # checks that say how much they scatter
MEDIAN = 0.6745  # of the size of a standard normal variable


def evaluate_together(traces: Sequence[CheckTrace], first: Sequence[Together] = ()) -> tuple[CheckResistance, ...]:
    """The checks of one specimen in the order of time, comparable with each other.

    A sensor that fails in one check is left out of all, as the mean of the others is another temperature, unless
    fewer than half would remain; then each check leaves out its own. Where no iron sensor would remain, the one that
    fails least often is kept, and the checks in which it fails have none. The route is the most trusted one that serves
    three quarters of the checks, those of `first` before all others, else the one that serves most; checks that it
    does not serve have none. What sensors are off by from check to check is read before the load (`check_zero`). By
    an iron sensor alone the first check has its own value, later ones without what darker surfaces take from theirs,
    2 % at most.
    """
    bad = _left_out(traces)
    checks = [read(*one) for one in zip(of_one_zero(traces, bad), bad, strict=True)]
    routes: tuple[Route | Together, ...] = (*first, *ROUTES)
    best, most = tuple[CheckResistance, ...](), 0
    for route in routes:
        answers = _answers(checks, bad, route)
        served = sum(answer.resistance_K_per_W is not None for answer in answers)
        if served > most:
            best, most = answers, served
        if served >= ENOUGH_SHARE * len(traces):
            break
    return _without_darkening(best, checks) if most else tuple(evaluate_by(check, ROUTES) for check in checks)


def _left_out(traces: Sequence[CheckTrace]) -> list[dict[str, str]]:
    """Sensors that each check leaves out: name -> why."""
    bad = [unusable_sensors(trace) for trace in traces]
    bad = [found | stray for found, stray in zip(bad, strayed(traces, bad), strict=True)]
    copper = {name for trace in traces for name in trace.copper_names}
    iron = {name for trace in traces for name in trace.iron_names}
    every = copper | iron
    common: dict[str, str] = {}
    for trace, found in zip(traces, bad, strict=True):
        common |= {name: f"{why}, in one check" for name, why in found.items() if name not in common}
        common |= dict.fromkeys(sorted(every - {*trace.copper_names, *trace.iron_names}), "not in every check")
    if iron and iron <= common.keys():
        common.pop(min(sorted(iron), key=lambda name: _fails(name, traces, bad)))
    if len(copper - common.keys()) >= LEAST_SENSORS_SHARE * len(copper):
        return [common | found for found in bad]
    return bad


def _fails(iron: str, traces: Sequence[CheckTrace], bad: Sequence[Mapping[str, str]]) -> int:
    """In how many checks the sensor is not there or cannot be believed."""
    return sum(iron in found or iron not in trace.iron_names for trace, found in zip(traces, bad, strict=True))


def _answers(
    checks: Sequence[Read], bad: Sequence[Mapping[str, str]], route: Route | Together
) -> tuple[CheckResistance, ...]:
    if isinstance(route, Together):
        found = route.estimates(bad)
    else:
        found = _in_their_course([route.estimate(one.check) if one.check else "" for one in checks])
    return tuple(answered(check, [(route.source, one)]) for check, one in zip(checks, found, strict=True))


def _in_their_course(found: Sequence[ResistanceEstimate | str]) -> list[ResistanceEstimate | str]:
    """The estimates with the sd by which they differ from check to check. Where checks lie nearer to the middle of
    their neighbours than their sds let them, the rest of each sd is common to all checks and moves no course: all sds
    are multiplied by one share, which the median of these distances gives, as errors are normal."""
    known = [one for one in found if isinstance(one, ResistanceEstimate) and one.value > 0.0]
    if len(known) < LEAST_COURSE:
        return list(found)
    ln_r, sd = np.log([one.value for one in known]), np.array([one.sd / one.value for one in known])
    off = ln_r[1:-1] - (ln_r[:-2] + ln_r[2:]) / 2
    allowed = np.sqrt(sd[1:-1] ** 2 + (sd[:-2] ** 2 + sd[2:] ** 2) / 4)
    share = min(1.0, float(np.median(np.abs(off) / allowed)) / MEDIAN)
    return [replace(one, sd=share * one.sd) if isinstance(one, ResistanceEstimate) else one for one in found]


def _without_darkening(answers: tuple[CheckResistance, ...], checks: Sequence[Read]) -> tuple[CheckResistance, ...]:
    """The answers by an iron sensor, with what darker surfaces took from them put back."""
    both = zip(answers, checks, strict=True)
    cold = [_cold(one.check) if answer.source == "iron sensor" else None for answer, one in both]
    rest = np.array([answer.resistance_K_per_W for answer in answers], np.float64)
    shift = surface_shift(rest, np.array(cold, np.float64))
    return tuple(
        answer
        if answer.resistance_K_per_W is None
        else replace(answer, resistance_K_per_W=answer.resistance_K_per_W * float(np.exp(by)))
        for answer, by in zip(answers, shift, strict=True)
    )


def _cold(check: Loaded | None) -> float | None:
    if check is None or check.iron is None or check.air is None:
        return None
    on = check.on
    copper, iron, air = check.copper[on], check.iron[on], check.air[on]
    return cold_resistance(check.t_s[on], copper - iron, iron - air, check.power[on])
