"""Arrow IPC: Feather (version 2) and Arrow files, and Arrow streams: tables of typed columns.

What becomes of its columns says `ingest/formats/_arrow_rows.py`. A file is read as the stream that it holds, so that
one that was cut keeps its rows up to there. Format: https://arrow.apache.org/docs/format/Columnar.html
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pyarrow as pa

from ingest.errors import UnreadableLogError
from ingest.formats._arrow_rows import DAMAGE, ArrowLog, checked

MAGIC = b"ARROW1"
STREAM = 8  # bytes before the stream that a file holds


@dataclass
class ArrowFileLog(ArrowLog):
    """An Arrow file or stream, read from front to back in bounded memory."""

    _begins: dict[int, int] = field(default_factory=dict)  # first row of each record batch -> its byte in the file

    def _tables(self) -> Iterator[pa.RecordBatch]:
        size, rows = self.path.stat().st_size, 0
        with pa.OSFile(str(self.path)) as file:
            is_file = file.read(len(MAGIC)) == MAGIC
            file.seek(STREAM if is_file else 0)
            try:
                stream = pa.ipc.open_stream(file)
                at = file.tell()
                for table in stream:
                    self._begins[rows], at = at, file.tell()
                    rows += checked(table).num_rows
                    yield table
            except DAMAGE as error:
                if not rows:
                    raise UnreadableLogError(
                        f"{self.path.name}: no row of it can be read ({' '.join(str(error).split())[:200]}). "
                        "Copy the file again."
                    ) from None
                self._ended = f"is damaged, or was cut, below row {rows:,}"
                return
            file.seek(max(0, size - len(MAGIC)))
            if is_file and file.read(len(MAGIC)) != MAGIC:
                self._ended = f"ends at byte {size:,}, before its end"

    def _place(self, record: int) -> str:
        first = max(row for row in self._begins if row <= record)
        number = list(self._begins).index(first) + 1
        return f"byte {self._begins[first]:,}, row {record - first + 1:,} of record batch {number:,} there"


reader = ArrowFileLog
