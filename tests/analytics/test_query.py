"""Questions are answered; what would do more than read this store's views is refused with one line."""

from __future__ import annotations

import os
import random
import re
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import duckdb
import pytest

from analytics import scans, warehouse
from analytics.errors import AnalyticsError, QueryError, RefusedQueryError, WarehouseError
from analytics.query import LONGEST, ask, run
from ingest.facts.store import Store
from made.escapes import ESCAPES, SECRET
from made.places import on_disk

FLIPS = 12  # of bits in a file

NAMES = ", ".join(warehouse.VIEWS)
ADVICE = "whyhot sql only reads: SELECT, FROM, WITH, VALUES, DESCRIBE, SHOW TABLES, SUMMARIZE, EXPLAIN"


@pytest.fixture(scope="module")
def connection(shared_store: Store) -> Iterator[duckdb.DuckDBPyConnection]:
    with warehouse.refresh(shared_store) as opened:
        yield opened.connection


@pytest.mark.parametrize(
    "sql",
    [
        "SELECT name FROM sessions",
        "FROM sessions SELECT name;",
        "-- a comment first\nSELECT name FROM sessions",
        "WITH a AS (SELECT name FROM sessions), b AS (FROM a) SELECT * FROM b",
        "WITH RECURSIVE r AS (SELECT 1 AS n UNION ALL SELECT n + 1 FROM r WHERE n < 3) FROM r",
        "SELECT name FROM sessions UNION ALL SELECT name FROM files ORDER BY ALL LIMIT 3",
        "VALUES (1), (2), (3)",
        "TABLE sessions",
        "SELECT (SELECT max(range) FROM range(3)), x FROM generate_series(1, 3) AS g(x)",
        "SELECT a.name FROM sessions AS a POSITIONAL JOIN sessions AS b",
        "SELECT name, key, value FROM sessions, json_each(attributes)",
        "SELECT * FROM (SELECT channel, value FROM samples) PIVOT (max(value) FOR channel IN ('speed')) , range(3)",
        (
            "SELECT session_name, row_number() OVER (PARTITION BY session ORDER BY t_s) AS n FROM samples "
            "QUALIFY n = 1 AND t_s = 0"
        ),
    ],
)
def test_every_way_to_read_is_open(connection: duckdb.DuckDBPyConnection, sql: str) -> None:
    assert len(run(connection, sql).rows) == 3


@pytest.mark.parametrize(
    ("sql", "shows"),
    [
        ("DESCRIBE samples", "t_ns"),
        ("DESCRIBE SELECT value FROM samples", "DOUBLE"),
        ("SHOW TABLES", "residuals"),
        ("SUMMARIZE sessions", "duration_s"),
        ("PRAGMA table_info('runs')", "mae_K"),
        ("EXPLAIN SELECT value FROM samples", "plan"),
        ("explain  analyze SELECT count(*) FROM samples", "plan"),
        ("SELECT column_name, comment FROM duckdb_columns() WHERE table_name = 'files'", "rejected"),
    ],
)
def test_the_views_explain_themselves(connection: duckdb.DuckDBPyConnection, sql: str, shows: str) -> None:
    assert shows in str(run(connection, sql).rows)


@pytest.mark.parametrize("sql", ESCAPES)
def test_no_query_leaves_the_store_or_writes(
    connection: duckdb.DuckDBPyConnection, shared_store: Store, tmp_path: Path, sql: str
) -> None:
    a_python_variable = [{"secret": SECRET}]
    outside, other = tmp_path / "outside.csv", tmp_path / "other.duckdb"
    outside.write_text(f"secret\n{SECRET}\n")
    with duckdb.connect(str(other)) as database:
        database.execute(f"CREATE TABLE s AS SELECT '{SECRET}' AS secret")
    inside = on_disk(shared_store.decoded("d2"))
    before = [sorted(folder.rglob("*")) for folder in (tmp_path, shared_store.folder)]
    words = {"outside": outside, "inside": inside, "raw": inside / "rows.parquet", "db": other}
    sql = sql.format(**{word: str(path).replace("'", "''") for word, path in words.items()})
    with pytest.raises(AnalyticsError) as caught:
        run(connection, sql)
    line = str(caught.value)
    assert line.startswith("SQL: ")
    assert "\n" not in line
    assert len(line) < 600
    assert SECRET not in line
    assert a_python_variable
    assert [sorted(folder.rglob("*")) for folder in (tmp_path, shared_store.folder)] == before
    assert run(connection, "SELECT max(value) FROM samples WHERE channel = 'oven'").rows == [(189.0,)]


def test_the_raw_connection_is_confined_too(
    connection: duckdb.DuckDBPyConnection, shared_store: Store, tmp_path: Path
) -> None:
    (tmp_path / "outside.csv").write_text(SECRET)
    inside = str(on_disk(shared_store.decoded("d2"))).replace("'", "''")
    for sql in (
        f"SELECT * FROM read_text('{tmp_path}/outside.csv')",
        f"SELECT * FROM read_blob('{inside}/../../../../../../../../../../../..{tmp_path}/outside.csv')",
        f"COPY (SELECT 1) TO '{inside}/stolen.csv'",
        f"COPY (SELECT 1) TO '{inside}/rows.parquet'",
        f"ATTACH '{tmp_path}/other.duckdb'",
        "INSTALL httpfs",
        "SET enable_external_access = true",
        "SET memory_limit = '100GB'",
        "DELETE FROM base.events",
    ):
        with pytest.raises(duckdb.Error):
            connection.execute(sql)
    assert not (on_disk(shared_store.decoded("d2")) / "stolen.csv").exists()


def test_memory_and_threads_are_limited(connection: duckdb.DuckDBPyConnection) -> None:
    rows = connection.execute("SELECT current_setting('memory_limit'), current_setting('threads')").fetchall()
    assert rows == [("2.0 GiB", min(4, os.cpu_count() or 1))]


@pytest.mark.parametrize(
    ("sql", "says"),
    [
        ("COPY sessions TO 'x'", f"SQL: COPY sessions does more than read: {ADVICE}"),
        ("SELECT 1; SELECT 2", "SQL: holds 2 statements: give one at a time"),
        (
            "FROM read_text('x')",
            f"SQL: the table function read_text is not for queries, it could leave the store: read the views ({NAMES})",
        ),
        ("SELECT write_log('x')", "SQL: the function write_log is not for queries: leave it out"),
    ],
)
def test_a_refusal_says_what_and_what_to_do(connection: duckdb.DuckDBPyConnection, sql: str, says: str) -> None:
    with pytest.raises(RefusedQueryError) as caught:
        run(connection, sql)
    assert str(caught.value) == says


@pytest.mark.parametrize(
    ("sql", "says"),
    [
        ("FROM sample", f"SQL: there is no view sample. Nearest: samples. Views: {NAMES}"),
        ("FROM quux", f"SQL: there is no view quux. Views: {NAMES}"),
        ("SELEKT 1", 'SQL: syntax error at or near "SELEKT". `DESCRIBE samples` lists the columns of a view'),
    ],
)
def test_a_wrong_query_is_explained_in_one_line(connection: duckdb.DuckDBPyConnection, sql: str, says: str) -> None:
    with pytest.raises(QueryError) as caught:
        run(connection, sql)
    assert str(caught.value) == says


def test_a_misspelt_column_gets_the_nearest_ones(connection: duckdb.DuckDBPyConnection) -> None:
    with pytest.raises(QueryError, match=r'^SQL: Referenced column "residual" not found .* "residual_K"'):
        run(connection, "SELECT residual FROM residuals")


def test_a_value_that_does_not_fit_is_one_line(connection: duckdb.DuckDBPyConnection) -> None:
    with pytest.raises(QueryError, match=r"^SQL: Could not convert string 'hot' to DOUBLE[^\n]*$"):
        run(connection, "SELECT CAST('hot' AS DOUBLE)")


def test_a_time_with_zone_says_how_to_show_it(connection: duckdb.DuckDBPyConnection) -> None:
    with pytest.raises(QueryError, match=r"cast it, as in now\(\)::TIMESTAMP$"):
        run(connection, "SELECT now()")
    assert len(run(connection, "SELECT now()::TIMESTAMP").rows) == 1


def test_a_question_is_answered_without_a_file_that_vanished(store: Store) -> None:
    ask(store, "FROM sessions")
    (on_disk(store.decoded("d2")) / "rows.parquet").unlink()
    found, asked = ask(store, "SELECT count(*) FROM sessions")
    assert (found.rows, asked.left_out) == ([(3,)], None), "nothing of it was asked"
    found, asked = ask(store, "SELECT count(*) FROM samples WHERE channel = 'oven'")
    assert found.rows == [(0,)]
    assert re.search("rows.parquet: is missing: .*; next: whyhot rebuild$", asked.left_out or "")


def test_a_damaged_page_is_told_with_its_file_and_the_next_command(store: Store) -> None:
    path = on_disk(store.decoded("d2")) / "rows.parquet"
    ask(store, "FROM sessions")
    whole = path.read_bytes()
    path.write_bytes(whole[:4] + bytes(256) + whole[260:])
    line = f"{path.absolute()}: is damaged: no answer has these samples; next: whyhot rebuild"
    with pytest.raises(WarehouseError, match=f"^{re.escape(line)}$"):
        ask(store, "SELECT sum(value), sum(t_ns) FROM samples")
    with pytest.raises(WarehouseError, match=f"^{re.escape(line)}$"):
        warehouse.connect(store.folder)


@pytest.mark.parametrize("kind", ["samples", "temperatures", "residuals"])
def test_a_flipped_bit_changes_no_answer_unseen(store: Store, kind: str) -> None:
    view = f"{kind} WHERE session_name = '1_s1'"
    with warehouse.refresh(store) as opened:
        true = run(opened.connection, f"FROM {view} ORDER BY ALL").rows
        file = Path(next(file for file, holds, *_ in scans.named(opened.connection) if holds == kind))
    file.chmod(0o644)
    whole, chance, told = file.read_bytes(), random.Random(kind), 0
    for _ in range(FLIPS):
        place, bit = chance.randrange(len(whole)), chance.randrange(8)
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :])
        try:
            found, asked = ask(store, f"FROM {view} ORDER BY ALL")
            assert found.rows == true or file.name in str(asked.left_out), f"bit {bit} of byte {place}"
        except AnalyticsError as error:
            assert re.fullmatch(f".*{file.name}.*", str(error)), f"bit {bit} of byte {place}"
            told += 1
    assert told > FLIPS / 2
    file.write_bytes(whole)
    assert ask(store, f"FROM {view} ORDER BY ALL")[0].rows == true


def test_a_damaged_file_stops_no_question_that_does_not_read_it(store: Store) -> None:
    path = on_disk(store.decoded("d1")) / "drive.parquet"
    ask(store, "FROM sessions")
    path.write_bytes(path.read_bytes()[:-20] + bytes(8) + path.read_bytes()[-12:])
    assert ask(store, "SELECT count(*) FROM sessions")[0].rows == [(3,)]
    assert ask(store, "SELECT max(residual_K) FROM residuals")[0].rows == [(3.0,)]


@pytest.mark.parametrize("brackets", [20_000, LONGEST])
def test_a_query_of_brackets_is_refused(connection: duckdb.DuckDBPyConnection, brackets: int) -> None:
    with pytest.raises(AnalyticsError) as caught:
        run(connection, "SELECT " + "(" * brackets + "1" + ")" * brackets)
    assert "\n" not in str(caught.value)


SORTED = "SELECT sum(abs(b - a)) > 0 FROM (SELECT a, lead(a) OVER (ORDER BY hash(a)) AS b FROM range(2000000) AS r(a))"


def test_what_is_put_in_order_may_be_larger_than_the_memory(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warehouse, "MEMORY", "60MiB")
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    with warehouse.refresh(store) as opened:
        run(opened.connection, "FROM sessions")
        assert not list(place.iterdir()), "nothing is written that needs not be"
        assert run(opened.connection, SORTED).rows == [(True,)]
        assert [made.name.startswith(warehouse.SPILLING) for made in place.iterdir()] == [True]
    assert not list(place.iterdir())
    monkeypatch.setattr(warehouse, "SPILLED", "1MiB")
    with warehouse.refresh(store) as opened, pytest.raises(QueryError, match=r"needs more memory than .* select fewer"):
        run(opened.connection, SORTED)


def test_too_little_memory_is_one_line(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warehouse, "MEMORY", "40MiB")
    with (
        warehouse.refresh(store) as opened,
        pytest.raises(QueryError, match=r"needs more memory than .* select fewer rows or columns"),
    ):
        run(opened.connection, "SELECT list(a) FROM range(30000000) AS r(a)")


def test_a_question_ends_without_notes_of_files(store: Store) -> None:
    """Where DuckDB takes them as it closes files that it had put on disk, it ends the process: about every tenth time
    after too little memory."""
    takes_notes = []

    class Connection:
        def __init__(self, true: duckdb.DuckDBPyConnection) -> None:
            self.true = true

        def __getattr__(self, name: str) -> object:
            return getattr(self.true, name)

        def note(self) -> None:
            takes_notes.extend(self.true.execute("SELECT current_setting('enable_logging')").fetchall())

        def close(self) -> None:
            self.note()
            self.true.close()

    opened = warehouse.refresh(store)
    connection = Connection(opened.connection)
    with replace(opened, connection=connection):  # type: ignore[arg-type]
        connection.note()
    assert takes_notes == [(True,), (False,)]


def test_a_limit_says_that_there_is_more(connection: duckdb.DuckDBPyConnection) -> None:
    assert [len(run(connection, "FROM sessions", limit=n).rows) for n in (2, 3, 4)] == [2, 3, 3]
    assert [run(connection, "FROM sessions", limit=n).more for n in (2, 3, 4)] == [True, False, False]


@pytest.mark.parametrize(
    "sql",
    [
        "SELECT count(*) FROM range(100000000) a, range(100000) b WHERE a.range * b.range = 7",
        "FROM range(100000000000)",
    ],
)
def test_a_query_that_takes_too_long_is_stopped_with_the_limit_named(
    connection: duckdb.DuckDBPyConnection, sql: str
) -> None:
    started = time.monotonic()
    with pytest.raises(QueryError, match=r"took longer than the 0\.5 s that a query gets: .* --seconds"):
        run(connection, sql, seconds=0.5)
    assert time.monotonic() - started < 20
    assert run(connection, "FROM sessions", seconds=60).rows, "the connection is as good as before"


def test_no_more_rows_are_made_than_are_given(connection: duckdb.DuckDBPyConnection) -> None:
    result = run(connection, "FROM range(100000000000)", limit=25_000, seconds=60)
    assert len(result.rows) == 25_000
    assert result.more


def test_columns_of_the_same_name_are_told_apart(connection: duckdb.DuckDBPyConnection) -> None:
    result = run(connection, "SELECT 1 AS a, 'x' AS a, 2 AS a_2")
    assert result.columns == ("a", "a_3", "a_2")
    assert result.types == ("INTEGER", "VARCHAR", "INTEGER")


@pytest.mark.parametrize("sql", ["DESCRIBE cycles", "desc Cycles;", 'describe "cycles"'])
def test_describe_says_what_the_columns_of_a_view_mean(connection: duckdb.DuckDBPyConnection, sql: str) -> None:
    result = run(connection, sql)
    assert result.columns == ("column_name", "column_type", "comment")
    assert ("highest_degC", "DOUBLE", "Highest temperature of that channel in degC") in result.rows
