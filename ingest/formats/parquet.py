"""Parquet: tables of typed columns, as pandas, polars, Spark and MATLAB write them.

What becomes of its columns says `ingest/formats/_arrow_rows.py`. Its index stands at its end: of a file that was cut
nothing can be read. Format: https://parquet.apache.org/docs/file-format/
"""

from __future__ import annotations

from collections.abc import Iterator

import pyarrow as pa
import pyarrow.parquet

from ingest.errors import UnreadableLogError
from ingest.formats import BATCH_ROWS
from ingest.formats._arrow_rows import DAMAGE, ArrowLog, checked, most_in_columns

MAGIC = b"PAR1"
NUMBER = 8  # bytes


class ParquetLog(ArrowLog):
    """A Parquet file, read in bounded memory, one group of rows after another."""

    def _place(self, record: int) -> str:
        """The group of rows, which begins with its first column, and the row in it: columns are packed apart."""
        index = pa.parquet.read_metadata(self.path)
        for number in range(index.num_row_groups):
            group = index.row_group(number)
            if record < group.num_rows:
                columns = [group.column(i) for i in range(group.num_columns)]
                at = min(place for one in columns for place in _begins(one))
                return f"byte {at:,}, row {record + 1:,} of row group {number + 1:,} there"
            record -= group.num_rows
        raise IndexError(record)

    def _tables(self) -> Iterator[pa.RecordBatch]:
        with self.path.open("rb") as stream:
            stream.seek(-len(MAGIC), 2)
            if stream.read() != MAGIC:
                raise UnreadableLogError(
                    f"{self.path.name}: was cut: the index of a Parquet file stands at its end, and is not there. "
                    "Copy the file again."
                )
        try:
            file = pa.parquet.ParquetFile(self.path, page_checksum_verification=True)
        except DAMAGE as error:
            raise self._damaged(error) from None
        with file:
            self._refuse_bomb(file.metadata)
            for number in range(file.num_row_groups):
                try:
                    yield from map(checked, file.iter_batches(BATCH_ROWS, row_groups=[number], use_threads=False))
                except DAMAGE as error:
                    if number == 0:
                        raise self._damaged(error) from None
                    self._ended = f"is damaged in row group {number + 1} of {file.num_row_groups}"
                    return

    def _refuse_bomb(self, index: pa.parquet.FileMetaData) -> None:
        """Before a row is read, where the index names more than any log of this size: zeros take no room."""
        most = most_in_columns(self.path.stat().st_size)
        if NUMBER * index.num_rows * index.num_columns > most:
            raise UnreadableLogError(
                f"{self.path.name}: its {index.num_rows:,} rows of {index.num_columns:,} columns unpack to more than "
                f"{most:,} bytes, the limit for its size: no log does. Look at the file, or export it again."
            )

    def _damaged(self, error: BaseException) -> UnreadableLogError:
        says = " ".join(str(error).split())[:200]
        return UnreadableLogError(f"{self.path.name}: is damaged ({says}): nothing of it is used. Copy the file again.")


def _begins(column: pa.parquet.ColumnChunkMetaData) -> list[int]:
    pages = (column.dictionary_page_offset, column.data_page_offset)
    return [at for at in pages if at]


reader = ParquetLog
