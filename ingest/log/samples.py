"""Decoded samples as Parquet: one file a group (a CAN message on a bus, or a table), one row a record.

Columns `t_ns, log_t_ns` (the same), `file_id, record`, then one a signal; its field says unit, quantity and signal.
Bytes depend on the rows alone; pages carry CRCs, which are checked on reading.
Format: https://parquet.apache.org/docs/file-format/
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ingest.errors import DamageError
from ingest.facts.bucket import Place
from ingest.log.arrow import from_numpy

FIXED = ("t_ns", "log_t_ns", "file_id", "record")
ROW_GROUP = 131_072  # rows
_INTEGERS = ("t_ns", "log_t_ns", "record")


@dataclass(frozen=True)
class Column:
    """A column of a group. `unit` is that of the values (None = not known); `text` columns hold str or None."""

    name: str
    signal: str
    unit: str | None = None
    quantity: str | None = None
    text: bool = False

    def field(self) -> pa.Field:
        """The field of the Parquet schema, which says signal, unit and quantity."""
        said = {"signal": self.signal, "unit": self.unit, "quantity": self.quantity}
        kind = pa.dictionary(pa.int32(), pa.string()) if self.text else pa.float64()
        return pa.field(self.name, kind, metadata={name: value for name, value in said.items() if value})


@dataclass(frozen=True)
class Samples:
    """N rows of a group: `t_ns` int64 [ns] and `record` int64, both (N,); `values` one array (N,) a column."""

    t_ns: NDArray[np.int64]
    record: NDArray[np.int64]
    values: Sequence[NDArray[Any]]

    def __len__(self) -> int:
        return len(self.t_ns)


class GroupWriter:
    """Writes one group to `path`. `file_id` is the SHA-256 of the raw log. Rows wait until they fill a row group."""

    def __init__(self, path: Path, file_id: str, columns: Sequence[Column]) -> None:
        self.path = path
        self._file_id = from_numpy(np.array([file_id], object))
        self._parts: list[Samples] = []
        self._rows = 0
        self._schema = pa.schema(
            [
                ("t_ns", pa.int64()),
                ("log_t_ns", pa.int64()),
                ("file_id", pa.dictionary(pa.int32(), pa.string())),
                ("record", pa.int64()),
                *(column.field() for column in columns),
            ]
        )
        packed = dict.fromkeys(_INTEGERS, "DELTA_BINARY_PACKED")
        split = {column.name: "BYTE_STREAM_SPLIT" for column in columns if not column.text}
        self._writer = pq.ParquetWriter(
            path,
            self._schema,
            compression="zstd",
            compression_level=1,
            use_dictionary=["file_id", *(column.name for column in columns if column.text)],
            column_encoding=packed | split,
            write_page_checksum=True,
            write_statistics=list(_INTEGERS),  # those of a column with NaN leave it out, and readers filter wrongly
        )

    @property
    def waiting(self) -> int:
        """Values in memory."""
        return self._rows * len(self._schema)

    def add(self, samples: Samples) -> None:
        """Append `samples`."""
        self._parts.append(samples)
        self._rows += len(samples)
        if self._rows >= ROW_GROUP:
            self.flush()

    def flush(self) -> None:
        """Write what waits as one row group."""
        parts, self._parts, self._rows = self._parts, [], 0
        if sum(len(part) for part in parts) == 0:
            return
        t_ns, record = (from_numpy(np.concatenate([getattr(p, name) for p in parts])) for name in ("t_ns", "record"))
        file_id = pa.DictionaryArray.from_arrays(from_numpy(np.zeros(len(t_ns), np.int32)), self._file_id)
        arrays = [t_ns, t_ns, file_id, record]
        for i, field in enumerate(list(self._schema)[len(FIXED) :]):
            array = from_numpy(np.concatenate([part.values[i] for part in parts]))
            arrays.append(array.cast(field.type) if pa.types.is_dictionary(field.type) else array)
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema), row_group_size=len(t_ns))

    def close(self) -> int:
        """Finish the file; the number of rows that it says it holds, read back from it."""
        self.flush()
        self._writer.close()
        return int(pq.read_metadata(self.path).num_rows)


@dataclass(frozen=True)
class RowGroup:
    """A row group of a file, as the file says it: rows, and the least and greatest of their stamps and records."""

    rows: int
    t_ns: tuple[int, int]
    record: tuple[int, int]

    def is_of(self, file: Mapping[str, Any]) -> bool:
        """Whether it may hold records of a session's `file`: from its `first_record` to its `last_record`."""
        return bool(self.record[0] <= file["last_record"] and self.record[1] >= file["first_record"])


def row_groups(path: Place) -> list[RowGroup]:
    """What each row group of the group at `path` holds; nothing of its pages is read. Raises DamageError."""
    with _reading(path), pq.ParquetFile(_source(path)) as file:
        names = file.schema_arrow.names
        at = [names.index("t_ns"), names.index("record")]
        found = [file.metadata.row_group(i) for i in range(file.num_row_groups)]
        return [RowGroup(one.num_rows, *(_span(one.column(i).statistics) for i in at)) for one in found]


def _span(statistics: Any) -> tuple[int, int]:
    if statistics is None or not statistics.has_min_max:
        raise ValueError("a row group does not say what it holds")
    return int(statistics.min), int(statistics.max)


def read(path: Place, columns: Sequence[str] | None = None, groups: Sequence[int] | None = None) -> pa.Table:
    """The group at `path`, or some of its columns, or some of its row groups; every page read is checked against its
    CRC. Raises DamageError."""
    with _reading(path):
        with pq.ParquetFile(_source(path), page_checksum_verification=True) as file:
            asked = None if columns is None else list(columns)
            table = file.read(asked) if groups is None else file.read_row_groups(list(groups), asked)
        table.validate(full=True)  # page headers are outside the CRCs
        return table


def _source(path: Place) -> Path | BinaryIO:
    return path if isinstance(path, Path) else path.parts()


@contextmanager
def _reading(path: Place) -> Iterator[None]:
    """What goes wrong in a file that is there is damage, and said so."""
    try:
        yield
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        if isinstance(error, FileNotFoundError):
            raise
        says = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DamageError(
            f"{path}: the samples are damaged ({says}). Make them again from the archive with `whyhot rebuild`."
        ) from error
