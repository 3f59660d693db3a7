"""Report and layers of what a store holds: which runs, read back from their seals, to which files."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from ingest.catalogue.channels import load
from ingest.catalogue.decoded import files_of, taken_off
from ingest.facts.events import ReplayCompleted, SessionRecorded
from ingest.facts.facts import Facts, at
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.results.run import Run
from replay.engine.results.sealed import load_run
from replay.engine.runs.campaign import replay_sessions
from replay.errors import ReplayDataError
from replay.show.plots.compare import MODELS
from replay.show.reports.diagnosis_report import write_diagnosis_report
from replay.show.reports.diagnosis_text import answer_markdown, diagnosis_name
from replay.show.reports.report import ReportContext, write_report
from replay.show.viewer import layers
from replay.show.viewer.seen import SessionSeen
from replay.show.words.onward import DEFAULT_STORE
from replay.show.words.words import joined, short
from replay.studies.ageing import assessment
from replay.studies.ageing.assessment import Assessment
from replay.studies.diagnosis.accept import sealed_diagnosis
from replay.studies.diagnosis.answer import Diagnosis
from replay.studies.diagnosis.formulas import text_diff

NAMED = ("whyhot", "numpy", "scipy", "numba", "pyarrow", "matplotlib")


def write_replay_report(
    store: Store, facts: Facts, sessions: Sequence[str], target: Path, command: str, model: str | None = None
) -> list[Run]:
    """The report of the latest run of each session (all replayed ones where none is named), with the model of id
    `model`, None for the one that is current; returns these runs. Raises ReplayDataError where a session has no such
    run."""
    chosen = facts.named(sessions) or [one for one in facts.sessions if latest_run(facts, one, model)]
    if not chosen:
        raise ReplayDataError(f"no session of this store was replayed{_with(facts, model)}, then report.")
    events = [_run_of(facts, session, model) for session in chosen]
    runs = [load_run(store, facts, event) for event in events]
    write_report(
        runs, target, context(store, command), {event.session: corrected(store, facts, event) for event in events}
    )
    return runs


def corrected(store: Store, facts: Facts, event: ReplayCompleted) -> str:
    """What its bench file took off the readings and times of a run, as a sentence; "" for nothing."""
    off = taken_off(files_of(store, facts, facts.session(event.session), event.bench))
    return f"readings and times are corrected, as the bench file says: {', '.join(off)}" if off else ""


def write_layers(store: Store, facts: Facts, sessions: Sequence[str], folder: Path) -> list[Path]:
    """The layers of sessions for the viewer, as `replay.show.viewer.layers` writes them. Raises ViewerError where rerun
    is not installed."""
    return [path for name in sessions for path in layers.write_layers(seen(store, facts, facts.session(name)), folder)]


def seen(store: Store, facts: Facts, session: SessionRecorded) -> SessionSeen:
    """What the viewer shows of a session: the models of the last diagnosis about it as far as they were replayed over
    it, with its answer; else its last replay."""
    events, found = _replays(store, facts, session)
    runs = {role: load_run(store, facts, event) for role, event in events.items()}
    return SessionSeen(
        session,
        load(store, facts, session),
        runs,
        network_of(store, facts, session, list(events.values())[-1].model) if events else None,
        answer_markdown(found) if found else "",
        _missing(found, runs),
        corrected(store, facts, list(events.values())[-1]) if events else "",
    )


def _replays(
    store: Store, facts: Facts, session: SessionRecorded
) -> tuple[dict[str, ReplayCompleted], Diagnosis | None]:
    """Key of MODELS -> the session's last replay with that model, in their order; and the diagnosis that made them."""
    runs = {event.model: event for event in facts.runs_of(session)}
    for completed in reversed(list(facts.diagnoses.values())):
        if session.session in (*completed.key.get("train", ()), *completed.key.get("kept", ())):
            found = sealed_diagnosis(store, completed)
            if found.model in runs:
                models = zip(MODELS, _models(found), strict=True)
                return {role: runs[model] for role, model in models if model in runs}, found
    last = latest_run(facts, session)
    return {"published": last} if last else {}, None


def _missing(found: Diagnosis | None, runs: Mapping[str, Run]) -> str:
    """Which models of a diagnosis were not replayed over the session yet, and how they come to be; "" for none."""
    made = zip(MODELS, _models(found), strict=True) if found else ()
    lacking = [MODELS[role].label for role, model in made if model and role not in runs]
    if found is None or not lacking:
        return ""
    name = diagnosis_name(found)
    return f"{name}: not replayed yet {joined(lacking)}: `whyhot report {name}` does it, then view again"


def _models(diagnosis: Diagnosis) -> tuple[str | None, str | None, str | None]:
    """In the order of MODELS."""
    return diagnosis.model, diagnosis.recalibrated_model, diagnosis.extended_model


def write_diagnosis(
    store: Store, diagnosis: Diagnosis, target: Path, command: str, tell: Callable[[str], None] = lambda _: None
) -> dict[str, dict[str, Run]]:
    """The report of a diagnosis; returns its runs, session -> model as the report calls it -> run. Its sessions are
    replayed first under its models, and the runs that the ledger does not have are recorded."""
    names = [*diagnosis.train, *diagnosis.held_out]
    sessions = [at(store.ledger).session(name) for name in names]
    runs: dict[str, dict[str, Run]] = {name: {} for name in names}
    for label, model in zip(MODELS, _models(diagnosis), strict=True):
        outcomes = replay_sessions(store, sessions, model, diagnosis.level, tell=tell) if model else []
        facts = at(store.ledger)
        for outcome in outcomes:
            if outcome.run:
                runs[outcome.session.session][label] = load_run(store, facts, outcome.run)
    network = network_of(store, at(store.ledger), sessions[0], diagnosis.model)
    write_diagnosis_report(diagnosis, runs, network, _difference(store, diagnosis), target, context(store, command))
    return runs


def write_sealed_diagnosis(store: Store, facts: Facts, diagnosis: Diagnosis, target: Path, command: str) -> None:
    """The report of a diagnosis with the runs that there are: nothing is replayed, nothing written into the store."""
    sealed = {(event.session, event.model): event for event in facts.runs.values() if event.level == diagnosis.level}
    models = dict(zip(MODELS, _models(diagnosis), strict=True))
    runs = {
        name: {
            label: load_run(store, facts, sealed[name, model])
            for label, model in models.items()
            if model and (name, model) in sealed
        }
        for name in (*diagnosis.train, *diagnosis.held_out)
    }
    network = network_of(store, facts, facts.session(diagnosis.train[0]), diagnosis.model)
    write_diagnosis_report(diagnosis, runs, network, _difference(store, diagnosis), target, context(store, command))


def last_assessment(store: Store, facts: Facts) -> Assessment | None:
    """The last assessment of ageing, None where there is none."""
    events = list(facts.assessments.values())
    return assessment.read(json.loads(store.archive.read(events[-1].answer))) if events else None


def _difference(store: Store, diagnosis: Diagnosis) -> str:
    """What the extended motor and bench files say otherwise."""
    models = (diagnosis.recalibrated_model, diagnosis.extended_model)
    before = diagnosis.recalibrated_benches
    benches = ((before.get(parent, parent), new) for parent, new in diagnosis.extended_benches.items())
    parts = ((old, new) for old, new in (models, *benches) if old and new)
    return "\n".join(text_diff(store.archive.read(old), store.archive.read(new)) for old, new in parts)


def context(store: Store | None, command: str) -> ReportContext:
    """What a report of this command was computed from; `store` is None where there is none."""
    return ReportContext(
        command=command.strip(),
        store_head=str(store.ledger.head()) if store else "no store",
        versions={name: version(name) for name in NAMED},
        store=store.asked if store else DEFAULT_STORE,
    )


def latest_run(facts: Facts, session: SessionRecorded, model: str | None = None) -> ReplayCompleted | None:
    """The run of a session (with this model, where one is given) that was recorded last, or None."""
    return next((event for event in reversed(facts.runs_of(session)) if model in (None, event.model)), None)


def _run_of(facts: Facts, session: SessionRecorded, model: str | None) -> ReplayCompleted:
    event = latest_run(facts, session, model) if model else facts.current_run(session)
    if event is None:
        raise ReplayDataError(f"session {session.name} was not replayed{_with(facts, model, session.name)}")
    return event


def _with(facts: Facts, model: str | None, session: str = "") -> str:
    """ " yet", or with which model not, and the command that would."""
    command = shlex.join(["whyhot", "replay", *([session] if session else [])])
    if model is None:
        return f" yet: `{command}`"
    return f" with model {facts.models[model].motor} {short(model)}: `{command} --model {short(model)}`"
