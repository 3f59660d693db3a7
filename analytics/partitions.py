"""What logs say of insulation as Parquet, a file for each month of a group of motors: made once, and read from then on.

The files lie in the store's `warehouse/`, as `hours/motors=3/month=2026-05/<digest>-<SHA-256>.parquet`: hours at
temperature of a session (`hours`), the thermal resistance of a check (`measured_checks`), and what an electrical check
measured (`electrical_checks`). The digest is that of all on which the rows depend: the facts of the partition's
sessions, and the code; the SHA-256 is that of the file. So a file that is there and whole needs no look at its logs, a
new log makes those partitions anew that it falls into, and a rebuild from nothing makes the same files, byte for byte.

Other programs read them as they are (hive partitions); `cycles`, `dc_checks` and `insulation_checks` are views on them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from analytics.scans import statement
from ingest.facts.durable import write_file

if TYPE_CHECKING:
    import duckdb

FOLDER = "warehouse"
RECORDS = 4_000_000  # of logs that are read at once: some 100 bytes of memory each
ROWS = """
SELECT m.session, s.name AS session_name, s.kind, s.specimen, s.batch, s.absolute, s.start_ns, m.* EXCLUDE (session)
FROM base.{holds} AS m
JOIN base.parts AS p ON p.session = m.session AND p.holds = $holds AND p.motors = $motors AND p.month = $month
JOIN base.sessions AS s ON s.session = m.session
ORDER BY ALL
"""


class PartitionFolders(NamedTuple):
    """`folder`: where partitions lie; `work`: one on the same disk for files that are not whole yet, as what lies in
    `folder` and is none of theirs is removed by others that are at work."""

    folder: Path
    work: Path


@dataclass(frozen=True)
class Partition:
    """The rows of one table (`holds`) of a group of motors in a month; `digest` of all that they depend on."""

    holds: str
    motors: str
    month: str
    digest: str

    def place(self, folder: Path) -> Path:
        """Where it lies in the store's folder of partitions."""
        return folder / self.holds / f"motors={self.motors}" / f"month={self.month}"

    def held(self, folder: Path) -> tuple[Path, pa.Table] | None:
        """Its file and the rows in it, None where there is none that is whole."""
        for file in self.place(folder).glob(f"{self.digest}-*.parquet"):
            with suppress(FileNotFoundError):  # gone since: a version that needs others is at work too
                content = file.read_bytes()
                if file == self.named(folder, content):
                    return file, pq.read_table(pa.BufferReader(content))
        return None

    def named(self, folder: Path, content: bytes) -> Path:
        """The name of its file with this content."""
        return self.place(folder) / f"{self.digest}-{sha256(content).hexdigest()}.parquet"


def create(connection: duckdb.DuckDBPyConnection, folder: Path | None, code: str) -> dict[Partition, Path | None]:
    """Fill the tables of what logs say of insulation, from the partitions in `folder` and, where one is not there, from
    the logs. `folder`: None where nothing is kept; `code`: which code reads them. Returns the file of each partition,
    None where it has none."""
    connection.execute(statement("parts"))
    parts: dict[Partition, Path | None] = {}
    for part in _parts(connection, code):
        parts[part], rows = (part.held(folder) if folder else None) or (None, None)
        if rows is not None:
            _insert(connection, part.holds, rows)
    missing = [part for part, file in parts.items() if not file]
    for holds, some in groupby(missing, lambda part: part.holds):
        for sessions in _at_once(connection, list(some)):
            connection.execute("DELETE FROM base.asked")
            _insert(connection, "asked", sessions)
            connection.execute(f"INSERT INTO base.{holds} BY NAME {statement(holds)}")
    connection.execute("DELETE FROM base.asked")
    return parts


def keep(connection: duckdb.DuckDBPyConnection, to: PartitionFolders, parts: Mapping[Partition, Path | None]) -> None:
    """Write the partitions that have no file yet, and remove those of other facts or other code. Raises OSError where
    a folder cannot be written."""
    kept = {file or _write(connection, part, to) for part, file in parts.items()}
    for old in {file for file in to.folder.rglob("*") if file.is_file()} - kept:
        old.unlink(missing_ok=True)  # another process was first


def _parts(connection: duckdb.DuckDBPyConnection, code: str) -> list[Partition]:
    asked = (
        "SELECT holds, motors, month, sha256(concat(?::VARCHAR, string_agg(depends_on, ', ' ORDER BY session))) "
        "FROM base.parts GROUP BY holds, motors, month ORDER BY holds, motors, month"
    )
    return [Partition(*row) for row in connection.execute(asked, [code]).fetchall()]


def _at_once(connection: duckdb.DuckDBPyConnection, parts: Sequence[Partition]) -> Iterator[pa.Table]:
    """The sessions of some partitions of one table, so many at once that `RECORDS` are read, and one at least."""
    connection.register("missing", pa.Table.from_pylist([asdict(part) for part in parts]))
    asked = (
        "SELECT session, sum(records) OVER (ORDER BY motors, month, session) // ? AS turn "
        "FROM base.parts SEMI JOIN missing USING (holds, motors, month) ORDER BY turn, session"
    )
    rows = connection.execute(asked, [RECORDS]).fetchall()
    connection.unregister("missing")
    for _, some in groupby(rows, lambda row: row[1]):
        yield pa.table({"session": [session for session, _ in some]})


def _insert(connection: duckdb.DuckDBPyConnection, table: str, rows: pa.Table) -> None:
    columns = [column[0] for column in connection.execute(f"FROM base.{table} LIMIT 0").description or ()]
    connection.register("new_rows", rows.select(columns))
    connection.execute(f"INSERT INTO base.{table} BY NAME SELECT * FROM new_rows")
    connection.unregister("new_rows")


def _write(connection: duckdb.DuckDBPyConnection, part: Partition, to: PartitionFolders) -> Path:
    """Write the rows of a partition, whole under its name or not at all. Returns its file."""
    whose = {"holds": part.holds, "motors": part.motors, "month": part.month}
    rows = connection.sql(ROWS.format(holds=part.holds), params=whose).to_arrow_table()
    content = pa.BufferOutputStream()
    pq.write_table(rows, content, compression="zstd")
    made = content.getvalue().to_pybytes()
    file = part.named(to.folder, made)
    file.parent.mkdir(parents=True, exist_ok=True)
    return write_file(to.work, [made]).replace(file)
