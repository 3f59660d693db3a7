"""The DuckDB warehouse: ledger and Parquet as views for SQL. A cache that is thrown away and made again at will.

`warehouse.duckdb` is never the record of anything. It holds the facts as small tables, what logs say of insulation
(`analytics.partitions`) and, over the Parquet files of the store, views by absolute path; it says in `base.built_from`
what it was made from, and is made anew where that has changed.
"""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import tempfile
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Self
from uuid import uuid4

import duckdb
import pyarrow as pa

from analytics import doubled, partitions, scans, tables
from analytics.errors import WarehouseError
from analytics.reached import reach
from ingest.facts.alias import is_misread
from ingest.facts.durable import scratch
from ingest.facts.facts import fold

if TYPE_CHECKING:
    from ingest.facts.bucket import Bucket
    from ingest.facts.store import Store

FILE = "warehouse.duckdb"
SAMPLES = ("sessions", "channels", "files", "samples")  # what is read from logs is asked of these views
VIEWS = (
    *SAMPLES,
    *("runs", "residuals", "temperatures"),
    *("cycles", "dc_checks", "insulation_checks", "inspections"),
    *("hours_by_temperature", "oven_cycles", "conductivity_by_cycle", "life_used", "fleet_health", "changepoints"),
    *("batches", "events"),
)
MACROS = ("resample", "equivalent_hours", "equivalent_hours_10K", "equivalent_hours_of")
BUILDING = "warehouse-"  # begins the names of folders in which one is being built
BLOCK = "16384"  # bytes, the least: the tables are small, and each takes a block at least
MEMORY = "2GiB"  # of a query; what cannot be put on disk meanwhile and needs more is refused with a line
BUILD_MEMORY = "1536MiB"  # while it is built: the facts of a fleet are in memory beside it
AT_ONCE = 20_000  # rows of a table
SPILLED = "20GiB"  # on disk, at most
SPILLING = "whyhot-sql-"  # begins the name of the folder there
THREADS = 4
HOUR_S = 3600.0


@dataclass(frozen=True)
class Warehouse:
    """An open warehouse, confined to reading this store. `notes`: what a person should know of it, a line each;
    `left_out`: that Parquet files are missing or cannot be read, so that no view has what they hold, in one line."""

    connection: duckdb.DuckDBPyConnection
    notes: tuple[str, ...] = ()
    left_out: str | None = None

    def needs(self, kind: str) -> None:
        """Raises WarehouseError where files of a kind ("samples") are left out, for who may not do without any."""
        if says := _left_out(self.connection, kind):
            raise WarehouseError(says)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Raises WarehouseError where a file that was read is damaged: then no answer holds that it had part in."""
        with contextlib.ExitStack() as at_the_end:
            at_the_end.callback(self.connection.close)
            at_the_end.callback(scans.unwatch, self.connection)
            if error is None:
                scans.check(self.connection, scans.named(self.connection))
            elif isinstance(error, Exception):
                with contextlib.suppress(duckdb.Error):  # there are errors after which DuckDB answers nothing more
                    scans.check(self.connection, scans.named(self.connection))


class _Stale(Exception):
    """The warehouse's file was built from other facts or files, or by other code, than there are now."""


class _Broken(Exception):
    """The file is not as it was built."""


def build(store: Store, target: Path, source: Mapping[str, str]) -> None:
    """Make the warehouse of the facts of now at `target`: whole or not at all.

    `source`: what it depends on, taken before the facts, so that an event that comes meanwhile makes the next one
    stale. Raises WarehouseError where the folder cannot be written.
    """
    rows = _rows(store)
    try:
        _sweep(target.parent, BUILDING)
        with scratch(target.parent, BUILDING) as folder:
            made = folder / target.name
            with _database(str(made), default_block_size=BLOCK, memory_limit=BUILD_MEMORY) as connection:
                kept = partitions.PartitionFolders(target.parent / partitions.FOLDER, folder)
                fill(connection, rows, source, store.bucket, kept)
                connection.execute("CHECKPOINT")  # what fails only when it is closed, DuckDB does not say
            made.replace(target)
    except (OSError, duckdb.Error) as error:
        raise WarehouseError(
            f"{target}: cannot be made ({_line(error)}): see that the folder may be written and the disk has space"
        ) from None


def refresh(store: Store, as_of: str | None = None, anew: bool = False, watched: bool = True) -> Warehouse:
    """The warehouse of the store as it is now; made anew where the ledger, this package or DuckDB has changed, a file
    that was left out is there again, or with `anew`.

    With `as_of` (event number or ISO 8601 time), in a folder whose name DuckDB misreads, or where it would have to be
    made in a folder that may only be read, it is made in memory and no file is written. A file that is not whole is
    moved aside, made again and told in `notes`. `watched`: files are held against their SHA-256 as they are read.
    Raises WarehouseError as `build`, LedgerError for a bad `as_of`.
    """
    if as_of is not None or is_misread(store.folder.resolve()):
        return _in_memory(store, as_of, watched)
    path = store.folder.absolute() / FILE
    source = _source(store)
    broken: _Broken | None = None
    if not anew and (path.exists() or _log(path).exists()):
        try:
            return _warehouse(_open(store, path, watched, source))
        except _Stale:
            pass
        except _Broken as error:
            broken = error
    if not os.access(store.folder, os.W_OK):
        return _in_memory(store, None, watched)
    notes = (_set_aside(path, str(broken)),) if broken else ()
    build(store, path, source)
    try:
        return _warehouse(_open(store, path, watched, source), *notes)
    except _Stale:  # another version put its own there meanwhile, or another command one of newer facts
        return _in_memory(store, None, watched)
    except _Broken as error:
        raise WarehouseError(f"{path}: was made and cannot be read ({error}): see that the disk has space") from None


def connect(folder: str | Path, as_of: str | None = None) -> duckdb.DuckDBPyConnection:
    """A connection to the warehouse of the store in `folder`, for notebooks; `refresh` says what it is.

    It cannot leave the store: no other file, no network, no extension, no setting. `analytics.query` also refuses
    statements that write, this raw connection leaves them to DuckDB. What `refresh` notes comes as a warning. All files
    are held against their SHA-256 here, as no one is asked before an answer is shown; those in a bucket are not.
    Raises as `refresh`, WarehouseError where a file is damaged.
    """
    from ingest.facts.store import Store

    with Store.open(Path(folder)) as store, contextlib.ExitStack() as unless_done:
        warehouse = refresh(store, as_of, watched=False)
        unless_done.callback(warehouse.connection.close)
        if not store.bucket:
            scans.check_all(scans.named(warehouse.connection))
        unless_done.pop_all()
    for note in filter(None, (*warehouse.notes, warehouse.left_out)):
        warnings.warn(note, stacklevel=2)
    return warehouse.connection


def fill(
    connection: duckdb.DuckDBPyConnection,
    rows: dict[str, tables.Rows],
    source: Mapping[str, str] | None = None,
    bucket: Bucket | None = None,
    kept: partitions.PartitionFolders | None = None,
) -> None:
    """Make all tables, views and macros in an empty database, from the rows of `analytics.tables`, which are taken out
    of `rows`: the facts behind them take no memory while logs are read. `bucket`: where the Parquet files lie that they
    name; `kept`: where what is read from logs is kept (`analytics.partitions`), by the `source` that says
    which code read it."""
    if bucket:
        reach(connection, bucket)
    connection.begin()  # one transaction: a commit for each statement takes ten times as long
    connection.execute(scans.statement("tables"))
    built_from = [{"what": what, "value": value} for what, value in (source or {}).items()]
    rows["built_from"] = built_from
    while rows:
        table, content = rows.popitem()
        left = iter(content)
        while some := list(islice(left, AT_ONCE)):
            connection.register("new_rows", pa.Table.from_pylist(some))
            connection.execute(f"INSERT INTO base.{table} BY NAME SELECT * FROM new_rows")
            connection.unregister("new_rows")
    del content, left
    schemas = scans.readable(connection, bucket)
    connection.execute(scans.statement("segments"))
    named = scans.named(connection)
    scans.watch(connection)
    try:
        doubled.find(connection, schemas)
        scans.create(connection, schemas)
        for part in SAMPLES:
            connection.execute(scans.statement(part))
        code = " ".join((source or {}).get(what, "") for what in ("analytics", "duckdb"))
        parts = partitions.create(connection, kept.folder if kept else None, code)
        scans.check(connection, named)
    except Exception:  # damage shows in many ways
        connection.rollback()  # else nothing more can be asked
        scans.check(connection, named)
        raise
    finally:
        scans.unwatch(connection)
    if kept:
        partitions.keep(connection, kept, parts)
    for part in (*VIEWS[len(SAMPLES) :], *MACROS):
        connection.execute(scans.statement(part))
    connection.commit()


def confine(connection: duckdb.DuckDBPyConnection, watched: bool = True) -> None:
    """Let `connection` read the Parquet files of its views and nothing else, for good; `watched`: it notes which.

    No other file, no network, no extension, no Python variable as a table; memory and threads are limited, and no
    setting can be changed afterwards. What a sort or a window needs beyond the memory lies in a folder of its own
    where the system keeps temporary files, made when it is needed and gone when the connection closes; what questions
    that were killed left there goes with the next one.
    """
    if watched:
        scans.watch(connection)
    temporary = Path(tempfile.gettempdir()).resolve()
    _sweep(temporary, SPILLING)
    spill = temporary / f"{SPILLING}{uuid4().hex}"
    found = connection.execute("SELECT file FROM base.groups UNION SELECT file FROM base.artefacts").fetchall()
    paths = ", ".join(scans.text(file) for (file,) in found)
    for setting in (
        f"temp_directory = {scans.text(str(spill))}",
        f"max_temp_directory_size = '{SPILLED}'",
        f"allowed_paths = [{paths}]",
        "enable_external_access = false",
        "autoinstall_known_extensions = false",
        "autoload_known_extensions = false",
        "python_enable_replacements = false",
        f"memory_limit = '{MEMORY}'",
        f"threads = {min(THREADS, os.cpu_count() or 1)}",
        "allowed_configs = ['enable_logging']",  # so that `scans.unwatch` can
        "lock_configuration = true",
    ):
        connection.execute(f"SET {setting}")


def digest(connection: duckdb.DuckDBPyConnection) -> dict[str, str]:
    """View -> number of its rows and a sum over their hashes: equal for equal rows in any order.

    Comparable within one version of DuckDB only.
    """
    return {view: _digest(connection, view) for view in VIEWS}


def _digest(connection: duckdb.DuckDBPyConnection, table: str) -> str:
    asked = f"SELECT count(*), coalesce(sum(hash(t)::HUGEINT), 0) FROM {table} AS t"
    ((count, total),) = connection.execute(asked).fetchall()
    return f"{count}-{total:x}"


def _rows(store: Store) -> dict[str, tables.Rows]:
    recorded = store.ledger.events()
    return tables.rows(store, fold(recorded), recorded)


def _database(path: str, **settings: str) -> duckdb.DuckDBPyConnection:
    """A database that prints no progress among what a verb answers."""
    connection = duckdb.connect(path, config=dict(settings))
    with contextlib.suppress(duckdb.InvalidInputException):  # a Jupyter without ipywidgets, which draws none anyway
        connection.execute("SET enable_progress_bar = false")
    return connection


def _sweep(folder: Path, begins: str) -> None:
    """Remove what was left behind in `folder` by builds or questions that were killed: folders in which nothing was
    written for an hour. (Builds lie not in `tmp/`, which a writer empties under a reader's feet.)"""
    for old in folder.glob(f"{begins}*"):
        with contextlib.suppress(OSError):  # another's, or gone meanwhile
            if time.time() - max(one.stat().st_mtime for one in (old, *old.iterdir())) > HOUR_S:
                shutil.rmtree(old)


def _in_memory(store: Store, as_of: str | None, watched: bool) -> Warehouse:
    recorded = store.ledger.events(as_of=as_of)
    facts = fold(recorded)
    with contextlib.ExitStack() as unless_done:
        connection = unless_done.enter_context(_database(":memory:"))
        fill(connection, tables.rows(store, facts, recorded), bucket=store.bucket)
        confine(connection, watched)
        unless_done.pop_all()
    gone = [f"{why}: its samples are in no answer" for raw, why in store.forgotten.logs.items() if raw in facts.files]
    return _warehouse(connection, *gone)


def _warehouse(connection: duckdb.DuckDBPyConnection, *notes: str) -> Warehouse:
    return Warehouse(connection, notes, _left_out(connection))


def _left_out(connection: duckdb.DuckDBPyConnection, kind: str | None = None) -> str | None:
    """Which file is left out, how many more, and what brings them back; None where none is."""
    asked = "SELECT says, again FROM base.left_out WHERE kind = coalesce(?, kind) ORDER BY again, file"
    lost = connection.execute(asked, [kind]).fetchall()
    if not lost:
        return None
    (says, again), *more = lost
    many = f", and {len(more):,} more" if more else ""
    others = "; `whyhot verify` says of all" if {again} != {one for _, one in lost} else ""
    return f"{says}{many}: no answer has what was in it; next: {again}{others}"


def _open(
    store: Store, path: Path, watched: bool, source: Mapping[str, str] | None = None
) -> duckdb.DuckDBPyConnection:
    """The file at `path`, attached read-only to a database of its own in memory, read through and confined.

    Attached and not opened: DuckDB would give a second opener in this process the settings, and after a rename the
    content, of the first. Raises _Stale where it was not built from `source`, _Broken where it is not whole.
    """
    if _log(path).exists():
        raise _Broken("another program wrote to it")
    try:
        with contextlib.ExitStack() as unless_done:
            connection = unless_done.enter_context(_database(":memory:"))
            if store.bucket:
                reach(connection, store.bucket)
            connection.execute(f"ATTACH {scans.text(str(path))} AS warehouse (READ_ONLY)")
            connection.execute("USE warehouse")
            if source is not None and dict(connection.execute("FROM base.built_from").fetchall()) != source:
                raise _Stale
            lost = connection.execute("SELECT file FROM base.left_out").fetchall()
            if source is not None and any(scans.is_readable(store.bucket, file) for (file,) in lost):
                raise _Stale
            base = connection.execute("SELECT table_name FROM duckdb_tables() WHERE schema_name = 'base'").fetchall()
            for (table,) in base:
                _digest(connection, f"base.{table}")  # reading a block is what checks it
            confine(connection, watched)
            unless_done.pop_all()
    except duckdb.Error as error:
        raise _Broken(_line(error)) from None
    return connection


def _set_aside(path: Path, why: str) -> str:
    """Move a broken file and its log away. Returns the note of it."""
    taken = [int(old.name.rpartition("-")[2]) for old in path.parent.glob(f"{FILE}.broken-*[0-9]")]
    aside = path.with_name(f"{FILE}.broken-{max(taken, default=0) + 1}")
    for old, new in ((path, aside), (_log(path), _log(aside))):
        with contextlib.suppress(FileNotFoundError):  # another process was first, or there is no log
            old.replace(new)
    return f"{path}: was not whole ({why}): made again from the ledger, the old one kept as {aside.name}"


def _log(path: Path) -> Path:
    """Where DuckDB keeps what was written to `path` and not yet merged. After a build there is none."""
    return path.with_name(f"{path.name}.wal")


def _source(store: Store) -> dict[str, str]:
    """What a warehouse of this store is made from, name -> value: it is stale where one of these has changed."""
    head = store.ledger.head()
    return {
        "ledger": f"{head.position} {head.root}",
        "analytics": _own_hash(),
        "duckdb": duckdb.__version__,
        "files": str(store.files.absolute()),
    }


@functools.cache
def _own_hash() -> str:
    parts = [*files("analytics").iterdir(), *files("analytics").joinpath("sql").iterdir()]
    texts = [part.read_text(encoding="utf-8") for part in parts if part.name.endswith((".py", ".sql"))]
    return sha256("".join(sorted(texts)).encode()).hexdigest()


def _line(error: BaseException) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__
