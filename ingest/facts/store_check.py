"""Is everything that the facts cite in the store, and is it what was sealed?"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from ingest.facts.archive import Archive
from ingest.facts.chain import Head
from ingest.facts.durable import sha256_of
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
    SignalDatabaseRegistered,
)
from ingest.facts.ledger_audit import audit
from ingest.facts.ledger_lock import has_wal_reset_bug
from ingest.facts.ledger_row import Recorded
from ingest.facts.store import Store

AGAIN = "`whyhot rebuild` makes it again"


def damage(store: Store, read: bool = True, since: Head | None = None) -> list[str]:
    """What is not as it was written in the ledger and in what it cites, one line each; missing products: see `hints`.

    With `read` every sealed byte and product is hashed again. `since` is a head that was noted down before.
    """
    checked = audit(store.ledger, since)
    changed = _changed_products(store, checked.recorded) if read else ()
    return [*checked.findings, *_damaged_blobs(store.archive, _cited(checked.recorded), read), *changed]


def hints(store: Store) -> list[str]:
    """What is no damage but good to know, one line each. Raises as `Ledger.events`."""
    recorded = store.ledger.events()
    missing = [f"{path}: is missing: {AGAIN}" for path, _ in _products(store, recorded) if not path.is_file()]
    return [*missing, *_strays(store, recorded), *_sqlite()]


def _cited(recorded: Iterable[Recorded]) -> dict[str, str]:
    """SHA-256 of each sealed file that an event cites -> which event and what it is."""
    return {sha256: f"event {one.position}: {what}" for one in recorded for sha256, what in _cites(one.event)}


def _cites(event: Event) -> Iterator[tuple[str, str]]:
    match event:
        case RawFileSealed() | SignalDatabaseRegistered():
            yield event.sha256, event.name
        case BenchRegistered():
            yield event.sha256, event.name
            if event.model:
                yield event.model, f"motor file of {event.name}"
        case ModelPublished():
            yield event.model, event.file
        case ReplayCompleted():
            for name, sha256 in event.artefacts.items():
                yield sha256, f"{name} of run {event.run}"
        case CalibrationCompleted() if event.covariance is not None:
            yield event.covariance, f"covariance of calibration {event.calibration}"
        case DiagnosisCompleted():
            yield event.artefact, f"document of diagnosis {event.diagnosis}"
        case InspectionRecorded():
            yield event.sha256, f"{event.name} of specimen {event.specimen}"
        case AgeingAssessed():
            yield event.answer, f"document of ageing assessment {event.assessment}"
            for name, sha256 in event.artefacts.items():
                yield sha256, f"{name} of ageing assessment {event.assessment}"
        case ModelExtended():
            yield from ((one, f"extension by diagnosis {event.diagnosis}") for one in (event.model, event.bench) if one)


def _damaged_blobs(archive: Archive, cited: Mapping[str, str], read: bool) -> Iterator[str]:
    for sha256 in sorted({*archive, *cited}):
        if says := archive.damage(sha256, read):
            yield f"{says} ({cited.get(sha256, 'no event cites it')})"


def _products(store: Store, recorded: Iterable[Recorded]) -> Iterator[tuple[Path, str]]:
    """Every file that a decode made: its path and SHA-256."""
    decodes = {one.event.decode: one.event for one in recorded if isinstance(one.event, DecodeCompleted)}
    for decode in decodes.values():
        for name, sha256 in decode.products.items():
            yield store.decoded(decode.decode) / Path(name).name, sha256


def _changed_products(store: Store, recorded: Iterable[Recorded]) -> Iterator[str]:
    for path, sha256 in _products(store, recorded):
        if path.is_file() and sha256_of(path) != sha256:
            yield f"{path}: is damaged, its bytes are not those that the decode gave: {AGAIN}"


def _strays(store: Store, recorded: Iterable[Recorded]) -> Iterator[str]:
    """What a command that was stopped leaves behind: bytes without an event. They do no harm."""
    cited = _cited(recorded)
    for sha256 in store.archive:
        if sha256 not in cited:
            yield f"{store.archive.path(sha256)}: no event cites it: a stopped command left it, it may stay"
    known = {one.event.decode for one in recorded if isinstance(one.event, DecodeCompleted)}
    for folder in sorted((store.folder / "decoded").glob("*")):
        if folder.name not in known:
            yield f"{folder}: no event names it: a stopped command left it, it may be deleted"


def _sqlite() -> Iterator[str]:
    if has_wal_reset_bug():
        yield (
            f"SQLite {sqlite3.sqlite_version} can corrupt a database that two processes write at once (fixed in "
            "3.51.3): safe here as ledger.lock lets in one writer, but write to ledger.sqlite with nothing else"
        )
