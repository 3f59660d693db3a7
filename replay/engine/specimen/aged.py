"""A motor as the specimen of a session has it: what that went through before, and what is left of its conductances."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts.events import AgeingAssessed, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.files.motor_file import read_motor
from replay.engine.specimen.heat_history import HEATED, Trace, doses, in_order, trace_of_heat
from replay.errors import ReplayDataError
from twin.insulation.ageing_state import Check, State, by_law, filtered, onwards
from twin.motor.ageing_law import Ageing, AgeingPlace, aged, ageing_places, insulation_law
from twin.motor.features import above_degC, monomials
from twin.motor.network import Network

LAW = "law"
DIGITS = 9  # behind the point, of what a run's key holds; the network has the same factor


@dataclass(frozen=True, kw_only=True)
class Aged:
    """Places of a motor that are equally old: `dose_h` hours above `above_degC` have left `factor` of them, `sd` of its
    logarithm. `from_`: the assessment whose checks say so, or "law"."""

    places: list[str]
    above_degC: float
    dose_h: float
    factor: float
    sd: float
    from_: str


@dataclass(frozen=True)
class OfSpecimen:
    """`network`: without ageing terms, these multiplied by `factors`; `hours`: its features `hours_above_<T>degC` -> h;
    `ageing`: how old it is by place."""

    network: Network
    factors: Mapping[AgeingPlace, float]
    hours: Mapping[str, float]
    ageing: Sequence[Aged]


@dataclass(frozen=True)
class _Left:
    """The state that the last check before a session left, and the assessment that it stands in."""

    assessment: str
    above_degC: float
    state: State


def of_specimen(store: Store, facts: Facts, session: SessionRecorded, network: Network) -> OfSpecimen:
    """A session's network (`replay.engine.files.configurations.network_of`) as its specimen has it.

    Insulation goes on from the state that the last check before the session left, where the latest assessment of this
    specimen counts hours above the temperature of the law; all else follows the law from 0 h on. Raises ReplayDataError
    where the motor asks for hours, and the session names no specimen or they are not known.
    """
    places, features = ageing_places(network), _hour_features(network)
    limits = sorted({*(place.ageing.above_degC for place in places), *features.values()})
    if not limits:
        return OfSpecimen(network, {}, {}, ())
    hours = _hours(store, facts, session, limits)
    left = _left(store, facts, session) if any(place.insulation for place in places) else None
    now = {place: _aged(place, hours[place.ageing.above_degC], left) for place in places}
    factors = {place: one.factor for place, one in now.items()}
    return OfSpecimen(
        network=aged(network, factors),
        factors=factors,
        hours={feature: hours[degC] for feature, degC in features.items()},
        ageing=_together(now.values()),
    )


def hours_of(store: Store, facts: Facts, session: SessionRecorded, network: Network) -> dict[str, float]:
    """The features `hours_above_<T>degC` of a network, in a session [h]; refusals as of `of_specimen`."""
    features = _hour_features(network)
    if not features:
        return {}
    hours = _hours(store, facts, session, sorted(set(features.values())))
    return {feature: hours[degC] for feature, degC in features.items()}


def ageing_left_out(store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str) -> list[str]:
    """A line for each session whose specimen is not new by the laws of `model` (SHA-256 of a motor file): for verbs
    that take it as new. Sessions are read for a motor with such laws only."""
    found = []
    for session in sessions:
        network = network_of(store, facts, session, model)
        known = session.specimen is not None and bool(ageing_places(network))
        for one in of_specimen(store, facts, session, network).ageing if known else ():
            if one.factor != 1.0:
                found.append(
                    f"session {session.name}: {', '.join(one.places)} taken as new; {one.dose_h:.3g} h above "
                    f"{one.above_degC:g} degC have left {one.factor:.3g} of it, which replay takes into account."
                )
    return found


def law_of(store: Store, facts: Facts, model: str | None, above_degC: float) -> Ageing:
    """What `model` (SHA-256 of a motor file; None: no motor) says of its insulation beforehand:
    `twin.motor.ageing_law.insulation_law`."""
    network = None if model is None else read_motor(store.archive.read(model), facts.models[model].file)
    return insulation_law(network, above_degC)


def states_left(specimens: Sequence[Sequence[Check | None]], law: Ageing) -> list[list[dict[str, float] | None]]:
    """The state that each check of each specimen leaves (`twin.insulation.ageing_state.State`), in the order of their
    doses; None where the check has no dose or no resistance."""
    each = map(iter, filtered([[check for check in checks if check] for checks in specimens], law))
    return [
        [dict(vars(next(states))) if check else None for check in checks]
        for checks, states in zip(specimens, each, strict=True)
    ]


def _hour_features(network: Network) -> dict[str, float]:
    """Feature -> its temperature [degC]."""
    found = {f: above_degC(f) for m in monomials(network) for f in m.features}
    return {f: degC for f, degC in found.items() if degC is not None}


def _before(facts: Facts, session: SessionRecorded) -> tuple[list[SessionRecorded], bool]:
    """The specimen's sessions before this one, in order, and whether stamps say so."""
    ordered, by_time = in_order([one for one in facts.sessions if one.specimen == session.specimen])
    return ordered[: [one.session for one in ordered].index(session.session)], by_time


def _hours(store: Store, facts: Facts, session: SessionRecorded, limits: Sequence[float]) -> dict[float, float]:
    """Hours above each of `limits` [degC] in the sessions before."""
    if session.specimen is None:
        raise ReplayDataError(
            f"session {session.name}: names no specimen, and the motor file asks how long that was above {limits[0]:g} "
            "degC before: ingest it again with --specimen S, or replay with a model without ageing (--model)."
        )
    before, by_time = _before(facts, session)
    traces: dict[str, Trace | None] = {}
    for one in before:
        trace = trace_of_heat(load(store, facts, one))
        if trace is not None:
            traces[one.session] = trace
        elif one.kind == HEATED:
            raise ReplayDataError(
                f"session {session.name}: the hours of {session.specimen} above {limits[0]:g} degC are not known, as "
                f"its session {one.name} of kind {HEATED} has no temperature of it: give its channel a node in the "
                "bench file and ingest it again."
            )

    def above(trace: Trace) -> NDArray[np.float64]:
        return np.array([trace.hours_above(degC) for degC in limits], dtype=np.float64)

    found = doses([*before, session], by_time, traces, above, np.zeros(len(limits)))[session.session]
    assert found is not None  # every oven session has a course
    return dict(zip(limits, found.tolist(), strict=True))


def _left(store: Store, facts: Facts, session: SessionRecorded) -> _Left | None:
    """The state by the latest assessment that knows the specimen; None where that has none before the session."""
    earlier = {one.session for one in _before(facts, session)[0]}

    def is_before(check: Mapping[str, Any]) -> bool:
        if check["start_ns"] is None or not session.absolute:
            return check["session"] in earlier
        return int(check["start_ns"]) < session.start_ns

    for event in reversed(list(facts.assessments.values())):
        answer = json.loads(store.archive.read(event.answer))
        checks = _checks(store, event, answer, str(session.specimen))
        if checks is not None:
            states = [check["left"] for check in checks if check.get("left") and is_before(check)]
            return _Left(event.assessment, float(answer["threshold_degC"]), State(**states[-1])) if states else None
    return None


def _checks(
    store: Store, event: AgeingAssessed, answer: Mapping[str, Any], specimen: str
) -> Sequence[Mapping[str, Any]] | None:
    """A specimen's checks in an assessment, None where it knows none; of a fleet of which the answer holds a part, from
    its table."""
    for one in answer["specimens"]:
        if one["specimen"] == specimen:
            checks: Sequence[Mapping[str, Any]] = one["checks"]
            return checks
    if "whole" not in answer or answer["whole"]["specimens"] == len(answer["specimens"]):
        return None
    table = pq.read_table(
        io.BytesIO(store.archive.read(event.artefacts["checks"])),
        columns=["session", "start_ns", "left"],
        filters=[("specimen", "=", specimen)],
    )
    return [{**row, "left": row["left"] and json.loads(row["left"])} for row in table.to_pylist()] or None


def _aged(place: AgeingPlace, dose_h: float, left: _Left | None) -> Aged:
    law = place.ageing
    if left is not None and place.insulation and left.above_degC == law.above_degC:
        state, source = onwards(left.state, dose_h, law), left.assessment
    else:
        state, source = by_law(dose_h, law), LAW
    return Aged(
        places=[place.place],
        above_degC=law.above_degC,
        dose_h=round(state.dose_h, DIGITS),
        factor=round(state.factor, DIGITS),
        sd=round(state.ln_factor_sd, DIGITS),
        from_=source,
    )


def _together(each: Iterable[Aged]) -> list[Aged]:
    """Ages of one place each as ages of several places: those that are equally old as one."""
    found: list[Aged] = []
    for one in each:
        like = next((other for other in found if replace(one, places=other.places) == other), None)
        if like is None:
            found.append(one)
        elif one.places[0] not in like.places:
            like.places.extend(one.places)
    return found
