"""Which values of `samples` are said a second time: `base.doubled`, as file, record and channel (null: all of them).

Within a file these are values of a channel that a record before has at the same stamp of the session: specimens of a
table have sessions of their own. Between files of a session that overlap in time (a log that grew and came again, two
loggers of one channel, one log in two formats) they are values at the same stamp, or while the other file goes on:
which of both counts `ingest.catalogue.at_once` says, of equals the one that begins first. Files are read only where
they share a channel, and only where they overlap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from analytics.scans import Schema, Schemas, column_names, name, text
from ingest.catalogue.at_once import GAP_MEDIANS, LOGGED_NS, in_turn

if TYPE_CHECKING:
    import duckdb

SESSION = "whyhot session"  # no signal is called so
# Each file that repeats a stamp, and (channel, column) of what it has.
REPEATS = """
SELECT g.file, list((c.channel, c.column_name) ORDER BY c.place)
FROM base.groups AS g JOIN base.channels AS c ON c.decode = g.decode AND c.group_name = g.group_name
WHERE g.doubled GROUP BY g.file ORDER BY g.file
"""
# Two files, the one that begins first before the other; from when to when; (channel, its column in each) of what both
# have; and all columns of each.
OVERLAPS = """
WITH held AS (SELECT DISTINCT session, decode FROM base.session_files)
SELECT
    fa.file, fb.file, first_ns, last_ns, list((a.channel, a.column_name, b.column_name) ORDER BY a.place),
    (
        SELECT list(c.column_name ORDER BY c.place) FROM base.channels AS c
        WHERE c.decode = before AND c.group_name = fa.group_name
    ),
    (
        SELECT list(c.column_name ORDER BY c.place) FROM base.channels AS c
        WHERE c.decode = after AND c.group_name = fb.group_name
    )
FROM (
    SELECT DISTINCT
        x.decode AS before, y.decode AS after, y.start_ns AS first_ns, least(x.end_ns, y.end_ns) AS last_ns
    FROM held AS sx
    JOIN held AS sy ON sy.session = sx.session AND sy.decode <> sx.decode
    JOIN base.decodes AS x ON x.decode = sx.decode
    JOIN base.decodes AS y ON y.decode = sy.decode
    WHERE (x.start_ns, -x.end_ns, x.raw) < (y.start_ns, -y.end_ns, y.raw) AND y.start_ns <= x.end_ns
)
JOIN base.channels AS a ON a.decode = before
JOIN base.channels AS b ON b.decode = after AND b.channel = a.channel
JOIN base.groups AS fa ON fa.decode = before AND fa.group_name = a.group_name
JOIN base.groups AS fb ON fb.decode = after AND fb.group_name = b.group_name
GROUP BY fa.file, fb.file, first_ns, last_ns, before, after, fa.group_name, fb.group_name
ORDER BY fa.file, fb.file
"""


def find(connection: duckdb.DuckDBPyConnection, schemas: Schemas) -> None:
    """Fill `base.doubled`."""
    for file, own in connection.execute(REPEATS).fetchall():
        b = _has(schemas[file], "b")
        earlier = {column: f"coalesce(bool_or({b[column]}) OVER earlier, false)" for _, column in own if column in b}
        connection.execute(
            f"INSERT INTO base.doubled SELECT {text(file)}, record, unnest(twice) "
            f"FROM (SELECT b.record, {_twice(b, earlier, own)} AS twice FROM ({_scan(file)}) AS b "
            f"WINDOW here AS (PARTITION BY {name(SESSION)}, t_ns ORDER BY record), earlier AS ("
            f"PARTITION BY {name(SESSION)}, t_ns ORDER BY record ROWS BETWEEN UNBOUNDED PRECEDING AND 1 PRECEDING) "
            "QUALIFY row_number() OVER here > 1)"
        )
    measures: dict[str, tuple[float, float]] = {}  # file -> its length and the median interval of its stamps [ns]
    for one, other, first_ns, last_ns, shared, of_one, of_other in connection.execute(OVERLAPS).fetchall():
        for file in {one, other} - measures.keys():
            measures[file] = _measures(connection, file)
        lengths_ns, steps_ns = zip(measures[one], measures[other], strict=True)
        if in_turn(lengths_ns, steps_ns)[0] == 0:
            _beside(connection, schemas, (one, other), steps_ns, (first_ns, last_ns), shared, of_other)
        else:
            turned = [(channel, second, first) for channel, first, second in shared]
            _beside(connection, schemas, (other, one), steps_ns[::-1], (first_ns, last_ns), turned, of_one)


def _beside(
    connection: duckdb.DuckDBPyConnection,
    schemas: Schemas,
    files: tuple[str, str],
    steps_ns: tuple[float, float],
    span_ns: tuple[int, int],
    shared: Sequence[tuple[str, str, str]],
    columns: Sequence[str],
) -> None:
    """Add what the second of two files says beside the first, with the median interval of each; `columns`: all of the
    second."""
    counts, file = files
    a, b = _has(schemas[counts], "a"), _has(schemas[file], "b")
    too = {other: a[one] for _, one, other in shared if one in a and other in b}
    if not too:
        return
    channel = {other: channel for channel, _, other in shared}
    within = f"v.t_ns BETWEEN {span_ns[0]} AND {span_ns[1]}"
    gap_ns = GAP_MEDIANS * steps_ns[0] if steps_ns[1] <= LOGGED_NS else 0
    session = name(SESSION)
    connection.execute(
        f"WITH first AS MATERIALIZED ({_scan(counts)} AND {within}), second AS ({_scan(file)} AND {within}), "
        f"stamps AS (SELECT {session}, t_ns, lead(t_ns) OVER (PARTITION BY {session} ORDER BY t_ns) AS next_ns "
        f"FROM (SELECT DISTINCT {session}, t_ns FROM first)) "
        f"INSERT INTO base.doubled SELECT DISTINCT {text(file)}, b.record, "
        f"unnest({_twice(b, too, [(channel.get(column), column) for column in columns])}) "
        f"FROM second AS b ASOF JOIN stamps AS s ON b.{session} = s.{session} AND b.t_ns >= s.t_ns "
        f"JOIN first AS a ON a.{session} = s.{session} AND a.t_ns = s.t_ns "
        f"WHERE b.t_ns = s.t_ns OR s.next_ns - s.t_ns <= {gap_ns:.0f}"
    )


def _measures(connection: duckdb.DuckDBPyConnection, file: str) -> tuple[float, float]:
    """Length and median interval of the stamps of a file [ns]; the latter infinite with one of them."""
    session = name(SESSION)
    found = connection.execute(
        f"SELECT max(t_ns) - min(t_ns), median(step_ns) FROM (SELECT t_ns, t_ns - lag(t_ns) OVER ("
        f"PARTITION BY {session} ORDER BY t_ns) AS step_ns FROM (SELECT DISTINCT {session}, t_ns FROM ({_scan(file)})))"
    ).fetchone()
    length, step = found or (None, None)
    return float(length or 0), float("inf") if step is None else float(step)


def _twice(has: Mapping[str, str], too: Mapping[str, str], own: Sequence[tuple[str | None, str]]) -> str:
    """The list of channels of a row that are said already, in SQL; [NULL] where all are. Column -> whether the row
    `has` a value, and whether it is there `too`; `own`: channel and column of all that the row may have."""
    new = [f"{has[column]} AND NOT {too.get(column, 'false')}" for _, column in own if column in has]
    said = [(channel, column) for channel, column in own if column in too]
    twice = [f"CASE WHEN {has[column]} AND {too[column]} THEN {text(channel)} END" for channel, column in said]
    return f"CASE WHEN {' OR '.join(new) or 'false'} THEN list_distinct([{', '.join(twice)}]) ELSE [NULL] END"


def _has(columns: Schema, side: str) -> dict[str, str]:
    """The columns of numbers of a file -> whether a row of it, called `side`, has a value there."""
    called = column_names(columns)
    numbers = [column for column, kind in columns if "string" not in kind]
    return {column: f"coalesce(isfinite({side}.{name(called[column])}), false)" for column in numbers}


def _scan(file: str) -> str:
    """The rows of a file that are in a session, with the session of each."""
    return (
        f"SELECT s.session AS {name(SESSION)}, v.* FROM read_parquet({text(file)}) AS v ASOF JOIN "
        f"(SELECT session, first_record, last_record FROM base.segments WHERE file = {text(file)}) AS s "
        "ON v.record >= s.first_record WHERE v.record <= s.last_record"
    )
