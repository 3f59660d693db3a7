"""Faults planted in our own checks, syncs and orders: each must make another attack fail.

Where two checks find the same, taking one away is seen by nobody: such a fault counts as missed, and is named. SQLite's
own check of its file is not among them: what it alone finds, no read meets.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any
from uuid import uuid4

from analytics import scans
from benchmarks.attack import faults, flips, kills, logs, tampering, together, unsynced
from benchmarks.attack.children import result_of
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts import archive, backup, ledger, ledger_audit, ledger_row, store, store_check
from ingest.facts.archive import Archive
from ingest.facts.chain import Head
from ingest.facts.events import LogForgotten
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_history import LedgerHistory
from ingest.facts.store import Store
from ingest.formats import Rejections
from ingest.intake import retractions
from made.places import on_disk


@dataclass(frozen=True)
class Fault:
    """`plant`: put it into this process; `caught_by`: the attack that must fail then, within so many tries; `verbs`:
    those that it attacks, where it attacks verbs that write."""

    says: str
    plant: Callable[[], None]
    caught_by: Callable[[Arena], Outcome]
    tries: int
    verbs: Sequence[str] = ()


def _set(owner: Any, name: str, value: Any) -> Callable[[], None]:
    return lambda: setattr(owner, name, value)


def _nothing(*_: Any, **__: Any) -> None:
    """In place of a check or a sync."""


def _unsynced_file(folder: Path, chunks: Any) -> Path:
    path = folder / uuid4().hex
    path.write_bytes(b"".join(chunks))
    return path


def _short_file(folder: Path, chunks: Any) -> Path:
    """What a disk that fills up takes of it, and no word of the rest."""
    path = folder / uuid4().hex
    with suppress(OSError), path.open("wb", buffering=0) as file:
        file.write(b"".join(chunks))
        os.fsync(file.fileno())
    return path


def _seal_in_place(self: Archive, data: Any) -> str:
    content = data if isinstance(data, bytes) else data.read_bytes() if isinstance(data, Path) else b"".join(data)
    sha256 = hashlib.sha256(content).hexdigest()
    target = on_disk(self.path(sha256))
    target.parent.mkdir(exist_ok=True)
    if not target.exists():
        handle = os.open(target, os.O_WRONLY | os.O_CREAT, 0o644)
        for at in range(0, len(content), 50):
            os.write(handle, content[at : at + 50])
        os.fsync(handle)
        os.close(handle)
    return sha256


def _events_first(source: Store, target: Store, read: bool, tell: Any) -> Any:
    recorded, held = backup._events(source), len(backup._events(target))
    if len(recorded) > held:
        target.ledger.take_over(source.ledger.rows(held + 1, recorded[-1].position))
    return _TRUE_COPY(source, target, read, tell)


_TRUE_COPY = backup._copy


def _bytes_first(store: Store, facts: Any, named: Any, batch: Any) -> Any:
    for _, event in batch:
        if isinstance(event, LogForgotten):
            on_disk(store.archive.path(event.raw)).unlink()
    return _TRUE_GROUPED(store, facts, named, batch)


_TRUE_GROUPED = retractions._grouped


def _to_the_fault(path: Path) -> Iterator[bytes]:
    """What could be read of a file, and no word of the rest."""
    with suppress(OSError):
        yield path.read_bytes()


def _publish_in_place(self: Store, made: Path, decode: str) -> Path:
    target = on_disk(self.decoded(decode))
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    for path in made.iterdir():
        shutil.copy(path, target / path.name)
    return target


class _NoLock:
    def __init__(self, path: Path) -> None:
        self.close = _nothing


def _unchecked(row: Any, position: int) -> Any:
    """An event taken as it stands, whatever its digest."""
    envelope = json.loads(row.state)
    event = ledger_row._event(row.topic, envelope, "")
    beside = {key: envelope[key] for key in ledger_row.KEYS - {"v", "body"}}
    number, stream = row.originator_version, row.originator_id
    return ledger_row.Recorded(position=position, stream=stream, version=number, event=event, **beside)


def _history_unchecked() -> None:
    from ingest.facts import ledger_history

    ledger_history.decode = ledger.decode = _unchecked  # type: ignore[attr-defined]


def _without_since() -> None:
    true = ledger_audit.audit
    store_check.audit = lambda ledger, since=None: true(ledger)  # type: ignore[attr-defined]


def _forgets() -> None:
    Rejections.append = lambda self, entry: None  # type: ignore[method-assign]


def _traceback() -> None:
    import_module("replay.cli.refusal").ROOTS = ()  # type: ignore[attr-defined]


BACKUPS, FORGET, ATTACH = ("backup", "restore"), ("forget",), ("attach",)
FAULTS = (
    Fault("verify does not read sealed files", _set(store_check, "_check_sealed", _nothing), flips.bits, 200),
    Fault("verify does not read decoded files", _set(store_check, "_check_products", _nothing), flips.bits, 200),
    Fault("a sealed file is not hashed", _set(Archive, "damage", lambda *_: None), flips.bits, 200),
    Fault("a decoded file is not hashed", _set(store_check, "_changed", lambda *_: None), flips.bits, 200),
    Fault("sql does not hash what it reads", _set(scans, "check", _nothing), flips.bits, 200),
    Fault("two sealed files exchanged are not seen", _set(Archive, "damage", lambda *_: None), tampering.tampered, 45),
    Fault("digests are not compared", _history_unchecked, tampering.tampered, 450),
    Fault("positions are not counted", _set(LedgerHistory, "_count", _nothing), tampering.tampered, 750),
    Fault("streams are not chained", _set(LedgerHistory, "_chain", _nothing), tampering.tampered, 150),
    Fault("seals are not compared", _set(LedgerHistory, "_seal", _nothing), tampering.tampered, 75),
    Fault("rows are not hashed into the tree", _set(LedgerHistory, "head", Head(0, "")), tampering.tampered, 75),
    Fault("a head noted before is not compared", _without_since, tampering.tampered, 75),
    Fault("files are not synced", _set(archive, "write_file", _unsynced_file), unsynced.power_cuts, 400),
    Fault("folders of the archive are not synced", _set(archive, "sync_folder", _nothing), unsynced.power_cuts, 400),
    Fault("decoded files are not synced", _set(store, "sync_tree", _nothing), unsynced.power_cuts, 400),
    Fault("bytes are sealed in place", _set(Archive, "seal", _seal_in_place), unsynced.power_cuts, 400),
    Fault("products are published in place", _set(Store, "publish", _publish_in_place), unsynced.power_cuts, 400),
    Fault("a backup copies events first", _set(backup, "_copy", _events_first), unsynced.power_cuts, 400),
    Fault(
        "a backup copies events first, killed", _set(backup, "_copy", _events_first), kills.at_each_change, 99, BACKUPS
    ),
    Fault(
        "a log is forgotten bytes first", _set(retractions, "_grouped", _bytes_first), kills.at_each_change, 99, FORGET
    ),
    Fault("a full disk is not noticed", _set(archive, "write_file", _short_file), faults.full_disk, 60, ATTACH),
    Fault("what cannot be read is left out", _set(archive, "_chunks", _to_the_fault), faults.io_errors, 300, ATTACH),
    Fault("writers do not wait for each other", _set(ledger, "WriterLock", _NoLock), together.writers, 80),
    Fault("our own errors are tracebacks", _traceback, faults.io_errors, 20, ATTACH),
    Fault("rejected records are not counted", _forgets, logs.fuzz, 160),
    Fault("a writer leaves its events without a seal", _set(Ledger, "seal", _nothing), tampering.tampered, 75),
)


def planted(arena: Arena) -> Outcome:
    """T10."""
    outcome, missed = Outcome(), []
    chosen = FAULTS if arena.tries >= len(FAULTS) else arena.chance.sample(FAULTS, arena.tries)
    for fault in chosen:
        found = _found(fault, replace(arena, folder=_empty(arena), tries=fault.tries, verbs=fault.verbs))
        missed += [fault.says] * (not found)
        outcome.count(*[f"not caught: {fault.says}"] * (not found))
    outcome.note = f"{outcome.tried - len(missed)} of {outcome.tried} caught"
    return outcome


def _empty(arena: Arena) -> Path:
    folder = arena.folder / "work"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def _until_it_fails(self: Outcome, *failures: str) -> None:
    """One more try; the first that fails is enough, and ends the attack. Raises RuntimeError with it."""
    if failures:
        raise RuntimeError(failures[0])
    self.tried += 1


def _found(fault: Fault, arena: Arena) -> bool:
    """Whether the attack fails with the fault planted; an attack that breaks down on it has noticed, too."""

    if fault.verbs:
        kills.wholes(arena)  # before it is planted

    def attacked() -> int:
        fault.plant()
        Outcome.count = _until_it_fails  # type: ignore[method-assign]
        return len(fault.caught_by(arena).failed)

    try:
        return bool(result_of(attacked, arena.folder.parent))
    except RuntimeError:
        return True


ATTACKS = (
    Attack("T10", "faults planted in our own checks", "each makes another attack fail", len(FAULTS), 1, planted),
)
