"""Sealed bytes, in a folder or a bucket: each file's name is the SHA-256 of what is in it."""

from __future__ import annotations

import hashlib
import logging
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ingest.errors import ChangingFileError, DamageError, StoreError
from ingest.facts.bucket import ObjectPath, Place, listed
from ingest.facts.durable import opened, sync_folder, write_file

CHUNK = 1 << 20  # bytes read at once
ADVICE = "ingest the original again, or restore it from a backup"
_log = logging.getLogger(__name__)


class Archive:
    """The sealed files under `folder`; `work` is where they are made, None where nothing may be sealed. `gone`: why
    bytes that are not there had to go, by their SHA-256; None where nobody knows. `behind`: an archive to read from
    what is not here. Where it lies in a bucket, everything raises BucketError besides."""

    def __init__(self, folder: Place, work: Path | None, gone: Callable[[str], str | None] = lambda _: None) -> None:
        self.folder = folder
        self.behind: Archive | None = None
        self._work = work
        self._gone = gone

    def path(self, sha256: str) -> Place:
        """Where the bytes lie, or would. Raises DamageError where `sha256` is none."""
        own = self._own(sha256)
        return own if self.behind is None or own.is_file() else self.behind.path(sha256)

    def _own(self, sha256: str) -> Place:
        if not re.fullmatch(r"[0-9a-f]{64}", sha256):
            raise DamageError(
                f"{self.folder}: {sha256!r} is not a SHA-256 in 64 hexadecimal digits: see `whyhot verify`"
            )
        return self.folder / sha256[:2] / sha256

    def has(self, sha256: str) -> bool:
        """True where a file of this name is there; `damage` says whether it is whole."""
        return self.path(sha256).is_file()

    def __iter__(self) -> Iterator[str]:
        """The name of every sealed file, in order."""
        for path in listed(self.folder, "*/*"):
            if re.fullmatch(r"[0-9a-f]{64}", path.name) and path.parent.name == path.name[:2]:
                yield path.name

    def seal(self, data: bytes | Path | Iterator[bytes]) -> str:
        """Keep `data`, the bytes of the file that it names, or all that it yields, for ever. Returns their SHA-256.

        What is there already and whole is kept; what is there and damaged is replaced, with a warning. Raises
        ChangingFileError where the file changes while it is read, StoreError where the store was opened for reading,
        and OSError (nothing is left behind) where a file cannot be read or the disk is full.
        """
        if self._work is None:
            raise StoreError(f"{self.folder}: the store was opened for reading: open it for writing")
        digest = hashlib.sha256()
        made = write_file(self._work, _hashed(data, digest))
        try:
            sha256 = digest.hexdigest()
            target = self._own(sha256)
            whole = self._is_whole(sha256)
            if isinstance(target, ObjectPath):
                if not whole:
                    target.put(made)
                return sha256
            target.parent.mkdir(exist_ok=True)
            if not whole:
                made.chmod(made.stat().st_mode & 0o444)
                made.replace(target)
            sync_folder(target.parent)
            sync_folder(target.parent.parent)
        finally:
            made.unlink(missing_ok=True)
        return sha256

    def read(self, sha256: str) -> bytes:
        """The sealed bytes, hashed again. Raises DamageError where they are missing, cannot be read or are not what
        was sealed."""
        with self._opened(sha256) as file:
            data = file.read()
        if hashlib.sha256(data).hexdigest() != sha256:
            raise DamageError(_damaged(self.path(sha256), len(data)))
        return data

    def chunks(self, sha256: str) -> Iterator[bytes]:
        """The sealed bytes, part by part. Raises DamageError where they are missing or cannot be read, and at the end
        where they are not what was sealed."""
        digest, size = hashlib.sha256(), 0
        with self._opened(sha256) as file:
            while chunk := file.read(CHUNK):
                digest.update(chunk)
                size += len(chunk)
                yield chunk
        if digest.hexdigest() != sha256:
            raise DamageError(_damaged(self.path(sha256), size))

    def lend(self, sha256: str, named: Path) -> None:
        """Let the new file `named` hold the sealed bytes, only to be read: a link, or a copy out of the bucket.
        Raises DamageError where they are missing or not what was sealed."""
        path = self.path(sha256)
        if isinstance(path, Path):
            if damage := self.damage(sha256):
                raise DamageError(damage)
            named.symlink_to(path.absolute())
        else:
            with named.open("xb") as file:
                file.writelines(self.chunks(sha256))

    def size(self, sha256: str) -> int:
        """How many bytes were sealed. Raises DamageError where they are missing."""
        with self._opened(sha256) as file:
            return file.seek(0, os.SEEK_END)

    def damage(self, sha256: str, read: bool = True) -> str | None:
        """What is wrong with a sealed file, in one line; None where it is whole (without `read`: where it is there)."""
        try:
            with self._opened(sha256):
                pass
            for _ in self.chunks(sha256) if read else ():
                pass
        except DamageError as error:
            return str(error)
        return None

    @contextmanager
    def _opened(self, sha256: str) -> Iterator[BinaryIO]:
        """A sealed file to read. Raises DamageError where it is missing or cannot be read."""
        path = self.path(sha256)
        try:
            with opened(path) as file:
                yield file
        except FileNotFoundError:
            raise DamageError(self._missing(sha256)) from None
        except OSError as error:
            raise DamageError(f"{path}: cannot be read ({error.strerror}): {ADVICE}") from None

    def _missing(self, sha256: str) -> str:
        why = self._gone(sha256)
        return f"{why}: its bytes are gone" if why else f"{self.path(sha256)}: is missing: {ADVICE}"

    def _is_whole(self, sha256: str) -> bool:
        if not self.has(sha256):
            return False
        damage = self.damage(sha256)
        if damage:
            _log.warning("%s; replaced by the true bytes just given", damage)
        return damage is None


def _damaged(path: Place, size: int) -> str:
    return f"{path}: is damaged, its {size:,} bytes are not those that were sealed: {ADVICE}"


def _hashed(data: bytes | Path | Iterator[bytes], digest: hashlib._Hash) -> Iterator[bytes]:
    """The chunks of `data`; `digest` has seen all that were taken."""
    for chunk in [data] if isinstance(data, bytes) else _chunks(data) if isinstance(data, Path) else data:
        digest.update(chunk)
        yield chunk


def _chunks(path: Path) -> Iterator[bytes]:
    """The bytes of a file that stays as it is meanwhile."""
    with path.open("rb") as file:
        before = os.fstat(file.fileno())
        left = before.st_size
        while left >= 0 and (chunk := file.read(CHUNK)):  # a file that grows all the time would never end
            left -= len(chunk)
            yield chunk
        after = os.fstat(file.fileno())
    if left or (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size):
        raise ChangingFileError(
            f"{path}: changed while it was read ({before.st_size:,} bytes at first, {after.st_size:,} at the end): "
            "nothing was stored; wait until its recording has ended, then ingest it again"
        )
