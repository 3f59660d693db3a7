"""One writing process a store.

SQLite 3.7.0 to 3.51.2 (but 3.50.7 and later 3.50.x, 3.44.6 and later 3.44.x) can corrupt a database in WAL mode when
two connections write or checkpoint at once (sqlite.org/wal.html, "the WAL-reset bug"). A writer holds a lock of the
operating system from open to close, on every version; a reader opens the file read-only, so it can never checkpoint.
"""

from __future__ import annotations

import os
import sqlite3
import sys
import time
from pathlib import Path

from ingest.errors import LedgerError

WAIT_S = 5.0  # for another writer to end


def has_wal_reset_bug(version: tuple[int, ...] = sqlite3.sqlite_version_info) -> bool:
    """True for the SQLite versions that need the lock to be safe."""
    fixed = version >= (3, 51, 3) or (3, 50, 7) <= version < (3, 51) or (3, 44, 6) <= version < (3, 45)
    return version >= (3, 7) and not fixed


def reading_uri(path: Path) -> str:
    """How a reader names the database at `path`: it can neither write nor checkpoint, with a WAL beside it or without.

    On a medium that cannot be written SQLite cannot make the files that readers of a WAL share, and needs none.
    """
    alone = not os.access(path.parent, os.W_OK) and not path.with_name(f"{path.name}-wal").exists()
    return f"{path.as_uri()}?mode=ro{'&immutable=1' if alone else ''}"


class WriterLock:
    """The lock on `path`, held from here to `close` or to the end of the process.

    Raises LedgerError where another process still holds it after `WAIT_S` seconds, OSError where it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            self._wait(path)
            os.truncate(self._file, 0)
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, str(os.getpid()).encode())
        except BaseException:
            os.close(self._file)
            raise

    def _wait(self, path: Path) -> None:
        deadline = time.monotonic() + WAIT_S
        while not _try_lock(self._file):
            if time.monotonic() > deadline:
                os.lseek(self._file, 0, os.SEEK_SET)
                holder = os.read(self._file, 20).decode(errors="replace")
                raise LedgerError(
                    f"{path}: another whyhot (process {holder or 'unknown'}) is writing to this store: "
                    "wait for it to end, then run the same command again"
                )
            time.sleep(0.02)

    def close(self) -> None:
        """Let the next writer in."""
        os.close(self._file)


if sys.platform == "win32":
    import msvcrt

    def _try_lock(file: int) -> bool:
        os.lseek(file, 1 << 20, os.SEEK_SET)  # beyond the process number, which others read
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _try_lock(file: int) -> bool:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
