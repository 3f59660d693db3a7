"""Several processes at one store: writers, readers, and backups while one writes."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
from contextlib import closing
from functools import partial
from pathlib import Path

from benchmarks.attack import subjects
from benchmarks.attack.children import ended, killed_within, started
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.errors import IngestError
from ingest.facts import ledger_lock
from ingest.facts.backup import backup
from ingest.facts.store import Store

WRITERS = 8
PATIENCE_S = 120.0  # of a writer for the others


def writers(arena: Arena) -> Outcome:
    """T14: each command opens the store, appends a log and closes it; a reader counts meanwhile."""
    outcome, folder = Outcome(), arena.folder / "store"
    each = -(-arena.tries // WRITERS)
    ledger_lock.WAIT_S = PATIENCE_S
    subjects.filled(folder, 0)
    children = [started(partial(_append, folder, writer, each)) for writer in range(WRITERS)]
    reads, seen = 0, 0
    while seen < WRITERS * each and reads < 200 * each:
        now = len(subjects.names(folder))
        outcome.failed += [f"a reader saw {now} logs after {seen}"] * (now < seen)
        reads, seen = reads + 1, now
    codes = [ended(child) for child in children]
    wanted = sorted(f"{writer}-{number}" for writer in range(WRITERS) for number in range(each))
    there = subjects.names(folder)
    outcome.tried = len(wanted)
    outcome.failed += [f"lost: {name}" for name in set(wanted) - set(there)]
    outcome.failed += [f"twice: {len(there) - len(set(there))}"] * (len(there) != len(set(there)))
    outcome.failed += [f"a writer ended with {code}" for code in codes if code]
    outcome.failed += subjects.damages(folder)
    outcome.note = f"{WRITERS} writers, each forces a checkpoint, and a reader that read {reads} times meanwhile"
    return outcome


def _append(folder: Path, writer: int, count: int) -> None:
    for number in range(count):
        with Store.open(folder, write=True) as store:
            subjects.put(store, f"{writer}-{number}")
            _checkpoint(folder / "ledger.sqlite")


def _checkpoint(ledger: Path) -> None:
    """Force what was committed into the ledger's file, from a connection beside that of the store."""
    with closing(sqlite3.connect(ledger)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def backups(arena: Arena) -> Outcome:
    """T15: a backup that is killed, one that is not, and a copy of the folder by hand, while another process writes."""
    outcome, chance = Outcome(), arena.chance
    folder, target, plain = (arena.folder / name for name in ("store", "backup", "plain"))
    subjects.filled(folder, 1)
    writer, position, flagged = started(partial(_append, folder, 0, 1_000_000)), 0, 0
    try:
        for number in range(arena.tries):
            killed_within(started(partial(backup, folder, target)), chance.uniform(0, 0.03))
            found = subjects.damages(target)
            done = backup(folder, target)
            found += [*subjects.damages(target), *done.left]
            found += [f"it went back to event {done.head.position}"] * (done.head.position < position)
            position = done.head.position
            silent = _copied_by_hand(folder, plain)
            flagged += silent is None
            outcome.count(*[f"backup {number}: {line}" for line in found], *filter(None, [silent]))
    finally:
        os.kill(writer, signal.SIGKILL)
        ended(writer)
    outcome.failed += subjects.damages(folder)
    backup(folder, target)
    same = subjects.head(folder) == subjects.head(target)
    outcome.failed += ["the last backup is another than the store"] * (not same)
    outcome.note = (
        f"{position:,} events written meanwhile; of the copies by hand {flagged} were flagged, the others whole"
    )
    return outcome


def _copied_by_hand(folder: Path, plain: Path) -> str | None:
    """`cp -r` of a store that is written to: "" where the copy is whole, None where it is said not to be; else what."""
    shutil.rmtree(plain, ignore_errors=True)
    try:
        shutil.copytree(folder, plain)
    except shutil.Error:
        return None
    try:
        if subjects.damages(plain):
            return None
        subjects.meaning(plain)
    except IngestError:
        return None
    return ""


ATTACKS = (
    Attack("T14", "writers at once", "no command lost or doubled, readers never see less", 1600, 16, writers),
    Attack("T15", "backup while one writes", "whole, though every other one is killed", 50, 2, backups),
)
