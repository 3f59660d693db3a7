"""Parquet files in a bucket, as DuckDB reads them: by their names in SQL, each only in the parts that a query needs.

DuckDB takes a file system of Python in the form of fsspec (the extra `s3`); this one reads through the store's own door
to the bucket, and reads only.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from analytics.errors import WarehouseError
from ingest.errors import not_installed
from ingest.facts.bucket import SCHEME, Bucket, ObjectPath

if TYPE_CHECKING:
    import duckdb

ONCE = datetime(2000, 1, 1, tzinfo=UTC)


def reach(connection: duckdb.DuckDBPyConnection, bucket: Bucket) -> None:
    """Let `connection` read files in `bucket`. Raises WarehouseError where fsspec is not installed."""
    try:
        from fsspec import AbstractFileSystem
    except ImportError:
        what = f"{bucket}: what SQL needs to read a bucket (fsspec)"
        raise WarehouseError(not_installed(what, "uv tool install '.[s3]'")) from None

    sizes: dict[str, int] = {}

    class Files(AbstractFileSystem):  # type: ignore[misc]
        """The objects of one bucket. Of one name there is only ever one content: nothing has to be asked for twice."""

        protocol = SCHEME.partition(":")[0]
        cachable = False

        def glob(self, path: str, **_: Any) -> list[str]:
            return [path]

        def open(self, path: str, mode: str = "rb", **_: Any) -> Any:
            return at(bucket, path).parts()

        def info(self, path: str, **_: Any) -> dict[str, Any]:
            if path not in sizes:
                sizes[path] = sum(at(bucket, path).sizes())
            return {"name": path, "size": sizes[path], "type": "file"}

        def modified(self, path: str) -> datetime:
            return ONCE

    connection.register_filesystem(Files())


def at(bucket: Bucket, file: str) -> ObjectPath:
    """The object that the tables of the warehouse call `file`."""
    return ObjectPath(bucket, file.removeprefix(SCHEME))
