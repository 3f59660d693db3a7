"""One writing process a store; or, where a server orders what they write, several beside each other.

SQLite 3.7.0 to 3.51.2 (but 3.50.7 and later 3.50.x, 3.44.6 and later 3.44.x) can corrupt a database in WAL mode when
two connections write or checkpoint at once (sqlite.org/wal.html, "the WAL-reset bug"). A writer holds a lock of the
operating system from open to close, on every version; a reader opens the file read-only, so it can never checkpoint.
"""

from __future__ import annotations

import os
import sqlite3
import sys
import time
from contextlib import suppress
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
    """The lock on `path`, held from here to `close` or to the end of the process; with `shared` beside others that
    share it. `alone`: no other process holds it, as long as `share` was not called.

    Raises LedgerError where another process still holds it after `WAIT_S` seconds, OSError where it cannot be made.
    """

    def __init__(self, path: Path, *, shared: bool = False) -> None:
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            self.alone = _try_lock(self._file)
            if not self.alone:
                self._wait(shared)
                self.alone = not shared
            os.truncate(self._file, 0)
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, str(os.getpid()).encode())
        except BaseException:
            os.close(self._file)
            raise

    def share(self) -> None:
        """Let others that share it in from now on. Raises LedgerError as at first."""
        if self.alone:
            self.alone = False
            self._wait(shared=True)

    def _wait(self, shared: bool) -> None:
        deadline = time.monotonic() + WAIT_S
        while not _try_lock(self._file, shared):
            if time.monotonic() > deadline:
                os.lseek(self._file, 0, os.SEEK_SET)
                holder = os.read(self._file, 20).decode(errors="replace")
                raise LedgerError(
                    f"{self._path}: another whyhot (process {holder or 'unknown'}) is writing to this store: "
                    "wait for it to end, then run the same command again"
                )
            time.sleep(0.02)

    def close(self) -> None:
        """Let the next writer in."""
        os.close(self._file)


if sys.platform == "win32":
    import msvcrt

    BEYOND, SHARES = 1 << 20, 64  # places of the lock, beyond the process number, which others read

    def _try_lock(file: int, shared: bool = False) -> bool:
        """All places, or with `shared` any one of them; what was held before is given up."""
        _unlock(file)
        return any(_locked(file, place, 1) for place in range(SHARES)) if shared else _locked(file, 0, SHARES)

    def _locked(file: int, place: int, count: int) -> bool:
        os.lseek(file, BEYOND + place, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, count)
        except OSError:
            return False
        return True

    def _unlock(file: int) -> None:
        os.lseek(file, BEYOND, os.SEEK_SET)
        with suppress(OSError):
            msvcrt.locking(file, msvcrt.LK_UNLCK, SHARES)

else:
    import fcntl

    def _try_lock(file: int, shared: bool = False) -> bool:
        try:
            fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
