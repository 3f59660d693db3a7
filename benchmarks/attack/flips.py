"""Damage at rest: single bits, and pieces of a file that are cut off, zeroed or exchanged."""

from __future__ import annotations

import random
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytics import query, scans, warehouse
from analytics.errors import AnalyticsError
from benchmarks.attack import subjects
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.errors import IngestError
from ingest.facts.store import Store

BLOCK = 512  # bytes


@dataclass(frozen=True)
class Truth:
    """What is read of a store that nothing is wrong with: its events, the view in SQL of each Parquet file, and what it
    answers of each view."""

    events: list[Any] | None
    views: Mapping[Path, str]
    answers: Mapping[str, list[Any]]


def _rows(ledger: Path) -> list[Any] | None:
    """What a read of the ledger gives; None where it cannot be read."""
    try:
        with closing(sqlite3.connect(f"{ledger.as_uri()}?mode=ro", uri=True)) as connection:
            return connection.execute("SELECT rowid, * FROM stored_events ORDER BY rowid").fetchall()
    except (sqlite3.Error, UnicodeError, OverflowError):
        return None


def _files(store: Path) -> list[Path]:
    """What is checked: the ledger, sealed files, decoded files."""
    parts = [store / "ledger.sqlite", *(store / "archive").rglob("*"), *(store / "decoded").rglob("*")]
    return [path for path in [parts[0], *sorted(parts[1:])] if path.is_file()]


def _views(store: Path) -> dict[Path, str]:
    """The Parquet files that SQL reads, each with the view of it."""
    with Store.open(store) as opened, warehouse.refresh(opened) as asked:
        return {Path(file): kind for file, kind, *_ in scans.named(asked.connection)}


def _answer(store: Path, view: str) -> tuple[list[Any], str | None]:
    """What SQL says of all rows of a view, and of files that it left out."""
    with Store.open(store) as opened:
        found, asked = query.ask(opened, f"SELECT count(*), sum(hash(t)) FROM {view} AS t")
    return found.rows, asked.left_out


def _misled(store: Path, path: Path, view: str, true: list[Any]) -> str | None:
    """What is wrong with the answer of SQL where a Parquet file is harmed."""
    try:
        rows, left_out = _answer(store, view)
    except AnalyticsError as error:
        return None if path.name in str(error) else f"sql names no file: {error}"
    named = left_out is not None and path.name in left_out
    return None if rows == true or named else "sql answers otherwise, and says nothing of it"


def _damaged(store: Path, path: Path, harm: Callable[[bytes], bytes], true: Truth) -> str | None:
    """What is wrong with how `verify` and `sql` take a harmed file; None where the harm changes nothing that is read,
    too."""
    whole, ledger = path.read_bytes(), path.name == "ledger.sqlite"
    harmed = harm(whole)
    if harmed == whole:
        return None
    path.chmod(0o644)
    path.write_bytes(harmed)
    try:
        if ledger and _rows(path) == true.events:
            return None
        if (view := true.views.get(path)) and (says := _misled(store, path, view, true.answers[view])):
            return says
        found = _found(store)
        if not found:
            return "nothing was found"
        names = ("event", "ledger.sqlite") if ledger else (path.parent.name, path.name)
        return None if any(name in line for name in names for line in found) else f"it is not named: {found[0]}"
    except Exception as error:  # noqa: BLE001 -- a defect is a try that failed
        return f"{type(error).__name__}: {error}"
    finally:
        path.write_bytes(whole)
        for left in store.glob("ledger.sqlite-*"):
            left.unlink()


def _found(store: Path) -> list[str]:
    """What `verify --read` finds, with a ledger that opens and one that does not."""
    from ingest.facts.store_check import check_without_ledger

    try:
        return subjects.damages(store)
    except IngestError as error:
        return [one.says for one in check_without_ledger(store, str(error)).damages]


def _attacked(arena: Arena, harms: Callable[[bytes, random.Random], Callable[[bytes], bytes]]) -> Outcome:
    outcome, chance = Outcome(), arena.chance
    store = subjects.copied(arena.bench, arena.folder / "bench") / "store"
    with Store.open(store, write=True):
        pass  # the ledger whole in one file
    files, views = _files(store), _views(store)
    true = Truth(_rows(store / "ledger.sqlite"), views, {view: _answer(store, view)[0] for view in {*views.values()}})
    for number in range(arena.tries):
        path = files[0] if number % 2 else chance.choice(files[1:])
        harm = harms(path.read_bytes(), chance)
        says = _damaged(store, path, harm, true)
        outcome.count(*[f"{path.relative_to(store)}, try {number}: {says}"] * bool(says))
    if found := subjects.damages(store):
        outcome.failed.append(f"the store that was put back: {found[0]}")
    return outcome


def _flip(data: bytes, chance: random.Random) -> Callable[[bytes], bytes]:
    place, bit = chance.randrange(len(data)), chance.randrange(8)
    return lambda whole: whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :]


def _piece(data: bytes, chance: random.Random) -> Callable[[bytes], bytes]:
    """Cut off, zeroed or exchanged with another, from a block's beginning."""
    blocks = max(1, len(data) // BLOCK)
    one, other = (chance.randrange(blocks) * BLOCK for _ in range(2))
    first, second = min(one, other), max(one, other)

    def exchange(whole: bytes) -> bytes:
        a, b = whole[first : first + BLOCK], whole[second : second + BLOCK]
        if first == second or len(a) != len(b):
            return whole[: len(whole) - 1]
        return whole[:first] + b + whole[first + BLOCK : second] + a + whole[second + BLOCK :]

    return chance.choice(
        [
            lambda whole: whole[:one],
            lambda whole: whole[:one] + bytes(min(BLOCK, len(whole) - one)) + whole[one + BLOCK :],
            exchange,
        ]
    )


def bits(arena: Arena) -> Outcome:
    """T7: half in the ledger, half in sealed and decoded files."""
    return _attacked(arena, _flip)


def pieces(arena: Arena) -> Outcome:
    """T8."""
    return _attacked(arena, _piece)


ATTACKS = (
    Attack("T7", "a flipped bit at rest", "found and named wherever a read or sql would differ", 35_000, 60, bits),
    Attack("T8", "cut, zeroed, exchanged blocks", "as T7", 3000, 12, pieces),
)
