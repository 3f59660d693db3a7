"""Rows that wait by name: in memory while they are few, in files of a folder beyond."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Name = TypeVar("Name", bound=Hashable)
Table = NDArray[np.void]  # of one structured type

MOST_ROWS = 400_000  # in memory, of all names; and that are handed out at once


class Spill(Generic[Name]):
    """Rows by name, each in the order in which they came. `folder` is made where rows do not fit
    into memory; who named it removes it."""

    def __init__(self, folder: Path, layout: np.dtype[np.void]) -> None:
        self._folder, self.layout = folder, layout
        self._waiting: defaultdict[Name, list[Table]] = defaultdict(list)
        self._rows = 0
        self._files: dict[Name, Path] = {}

    @property
    def names(self) -> list[Name]:
        """Names with rows, in the order in which they first came."""
        return list(self._waiting)

    def add(self, name: Name, rows: Table) -> None:
        """Append rows to those of a name. Raises OSError where the disk is full."""
        self._waiting[name].append(rows)
        self._rows += len(rows)
        if self._rows > MOST_ROWS:
            for waits in self.names:
                self._write(waits)
            self._rows = 0

    def batches(self, name: Name) -> Iterator[Table]:
        """The rows of a name in order, about MOST_ROWS at once."""
        if name in self._files:
            with self._files[name].open("rb") as file:
                while len(rows := np.fromfile(file, self.layout, MOST_ROWS)):
                    yield rows
        if self._waiting.get(name):
            yield np.concatenate(self._waiting[name])

    def _write(self, name: Name) -> None:
        parts, self._waiting[name] = self._waiting[name], []
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._files.setdefault(name, self._folder / f"{len(self._files)}.rows")
        with path.open("ab") as file:
            for part in parts:
                file.write(part.tobytes())
