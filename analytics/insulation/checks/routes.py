"""The ways from a DC check to the thermal resistance between winding and iron.

Three, in order of trust; one is taken where its sd is under `MOST_SD` of the resistance:

- "iron sensor": (mean copper - mean iron) / (V I) at rest, `steady.resistance_at_rest`: 20 min of load at least.
  Within 1 % of the plain mean of the last 10 min where that changes by less.
- "first minutes": no iron needed, but the switch-on or switch-off with 20 min after it, `first_minutes`.
- "ambient": the whole curve over the ambient with film and emissivity free, `whole_curve`.

On a bare stator of 24 lumps in free air the second gives 1.3 times, the third 2.2 times the iron sensor's value,
whatever the insulation; their courses over checks are 0.9 times as steep in ln R. So values of two routes never
belong into one course.

What else can tell the resistances of all checks of a specimen at once, such as a motor file's network of the rig,
comes in as `Together`; it is no business of this package how.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.checks import first_minutes, whole_curve
from analytics.insulation.checks.estimate import ResistanceEstimate
from analytics.insulation.checks.steady import LAST_S, LEAST_S, Settled, resistance_at_rest, settle
from analytics.insulation.checks.trace import CheckTrace, Loaded, loaded

State = Literal["steady", "extrapolated", "not reached"]
Part = Literal["on", "off"]

MOST_SD = 0.05  # of the resistance: forms of 10 % over a campaign are still seen
MOST_LEAD_K = 10.0  # of the copper over the ambient at rest: a stator that was not left overnight


@dataclass(frozen=True, kw_only=True)
class CheckResistance:
    """What a check says: `resistance_K_per_W` with `sd_K_per_W` by the route `source`, or None and `why` not.

    `copper_degC` and `iron_degC` are means of the used sensors, and `power_W` that where they settle; `hottest_degC`
    with `hottest_sd_K` is that of the sensor `hottest`. `steady` says what these are: means of the last 10 min of
    load ("steady"), asymptotes ("extrapolated"), or means of the last 10 min of a load too short to tell ("not
    reached"). `left_out`: sensors that were not used, each with why.
    """

    resistance_K_per_W: float | None = None
    sd_K_per_W: float | None = None
    source: str | None = None
    why: str | None = None
    steady: State = "not reached"
    copper_degC: float | None = None
    iron_degC: float | None = None
    power_W: float | None = None
    hottest: str | None = None
    hottest_degC: float | None = None
    hottest_sd_K: float | None = None
    left_out: tuple[str, ...]


@dataclass(frozen=True)
class Route:
    """`estimate` gives the resistance, or why this route does not serve."""

    source: str
    estimate: Callable[[Loaded], ResistanceEstimate | str]


@dataclass(frozen=True)
class Together:
    """A route over all checks of a specimen: from the sensors that are left out of each (name -> why) to the resistance
    of each, or why this route does not serve it."""

    source: str
    estimates: Callable[[Sequence[Mapping[str, str]]], Sequence[ResistanceEstimate | str]]


@dataclass(frozen=True)
class Read:
    """A `check` without the sensors that are left out, and all that it says but for the resistance, `told`. Where
    nothing can be evaluated `check` is None and `told` says why."""

    check: Loaded | None
    told: CheckResistance


def read(trace: CheckTrace, left_out: Mapping[str, str]) -> Read:
    """The check without the sensors `left_out` (name -> why)."""
    said = tuple(f"{name}: {why}" for name, why in left_out.items())
    check = loaded(trace, left_out)
    if isinstance(check, str):
        return Read(None, CheckResistance(why=check, left_out=said))
    return Read(check, _without_resistance(check, said))


def evaluate_by(one: Read, routes: Sequence[Route]) -> CheckResistance:
    """The check by the first of `routes` that serves."""
    return answered(one, ((route.source, route.estimate(one.check)) for route in routes if one.check is not None))


def answered(one: Read, found: Iterable[tuple[str, ResistanceEstimate | str]]) -> CheckResistance:
    """The check with the first estimate that is sure enough; `found`: the name of each route with its estimate, or
    why it has none."""
    if one.check is None:
        return one.told
    reasons: dict[str, None] = {}  # in order, each once
    for source, estimate in found:
        why = estimate if isinstance(estimate, str) else too_wide(estimate)
        if why is None and isinstance(estimate, ResistanceEstimate):
            return replace(one.told, resistance_K_per_W=estimate.value, sd_K_per_W=estimate.sd, source=source)
        reasons[f"{source}: {why}"] = None
    advice = "" if one.check.iron is not None else "; put a thermocouple on the iron"
    return replace(one.told, why="; ".join(reasons) + advice)


def too_wide(found: ResistanceEstimate) -> str | None:
    """Why an estimate is not taken; None where it is."""
    if found.value <= 0.0:
        return "copper is not warmer than iron"
    if found.sd > MOST_SD * found.value:
        return f"known to {100.0 * found.sd / found.value:.0f} % only, {100.0 * MOST_SD:.0f} % is allowed"
    return None


def _without_resistance(check: Loaded, left_out: tuple[str, ...]) -> CheckResistance:
    on, t = check.on, check.t_s[check.on]
    means = [check.copper[on], check.power[on], *([] if check.iron is None else [check.iron[on]])]
    series = np.column_stack([*means, check.sensors[on]])
    follows = np.ones(series.shape[1])
    follows[1] = 0.0
    air = None if check.air is None else check.air[on]
    settled = settle(t, series, air, follows)
    state, value, sd = _state(settled, series[t > t[-1] - LAST_S].mean(axis=0))
    hottest = len(means) + int(np.argmax(value[len(means) :]))
    return CheckResistance(
        steady=state,
        copper_degC=float(value[0]),
        iron_degC=None if check.iron is None else float(value[2]),
        power_W=float(value[1]),
        hottest=check.names[hottest - len(means)],
        hottest_degC=float(value[hottest]),
        hottest_sd_K=None if sd is None else float(sd[hottest]),
        left_out=left_out,
    )


def _state(settled: Settled | None, last: Floats) -> tuple[State, Floats, Floats | None]:
    if settled is None or bool(settled.lost[0]):
        return "not reached", last, None
    if bool(settled.steady[0]):
        return "steady", settled.last, settled.sd
    return "extrapolated", settled.final, settled.sd


def _by_iron(check: Loaded) -> ResistanceEstimate | str:
    if check.iron is None:
        return "no iron temperature: no channel of region iron has one"
    if check.load_s < LEAST_S:
        return f"loaded for {check.load_s // 6.0 / 10.0:.1f} min without a break, {LEAST_S / 60.0:.0f} min are needed"
    on = check.on
    drop = check.copper[on] - check.iron[on]
    found = resistance_at_rest(check.t_s[on], drop, check.iron[on], check.power[on])
    return found or f"fewer than {LEAST_S / 60.0:.0f} min of load with every sensor"


def _by_minutes(check: Loaded, parts: tuple[Part, ...]) -> ResistanceEstimate | str:
    switched = {"on": check.first, "off": check.last + 1}
    found = []
    for part in parts:
        place = switched[part]
        stretch = first_minutes.stretch(check.t_s, check.copper, check.power, place) if place < check.t_s.size else None
        if stretch is None:
            return (
                f"fewer than {first_minutes.LENGTH_S / 60.0:.0f} min recorded after switching {part}, "
                f"or samples more than {first_minutes.MOST_STEP_S:.0f} s apart"
            )
        found.append(stretch)
    return first_minutes.fit(found)


def _by_ambient(check: Loaded) -> ResistanceEstimate | str:
    if check.air is None:
        return "no ambient temperature"
    if check.load_s < LEAST_S:
        return f"loaded for {check.load_s // 6.0 / 10.0:.1f} min without a break, {LEAST_S / 60.0:.0f} min are needed"
    since = max(check.first - 1, 0)
    lead_K = abs(float(check.copper[since] - check.air[since]))
    if lead_K > MOST_LEAD_K:
        return f"it begins {lead_K:.0f} K off the ambient, not at rest"
    t_s, copper, power, air = (values[since:] for values in (check.t_s, check.copper, check.power, check.air))
    curve = whole_curve.Curve(t_s, copper, power, air, check.first - since, check.last + 1 - since)
    found = whole_curve.fit(curve)
    return found or "too few samples"


ROUTES: tuple[Route, ...] = (
    Route("iron sensor", _by_iron),
    Route("first minutes", partial(_by_minutes, parts=("on", "off"))),
    Route("first minutes", partial(_by_minutes, parts=("on",))),
    Route("first minutes", partial(_by_minutes, parts=("off",))),
    Route("ambient", _by_ambient),
)
