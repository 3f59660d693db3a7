"""Where in the ledger the facts of a file, a session or a run lie, so that a command reads those events and no others.

The index holds no fact: it says at which positions to look, and what is read there is checked as ever. It is a small
database in memory, kept beside the ledger as `ledger.index` with a SHA-256 in front, and may be deleted at any time.
It is believed only while the ledger is as the last command left it and the last event that it knows is the one that
stands there; else every event is read and checked, and the index is made again. SQLite's file is known by its size and
time of change; a server's table by the counts that the server keeps of rows that were changed or removed: what others
append there leaves them alone, and is read behind what the index knows.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from hashlib import blake2b, sha256
from pathlib import Path
from typing import Any, NamedTuple

from ingest.facts.events import (
    ClockAligned,
    DecodeCompleted,
    LedgerSealed,
    QualityFlagged,
    RawFileSealed,
    ReplayCompleted,
    ReplayDiverged,
    SessionRecorded,
    SessionRegrouped,
)
from ingest.facts.ledger_row import Recorded

MADE_BY = sha256(Path(__file__).read_bytes()).hexdigest()  # an index that another version made is made anew
DIGEST = 32  # bytes
BEGINS = 4  # characters of an id by which sessions are found
# Events of which there are more with each log; of all others there are few, and they are read whole.
MANY = (
    *(RawFileSealed, DecodeCompleted, SessionRecorded, SessionRegrouped, QualityFlagged, ClockAligned),
    *(ReplayCompleted, ReplayDiverged, LedgerSealed),
)
TABLES = """
CREATE TABLE place (key INTEGER, position INTEGER, PRIMARY KEY (key, position)) WITHOUT ROWID;
CREATE TABLE few (position INTEGER PRIMARY KEY);
CREATE TABLE session (id TEXT PRIMARY KEY, position INTEGER, specimen TEXT, start_ns INTEGER, end_ns INTEGER);
CREATE INDEX by_specimen ON session (specimen, start_ns, end_ns, position);
CREATE INDEX by_start ON session (start_ns, position);
CREATE TABLE loose (decode TEXT PRIMARY KEY, raw TEXT);
CREATE TABLE quarantined (raw TEXT PRIMARY KEY);
"""


class Stamp(NamedTuple):
    """What the rows were left as, by what differs after something else touched them: bytes and time of last change [ns]
    of SQLite's file; of a server's table its file there, and how often rows were changed or removed."""

    extent: int
    changes: int


@dataclass(frozen=True)
class Known:
    """How far an index knows the ledger: the last event's `position` and `digest`, when it was `recorded`, the Merkle
    tree up to it as (height, hash), and what the rows were left as then (`stamp`)."""

    position: int = 0
    digest: str = ""
    recorded: str = ""
    tree: tuple[tuple[int, str], ...] = ()
    stamp: Stamp | None = None
    made_by: str = MADE_BY


class LedgerIndex:
    """Positions of events by what they are about. `known`: what it knew when it was kept; `position`, `digest`: of the
    last event that it knows now."""

    def __init__(self, known: Known = Known(), database: bytes = b"") -> None:
        self._connection = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)  # any may end it
        if database:
            self._connection.deserialize(database)
        else:
            self._connection.executescript(TABLES)
        self.known = known
        self.position, self.digest = known.position, known.digest

    def __del__(self) -> None:
        with suppress(AttributeError):  # interrupted before it was there
            self._connection.close()

    @classmethod
    def load(cls, path: Path, stamp: Stamp | None) -> LedgerIndex | None:
        """The index at `path`, None where there is none for a ledger that is as `stamp` says."""
        try:
            data = path.read_bytes()
            if sha256(data[DIGEST:]).digest() != data[:DIGEST]:
                return None
            state, _, database = data[DIGEST:].partition(b"\n")
            known = _known(json.loads(state))
        except (OSError, ValueError, TypeError, LookupError):
            return None
        return cls(known, database) if stamp and known.stamp == stamp and known.made_by == MADE_BY else None

    def save(self, path: Path, known: Known) -> None:
        """Keep it at `path`, whole or not at all; where it cannot be written, the next command reads all events."""
        data = json.dumps(asdict(known)).encode() + b"\n" + self._connection.serialize()
        made = path.with_name(f"{path.name}-new")
        with suppress(OSError):
            made.write_bytes(sha256(data).digest() + data)
            made.replace(path)

    def add(self, events: Iterable[Recorded]) -> None:
        """Take in the next events of the ledger."""
        self._connection.execute("BEGIN")
        for one in events:
            self._connection.executemany(
                "INSERT OR IGNORE INTO place VALUES (?, ?)", [(_hash(key), one.position) for key in keys_of(one)]
            )
            match one.event:
                case DecodeCompleted(outcome="quarantined") as event:
                    self._connection.execute("INSERT OR IGNORE INTO quarantined VALUES (?)", [event.raw])
                case DecodeCompleted() as event:
                    self._connection.execute("INSERT OR REPLACE INTO loose VALUES (?, ?)", [event.decode, event.raw])
                case SessionRecorded() as event:
                    self._add_session(one.position, event)
                case SessionRegrouped() as event:
                    self._connection.execute("DELETE FROM session WHERE id = ?", [event.session])
                case event if not isinstance(event, MANY):
                    self._connection.execute("INSERT INTO few VALUES (?)", [one.position])
            self.position, self.digest = one.position, one.digest
        self._connection.execute("COMMIT")

    def _add_session(self, position: int, event: SessionRecorded) -> None:
        times = (event.start_ns, event.end_ns) if event.absolute else (None, None)
        row = (event.session, position, event.specimen, *times)
        self._connection.execute("INSERT OR REPLACE INTO session VALUES (?, ?, ?, ?, ?)", row)
        decodes = [(file["decode"],) for file in event.files]
        self._connection.executemany("DELETE FROM loose WHERE decode = ?", decodes)

    def places(self, key: str, until: int) -> Iterator[int]:
        """Positions of the events about `key` up to `until`, the last first; a few others may be among them."""
        asked = "SELECT position FROM place WHERE key = ? AND position <= ? ORDER BY position DESC"
        return self._positions(asked, _hash(key), until)

    def few(self, until: int) -> Iterator[int]:
        """Positions of all events of which there are few, rising."""
        return self._positions("SELECT position FROM few WHERE position <= ? ORDER BY position", until)

    def sessions_in(self, specimen: str | None, from_ns: int, to_ns: int) -> Iterator[int]:
        """Positions of the specimen's current sessions that lie at least partly in this time."""
        asked = "SELECT position FROM session WHERE specimen IS ? AND start_ns <= ? AND end_ns >= ?"
        return self._positions(asked, specimen, to_ns, from_ns)

    def last_sessions(self, count: int) -> list[int]:
        """Positions of the current sessions that began last, at least `count` of them, and of all without a date."""
        dated = "SELECT position FROM session WHERE start_ns IS NOT NULL ORDER BY start_ns DESC LIMIT ?"
        undated = "SELECT position FROM session WHERE start_ns IS NULL"
        return [*self._positions(dated, count), *self._positions(undated)]

    @property
    def count(self) -> int:
        """How many current sessions there are."""
        ((count,),) = self._connection.execute("SELECT count(*) FROM session")
        return int(count)

    def quarantined(self) -> list[str]:
        """SHA-256 of the logs that could not be read once."""
        return [raw for (raw,) in self._connection.execute("SELECT raw FROM quarantined")]

    def loose(self) -> list[str]:
        """SHA-256 of the logs with a decode that no session names."""
        return [raw for (raw,) in self._connection.execute("SELECT DISTINCT raw FROM loose")]

    def says_as(self, events: Sequence[Recorded]) -> bool:
        """Whether it says what an index made of these events says, as far as it knows them."""
        made = LedgerIndex()
        made.add(one for one in events if one.position <= self.position)
        return (made.position, made.digest, made._rows()) == (self.position, self.digest, self._rows())

    def _rows(self) -> list[set[tuple[Any, ...]]]:
        tables = ("place", "few", "session", "loose", "quarantined")
        return [set(self._connection.execute(f"SELECT * FROM {table}")) for table in tables]

    def _positions(self, statement: str, *values: Any) -> Iterator[int]:
        return (position for (position,) in self._connection.execute(statement, values))


def keys_of(one: Recorded) -> set[str]:
    """What an event is about: its stream, and by what else its kind is looked for."""
    match one.event:
        case RawFileSealed() as event:
            return {one.stream, f"called {event.name}"}
        case DecodeCompleted() as event:
            return {one.stream, f"decode {event.decode}"}
        case SessionRecorded() as event:
            begin = f"begins {event.session[:BEGINS]}"
            return {one.stream, f"name {event.name}", begin, *(f"holds {file['raw']}" for file in event.files)}
        case ReplayCompleted() as event:
            return {one.stream, f"replays {event.session}"}
    return {one.stream}


def _hash(key: str) -> int:
    """A key as 64 bits: two that share one cost a look at an event that is about something else."""
    return int.from_bytes(blake2b(key.encode(), digest_size=8).digest(), "big", signed=True)


def _known(state: dict[str, Any]) -> Known:
    tree = tuple((int(height), str(node)) for height, node in state.pop("tree"))
    stamp = state.pop("stamp")
    return Known(**state, tree=tree, stamp=Stamp(*stamp) if stamp else None)
