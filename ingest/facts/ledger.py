"""The ledger: every fact, in order, for ever.

Rows are kept by the `eventsourcing` library: SQLite in the store's folder, or what PERSISTENCE_MODULE and POSTGRES_* in
the environment name. It stores and orders them, guards each stream by (stream, version) and never sees an event: topics
and states are ours (`ingest.facts.ledger_row`).
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from eventsourcing.domain import EventSourcingError
from eventsourcing.persistence import (
    ApplicationRecorder,
    InfrastructureFactory,
    IntegrityError,
    Notification,
    StoredEvent,
    TrackingRecorder,
)

from ingest.errors import DamageError, IngestError, LedgerError
from ingest.facts.chain import Head, Tree
from ingest.facts.events import Event, LedgerSealed
from ingest.facts.ledger_history import LedgerHistory, Tail
from ingest.facts.ledger_index import Known, LedgerIndex, Stamp
from ingest.facts.ledger_lock import WriterLock, reading_uri
from ingest.facts.ledger_row import Recorded, decode, encode, utc_text

INDEX = "ledger.index"  # beside the ledger, derived from it
SEALS = "ledger-0"  # the stream of the seals
Factory = InfrastructureFactory[TrackingRecorder]
Connection = tuple[Factory, ApplicationRecorder]
FOR_EVER = "9999"  # after every recorded time
PAGE = 1000  # rows read at once
# What a damaged database makes Python raise; the last three where names in its schema are no UTF-8, or other columns,
# or numbers are too large.
DATABASE_ERRORS = (EventSourcingError, sqlite3.Error, OSError, UnicodeError, LookupError, OverflowError)


class Ledger:
    """The ledger of the store in `folder`. One process writes at a time; any number read meanwhile.

    Raises LedgerError where another process writes, or the database cannot be reached.
    """

    def __init__(self, folder: Path, *, write: bool = False, create: bool = False) -> None:
        self.path = folder.absolute() / "ledger.sqlite"
        self._lock = WriterLock(folder / "ledger.lock") if write else None
        self._env = _environment(self.path, write, create)
        self._seen = LedgerHistory(self.is_file)
        self._index: LedgerIndex | None = None
        self._index_path = folder.absolute() / INDEX
        self._left = Stamp.of(self.path)  # as the last command left it
        self._connection: Connection | None = None
        self._closed = False
        try:
            with self._plain_words():
                self._recorder()
        except BaseException:
            self.close()
            raise
        self._env["CREATE_TABLE"] = "no"

    @property
    def is_file(self) -> bool:
        """True where the rows lie in SQLite, at `path`."""
        return self._env["PERSISTENCE_MODULE"] == "eventsourcing.sqlite"

    def append(
        self, stream: str, event: Event, *, caused_by: str | None = None, happened: str | None = None
    ) -> Recorded:
        """Add `event` to `stream`; it is on disk when this returns. Raises as `append_all`."""
        return self.append_all([(stream, event)], caused_by=caused_by, happened=happened)[0]

    def append_all(
        self, batch: Sequence[tuple[str, Event]], *, caused_by: str | None = None, happened: str | None = None
    ) -> list[Recorded]:
        """Add all events of `batch`, or none. Raises LedgerError (refused, nothing stored) and DamageError."""
        if self._lock is None:
            raise LedgerError(f"{self.path}: was opened for reading: open the store for writing")
        encoded = self._encoded(batch, caused_by, happened)
        places = self._insert([row for row, _ in encoded])
        return [replace(one, position=place) for (_, one), place in zip(encoded, places, strict=True)]

    def proposed(self, batch: Sequence[tuple[str, Event]]) -> list[Recorded]:
        """All events, and those of `batch` behind them as if they were recorded. Raises as `append_all`."""
        encoded = self._encoded(batch, None, None)
        events = self.events()
        return [*events, *(replace(one, position=place) for place, (_, one) in enumerate(encoded, len(events) + 1))]

    def take_over(self, rows: Iterable[StoredEvent]) -> None:
        """Store rows of another ledger, as they are, behind those that it has in common with this one. All or none.

        Raises LedgerError.
        """
        self._insert([*rows])

    def events(self, *types: type[Event], stream: str | None = None, as_of: str | int | None = None) -> list[Recorded]:
        """The events in order: of `types` (all where none is given), of `stream`, as they were at `as_of`.

        `as_of` is a position, or an ISO 8601 time (UTC where it names no zone): what was recorded up to then.
        Raises DamageError where the ledger up to there is not what was written, LedgerError for an `as_of` that is
        neither.
        """
        stop, moment = self._as_of(as_of)
        if self._seen.resumed:
            self._seen = LedgerHistory(self.is_file)
        self._read(stop)
        return [
            one
            for one in self._seen.recorded
            if isinstance(one.event, types or Event)
            and stream in (None, one.stream)
            and one.recorded <= moment
            and (stop is None or one.position <= stop)
        ]

    def rows(self, start: int | None = None, stop: int | None = None, at_once: int = PAGE) -> Iterator[Notification]:
        """The stored rows from position `start` (None: the first) to `stop`, unchecked, read `at_once`.

        Raises LedgerError.
        """
        while True:
            with self._reading() as recorder:
                page = recorder.select_notifications(start, at_once, stop)
            yield from page
            if len(page) < at_once:
                return
            start = page[-1].id + 1

    def index(self) -> LedgerIndex | None:
        """Where facts lie in the events up to now; None where the ledger is no file. Raises as `events`.

        Only events that came since the last command are read; all of them where something else touched the ledger.
        """
        if not self.is_file:
            return None
        if self._index is None:
            self._index = self._kept_index() or LedgerIndex()
        self._read()
        self._index.add(self._seen.behind(self._index.position))
        return self._index

    def event(self, position: int) -> Recorded:
        """The event at `position`, checked against its own digest. Raises DamageError, and as `rows`."""
        found = self._seen.behind(position - 1)
        if found and found[0].position == position:
            return found[0]
        row = next(self.rows(position, position, 1), None)
        if row is None:
            raise DamageError(f"event {position}: is missing; `whyhot verify` lists all damage")
        return decode(row, position)

    def head(self) -> Head:
        """Position of the last event and Merkle root over all rows up to it. Raises DamageError, and as `rows`."""
        self.index()
        self._read()
        return self._seen.head

    def seal(self) -> Recorded | None:
        """Record the head as an event, so that what is before cannot change unseen. None where nothing is new."""
        head = self.head()
        if head.position == 0 or isinstance(self.event(head.position).event, LedgerSealed):
            return None
        return self.append(SEALS, LedgerSealed(position=head.position, root=head.root))

    def close(self) -> None:
        """End all connections, keep the index, and let the next writer in. Facts that are asked for later are read."""
        self._disconnect()
        self._keep_index()
        self._closed = True
        self._env["SQLITE_DBNAME"] = reading_uri(self.path)
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _encoded(
        self, batch: Sequence[tuple[str, Event]], caused_by: str | None, happened: str | None
    ) -> list[tuple[StoredEvent, Recorded]]:
        """The rows of `batch` behind what there is, and what each will read as."""
        encoded: list[tuple[StoredEvent, Recorded]] = []
        last = self._last()
        recorded = last.recorded if last else ""
        tails: dict[str, Recorded | None] = {}
        for stream, event in batch:
            tail = tails[stream] if stream in tails else self._tail(stream)
            recorded = _stamp(after=recorded)
            row, one = encode(event, stream, tail, recorded, happened, caused_by)
            tails[stream] = one
            encoded.append((row, one))
        return encoded

    def _kept_index(self) -> LedgerIndex | None:
        """The index that the last command left, where the last event that it knows is the one that stands there."""
        kept = LedgerIndex.load(self._index_path, self._left)
        try:
            if kept is None or self.event(kept.position).digest != kept.known.digest:
                return None
        except IngestError:
            return None
        if self._seen.position == 0:
            known = kept.known
            tail_of = partial(self._tail_up_to, kept, kept.position)
            self._seen = LedgerHistory(True, [], [], known.position, Tree(known.tree), known.recorded, tail_of, True)
        return kept

    def _tail_up_to(self, index: LedgerIndex, position: int, stream: str) -> Tail:
        """The last version of `stream` up to `position`, and its digest."""
        events = map(self.event, index.places(stream, position))
        return next(((one.version, one.digest) for one in events if one.stream == stream), (0, None))

    def _keep_index(self) -> None:
        """Keep the index for the next command: what a writer leaves, or a reader had to make."""
        index, seen = self._index, self._seen
        if index is None or seen.findings or seen.position != index.position or index.position == 0:
            return
        if self._lock is None and index.known.position:
            return
        stamp = Stamp.of(self.path) if self._lock else self._left
        index.save(self._index_path, Known(seen.position, index.digest, seen.moment, seen.tree.whole, stamp))

    def _read(self, stop: int | None = None) -> None:
        """See the rows up to `stop` that were not seen yet."""
        seen = self._seen
        for row in self.rows(seen.position + 1 if seen.position else None, stop):
            seen.add(row)
            if seen.findings:
                break
        if seen.findings:
            raise DamageError(f"{seen.findings[0].says}; `whyhot verify` lists all damage")

    def _recorder(self) -> ApplicationRecorder:
        """The rows, over a connection that is made where there is none. Raises what the database complains of."""
        if self._connection is None:
            self._connection = self._connect()
        return self._connection[1]

    def _connect(self) -> Connection:
        factory: Factory = InfrastructureFactory.construct(self._env)
        try:
            recorder = factory.application_recorder()
            if self.is_file and self._lock is not None:
                with factory.datastore.get_connection(commit=True) as connection:  # type: ignore[attr-defined]
                    connection.cursor().execute("PRAGMA synchronous=FULL")  # some builds sync less in WAL mode
        except BaseException:
            factory.close()
            raise
        return factory, recorder

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection[0].close()
            self._connection = None

    def _last(self) -> Recorded | None:
        with self._reading() as recorder:
            position = recorder.max_notification_id()
            rows = recorder.select_notifications(position, 1) if position else []
        return decode(rows[0], rows[0].id) if rows else None

    def _tail(self, stream: str) -> Recorded | None:
        with self._reading() as recorder:
            rows = recorder.select_events(stream, desc=True, limit=1)
        return decode(rows[0], 0) if rows else None

    def _insert(self, rows: Sequence[StoredEvent]) -> Sequence[int]:
        """Store `rows` in one transaction; a database that is locked is tried once more."""
        try:
            return self._try_insert(rows)
        except LedgerError as error:
            if "(database is locked)" not in str(error):
                raise
            return self._try_insert(rows)

    def _try_insert(self, rows: Sequence[StoredEvent]) -> Sequence[int]:
        with self._plain_words():
            return self._recorder().insert_events(rows) or []

    def _as_of(self, as_of: str | int | None) -> tuple[int | None, str]:
        """`as_of` as (last position, last recorded time)."""
        if as_of is None:
            return None, FOR_EVER
        last = self._last()
        end = last.position if last else 0
        if isinstance(as_of, int) or as_of.isdecimal():
            if not 0 <= int(as_of) <= end:
                raise LedgerError(f"as of {as_of}: the ledger ends at event {end}: give a number up to that, or a time")
            return int(as_of), FOR_EVER
        try:
            return None, utc_text(datetime.fromisoformat(as_of))
        except (ValueError, OverflowError):
            raise LedgerError(
                f"as of {as_of!r}: is neither the number of an event (up to {end}) nor a time like 2026-11-21T08:00:00Z"
            ) from None

    @contextmanager
    def _reading(self) -> Iterator[ApplicationRecorder]:
        """The rows, for one reading; of a closed ledger no connection stays."""
        with self._plain_words():
            yield self._recorder()
        if self._closed:
            self._disconnect()

    @contextmanager
    def _plain_words(self) -> Iterator[None]:
        """What the database complains of, as one line of ours; the next call starts with a new connection.

        A transaction that failed while it was committed may still be open on the old one.
        """
        where = self.path if self.is_file else self._env["PERSISTENCE_MODULE"]
        try:
            yield
        except IntegrityError:
            self._disconnect()
            raise LedgerError(
                f"{where}: another program wrote to the same stream meanwhile: run the same command again"
            ) from None
        except DATABASE_ERRORS as error:
            self._disconnect()
            raise LedgerError(
                f"{where}: cannot be read or written ({' '.join(str(error).split())}): see that it may be written and "
                "the disk has space, and restore it from a backup if it is damaged"
            ) from None


def _environment(path: Path, write: bool, create: bool) -> dict[str, str]:
    """The settings of the `eventsourcing` library: a file at `path` unless the environment names a database."""
    given = {key: value for key, value in os.environ.items() if key.startswith("POSTGRES_")}
    return given | {
        "PERSISTENCE_MODULE": os.environ.get("PERSISTENCE_MODULE") or "eventsourcing.sqlite",
        "SQLITE_DBNAME": f"{path.as_uri()}?mode={'rwc' if create else 'rw'}" if write else reading_uri(path),
        "ORIGINATOR_ID_TYPE": "text",
        "CREATE_TABLE": "yes" if create else "no",
    }


def _stamp(after: str) -> str:
    """Now, but at least 1 us after `after` even where the clock was set back, so that a time is one position."""
    now = utc_text(datetime.now(UTC))
    return max(now, utc_text(datetime.fromisoformat(after) + timedelta(microseconds=1))) if after else now
