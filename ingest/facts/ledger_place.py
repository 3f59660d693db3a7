"""Where the rows of a ledger lie: in SQLite, in the store's folder, or in the table of a PostgreSQL server.

Both are recorders of the `eventsourcing` library, which stores rows in order and guards each stream by (stream,
version). What a ledger has to know of the one and the other is said here and in `ledger_server`, and nowhere else.
"""

from __future__ import annotations

import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from eventsourcing.domain import EventSourcingError
from eventsourcing.persistence import (
    ApplicationRecorder,
    InfrastructureFactory,
    IntegrityError,
    StoredEvent,
    TrackingRecorder,
)

from ingest.errors import LedgerError
from ingest.facts.ledger_index import Stamp
from ingest.facts.ledger_lock import reading_uri

# What a damaged database makes Python raise; the last four where names in its schema are no UTF-8, or other columns,
# or numbers are too large, or columns are empty.
DATABASE_ERRORS = (EventSourcingError, sqlite3.Error, OSError, UnicodeError, LookupError, OverflowError, TypeError)


class LedgerPlace(ABC):
    """The rows of one ledger. `where`: what messages call it; `shared`: several programs write to it at once."""

    where: str
    shared: bool

    def __init__(self) -> None:
        self._recorder: ApplicationRecorder | None = None

    def recorder(self) -> ApplicationRecorder:
        """The rows, over a connection that is made where there is none. Raises what the database complains of."""
        if self._recorder is None:
            self._recorder = self._connect()
        return self._recorder

    @abstractmethod
    def _connect(self) -> ApplicationRecorder: ...

    @abstractmethod
    def disconnect(self) -> None:
        """End the connection, if there is one."""

    @abstractmethod
    def only_read(self) -> None:
        """From the next connection on rows are read and none is written."""

    @abstractmethod
    def stamp(self) -> Stamp | None:
        """What differs after something else than an append of ours touched the rows; None where there are none."""

    @abstractmethod
    def insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        """Store `rows`, all or none, behind position `after`, and return their positions; None where others are there
        by now."""

    @abstractmethod
    def refusal(self, error: Exception) -> LedgerError:
        """What the database complains of, as one line of ours."""

    @contextmanager
    def plain_words(self) -> Iterator[None]:
        """What the database complains of, raised as a LedgerError; the next call starts with a new connection.

        A transaction that failed while it was committed may still be open on the old one.
        """
        try:
            yield
        except DATABASE_ERRORS as error:
            self.disconnect()
            raise self.refusal(error) from None


class SqliteFile(LedgerPlace):
    """A file at `path`, which one process writes to at a time: it holds ledger.lock."""

    shared = False

    def __init__(self, path: Path, write: bool, create: bool) -> None:
        super().__init__()
        path = path.absolute()
        self.path, self.where = path, str(path)
        self._write = write
        self._factory: InfrastructureFactory[TrackingRecorder] | None = None
        self._settings = {
            "PERSISTENCE_MODULE": "eventsourcing.sqlite",
            "SQLITE_DBNAME": f"{path.as_uri()}?mode={'rwc' if create else 'rw'}" if write else reading_uri(path),
            "ORIGINATOR_ID_TYPE": "text",
            "CREATE_TABLE": "yes" if create else "no",
        }

    def _connect(self) -> ApplicationRecorder:
        factory = InfrastructureFactory[TrackingRecorder].construct(self._settings)
        try:
            recorder = factory.application_recorder()
            if self._write:
                with factory.datastore.get_connection(commit=True) as connection:  # type: ignore[attr-defined]
                    connection.cursor().execute("PRAGMA synchronous=FULL")  # some builds sync less in WAL mode
        except BaseException:
            factory.close()
            raise
        self._factory = factory
        self._settings["CREATE_TABLE"] = "no"
        return recorder

    def disconnect(self) -> None:
        self._recorder = None
        if self._factory is not None:
            self._factory.close()
            self._factory = None

    def only_read(self) -> None:
        self._write = False
        self._settings["SQLITE_DBNAME"] = reading_uri(self.path)

    def stamp(self) -> Stamp | None:
        """The file's bytes, and time of its last change [ns]."""
        try:
            found = self.path.stat()
        except OSError:
            return None
        return Stamp(found.st_size, found.st_mtime_ns)

    def insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        return self.recorder().insert_events(rows) or []

    def refusal(self, error: Exception) -> LedgerError:
        if isinstance(error, IntegrityError):
            says = "another program wrote to the same stream meanwhile: run the same command again"
            return LedgerError(f"{self.where}: {says}")
        return LedgerError(
            f"{self.where}: cannot be read or written ({' '.join(str(error).split())}): see that it may be written and "
            "the disk has space, and restore it from a backup if it is damaged"
        )
