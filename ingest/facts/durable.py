"""Files that are whole and on disk, or not there; the SHA-256 of a file; folders for what is only on its way."""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

if TYPE_CHECKING:
    from ingest.facts.bucket import Place


def opened(path: Place) -> BufferedReader:
    """A file, to be read. Raises OSError where it cannot be; where it is a pipe or device too, which may never end."""
    if isinstance(path, Path) and path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "It is a pipe or device and no file", str(path))
    return path.open("rb")


def sha256_of(path: Place) -> str:
    """SHA-256 (hex) of the bytes of a file. Raises OSError as `opened` does."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sync_folder(folder: Path) -> None:
    """Bring the names in `folder` to disk: a rename is durable only then. Windows has no such call, and needs none."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sync_tree(folder: Path) -> None:
    """Bring every file and folder under `folder` to disk."""
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb+") as file:
                os.fsync(file.fileno())
        else:
            sync_folder(path)
    sync_folder(folder)


def write_file(folder: Path, chunks: Iterable[bytes]) -> Path:
    """A new file in `folder` that holds `chunks`, on disk. Raises OSError (disk full ...), and leaves no file then."""
    path = folder / uuid4().hex
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        try:
            for chunk in chunks:
                rest = memoryview(chunk)
                while rest:
                    rest = rest[os.write(handle, rest) :]
            os.fsync(handle)
        finally:
            os.close(handle)
    except BaseException:
        path.unlink()
        raise
    return path


@contextmanager
def scratch(beside: Path | None = None, begins: str = "whyhot-") -> Iterator[Path]:
    """An empty folder, in `beside` or where the system keeps temporary files, with all that is in it gone at the end.

    What cannot be removed is left: Python's `TemporaryDirectory` tries without end on a disk that denies it. Raises
    OSError where no folder can be made.
    """
    folder = Path(tempfile.mkdtemp(prefix=begins, dir=beside))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
