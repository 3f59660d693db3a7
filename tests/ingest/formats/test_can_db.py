"""SQLite of python-can: equal to what it wrote, and nothing that a file says is believed or run."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import can
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import FD, TimeSpec
from made.frames import as_frames, messages, read, write

TABLE = (
    "CREATE TABLE {} (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, "
    "data BLOB)"
)
FINE = (0.5, 1, 0, 0, 0, 2, b"\1\2")


def log_of(folder: Path, *rows: tuple[Any, ...], table: str = "messages") -> Path:
    path = folder / "log"
    with closing(sqlite3.connect(path)) as database:
        database.execute(TABLE.format(table))
        database.executemany(f"INSERT INTO {table} VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
        database.commit()
    return path


def test_frames_equal_those_that_python_can_wrote(tmp_path: Path) -> None:
    path, some = tmp_path / "log.db", messages(200)
    write(can.SqliteWriter(path), some)
    log, frames = read(path)
    assert frames == as_frames(some, without_bus=True, ways=False)
    assert len(log.rejected) == 4 and {one.why for one in log.rejected} == {"error frame"}
    assert log.absolute


def test_a_table_of_another_name_is_found_and_said(tmp_path: Path) -> None:
    log, frames = read(log_of(tmp_path, FINE, table="Montag"), TimeSpec(start_ns=10**9))
    assert log.settings == {"table": "Montag"}
    assert frames == [(1_500_000_000, 1, 1, 0, "0102")]


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ((None, 1, 0, 0, 0, 0, b""), "has no stamp, or one that no log can reach"),
        ((9e99, 1, 0, 0, 0, 0, b""), "has no stamp, or one that no log can reach"),
        ((-1.0, 1, 0, 0, 0, 0, b""), "has no stamp, or one that no log can reach"),
        ((1.0, "x", 0, 0, 0, 0, b""), "has no identifier"),
        ((1.0, 2**40, 1, 0, 0, 0, b""), 'has the identifier "10000000000", which is no number of 29 bits'),
        ((1.0, 1, 0, 0, 0, 8, b"\1"), "holds 1 of its 8 bytes"),
        ((1.0, 1, 0, 0, 0, 8, 3.5), "holds no bytes"),
        ((1.0, 1, 0, 0, 0, 65, bytes(65)), "says it holds 65 bytes, more than the 64 of a frame"),
        ((1.0, 0, 0, 0, 1, 0, b""), "error frame"),
    ],
)
def test_a_row_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, row: tuple[Any, ...], why: str) -> None:
    log, frames = read(log_of(tmp_path, FINE, row, (1.5, 3, 0, 0, 0, 12, bytes(12))))
    assert [(frame[0], frame[3]) for frame in frames] == [(500_000_000, 0), (1_500_000_000, FD)]
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(1, 'rowid 2 of table "messages"', why)]


def test_a_database_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    path = log_of(tmp_path, *[(float(n), 1, 0, 0, 0, 8, bytes(8)) for n in range(5000)])
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    try:
        log, frames = read(path)
    except UnreadableLogError as error:
        assert "is damaged behind row 0" in str(error)
    else:
        assert log.cut and len(frames) < 5000


@pytest.mark.parametrize(
    ("made", "says"),
    [
        ("CREATE TABLE other (a INTEGER)", "is an SQLite database without a table of CAN frames"),
        ("CREATE VIEW messages AS SELECT 1 AS ts", "is an SQLite database without a table of CAN frames"),
        ("CREATE TABLE topics (a); CREATE TABLE messages (a)", "is a bag of ROS 2 without a table of CAN frames"),
        (TABLE.format("messages"), "no CAN frame is in it"),
    ],
)
def test_a_database_without_frames_is_refused(tmp_path: Path, made: str, says: str) -> None:
    path = tmp_path / "log.db"
    with closing(sqlite3.connect(path)) as database:
        database.executescript(made)
        database.commit()
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    assert str(refused.value).startswith(f"log.db: {says}")
    if "ROS" in says:
        assert str(refused.value).endswith("Export it: mcap convert log.db3 log.mcap.")
