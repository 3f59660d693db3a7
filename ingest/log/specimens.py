"""Which rows of a table are of which specimen: the parts of a file that holds many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench
from ingest.errors import BenchFileError
from ingest.facts import sessions
from ingest.formats import Frames, Rows
from ingest.log import stamps
from ingest.log.clock import JUMP_NS, StampFaults
from ingest.texts.nearest import hint

Text = str | None


class Specimens:
    """Collects the columns that `specimen_column` and `batch_column` of a bench file name."""

    def __init__(self, bench: Bench | None, columns: Sequence[str]) -> None:
        """`columns` of the table. Raises BenchFileError where one that is named is not among them."""
        self._specimen = bench.specimen_column if bench else None
        self._batch = bench.batch_column if bench else None
        self._of_checks = bool(bench and bench.of_checks)
        self._places: dict[sessions.Label, int] = {}
        self._found: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]] = []
        for key, name in (("specimen_column", self._specimen), ("batch_column", self._batch)):
            if bench and name is not None and name not in columns:
                raise BenchFileError(
                    f'{bench.name}: {key} "{name}" is not a column of this log.{hint(name, columns)} Correct the name.'
                )

    def add(self, batch: Frames | Rows) -> None:
        """Take the labels of a batch of rows."""
        if isinstance(batch, Rows) and (self._specimen or self._batch):
            labels = zip(_labels(batch, self._specimen), _labels(batch, self._batch), strict=True)
            which = np.array([self._places.setdefault(one, len(self._places)) for one in labels], np.int64)
            self._found.append((batch.record, batch.t_ns, which))

    def parts(self) -> list[dict[str, Any]]:
        """`ingest.facts.sessions.parts` of all rows; empty without such columns."""
        if not self._found:
            return []
        record, t_ns, which = (np.concatenate(some) for some in zip(*self._found, strict=True))
        return sessions.parts(record, t_ns, which, list(self._places), self._of_checks)

    def within(self, faults: StampFaults) -> StampFaults:
        """The faults without those of specimens that take turns in one table; a list of checks is in any order."""
        if not self._found:
            return faults
        record, t_ns, which = (np.concatenate(some) for some in zip(*self._found, strict=True))
        order = np.lexsort((record, which))
        step = np.diff(t_ns[order])[np.diff(which[order]) == 0]
        runs = stamps.runs(stamps.near(step), len(step))
        back = -step[(step < 0) & (not self._of_checks)]
        jump = step[(step > JUMP_NS) & runs & (not self._of_checks)]
        again = len(t_ns) - np.unique(np.stack([which, t_ns]), axis=1).shape[1]
        return replace(
            faults,
            back_steps=len(back),
            back_ns=int(back.max(initial=0)),
            jump_steps=len(jump),
            jump_ns=int(jump.max(initial=0)),
            other=max(0, again - faults.equal - faults.block_records),
        )


def _labels(rows: Rows, column: str | None) -> list[Text]:
    """Texts of a column; whole numbers without a decimal point, None for an empty cell."""
    if column is None:
        return [None] * len(rows.t_ns)
    values = rows.columns[column]
    if values.dtype == object:
        return [text or None for text in values.tolist()]
    return [None if np.isnan(value) else f"{value:.15g}" for value in values.tolist()]
