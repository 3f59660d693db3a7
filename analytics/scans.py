"""Views over the Parquet files of a store: samples, temperatures, residuals, and the latest assessment of ageing.

They are `base.values` (of files with many sessions `base.values_of_many`), `base.temperatures`, `base.residuals` and
`base.ageing_...`. Each is a UNION of branches. A branch reads one column (a channel, a node) of all files that have
the same columns; a join on the file's path says which session a row is of. Measured on 250 files (50 sessions of 5
groups with 6 channels, 30 million values): a query that names a session and a channel takes 13 ms, one channel of all
sessions 70 ms. DuckDB drops the branches whose constant channel, quantity or node does not fit, reads only the column
left, and skips the files that the join leaves out. The two obvious designs lose: a branch for each file opens all of
them to bind (300 ms and 1,000 ms), and UNPIVOT reads every column of the group (40 ms and 500 ms). What grows is the
number of distinct columns: about 1 ms a query for each at 200 files.
"""

from __future__ import annotations

import contextlib
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq

from analytics.columns import AGEING, RESIDUALS, TEMPERATURES, VALUES
from analytics.errors import WarehouseError
from analytics.reached import at
from ingest.facts.durable import sha256_of

if TYPE_CHECKING:
    from ingest.facts.bucket import Bucket

Kind = TypeVar("Kind", bound=Hashable)
Schema = tuple[tuple[str, str], ...]  # (name, type) of each column, in order
Named = tuple[str, str, str, str | None]  # a file: its path, what it holds, what brings it back, its SHA-256
Schemas = Mapping[str, Schema]  # of each file that a view reads

FILE = "whyhot file"  # name of the scan's column with the path: no signal is called so
SUFFIX = "_degC"
READ = ["temperatures", "residuals", *AGEING]  # kinds of artefacts
FILES = """
SELECT file, 'samples', 'whyhot rebuild', sha256 FROM base.groups
UNION SELECT file, kind, again, sha256 FROM base.artefacts WHERE kind IN (SELECT unnest(?)) ORDER BY ALL
"""
OPENED = "SELECT DISTINCT path FROM duckdb_logs_parsed('FileSystem') WHERE fs = 'LocalFileSystem'"
MANY = 64  # sessions that a file may hold for each of its rows to be held against all of them


def named(connection: duckdb.DuckDBPyConnection) -> list[Named]:
    """The Parquet files that the views read; their SHA-256 is None where no event says it."""
    return connection.execute(FILES, [READ]).fetchall()


def readable(connection: duckdb.DuckDBPyConnection, bucket: Bucket | None = None) -> Schemas:
    """The schema of each Parquet file that a view reads. A file that is missing or cannot be read is taken out of the
    tables of groups and artefacts, and `base.left_out` says why. `bucket`: where the files lie."""
    found: dict[str, Schema] = {}
    alike: dict[Schema, Schema] = {}  # kept once
    lost = []
    for file, kind, again, _ in named(connection):
        try:
            schema = _schema(bucket, file)
            found[file] = alike.setdefault(schema, schema)
        except WarehouseError as error:
            lost.append((file, kind, str(error), again))
    if lost:
        connection.executemany("INSERT INTO base.left_out VALUES (?, ?, ?, ?)", lost)
        for table in ("groups", "artefacts"):
            connection.execute(f"DELETE FROM base.{table} WHERE file IN (SELECT file FROM base.left_out)")
    return found


def is_readable(bucket: Bucket | None, file: str) -> bool:
    """Whether a Parquet file is there and begins as one."""
    try:
        return bool(_schema(bucket, file))
    except WarehouseError:
        return False


def watch(connection: duckdb.DuckDBPyConnection) -> None:
    """Let `connection` note from here on which files it opens, for `check`: its notes are in memory."""
    connection.execute("CALL enable_logging('FileSystem')")


def unwatch(connection: duckdb.DuckDBPyConnection) -> None:
    """Let it note no more. Before it is closed: DuckDB 2.0 would note that it closes its temporary files where its
    notes are no more, and so end the process."""
    with contextlib.suppress(duckdb.Error):  # there are errors after which DuckDB answers nothing more
        connection.execute("CALL disable_logging()")


def check(connection: duckdb.DuckDBPyConnection, files: Iterable[Named]) -> None:
    """Of `files`, hold those on this disk that `connection` has opened since it was last asked against their SHA-256:
    DuckDB checks no CRC of a page, and a footer has none. Raises as `check_all`."""
    opened = {path for (path,) in connection.execute(OPENED).fetchall()}
    connection.execute("CALL truncate_duckdb_logs()")
    check_all(one for one in files if one[0] in opened)


def check_all(files: Iterable[Named]) -> None:
    """Hold `files`, all on this disk, against their SHA-256. Raises WarehouseError for the first that is another."""
    for file, kind, again, sha256 in files:
        if sha256 and not _is_whole(Path(file), sha256):
            raise WarehouseError(f"{file}: is damaged: no answer has these {kind}; next: {again}")


def create(connection: duckdb.DuckDBPyConnection, schemas: Schemas) -> None:
    """Make the views from the tables that `base` has of groups, channels, doubled values and artefacts."""
    shared = "FROM base.segments SELECT file GROUP BY file HAVING count(*) > ?"
    of_many = {file for (file,) in connection.execute(shared, [MANY]).fetchall()}
    _view(connection, "values", VALUES, _values(connection, schemas, lambda file: file not in of_many))
    _view(connection, "values_of_many", VALUES, _values(connection, schemas, lambda file: file in of_many))
    _view(connection, "temperatures", TEMPERATURES, _temperatures(connection, schemas))
    _view(connection, "residuals", RESIDUALS, _tables(connection, schemas, "residuals", RESIDUALS))
    for kind, columns in AGEING.items():
        _view(connection, kind, columns, _tables(connection, schemas, kind, columns))


def text(value: str | None) -> str:
    """`value` as a literal of SQL."""
    return "NULL" if value is None else "'" + value.replace("'", "''") + "'"


def statement(part: str) -> str:
    """The SQL of a part of the warehouse: the file of `analytics/sql` of this name."""
    return resources.files("analytics").joinpath("sql", f"{part}.sql").read_text(encoding="utf-8")


def name(value: str) -> str:
    """`value` as an identifier of SQL."""
    return '"' + value.replace('"', '""') + '"'


def _values(connection: duckdb.DuckDBPyConnection, schemas: Schemas, taken: Callable[[str], bool]) -> Iterable[str]:
    """One branch for each channel of each kind of file that is taken: same columns, same channels."""
    twice = set(connection.execute("SELECT DISTINCT file FROM base.doubled").fetchall())
    channels: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for file, *channel in connection.execute(
        "SELECT g.file, c.column_name, c.channel, c.quantity, c.unit, c.node, c.region "
        "FROM base.groups AS g JOIN base.channels AS c ON c.decode = g.decode AND c.group_name = g.group_name "
        "ORDER BY g.file, c.place"
    ).fetchall():
        if taken(file):
            channels[file].append(tuple(channel))
    alike = _alike({file: (schemas[file], tuple(of), (file,) in twice) for file, of in channels.items()})
    for (schema, listed, some), files in alike.items():
        columns, kinds = column_names(schema), dict(schema)
        for column, *constants in listed:
            if "string" in kinds[column]:
                continue
            fixed = ", ".join(text(constant) for constant in constants)
            of_it = f"SELECT file, record FROM base.doubled WHERE channel IS NULL OR channel = {text(constants[0])}"
            doubled = f"({name(FILE)}, record) IN ({of_it})" if some else "false"
            yield _branch(files, f"{fixed}, t_ns, record, {name(columns[column])}, {doubled}")


def _temperatures(connection: duckdb.DuckDBPyConnection, schemas: Schemas) -> Iterable[str]:
    """One branch for each node of each kind of file."""
    for schema, files in _alike({file: schemas[file] for file in _artefacts(connection, "temperatures")}).items():
        for column, actual in column_names(schema).items():
            if column.endswith(SUFFIX):
                yield _branch(files, f"{text(column.removesuffix(SUFFIX))}, t_ns, {name(actual)}")


def _tables(
    connection: duckdb.DuckDBPyConnection, schemas: Schemas, kind: str, columns: Mapping[str, str]
) -> Iterable[str]:
    """One branch for each kind of file; a column that it lacks is null, and so is a number that is not finite."""
    for schema, files in _alike({file: schemas[file] for file in _artefacts(connection, kind)}).items():
        there = dict(schema)
        listed = (_or_null(column, said) if column in there else "NULL" for column, said in columns.items())
        yield _branch(files, ", ".join(listed))


def _or_null(column: str, kind: str) -> str:
    called = name(column)
    return f"CASE WHEN isfinite({called}) THEN {called} END" if kind == "DOUBLE" else called


def _artefacts(connection: duckdb.DuckDBPyConnection, kind: str) -> list[str]:
    found = connection.execute(
        "SELECT DISTINCT file FROM base.artefacts WHERE kind = ? ORDER BY file", [kind]
    ).fetchall()
    return [file for (file,) in found]


def _branch(files: Sequence[str], columns: str) -> str:
    listed = ", ".join(text(file) for file in files)
    return f"SELECT {name(FILE)}, {columns} FROM read_parquet([{listed}], filename = {text(FILE)})"


def _view(
    connection: duckdb.DuckDBPyConnection, view: str, columns: Mapping[str, str], branches: Iterable[str]
) -> None:
    """`view` over all branches: path, then `columns` with their types; without branches it is empty."""
    nothing = "SELECT NULL" + ", NULL" * len(columns) + " WHERE false"
    casts = ", ".join(f"{name(column)}::{kind} AS {name(column)}" for column, kind in columns.items())
    declared = ", ".join(name(column) for column in ("file", *columns))
    union = "\nUNION ALL\n".join(branches) or nothing
    connection.execute(
        f"CREATE VIEW base.{view} AS SELECT file::VARCHAR AS file, {casts} FROM (\n{union}\n) AS f({declared})"
    )


def _is_whole(file: Path, sha256: str) -> bool:
    try:
        return sha256_of(file) == sha256
    except FileNotFoundError:  # what was asked of it has failed
        return True
    except OSError:
        return False


def _schema(bucket: Bucket | None, file: str) -> Schema:
    """The columns of a Parquet file. Raises WarehouseError where it is missing or damaged."""
    try:
        found = pq.read_schema(at(bucket, file).parts() if bucket else file)
    except FileNotFoundError:
        raise WarehouseError(f"{file}: is missing") from None
    except (pa.ArrowException, OSError) as error:
        why = " ".join(str(error).split())
        raise WarehouseError(f"{file}: cannot be read as Parquet ({why[:120]})") from None
    return tuple((field.name, str(field.type)) for field in found)


def column_names(schema: Schema) -> dict[str, str]:
    """Column -> what DuckDB calls it: it knows no upper and lower case, and numbers the second of two alike."""
    taken: set[str] = set()
    actual = {}
    for column, _ in schema:
        called, number = column, 0
        while called.casefold() in taken:
            number += 1
            called = f"{column}_{number}"
        taken.add(called.casefold())
        actual[column] = called
    return actual


def _alike(by_file: Mapping[str, Kind]) -> dict[Kind, list[str]]:
    """Kind of file -> the files of that kind."""
    found: dict[Kind, list[str]] = defaultdict(list)
    for file, kind in by_file.items():
        found[kind].append(file)
    return found
