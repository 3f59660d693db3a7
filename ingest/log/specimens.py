"""Which rows of a table are of which specimen: the parts of a file that holds many.

Where no bench file names the column, one that is called as such columns are tells that a table holds several: then they
are one session, which is said, but no clock steps back where the next specimen begins.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ingest.bench.bench_file import Bench
from ingest.errors import BenchFileError
from ingest.facts import sessions
from ingest.facts.events import QualityFlagged
from ingest.formats import Frames, Rows
from ingest.log import stamps
from ingest.log.clock import JUMP_NS, Ints, StampFaults
from ingest.texts.guessing import labels
from ingest.texts.nearest import hint

Text = str | None
UNSAID = "several_specimens"


class Specimens:
    """Collects the columns that `specimen_column` and `batch_column` of a bench file name, else one that seems to."""

    def __init__(self, bench: Bench | None, columns: Sequence[str]) -> None:
        """`columns` of the table. Raises BenchFileError where one that is named is not among them."""
        self._specimen = bench.specimen_column if bench else None
        self._batch = bench.batch_column if bench else None
        self._said = self._specimen is not None or self._batch is not None
        self._of_checks = bool(bench and bench.of_checks)
        self._places: dict[sessions.Label, int] = {}
        self._found: list[tuple[Ints, Ints, Ints]] = []
        for key, name in (("specimen_column", self._specimen), ("batch_column", self._batch)):
            if bench and name is not None and name not in columns:
                raise BenchFileError(
                    f'{bench.name}: {key} "{name}" is not a column of this log.{hint(name, columns)} Correct the name.'
                )
        if not self._said:
            self._specimen = labels(columns).get("specimen")

    def add(self, batch: Frames | Rows) -> None:
        """Take the labels of a batch of rows."""
        if isinstance(batch, Rows) and (self._specimen or self._batch):
            told = zip(_labels(batch, self._specimen), _labels(batch, self._batch), strict=True)
            which = np.array([self._places.setdefault(one, len(self._places)) for one in told], np.int64)
            self._found.append((batch.record, batch.t_ns, which))

    def parts(self) -> list[dict[str, Any]]:
        """`ingest.facts.sessions.parts` of all rows; empty where no bench file names such columns."""
        if not (self._said and self._found):
            return []
        record, t_ns, which = self._rows()
        return sessions.parts(record, t_ns, which, list(self._places), self._of_checks)

    def unsaid(self) -> dict[str, Any]:
        """The column that tells several specimens apart and that no bench file names, and how many; else empty."""
        named = [one for one, _ in self._places if one is not None]
        if self._said or len(named) < 2 or self._counts_rows():
            return {}
        return {UNSAID: {"column": self._specimen, "count": len(named)}}

    def within(self, faults: StampFaults) -> StampFaults:
        """The faults without those of specimens that take turns in one table; a list of checks is in any order."""
        if not self._found or not (self._said or self.unsaid()):
            return faults
        record, t_ns, which = self._rows()
        order = np.lexsort((record, which))
        step = np.diff(t_ns[order])[np.diff(which[order]) == 0]
        runs = stamps.runs(stamps.near(step), len(step))
        back = -step[(step < 0) & (not self._of_checks)]
        jump = step[(step > JUMP_NS) & runs & (not self._of_checks)]
        again = len(t_ns) - np.unique(np.stack([which, t_ns]), axis=1).shape[1]
        return replace(
            faults,
            falls=0,
            back_steps=len(back),
            back_ns=int(back.max(initial=0)),
            jump_steps=len(jump),
            jump_ns=int(jump.max(initial=0)),
            other=max(0, again - faults.equal - faults.block_records),
        )

    def _rows(self) -> tuple[Ints, Ints, Ints]:
        """Record, stamp [ns] and place in `_places` of all rows (N,), in the order of the file."""
        record, t_ns, which = (np.concatenate(some) for some in zip(*self._found, strict=True))
        return record, t_ns, which

    def _counts_rows(self) -> bool:
        """Whether what seems to name specimens are numbers of which none comes twice: those of the rows."""
        return len(self._places) == sum(map(len, (one for one, *_ in self._found))) and all(
            one is not None and one.isdecimal() for one, _ in self._places
        )


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag where the file `name` holds rows of several specimens and no bench file says which column names them."""
    if not (unsaid := settings.get(UNSAID)):
        return []
    line = f"specimen_column = {json.dumps(unsaid['column'], ensure_ascii=False)}"
    says = f"rows of {unsaid['count']:,} specimens, taken as one: say {line} above the first [table] of a bench file"
    return [QualityFlagged(flag=UNSAID, says=f"{name}: {says}", detail={"file": name, **unsaid})]


def _labels(rows: Rows, column: str | None) -> list[Text]:
    """Texts of a column without blanks around them; whole numbers without a decimal point, None for an empty cell, or
    where the series of a long table has no such column."""
    if column is None or column not in rows.columns:
        return [None] * len(rows.t_ns)
    values = rows.columns[column]
    if values.dtype == object:
        return [text.strip() or None for text in values.tolist()]
    return [None if np.isnan(value) else f"{value:.15g}" for value in values.tolist()]
