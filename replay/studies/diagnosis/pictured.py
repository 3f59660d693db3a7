"""What is looked at instead of read: a cause's law over speed, and what the next test would show under each rival."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from replay.studies.diagnosis.answer import ForeseenTest, LawCourse, Named, SteadyPoint, TwoModels
from replay.studies.diagnosis.answer_parts import with_unit
from replay.studies.diagnosis.question import Campaign
from replay.studies.diagnosis.search import Found
from twin.calibration.learned import network_of
from twin.diagnosis.next_tests import HOUR_S, Proposed, as_test, load_of, menu
from twin.diagnosis.rounds import Refit
from twin.diagnosis.two_models import Foreseen, foreseen
from twin.fitting.actions import Added, Scale
from twin.fitting.fit import Fit
from twin.fitting.model import Floats
from twin.fitting.recorded import Test
from twin.motor.features import evaluate, monomial, monomials, terms
from twin.motor.network import Network
from twin.motor.paths import Place, terms_at

RECALIBRATED = "recalibrated"
RIVALS = 3  # beside the cause, at most
SPEEDS = 25
VISITED_S = 10.0  # near a speed: less is no training there
INSTANTS = 61  # of a reading over a test


def laws(campaign: Campaign, found: Found, causes: Sequence[Named]) -> list[LawCourse]:
    """The law of each named heat and heat path that a file can say; [] where the tests know no speed or load."""
    tests, scale = campaign.tests, campaign.network.scale
    load = load_of(tests)
    if load is None or not all("speed" in test.inputs for test in tests):
        return []
    speeds, loads = (np.concatenate([test.inputs[name] for test in tests]) for name in ("speed", load))
    grid, usual = np.linspace(0.0, max(1.0, float(speeds.max())), SPEEDS), float(np.sqrt(np.mean(loads**2)))
    ones = np.ones(SPEEDS)  # up to the motor's own scale: what no session visited is drawn as such
    sweep = as_test(campaign.network, tests, Proposed("every speed", grid, usual * ones, ones))
    named = {cause.id: cause for cause in causes}
    courses = []
    for refit in found.naming.accepted:
        over_speed = isinstance(refit.parameter.action, Added | Scale)
        if refit.candidate.cause.kind not in ("loss", "conductance") or not over_speed:
            continue
        cause, places = named[str(refit.candidate.cause)], refit.candidate.places
        models = _models(found, refit)
        base, extended, *others = (_over(network_of(fit, campaign.monomials), places, sweep) for fit in models.values())
        low, high = (_moved(refit, cause, extended, end, sweep) for end in cause.ci95)
        courses.append(
            LawCourse(
                cause=cause.id,
                place=refit.candidate.cause.place,
                unit="W" if refit.candidate.cause.kind == "loss" else "W/K",
                at={with_unit(load): usual * scale[load]},
                speed_rpm=(grid * scale["speed"]).tolist(),
                published=_over(campaign.network, places, sweep).tolist(),
                recalibrated=base.tolist(),
                extended=extended.tolist(),
                low=low.tolist(),
                high=high.tolist(),
                rivals=dict(zip(list(models)[2:], (one.tolist() for one in others), strict=True)),
                trained_rpm=_visited(speeds * scale["speed"], grid * scale["speed"], tests[0].frame.step_s),
            )
        )
    return courses


def _models(found: Found, leader: Refit) -> dict[str, Fit]:
    """Recalibrated alone, with all that was named, and with each rival of the `leader` instead of it,
    by name."""
    named = {str(refit.candidate.cause) for refit in found.naming.accepted}
    models = {RECALIBRATED: found.base} | ({str(leader.candidate.cause): found.naming.final} if named else {})
    rivals = [one for one in _beside(found, leader) if one.ended and one.nameable and one.candidate.sayable]
    fits = {str(one.candidate.cause): one.fit for one in ([] if named else [leader]) + rivals}
    best = [name for name in fits if name not in named][:RIVALS]
    return models | {name: fits[name] for name in sorted(best)}  # as they come back from JSON, and are drawn


def _beside(found: Found, leader: Refit) -> list[Refit]:
    """The other refits of the round that a term led, best first."""
    refits = found.naming.entered(leader.candidate).refits
    others = [one for one in refits if one.candidate != leader.candidate]
    return sorted(others, key=lambda one: -one.log_bayes_factor)


def _over(network: Network, places: Sequence[Place], sweep: Test) -> Floats:
    """The whole heat or conductance of places over the steps of a test, temperature factors left out."""
    columns = monomials(network)
    needed = dict.fromkeys(feature for one in columns for feature in one.features)
    length = len(sweep.frame.features)
    inputs = {feature: sweep.inputs.get(feature, np.zeros(length)) for feature in needed}
    phi = dict(zip(columns, evaluate(columns, inputs, length).T, strict=True))
    own = list(terms(network))
    total = np.zeros(length)
    for i in (i for place in places for i in terms_at(network, place)):
        total += own[i].coefficient * phi.get(monomial(own[i]), 1.0)
    return total


def _moved(refit: Refit, cause: Named, extended: Floats, end: float, sweep: Test) -> Floats:
    """The extended law where the cause has the size of one `end` of its interval."""
    action = refit.parameter.action
    if isinstance(action, Added):
        product = sweep.features[action.feature] if action.feature != "constant" else np.ones(len(extended))
        return extended + (end - cause.estimate) * product * len(action.places)
    return extended * end / cause.estimate


def _visited(speeds_rpm: Floats, grid_rpm: Floats, step_s: float) -> list[list[float]]:
    """Ranges about the grid's speeds that were visited, touching ones joined."""
    half = (grid_rpm[1] - grid_rpm[0]) / 2
    at, count = np.unique(np.rint(speeds_rpm / (2 * half)).astype(np.intp), return_counts=True)
    ranges: list[list[float]] = []
    for i in at[count * step_s >= VISITED_S].tolist():
        low, high = max(0.0, float((2 * i - 1) * half)), min(float(grid_rpm[-1]), float((2 * i + 1) * half))
        if ranges and ranges[-1][1] >= low:
            ranges[-1][1] = high
        else:
            ranges.append([low, high])
    return ranges


def foreseen_test(
    campaign: Campaign, found: Found, next_test: str | None, apart: TwoModels | None
) -> ForeseenTest | None:
    """The readings in the next test, or else in the one that tells the two models apart; None where there is neither,
    or no second model to compare with."""
    best = found.naming.accepted[0] if found.naming.accepted else found.naming.rounds[0].best
    proposed = _proposed(campaign, next_test, apart)
    if proposed is None or best is None:
        return None
    shown = [one for one in foreseen(_models(found, best), proposed) if len(one.reads) > 1]
    if not shown:
        return None
    most = max(shown, key=_apart)
    at = np.unique(np.linspace(0, most.t_s.size - 1, INSTANTS).astype(np.intp))
    reads: Mapping[str, list[float]] = {name: values[at].tolist() for name, values in most.reads.items()}
    return ForeseenTest(
        says=proposed.words,
        channel=most.name,
        node=most.node,
        floor_K=most.floor_K,
        t_s=most.t_s[at].tolist(),
        reads=dict(reads),
    )


def _apart(sensor: Foreseen) -> float:
    """How far a sensor's readings are apart at most, over what it may be off."""
    reads = np.array(list(sensor.reads.values()))
    return float(np.ptp(reads, axis=0).max()) / sensor.floor_K


def _proposed(campaign: Campaign, next_test: str | None, apart: TwoModels | None) -> Proposed | None:
    if next_test is not None:
        tests = menu(campaign.network, campaign.tests)
        return next((one for one in tests if next_test.startswith(one.words)), None)
    if apart is None or apart.test is None:
        return None
    return _steady(campaign, next(point for point in apart.points if point.says == apart.test.says))


def _steady(campaign: Campaign, point: SteadyPoint) -> Proposed:
    """An hour at a point."""
    scale, load = campaign.network.scale, str(load_of(campaign.tests))
    ones = np.ones(round(HOUR_S / campaign.tests[0].frame.step_s))
    speed, level = (point.at[with_unit(name)] / scale[name] for name in ("speed", load))
    return Proposed(point.says, speed * ones, level * ones, ones)
