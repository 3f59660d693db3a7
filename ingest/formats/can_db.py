"""SQLite: the database that python-can's logger writes (`can_logger -f log.db`).

A row of the table is a frame: ts [s], arbitration_id, extended, remote, error, dlc, data. The table may have any name.
It tells no bus: all is bus 1. Nor does it tell direction or CAN FD; a frame of more than 8 bytes is one of CAN FD.
Described in https://python-can.readthedocs.io/en/stable/file_io.html#sqlite-database
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from ingest.errors import UnreadableLogError
from ingest.formats import EARLIEST_NS, FD, LATE_NS, REMOTE, SHOWN, Frames, Log, Rejected
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    LONGEST_CLASSIC,
    ONLY_BUS,
    OneFrame,
    as_arrays,
    end_frames,
    frame_of,
    identifier,
    nanoseconds,
    whole,
)

COLUMNS = ("ts", "arbitration_id", "extended", "remote", "error", "dlc", "data")
DAMAGE = (sqlite3.Error, UnicodeDecodeError)  # the latter where its words for the damage hold damaged bytes
BATCH = 100_000  # rows that are read at once
LATEST_S = LATE_NS / 1e9

ROS = {"topics", "messages"}  # tables of a bag of ROS 2


@dataclass
class CanDbLog(Log):
    """A database of python-can."""

    def batches(self) -> Iterator[Frames]:
        """Frames in the order of the table. Raises UnreadableLogError where there is no such table, or no row."""
        ended = None
        with closing(sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
            database.text_factory = bytes
            try:
                rows = self._rows(database)
                while some := rows.fetchmany(BATCH):
                    yield from self._batch(some)
            except DAMAGE:
                ended = f"is damaged behind row {self.found:,}"
        self.absolute |= self.time.start_ns is not None
        end_frames(self, ended, "", "once the program that wrote it has closed it")

    def _rows(self, database: sqlite3.Connection) -> sqlite3.Cursor:
        database.execute("PRAGMA trusted_schema = OFF")  # nothing that the file says is run
        tables = database.execute("SELECT name FROM sqlite_schema WHERE type = 'table' AND rootpage > 0").fetchall()
        for (name,) in tables:
            quoted = '"' + name.decode(errors="replace").replace('"', '""') + '"'
            if [row[1] for row in database.execute(f"PRAGMA table_info({quoted})")] == [
                one.encode() for one in COLUMNS
            ]:
                self.settings["table"] = name.decode(errors="replace")
                return database.execute(f"SELECT {', '.join(COLUMNS)}, rowid FROM {quoted}")
        names = {name.decode(errors="replace") for (name,) in tables}
        todo = "mcap convert log.db3 log.mcap" if names >= ROS else "sqlite3 -header -csv FILE 'SELECT * FROM TABLE'"
        raise UnreadableLogError(
            f"{self.path.name}: is {'a bag of ROS 2' if names >= ROS else 'an SQLite database'} without a table of CAN "
            f"frames (columns {', '.join(COLUMNS)}), as python-can writes it. Export it: {todo}."
        )

    def _batch(self, rows: list[tuple[Any, ...]]) -> Iterator[Frames]:
        frames: list[OneFrame] = []
        record: list[int] = []
        for row in rows:
            *cells, number = row
            frame = self._placed(cells)
            if isinstance(frame, OneFrame):
                frames.append(frame)
                record.append(self.found)
                if self.found in self.sought:
                    self.places[self.found] = self._where(number)
            else:
                raw = repr(tuple(cells)).encode()[:SHOWN]
                self.rejected.append(Rejected(self.found, self._where(number), frame, raw))
            self.found += 1
        if frames:
            yield as_arrays(frames, record)

    def _where(self, rowid: int) -> str:
        return f'rowid {rowid} of table "{self.settings["table"]}"'

    def _placed(self, row: list[Any]) -> OneFrame | str:
        """The frame in a row with its time, or why it cannot be read."""
        frame = _frame(*row)
        if isinstance(frame, str) or frame.t_ns >= EARLIEST_NS:
            self.absolute |= not isinstance(frame, str)
            return frame
        return frame._replace(t_ns=frame.t_ns + (self.time.start_ns or 0))


def _frame(ts: Any, number: Any, extended: Any, remote: Any, error: Any, length: Any, data: Any) -> OneFrame | str:
    if error:
        return ERROR_FRAME
    if not isinstance(ts, int | float) or not math.isfinite(ts) or not 0 <= ts < LATEST_S:
        return "has no stamp, or one that no log can reach"
    if not isinstance(number, int) or number < 0:
        return "has no identifier"
    payload = b"" if remote else _payload(data, length)
    flags = (REMOTE if remote else 0) | (FD if len(payload) > LONGEST_CLASSIC else 0)
    return frame_of(nanoseconds(repr(ts)), ONLY_BUS, identifier(number, bool(extended)), flags, payload)


def _payload(data: Any, length: Any) -> bytes | str:
    if not isinstance(data, bytes | None) or not isinstance(length, int):
        return "holds no bytes"
    return whole(data or b"", length)


reader = CanDbLog
