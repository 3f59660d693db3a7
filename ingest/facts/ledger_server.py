"""A ledger in a PostgreSQL server: one table a store, which several programs on several machines write to at once.

`store.json` names the URL and the table; no password stands there or in any message (libpq finds it: PGPASSFILE,
~/.pgpass, PGPASSWORD or a service file). The table's name is drawn when it is made, so that the ledger of one store is
never taken for that of another. Needs the extra `postgres` (psycopg); SQL lies in `ledger_table`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from secrets import token_hex
from typing import TYPE_CHECKING, NamedTuple

from eventsourcing.persistence import (
    ApplicationRecorder,
    InterfaceError,
    OperationalError,
    ProgrammingError,
    StoredEvent,
)

from ingest.errors import LedgerError, ServerError, not_installed
from ingest.facts.ledger_index import Stamp
from ingest.facts.ledger_place import LedgerPlace

if TYPE_CHECKING:
    from ingest.facts.ledger_table import LedgerTable

SCHEMES = ("postgresql://", "postgres://")
PASSWORD = re.compile(r"//[^:@/?]*:.*@|[?&]\w*password=")  # before the host, or as a parameter
EXAMPLE = "postgresql://USER@HOST:5432/DATABASE"


class Server(NamedTuple):
    """Where a store's ledger lies: `url` as libpq reads it, without a password; `table` in the schema `public`."""

    url: str
    table: str

    @classmethod
    def new(cls, url: str) -> Server:
        """A table that is not there yet. Raises ServerError for what is no such URL."""
        return cls(checked(url), f"whyhot_{token_hex(8)}")


def is_url(text: str) -> bool:
    """Whether `text` names a PostgreSQL server."""
    return text.lower().startswith(SCHEMES)


def shown(url: str) -> str:
    """`url` as messages show it: without a password."""
    return re.sub(r"([?&]\w*password=)[^&]*", r"\1***", re.sub(r"//([^:@/?]*):.*@", r"//\1:***@", url))


def checked(url: str) -> str:
    """`url`, where it is one of a server and holds no password. Raises ServerError."""
    if not is_url(url):
        raise ServerError(f"{shown(url)}: is not the URL of a PostgreSQL server: give one like {EXAMPLE}")
    if PASSWORD.search(url):
        raise ServerError(
            f"{shown(url)}: holds a password, which would be kept in store.json: take it out of the URL and put it "
            "into ~/.pgpass (or the file that PGPASSFILE names) or into PGPASSWORD"
        )
    return url


class ServerTable(LedgerPlace):
    """The rows in `server`. With `create` the table is made at the first connection."""

    shared = True

    def __init__(self, server: Server, create: bool = False) -> None:
        super().__init__()
        self.where = f"{shown(server.url)} (table {server.table})"
        self._server = server._replace(url=checked(server.url))
        self._create = create
        self._table: LedgerTable | None = None

    def table(self) -> LedgerTable:
        """The table over a connection. Raises ServerError where psycopg is not installed, the server cannot be reached
        or refuses, or has no such table."""
        if self._table is None:
            try:
                from ingest.facts.ledger_table import LedgerTable
            except ImportError:
                what = f"{shown(self._server.url)}: the client of PostgreSQL (psycopg)"
                raise ServerError(not_installed(what, "uv tool install '.[postgres]'")) from None
            self._table = LedgerTable(self._server.url, self._server.table, shown(self._server.url), self._create)
            self._create = False
        return self._table

    def _connect(self) -> ApplicationRecorder:
        return self.table().recorder

    def disconnect(self) -> None:
        self._recorder = None
        if self._table is not None:
            self._table.close()
            self._table = None

    def only_read(self) -> None:
        """Nothing of it: the server lets in writers and readers alike."""

    def stamp(self) -> Stamp | None:
        """The table's file in the server, and how often rows were changed or removed: appends leave both alone."""
        return self.table().stamp()

    def insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        return self.table().insert(rows, after)

    def remove(self) -> None:
        """Drop the table with all its rows."""
        self.table().drop()

    def refusal(self, error: Exception) -> LedgerError:
        says = " ".join(str(error).split())
        if isinstance(error, OperationalError | InterfaceError):
            return ServerError(
                f"{self.where}: the server does not answer ({says}): what was recorded before is kept; run the same "
                "command again when it is back"
            )
        if isinstance(error, ProgrammingError):
            return ServerError(
                f"{self.where}: is refused ({says}): the user needs the right to read and append there; where the "
                "ledger was moved meanwhile, run the same command again"
            )
        return LedgerError(
            f"{self.where}: cannot be read or written ({says}): where the server is damaged, restore its own backup"
        )
