"""One question in SQL to an open warehouse: checked, asked, answered in rows.

Two walls stand around a question. The connection itself can reach nothing but the store's Parquet files
(`warehouse.confine`). And the question is parsed first: only what reads is passed on, and of functions that make a
table only those in `TABLE_FUNCTIONS`, because DuckDB has some that write files or take raw pointers. The parse tree
is looked at, not only the kind of the statement: from 2.0 on, `WITH x AS (COPY ... TO ...) SELECT` counts as a
SELECT.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import duckdb

from analytics.errors import AnalyticsError, LostFileError, QueryError, RefusedQueryError
from analytics.warehouse import MACROS, MEMORY, VIEWS, Warehouse, refresh
from ingest.texts.names import each_once
from ingest.texts.nearest import nearest

if TYPE_CHECKING:
    from ingest.facts.store import Store

ROWS, SECONDS = 1_000_000, 60.0  # what the command line allows a question unless it is told otherwise
BLOCK = 10_000  # rows fetched at once
LONGEST = 100_000  # characters; the parser takes seconds for a megabyte of brackets
READING_NODES = {"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"}
TABLE_FUNCTIONS = {
    *MACROS,
    *("range", "generate_series", "unnest", "json_each", "json_tree", "pragma_table_info"),
    *("duckdb_columns", "duckdb_functions", "duckdb_keywords", "duckdb_tables", "duckdb_types", "duckdb_views"),
}
REFUSED_FUNCTIONS = {"write_log", "sleep_ms", "nextval", "setval", "setseed", "current_setting", "getvariable"}
EXPLAIN = re.compile(r"\s*explain(\s+analyze)?\s+(?=\S)", re.IGNORECASE)
DESCRIBE = re.compile(r"""\s*desc(?:ribe)?\s+"?(\w+)"?\s*;?\s*""", re.IGNORECASE)
TABLE_INFO = re.compile(r"""\s*pragma\s+table_info\s*\(\s*(['"]?)(\w+)\1\s*\)\s*;?\s*""", re.IGNORECASE)
ADVICE = "whyhot sql only reads: SELECT, FROM, WITH, VALUES, DESCRIBE, SHOW TABLES, SUMMARIZE, EXPLAIN"


@dataclass(frozen=True)
class QueryResult:
    """An answer. `columns`: names, made unique; `types`: of DuckDB; `more`: there were more rows than asked for."""

    columns: tuple[str, ...]
    types: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    more: bool = False


def run(
    connection: duckdb.DuckDBPyConnection, sql: str, limit: int | None = None, seconds: float | None = None
) -> QueryResult:
    """The answer to one statement, at most `limit` rows of it, within `seconds`; no more rows are made than are given.

    Raises RefusedQueryError for anything that does more than read, QueryError for what DuckDB cannot answer in time.
    """
    try:
        with _within(connection, seconds) as deadline:
            check(connection, sql)
            connection.execute(_described(sql))
            columns = [(str(column[0]), str(column[1])) for column in connection.description or ()]
            rows = _fetched(connection, None if limit is None else limit + 1, deadline)
    except (duckdb.InterruptException, TimeoutError):
        raise QueryError(
            f"SQL: took longer than the {seconds:g} s that a query gets: select fewer rows or columns, or allow more "
            "with --seconds"
        ) from None
    except duckdb.Error as error:
        raise _explained(error) from None
    return QueryResult(
        columns=each_once([name for name, _ in columns]),
        types=tuple(kind for _, kind in columns),
        rows=rows[:limit],
        more=limit is not None and len(rows) > limit,
    )


def ask(
    store: Store, sql: str, limit: int | None = None, seconds: float | None = None, as_of: str | None = None
) -> tuple[QueryResult, Warehouse]:
    """The answer of the store as it is now, or was at `as_of`, and the warehouse that gave it, closed. Raises as `run`
    and `warehouse.refresh`."""
    try:
        return _asked(refresh(store, as_of), sql, limit, seconds)
    except LostFileError:  # what is left can be answered
        return _asked(refresh(store, as_of, anew=True), sql, limit, seconds)


def _asked(warehouse: Warehouse, sql: str, limit: int | None, seconds: float | None) -> tuple[QueryResult, Warehouse]:
    with warehouse as opened:
        return run(opened.connection, sql, limit, seconds), opened


def first_row(store: Store, sql: str, seconds: float | None = None) -> dict[str, Any]:
    """The first row of an answer, by column. Raises as `ask`, QueryError where there is none."""
    found, _ = ask(store, sql, 1, seconds)
    if not found.rows:
        raise QueryError("SQL: gives no row: there is nothing to trace")
    return dict(zip(found.columns, found.rows[0], strict=True))


@contextmanager
def _within(connection: duckdb.DuckDBPyConnection, seconds: float | None) -> Iterator[float | None]:
    """Interrupt what runs in here after `seconds`; gives the time at which that is."""
    if seconds is None:
        yield None
        return
    timer = threading.Timer(seconds, connection.interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield time.monotonic() + seconds
    finally:
        timer.cancel()


def _fetched(connection: duckdb.DuckDBPyConnection, most: int | None, deadline: float | None) -> list[tuple[Any, ...]]:
    """The first `most` rows, block by block: DuckDB makes no more of them. Raises TimeoutError after `deadline`."""
    rows: list[tuple[Any, ...]] = []
    while most is None or len(rows) < most:
        block = connection.fetchmany(BLOCK if most is None else min(BLOCK, most - len(rows)))
        if not block:
            break
        rows += block
        if deadline is not None and time.monotonic() > deadline:
            raise TimeoutError
    return rows


def _described(sql: str) -> str:
    """`DESCRIBE view` with what its columns mean, which DuckDB's own leaves out; any other statement as it is."""
    found = DESCRIBE.fullmatch(sql)
    if found is None or found[1].lower() not in VIEWS:
        return sql
    return (
        "SELECT column_name, data_type AS column_type, comment FROM duckdb_columns() WHERE schema_name = 'main' "
        f"AND database_name = current_database() AND table_name = '{found[1].lower()}' ORDER BY column_index"
    )


def check(connection: duckdb.DuckDBPyConnection, sql: str) -> None:
    """Pass a statement that only reads. Raises RefusedQueryError or, where it cannot be parsed, QueryError."""
    if len(sql) > LONGEST:
        raise RefusedQueryError(
            f"SQL: is {len(sql):,} characters long, at most {LONGEST:,} are taken: ask less at once"
        )
    if TABLE_INFO.fullmatch(sql):
        return
    for node in _nodes(_tree(connection, EXPLAIN.sub("", sql, count=1))):
        kind, function = str(node.get("type", "")), str(node.get("function_name", "")).lower()
        if kind.endswith("_NODE") and kind not in READING_NODES:
            raise RefusedQueryError(f"SQL: holds {kind.split('_')[0]}, which writes: {ADVICE}")
        if kind == "TABLE_FUNCTION":
            table_function = str(node["function"].get("function_name", "")).lower()
            if table_function not in TABLE_FUNCTIONS:
                raise RefusedQueryError(
                    f"SQL: the table function {table_function} is not for queries, it could leave the store: read the "
                    f"views ({', '.join(VIEWS)})"
                )
        if function in REFUSED_FUNCTIONS:
            raise RefusedQueryError(f"SQL: the function {function} is not for queries: leave it out")


def _tree(connection: duckdb.DuckDBPyConnection, sql: str) -> dict[str, Any]:
    """The parse tree of exactly one reading statement."""
    try:
        count = len(connection.extract_statements(sql))
        if count != 1:
            raise RefusedQueryError(f"SQL: holds {count} statements: give one at a time")
        found = connection.execute("SELECT json_serialize_sql(?::VARCHAR)", [sql]).fetchone()
        tree: dict[str, Any] = json.loads(found[0]) if found else {"error": True}
    except duckdb.InterruptException:
        raise
    except duckdb.Error as error:
        raise _explained(error) from None
    except RecursionError:
        raise RefusedQueryError("SQL: is nested too deeply: use WITH to name its parts") from None
    if tree.get("error"):
        raise RefusedQueryError(f"SQL: {_first_words(sql)} does more than read: {ADVICE}")
    return tree


def _nodes(tree: Any) -> Iterator[dict[str, Any]]:
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, dict):
            yield node
            waiting.extend(node.values())
        elif isinstance(node, list):
            waiting.extend(node)


def _first_words(sql: str) -> str:
    return " ".join(re.sub(r"--[^\n]*|/\*.*?\*/", " ", sql, flags=re.DOTALL).split()[:2])[:40]


def _explained(error: duckdb.Error) -> AnalyticsError:
    """DuckDB's complaint as one line, with the names that were probably meant."""
    said = " ".join(re.split(r"\n\s*\n|\nLINE \d", str(error))[0].split())
    said = re.sub(r"^[A-Za-z ]*Error: ", "", said)
    if isinstance(error, duckdb.OutOfMemoryException):
        return QueryError(f"SQL: needs more memory than the {MEMORY} that a query gets: select fewer rows or columns")
    if missing := re.match(r'Table with name (".*?"|\S+) does not exist', said):
        name = missing[1].strip('"')
        near = nearest(name, VIEWS)
        hint = f"Nearest: {near[0]}. " if near else ""
        return QueryError(f"SQL: there is no view {name}. {hint}Views: {', '.join(VIEWS)}")
    if bucket := re.search(r"BucketError: (.*)", str(error)):
        return QueryError(f"SQL: {bucket[1]}")
    if lost := re.search(r'"([^"]*)/\*\*/[^"]*"', said):  # DuckDB takes a path without a file for a folder
        return LostFileError(f"SQL: {lost[1]}: is missing since the warehouse was made: ask again")
    if isinstance(error, duckdb.PermissionException):
        return RefusedQueryError(f"SQL: {said}: a query reads the views of this store only ({', '.join(VIEWS)})")
    if "pytz" in said:
        return QueryError("SQL: a time with a zone cannot be shown: cast it, as in now()::TIMESTAMP")
    advice = "" if "Candidate" in said or "Did you mean" in said else ". `DESCRIBE samples` lists the columns of a view"
    return QueryError(f"SQL: {said[:400]}{advice}")
