"""Stores changed on purpose, by someone who can write to the folder, and by someone who knows the format as well."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attack import subjects
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts.chain import canonical
from ingest.facts.store import Store
from made.forged import Row, change, forge, resealed, rewrite, stored
from made.places import on_disk

WRITERS, LOGS = 5, 3  # of the store: each writer appends so many logs and a seal; one more is stopped before its seal
LOG, SEAL = "whyhot:RawFileSealed", "whyhot:LedgerSealed"
CLEAN = 1000  # verifies of a store that nobody touched, of the full table


class Stopped(Exception):
    """A writer that fails seals nothing."""


@dataclass(frozen=True)
class Kind:
    """`alone`: found without a head that was noted elsewhere."""

    says: str
    alone: bool
    do: Callable[[Path, random.Random], None]


def _sealed(folder: Path, chance: random.Random) -> int:
    """The position of the event of a log that a seal follows."""
    rows = stored(folder)
    last = max(row[0] for row in rows if row[3] == SEAL)
    return chance.choice([row[0] for row in rows if row[3] == LOG and row[0] < last])


def _any(folder: Path, chance: random.Random) -> int:
    """The position of any event of a log, sealed or not."""
    return chance.choice([row[0] for row in stored(folder) if row[3] == LOG])


def _payload(folder: Path, chance: random.Random) -> None:
    statement = "UPDATE stored_events SET state=CAST(replace(state, 'log-', 'lug-') AS BLOB) WHERE rowid=?"
    change(folder, statement, _any(folder, chance))


def _envelope(key: str, value: object) -> Callable[[Path, random.Random], None]:
    """Another value beside an event, with a digest that fits."""

    def do(folder: Path, chance: random.Random) -> None:
        position, stream, version, topic, state = _row(folder, _sealed(folder, chance))
        envelope = resealed(stream, version, topic, json.loads(state) | {key: value})
        change(folder, "UPDATE stored_events SET state=? WHERE rowid=?", canonical(envelope), position)

    return do


def _row(folder: Path, position: int) -> Row:
    return next(row for row in stored(folder) if row[0] == position)


def _stream(folder: Path, chance: random.Random) -> None:
    change(folder, "UPDATE stored_events SET originator_id='file-other' WHERE rowid=?", _any(folder, chance))


def _reorder(folder: Path, chance: random.Random) -> None:
    one, two = chance.sample([row[0] for row in stored(folder)], 2)
    for old, new in ((one, 10_000), (two, one), (10_000, two)):
        change(folder, "UPDATE stored_events SET rowid=? WHERE rowid=?", new, old)


def _delete(folder: Path, chance: random.Random) -> None:
    change(folder, "DELETE FROM stored_events WHERE rowid=?", chance.choice(stored(folder)[:-1])[0])


def _cut(folder: Path, chance: random.Random) -> None:
    change(folder, "DELETE FROM stored_events WHERE rowid>?", chance.randrange(1, len(stored(folder))))


def _insert(folder: Path, chance: random.Random) -> None:
    """A true event once more, in a stream of its own."""
    _, _, _, topic, state = _row(folder, _sealed(folder, chance))
    envelope = resealed("file-x", 1, topic, json.loads(state) | {"previous": None})
    change(folder, "INSERT INTO stored_events VALUES (?,?,?,?)", "file-x", 1, topic, canonical(envelope))


def _swap(folder: Path, chance: random.Random) -> None:
    with Store.open(folder) as store:
        one, two = (on_disk(store.archive.path(name)) for name in chance.sample(list(store.archive), 2))
    for old, new in ((one, folder / "aside"), (two, one), (folder / "aside", two)):
        old.replace(new)


def _topic(folder: Path, chance: random.Random) -> None:
    position, stream, version, _, state = chance.choice(stored(folder))
    envelope = resealed(stream, version, "antigravity:fly", json.loads(state))
    statement = "UPDATE stored_events SET topic='antigravity:fly', state=? WHERE rowid=?"
    change(folder, statement, canonical(envelope), position)


def _version(folder: Path, chance: random.Random) -> None:
    position, stream, version, topic, state = _row(folder, _sealed(folder, chance))
    envelope = resealed(stream, version + 3, topic, json.loads(state))
    statement = "UPDATE stored_events SET originator_version=?, state=? WHERE rowid=?"
    change(folder, statement, version + 3, canonical(envelope), position)


def _older(folder: Path, chance: random.Random) -> None:
    shutil.copy(chance.choice(sorted(folder.parent.glob("older-*"))), folder / "ledger.sqlite")


def _forged(chain: bool) -> Callable[[Path, random.Random], None]:
    return lambda folder, chance: forge(folder, _sealed(folder, chance), chain=chain, size=7)


KINDS = (
    Kind("a payload, digest left", True, _payload),
    Kind("a payload, with its digest", True, _forged(chain=False)),
    Kind("a payload, with its stream's chain", True, _forged(chain=True)),
    Kind("an event's stream", True, _stream),
    Kind("its version", True, _version),
    Kind("its time", True, _envelope("recorded", "2020-01-01T00:00:00.000000Z")),
    Kind("who wrote it", True, _envelope("code", "whyhot 9.9.9")),
    Kind("its topic", True, _topic),
    Kind("two events exchanged", True, _reorder),
    Kind("one deleted in the middle", True, _delete),
    Kind("two sealed files exchanged", True, _swap),
    Kind("one added at the end", True, _insert),
    Kind("the end deleted", False, _cut),
    Kind("an older copy of the ledger", False, _older),
    Kind(
        "the whole history computed anew",
        False,
        lambda folder, chance: rewrite(folder, _sealed(folder, chance), size=7),
    ),
)


def tampered(arena: Arena) -> Outcome:
    """T9."""
    outcome, chance, alone = Outcome(), arena.chance, 0
    true = arena.folder / "true"
    for writer in range(WRITERS):
        with Store.open(true / "store", create=True) as store:
            for number in range(LOGS):
                subjects.put(store, f"log-{writer}-{number}")
        shutil.copy(true / "store" / "ledger.sqlite", true / f"older-{writer}")
    with suppress(Stopped), Store.open(true / "store", write=True) as store:
        for number in range(LOGS):
            subjects.put(store, f"log-open-{number}")
        raise Stopped
    head = subjects.head(true / "store")
    for number in range(arena.tries):
        kind = KINDS[number % len(KINDS)]
        folder = subjects.copied(true, arena.folder / "other") / "store"
        kind.do(folder, chance)
        by_itself, since = subjects.damages(folder), subjects.damages(folder, head)
        alone += bool(by_itself)
        missed = [f"{kind.says}, try {number}: not found"] * (not (by_itself if kind.alone else since))
        outcome.count(*missed)
    clean = max(10, CLEAN * arena.tries // 750)
    alarms = [line for _ in range(clean) for line in subjects.damages(true / "store", head)]
    outcome.failed += [f"a false alarm: {line}" for line in alarms]
    kinds = sum(kind.alone for kind in KINDS)
    outcome.note = (
        f"{len(KINDS)} kinds, {kinds} found from the store alone, the others against a head; {clean:,} clean verifies"
    )
    return outcome


ATTACKS = (Attack("T9", "tampering", "found; no false alarm", 750, len(KINDS), tampered),)
