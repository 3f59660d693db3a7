"""Calibration over stored sessions: estimates, the motor file that holds them as a new model, and the fact of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from ingest.facts.events import CalibrationCompleted, Event, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from ingest.texts.nearest import hint
from replay.engine.files.configurations import network_of
from replay.engine.files.models import model_of, published
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import written
from replay.engine.results.artefacts import to_parquet
from replay.engine.results.hot_spot_bands import covariance_table
from replay.engine.runs.identity import environment, run_id
from replay.engine.runs.sources import code_of
from replay.engine.specimen.aged import of_specimen
from replay.errors import ReplayDataError
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import STEP_S, read_from, test_of
from twin.calibration.calibrate import Calibration, calibrate
from twin.calibration.profile import profile
from twin.calibration.united import United
from twin.fitting.model import Test
from twin.fitting.recorded import RecordedMeter

UNITS = {"loss": "W", "conductance": "W/K", "capacity": "J/K"}


@dataclass(frozen=True)
class CalibrationResult:
    """A calibration: the fact, the numbers behind it (covariance included), and the sessions as they were learnt from,
    in their order."""

    event: CalibrationCompleted
    calibration: Calibration
    tests: tuple[Test, ...]


def calibrate_sessions(
    store: Store,
    facts: Facts,
    sessions: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    only: Sequence[str] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> CalibrationResult:
    """Estimate coefficients and capacities of `model` (None: the one that the sessions' bench files name) from
    sessions; only those named in `only`, where it is given.

    Each session is run in its own configuration of the motor, all of them with the same coefficients. The motor file
    with the new numbers is sealed and published with its parent. The same question again writes nothing. Raises
    ReplayDataError where there is no session, the sessions name different models, or one lacks what it needs.
    """
    parent = model or common_model(facts, sessions)
    name = facts.models[parent].file
    data = store.archive.read(parent)
    old = [of_specimen(store, facts, one, network_of(store, facts, one, parent)) for one in sessions]
    rigs = [session.configuration for session in sessions]
    united = United(read_motor(data, name), rigs)
    network = united.network
    tests: list[Test] = []
    for session, rig, its in zip(sessions, rigs, old, strict=True):
        tell(f"reading {len(tests) + 1} of {len(sessions)}: {session.name}")
        test = test_of(store, facts, session, its.network, (), level, meters=True)
        tests.append(united.test(test, rig, its.factors))
    with fitting(f"calibration of {network.name}"):
        found = calibrate(network, tests, only, tell)
    named_estimates = zip(found.estimates, united.names, strict=True)
    result = replace(found, estimates=tuple(replace(one, name=called) for one, called in named_estimates))
    key = _key(facts, sessions, parent, level, only)
    own = slice(len(result.estimates))  # the motor's own parameters, of all that were fitted
    covariance = np.asarray(np.linalg.inv(result.fit.hessian)[own, own], np.float64)
    named = ", ".join(f"{s.name} ({s.configuration})" if s.configuration else s.name for s in sessions)
    says = f"Calibrated on {named} from model {handle(parent)}.\nComments beside a number speak of its value before."
    text = written(data, name, united.version(result.network), says)
    sealed = store.archive.seal(text)
    event = CalibrationCompleted(
        calibration=run_id(key),
        sessions=[session.session for session in sessions],
        parent=parent,
        model=sealed,
        motor=network.name,
        level=level,
        key=key,
        environment=environment(),
        converged=result.fit.converged,
        iterations=result.iterations,
        log_posterior=-result.fit.cost,
        parameters=[{"name": one.name, "unit": UNITS[_kind(one.name)], **vars(one)} for one in result.estimates],
        errors=_errors(sessions, tests, result),
        covariance=store.archive.seal(to_parquet(covariance_table(united.names, covariance))),
    )
    _keep(store, facts, event)
    return CalibrationResult(event, result, tuple(tests))


def profiles(result: CalibrationResult, names: Sequence[str]) -> list[dict[str, Any]]:
    """What the data alone say of each named parameter, everything else fitted anew (`twin.calibration.profile`), one
    entry for each; an end of the interval is None where the data do not bound it. Raises ReplayDataError where there
    is no such parameter."""
    before = {estimate.name: estimate.before for estimate in result.calibration.estimates}
    if unknown := [name for name in names if name not in before]:
        raise ReplayDataError(
            f"--profile {unknown[0]}: the motor has no such parameter.{_nearest(unknown[0], before)} Names are "
            "kind.place.law; `whyhot calibrate --on S --json` lists those of this motor as `parameters`."
        )
    found = []
    for name in names:
        with fitting(f"profile of {name}"):
            one = profile(result.calibration.fit, list(before).index(name))
        ends = [None if end is None else before[name] * math.exp(end) for end in (one.low, one.high)]
        value, unit = before[name] * math.exp(one.best), UNITS[_kind(name)]
        course = [[before[name] * math.exp(v), float(r)] for v, r in zip(one.values, one.rise, strict=True)]
        found.append({"name": name, "unit": unit, "value": value, "ci95": ends, "course": course})
    return found


def _kind(name: str) -> str:
    return name.split(".", 1)[0]


def _nearest(name: str, names: Collection[str]) -> str:
    """The end of a refusal: the parameter most like an unknown name, one of the same kind where there is any."""
    alike = [one for one in names if _kind(one) == _kind(name)] or list(names)
    return hint(name, names) or f" Nearest: {get_close_matches(name, alike, n=1, cutoff=0.0)[0]}."


def common_model(facts: Facts, sessions: Sequence[SessionRecorded]) -> str:
    """The model that all sessions name. Raises ReplayDataError where there is none or they name different ones."""
    if not sessions:
        raise ReplayDataError("no session to calibrate on: name some with --on. `whyhot sessions` lists them.")
    named = {model_of(facts, session): session.name for session in sessions}
    if len(named) > 1:
        which = ", ".join(f"{session} names {handle(model)}" for model, session in named.items())
        raise ReplayDataError(
            f"the sessions' bench files name different motor files ({which}): say which one with --model."
        )
    return next(iter(named))


def _key(
    facts: Facts, sessions: Sequence[SessionRecorded], parent: str, level: str, only: Sequence[str] | None
) -> dict[str, Any]:
    """Everything that the estimates may depend on, but for the environment."""
    return {
        "sessions": sorted(session.session for session in sessions),
        **read_from(facts, sessions),
        "parent": parent,
        "level": level,
        "settings": {"step_s": STEP_S} | ({} if only is None else {"only": sorted(only)}),
        "code": code_of(__name__),
    }


def _keep(store: Store, facts: Facts, event: CalibrationCompleted) -> None:
    """Append what the ledger does not have."""
    known = any(
        isinstance(one.event, CalibrationCompleted) and one.event.calibration == event.calibration
        for one in store.ledger.events()
    )
    events: list[tuple[str, Event]] = [*published(facts, event.parent, event.model)]
    if not known:
        events.append((f"calibration-{event.calibration}", event))
    if events:
        store.ledger.append_all(events)


def _errors(sessions: Sequence[SessionRecorded], tests: Sequence[Test], result: Calibration) -> list[dict[str, Any]]:
    """One entry for each session and channel; those of meters have a `unit` and no K in their keys."""
    entries = []
    for (s, name), before in result.mae_before.items():
        found = next(one for one in tests[s].sensors if one.name == name)
        entry: dict[str, Any] = {"session": sessions[s].session, "session_name": sessions[s].name, "channel": name}
        after, bias = result.mae_after[s, name], result.bias.get((s, name), 0.0)
        if isinstance(found, RecordedMeter):
            entry |= {"place": _place(found), "unit": found.what.unit, "before": before, "after": after}
            entry |= {"bias": bias, "bias_sd": found.sensor.bias_sd}
            entry |= {"gain": result.gain.get(name, 0.0), "gain_sd": found.what.gain_sd}
        else:
            entry |= {"node": " + ".join(found.sensor.weights), "before_K": before, "after_K": after}
            entry |= {
                "bias_K": bias,
                "bias_sd_K": found.sensor.bias_sd,
                "outliers_s": result.outliers_s.get((s, name), 0.0),
            }
        entries.append(entry)
    return entries


def _place(meter: RecordedMeter) -> str:
    return " + ".join(meter.sensor.weights) if meter.what.law is not None else meter.what.boundary or "motor"
