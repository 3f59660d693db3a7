"""Lives by a criterion from the courses of specimens, and the Arrhenius law of these lives where they tell one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from replay.studies.ageing.assessment import AssessedLives, LivesLaw, OneLife
from replay.studies.ageing.dc_checks import Evaluated
from replay.studies.ageing.history import History

if TYPE_CHECKING:
    from analytics.insulation.life.bounds import Bounds

LEAST_SPREAD_K = 5.0  # temperatures closer than this are one: ovens are not equally hot every time


def lives_of(
    histories: Mapping[str, History], sd: Mapping[str, Sequence[float | None]], criterion: str
) -> AssessedLives:
    """Between which doses each specimen's conductivity first fell by half, at the median temperature of its dose, and
    the lognormal law of these.

    Lives are interval-censored by the checks, and right-censored where the criterion is not reached (IEC 60216, IEEE
    117). `sd`: of ln R of each point of a history, None where it is not usable.
    """
    from analytics.insulation.life.first_passage import first_passage

    lives = []
    for name, history in histories.items():
        known = [(point, own) for point, own in zip(history.points, sd[name], strict=True) if own is not None]
        degC = _temperature(history)
        if degC is None or not known:
            continue
        resistance = np.array([point.resistance for point, _ in known], np.float64)
        found = first_passage(
            [point.dose_h or 0.0 for point, _ in known], np.log(resistance), [own for _, own in known]
        )
        if found.lower_h is not None and found.upper_h is not None:
            upper = None if math.isinf(found.upper_h) else found.upper_h
            lives.append(OneLife(specimen=name, degC=degC, lower_h=found.lower_h, upper_h=upper))
    law, why = _law(lives, criterion)
    return AssessedLives(criterion=criterion, lives=lives, law=law, why=why)


def _temperature(history: History) -> float | None:
    """Median temperature of the hours that are the dose, of a table the one that its last row says, to the nearest step
    that ovens are told apart by."""
    from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC

    said = [point.found.degC for point in history.points if isinstance(point.found, Evaluated) and point.usable]
    if said and said[-1] is not None and said[-1] > THRESHOLD_DEGC:
        return LEAST_SPREAD_K * round(said[-1] / LEAST_SPREAD_K)
    degC = np.concatenate([np.empty(0), *(one.heat.degC for one in history.hours)])
    hours = np.concatenate([np.empty(0), *(one.heat.hours for one in history.hours)])
    hot = degC > THRESHOLD_DEGC
    if hours[hot].sum() <= 0.0:
        return None
    median = float(np.quantile(degC[hot], 0.5, weights=hours[hot], method="inverted_cdf"))
    return LEAST_SPREAD_K * round(median / LEAST_SPREAD_K)


def _law(lives: list[OneLife], criterion: str) -> tuple[LivesLaw | None, str | None]:
    from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC
    from analytics.insulation.life import life
    from analytics.insulation.life.bounds import ActivationEnergy, Quantile, profile
    from analytics.insulation.life.temperature_index import Endurance, endurance

    ended = [one for one in lives if one.upper_h is not None]
    if not ended:
        return None, "no specimen has reached the criterion yet"
    law = life.fit(
        [one.degC for one in lives],
        [one.lower_h for one in lives],
        [math.inf if one.upper_h is None else one.upper_h for one in lives],
        "lognormal",
        criterion=criterion,
    )
    if isinstance(law, life.NoFit):
        return None, law.reason
    index = endurance(law)
    return LivesLaw(
        distribution="lognormal",
        activation_energy_eV=_value_and_bounds(profile(law, ActivationEnergy())),
        median_h_at_180degC=_value_and_bounds(profile(law, Quantile(0.5, THRESHOLD_DEGC))),
        temperature_index_degC=_value_and_bounds(index.index) if isinstance(index, Endurance) else None,
        halving_interval_K=_value_and_bounds(index.halving) if isinstance(index, Endurance) else None,
        why_no_index=None if isinstance(index, Endurance) else index.reason,
    ), None


def _value_and_bounds(found: Bounds) -> dict[str, Any]:
    """Value and 95 % bounds as JSON; a bound that the data do not give is null."""
    ends = [bound if math.isfinite(bound) else None for bound in (found.lower, found.upper)]
    return {"value": found.value, "ci95": ends}
