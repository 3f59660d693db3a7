"""What all jobs of a piece of work share, as a file beside them: its path travels, and each process reads it once."""

from __future__ import annotations

import hashlib
import pickle
import socket
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Generic, TypeVar, cast

from ingest.errors import StoreError

T = TypeVar("T")


@dataclass(frozen=True)
class Shared(Generic[T]):
    """A value at `path`, a file that is named by the SHA-256 of what is in it."""

    path: Path

    def value(self) -> T:
        """Raises StoreError where this machine does not see the file, or sees another."""
        return cast("T", _read(self.path))


@dataclass(frozen=True)
class InProcess(Generic[T]):
    """The same for jobs that run in this process: the value itself, as it is."""

    held: T

    def value(self) -> T:
        return self.held


def share(value: T, work: Path) -> Shared[T]:
    """Write `value` into the folder `work` of a store."""
    data = pickle.dumps(value)
    path = work.absolute() / hashlib.sha256(data).hexdigest()
    path.write_bytes(data)
    return Shared(path)


@lru_cache(maxsize=2)
def _read(path: Path) -> object:
    try:
        data = path.read_bytes()
    except OSError as error:
        data, why = b"", f"({error.strerror})"
    else:
        why = "as it was written"
    if hashlib.sha256(data).hexdigest() != path.name:
        raise StoreError(
            f"worker on {socket.gethostname()}: cannot read {path} {why}: "
            "the store must lie in a folder that every worker sees under the same path"
        )
    return pickle.loads(data)
