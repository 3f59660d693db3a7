"""What the facts cite of sealed bytes: who cites them, which sessions stand on them, what brings them back; and which
had to go for good, with the logs that were forgotten."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    CalibrationCompleted,
    DecodeCompleted,
    DiagnosisCompleted,
    Event,
    InspectionRecorded,
    ModelExtended,
    ModelPublished,
    RawFileSealed,
    ReplayCompleted,
    SessionRecorded,
    SignalDatabaseRegistered,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.facts.standing import without_forgotten

NOTHING: Mapping[str, str] = MappingProxyType({})
BACKUP = "put it back from a backup of the store"


class Cited(NamedTuple):
    """A sealed file that an event cites: `what` it is, what brings it back (`mend`), and the run that it is of."""

    sha256: str
    what: str
    mend: str = BACKUP
    run: str | None = None


@dataclass(frozen=True)
class Forgotten:
    """What went for good, each with which log was forgotten, when and why: `logs` by SHA-256; `decodes` of them by id;
    `files`, sealed bytes by SHA-256: the logs themselves, and what only their replays and assessments cite."""

    logs: Mapping[str, str] = field(default_factory=dict)
    decodes: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)


def cited(recorded: Iterable[Recorded]) -> dict[str, Cited]:
    """SHA-256 of each sealed file that an event cites, and that was not forgotten -> which event and what it is."""
    events = list(recorded)
    found: dict[str, Cited] = {}
    beside = _beside(events)
    for one in events:
        for file in _cites(one.event, beside):
            found[file.sha256] = file._replace(what=f"event {one.position}: {file.what}")
    gone = forgotten(events).files
    return {sha256: file for sha256, file in found.items() if sha256 not in gone}


def forgotten(recorded: Iterable[Recorded]) -> Forgotten:
    """What went for good, by all events of a ledger."""
    events = list(recorded)
    left = without_forgotten(events)
    logs = {stream.partition("-")[2]: one.says for stream, one in left.retractions.items()}
    if not logs:
        return Forgotten()
    stands = {one.position for one in left.events}
    gone = [one.event for one in events if one.position not in stands]
    held = {file.sha256 for one in left.events for file in _cites(one.event)}
    lines = {file.sha256: _line(event, logs, left.sessions) for event in gone for file in _cites(event)}
    return Forgotten(
        logs,
        {event.decode: logs[event.raw] for event in gone if isinstance(event, DecodeCompleted) and event.raw in logs},
        {sha256: line for sha256, line in lines.items() if sha256 not in held} | logs,
    )


def sessions_on(facts: Facts, key: str) -> tuple[str, ...]:
    """Names of the sessions that stand on a file (SHA-256), a decode, a session or a run (ids), or a motor (name)."""
    decodes = {one.decode for one in facts.decodes.values() if key in one.databases}
    run = facts.runs.get(key)
    benches = {sha256 for sha256, one in facts.benches.items() if one.motor == key}
    return tuple(
        session.name
        for session in facts.sessions
        if key in (session.session, session.bench, session.model)
        or session.bench in benches
        or (run and run.session == session.session)
        or any(key in file.values() or file.get("decode") in decodes for file in session.files)
    )


def sessions_without_ground(facts: Facts) -> tuple[str, ...]:
    """Names of the sessions that stand on a log, decode, bench or motor file of which the facts say nothing."""
    return tuple(
        session.name
        for session in facts.sessions
        if not (session.bench is None or session.bench in facts.benches)
        or not (session.model is None or session.model in facts.models)
        or not all(file["raw"] in facts.files and file["decode"] in facts.decodes for file in session.files)
    )


def _line(event: Event, logs: Mapping[str, str], sessions: Mapping[str, SessionRecorded]) -> str:
    """Why what an event cites is gone: the first of the logs that it was made from that is."""
    of = [event.session] if isinstance(event, ReplayCompleted) else getattr(event, "sessions", [])
    raws = [file["raw"] for session in of if session in sessions for file in sessions[session].files]
    return next((logs[raw] for raw in raws if raw in logs), next(iter(logs.values())))


def _beside(events: Iterable[Recorded]) -> dict[str, str]:
    """SHA-256 of a log -> the files that it was decoded with last, as words of the command line."""
    names: dict[str, str] = {}
    found: dict[str, str] = {}
    for event in (one.event for one in events):
        match event:
            case BenchRegistered() | SignalDatabaseRegistered():
                names[event.sha256] = shlex.quote(event.name)
            case DecodeCompleted():
                bench = f" --bench {names[event.bench]}" if event.bench in names else ""
                found[event.raw] = bench + "".join(f" --dbc {names[one]}" for one in event.databases if one in names)
    return found


def _cites(event: Event, beside: Mapping[str, str] = NOTHING) -> Iterator[Cited]:
    match event:
        case RawFileSealed():
            again = f"whyhot ingest {shlex.quote(event.name)}{beside.get(event.sha256, '')}"
            yield Cited(event.sha256, event.name, again)
        case SignalDatabaseRegistered():
            yield Cited(event.sha256, event.name, f"whyhot ingest a log of it again with --dbc {event.name}")
        case BenchRegistered():
            again = f"whyhot ingest a log of it again with --bench {event.name}"
            yield Cited(event.sha256, event.name, again)
            if event.model:
                yield Cited(event.model, f"motor file of {event.name}", again)
        case ModelPublished():
            yield Cited(event.model, event.file)
        case ReplayCompleted():
            again = f"whyhot replay {event.session[:8]} --model {event.model[:8]} --level {event.level}"
            for name, sha256 in event.artefacts.items():
                yield Cited(sha256, f"{name} of run {event.run}", again, event.run)
        case CalibrationCompleted() if event.covariance is not None:
            yield Cited(event.covariance, f"covariance of calibration {event.calibration}")
        case DiagnosisCompleted():
            yield Cited(event.artefact, f"document of diagnosis {event.diagnosis}")
            yield from (Cited(sha256, f"file that diagnosis {event.diagnosis} tried") for sha256 in event.files)
        case InspectionRecorded():
            yield Cited(event.sha256, f"{event.name} of specimen {event.specimen}")
        case AgeingAssessed():
            yield Cited(event.answer, f"document of ageing assessment {event.assessment}")
            for name, sha256 in event.artefacts.items():
                yield Cited(sha256, f"{name} of ageing assessment {event.assessment}")
        case ModelExtended():
            files = (event.model, event.bench)
            yield from (Cited(one, f"extension by diagnosis {event.diagnosis}") for one in files if one)
