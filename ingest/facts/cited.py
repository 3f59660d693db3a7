"""What the facts cite of sealed bytes: who cites them, which sessions stand on them, and what brings them back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    CalibrationCompleted,
    DiagnosisCompleted,
    Event,
    InspectionRecorded,
    ModelExtended,
    ModelPublished,
    RawFileSealed,
    ReplayCompleted,
    SignalDatabaseRegistered,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded

BACKUP = "put it back from a backup of the store"


class Cited(NamedTuple):
    """A sealed file that an event cites: `what` it is, what brings it back (`mend`), and the run that it is of."""

    sha256: str
    what: str
    mend: str = BACKUP
    run: str | None = None


def cited(recorded: Iterable[Recorded]) -> dict[str, Cited]:
    """SHA-256 of each sealed file that an event cites -> which event and what it is."""
    found: dict[str, Cited] = {}
    for one in recorded:
        for file in _cites(one.event):
            found[file.sha256] = file._replace(what=f"event {one.position}: {file.what}")
    return found


def sessions_on(facts: Facts, key: str) -> tuple[str, ...]:
    """Names of the sessions that stand on a file (SHA-256), a decode, a session or a run (ids)."""
    decodes = {one.decode for one in facts.decodes.values() if key in one.databases}
    run = facts.runs.get(key)
    return tuple(
        session.name
        for session in facts.sessions
        if key in (session.session, session.bench, session.model)
        or (run and run.session == session.session)
        or any(key in file.values() or file.get("decode") in decodes for file in session.files)
    )


def _cites(event: Event) -> Iterator[Cited]:
    match event:
        case RawFileSealed():
            yield Cited(event.sha256, event.name, f"whyhot ingest {event.name}")
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
        case InspectionRecorded():
            yield Cited(event.sha256, f"{event.name} of specimen {event.specimen}")
        case AgeingAssessed():
            yield Cited(event.answer, f"document of ageing assessment {event.assessment}")
            for name, sha256 in event.artefacts.items():
                yield Cited(sha256, f"{name} of ageing assessment {event.assessment}")
        case ModelExtended():
            files = (event.model, event.bench)
            yield from (Cited(one, f"extension by diagnosis {event.diagnosis}") for one in files if one)
