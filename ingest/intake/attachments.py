"""Inspections: a photograph, a thermogram, any file, sealed with what a person found on a specimen."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from mimetypes import MimeTypes
from pathlib import Path

from ingest.errors import IngestError, UnknownSessionError
from ingest.facts import facts as ledger_facts
from ingest.facts.durable import sha256_of
from ingest.facts.events import InspectionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import utc_text
from ingest.facts.store import Store
from ingest.intake.setup import kept_name, refuse_missing
from ingest.texts.nearest import hint

UNKNOWN_TYPE = "application/octet-stream"
Key = tuple[str | None, ...]  # bytes, specimen, time, session and finding


@dataclass(frozen=True)
class Finding:
    """What was found on `specimen`; when, and after which session, may be unknown."""

    specimen: str
    says: str
    happened: str | None = None  # ISO 8601, UTC where it names no zone
    session: str | None = None  # id, unique beginning of one, or name


@dataclass(frozen=True)
class AttachedFile:
    """The fact of one file, and whether the ledger held it before (then nothing was written)."""

    event: InspectionRecorded
    known: bool


def attach(store: Store, paths: Sequence[Path], finding: Finding) -> list[AttachedFile]:
    """Seal files with a finding; the same bytes with the same finding once only. Needs a store that may be written.

    Raises IngestError for a file that is missing or empty or a forgotten log, a specimen or finding without text, and a
    time that is none, UnknownSessionError for a session that is not there or is of another specimen: nothing is kept.
    """
    facts = ledger_facts.at(store.ledger)
    refuse_missing(paths)
    _refuse_forgotten(facts, paths)
    if empty := next((path for path in paths if not path.stat().st_size), None):
        raise IngestError(f"{empty}: is empty (0 bytes): it shows nothing. Copy the file again.")
    specimen = in_words(finding.specimen, "--specimen", "stator-07")
    says = in_words(finding.says, "--finding", '"resin cracked at slot 3"')
    session = _session(facts, finding.session, specimen) if finding.session else None
    happened = _utc(finding.happened) if finding.happened else None
    before = {_key(one): one for one in facts.inspections.values()}
    found: dict[Key, AttachedFile] = {}
    for path in paths:
        sha256 = store.archive.seal(path)
        identity = (sha256, specimen, happened, session, says)
        event = InspectionRecorded(
            inspection=hashlib.sha256(json.dumps(identity).encode()).hexdigest(),
            sha256=sha256,
            name=kept_name(path),
            media_type=MimeTypes().guess_type(path.name, strict=False)[0] or UNKNOWN_TYPE,  # the same on every machine
            size=store.archive.size(sha256),
            specimen=specimen,
            happened=happened,
            session=session,
            finding=says,
        )
        key = _key(event)
        found.setdefault(key, AttachedFile(before.get(key, event), key in before))
    new = [(f"inspection-{one.event.inspection}", one.event) for one in found.values() if not one.known]
    if new:
        store.ledger.append_all(new, happened=happened)
    return list(found.values())


def _refuse_forgotten(facts: Facts, paths: Sequence[Path]) -> None:
    """Raises IngestError for the bytes of a log that had to go for good."""
    gone = {stream: one for stream, one in facts.retractions.items() if one.forgotten}
    for path in paths if gone else ():
        if back := gone.get(f"file-{sha256_of(path)}"):
            raise IngestError(f"{path.name}: {back.line}")


def unknown_specimen(facts: Facts, specimen: str) -> str | None:
    """A line where no session is of `specimen` yet: it may be misspelt."""
    known = {session.specimen for session in facts.sessions if session.specimen}
    if specimen in known:
        return None
    return f'specimen "{specimen}": no session of it is in this store yet.{hint(specimen, sorted(known))}'


def in_words(text: str, flag: str, example: str) -> str:
    """What a flag says, without spaces around it. Raises IngestError where it says nothing."""
    if not text.strip():
        raise IngestError(f"{flag}: says nothing: write it in words, as {flag} {example}")
    return text.strip()


def _key(event: InspectionRecorded) -> Key:
    return event.sha256, event.specimen, event.happened, event.session, event.finding


def _session(facts: Facts, text: str, specimen: str) -> str:
    session = facts.session(text)
    if session.specimen not in (None, specimen):
        raise UnknownSessionError(
            f'session {session.name}: is of specimen "{session.specimen}", not "{specimen}": '
            "correct --specimen or --session"
        )
    return session.session


def _utc(text: str) -> str:
    """The time that was said, as the ledger writes it. Raises IngestError."""
    try:
        return utc_text(datetime.fromisoformat(text))
    except (ValueError, OverflowError):
        raise IngestError(f'--when "{text}": is no time: write it as 2025-12-24T08:00:00Z') from None
