"""The table of a ledger in a PostgreSQL server: eventsourcing's own recorder, and what it leaves open.

The recorder takes a lock on the table for each insert, so that rows become visible in the order of their numbers. Two
things are added under the same lock: rows are stored only behind the row that the writer took for the last, as their
time and digests follow from it; and numbers have no gaps, though a transaction that fails uses some up, as the ledger's
head is made of them and a missing row must show.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import psycopg
from eventsourcing.persistence import StoredEvent
from eventsourcing.postgres import PostgresApplicationRecorder, PostgresDatastore
from psycopg.rows import dict_row
from psycopg.sql import SQL, Identifier

from ingest.errors import ServerError
from ingest.facts.ledger_index import Stamp

CONNECT_S = 5  # for the first connection
AGAIN_S = 1.0  # for each of the recorder's ten tries at one that was lost
LOCK_S = 30  # for other writers' transactions, which take milliseconds
IDLE_S = 60.0  # after which the server ends the transaction of a client that was stopped in it


class MovedOnError(Exception):
    """Others stored rows behind the one that a writer took for the last."""


class LedgerTable:
    """The table `name` of the database at `url`, which messages call `shown`; made where `create`.

    Raises ServerError where the server cannot be reached or refuses, or has no such table.
    """

    def __init__(self, url: str, name: str, shown: str, create: bool) -> None:
        self._name = name
        self._datastore = _datastore(url)
        try:
            known = self._connected(url, shown)
            if name not in known and not create:
                others = f", but the ledgers of {len(known)} others" if known else ""
                raise ServerError(
                    f"{shown}: holds no ledger of this store (no table {name}){others}: give store.json the URL of the "
                    "database that the ledger was moved to"
                )
            self.recorder = _Recorder(self._datastore, name)
            if create:
                self.recorder.create_table()
        except BaseException:
            self.close()
            raise

    def _connected(self, url: str, shown: str) -> list[str]:
        """The names of all ledgers there. The first connection says what is wrong, which those of the pool do not."""
        try:
            with psycopg.connect(url, connect_timeout=CONNECT_S) as connection:
                known = [str(one) for (one,) in connection.execute(TABLES)]
            self._datastore.pool.open(wait=True, timeout=CONNECT_S)
        except psycopg.Error as error:
            says = " ".join(str(error).split())
            raise ServerError(
                f"{shown}: cannot be used ({says}): see that the server runs, and that address, user and database are "
                "right; a password belongs in ~/.pgpass or PGPASSWORD"
            ) from None
        return known

    def insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        """Store `rows`, all or none, behind position `after`; None where others are there by now."""
        try:
            return self.recorder.insert_events(rows, after=after) or []
        except MovedOnError:
            return self._stored(rows, after)

    def _stored(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        """The positions of `rows` where the others are these: the connection was lost after they were committed."""
        there = self.recorder.select_notifications(after + 1, len(rows))
        return [one.id for one in there] if [one.state for one in there] == [one.state for one in rows] else None

    def stamp(self) -> Stamp:
        with self._datastore.get_connection() as connection:
            found = connection.execute(STAMP, {"table": f"public.{self._name}"}).fetchone()
        assert found is not None
        return Stamp(found["file"], found["changes"])

    def drop(self) -> None:
        with self._datastore.get_connection() as connection:
            connection.execute(SQL("DROP TABLE IF EXISTS public.{}").format(Identifier(self._name)))

    def close(self) -> None:
        self._datastore.close()


def _datastore(url: str) -> PostgresDatastore:
    made = PostgresDatastore(
        *("", "", "", "", ""),
        connect_timeout=AGAIN_S,
        lock_timeout=LOCK_S,
        idle_in_transaction_session_timeout=IDLE_S,
        originator_id_type="text",
    )
    # The whole URL instead of five parts: TLS, several hosts, services and password files are libpq's.
    made.pool.conninfo, made.pool.kwargs = url, {"row_factory": dict_row}
    return made


TABLES = "SELECT tablename FROM pg_tables WHERE schemaname = 'public' AND tablename LIKE 'whyhot\\_%'"
STAMP = """
SELECT coalesce(pg_relation_filenode(c.oid), 0)::bigint AS file,
       pg_stat_get_tuples_updated(c.oid) + pg_stat_get_tuples_deleted(c.oid) AS changes
FROM pg_class c WHERE c.oid = %(table)s::regclass
"""
LAST = """
SELECT coalesce(max(notification_id), 0) AS last,
       setval(pg_get_serial_sequence({name}, 'notification_id'), coalesce(max(notification_id), 0) + 1, false)
FROM public.{table}
"""


class _Recorder(PostgresApplicationRecorder):
    def __init__(self, datastore: PostgresDatastore, table: str) -> None:
        super().__init__(datastore, events_table_name=table)
        # A function of the database that names one table: not used, and stores would take it from each other.
        del self.sql_create_statements[self.create_insert_function_statement_index]
        self._last = SQL(LAST).format(name=f"public.{table}", table=Identifier(table))

    def _insert_events(self, curs: Any, stored_events: Sequence[StoredEvent], *, after: int = 0, **_: Any) -> None:
        """Called by `insert_events` in its transaction, before it stores anything."""
        self._lock_table(curs)
        last = curs.execute(self._last).fetchone()["last"]
        if last != after:
            raise MovedOnError
