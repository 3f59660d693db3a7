"""Signals that derived channels need at other times than they come: each holds its last value until the next."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ingest.formats import Rows
from ingest.log import recording
from ingest.log.frames import FrameBatch
from ingest.log.j1939 import Explained
from ingest.log.plan import SignalGroup, Source
from ingest.log.transport import Unpacked

Series = tuple[NDArray[np.int64], NDArray[np.float64]]


class Held:
    """`series`: (stamps [ns], values) of each signal, in any order; an undefined value is none."""

    def __init__(self, series: dict[Source, list[Series]]) -> None:
        self._series: dict[Source, Series] = {}
        for source, parts in series.items():
            t_ns, values = (np.concatenate(column) for column in zip(*parts, strict=True))
            known = np.flatnonzero(np.isfinite(values))
            known = known[np.argsort(t_ns[known], kind="stable")]
            self._series[source] = t_ns[known], values[known]

    def at(self, source: Source, t_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """The last value at or before each stamp [ns], (N,); NaN before the first."""
        stamps, values = self._series.get(source, (np.empty(0, np.int64), np.empty(0)))
        at = np.searchsorted(stamps, t_ns, side="right")
        return np.concatenate([[np.nan], values])[at]


def collect(path: Path, groups: Sequence[SignalGroup], means: Explained) -> Held:
    """What derived channels need at other times, from a pass of its own over the recording at `path`.

    It takes 16 bytes of memory for each sample; where none needs anything there is no pass. Raises DamageError.
    """
    foreign = set().union(*(group.held for group in groups))
    sought = {group.stream: group for group in groups if any(group.name == home for home, _ in foreign)}
    series: defaultdict[Source, list[Series]] = defaultdict(list)
    unpacked = Unpacked(means)
    for _, batch in recording.read(path) if foreign else ():
        if isinstance(batch, Rows):
            if group := sought.get(batch.series):
                for name in {name for home, name in foreign if home == group.name}:
                    series[group.name, name].append((batch.t_ns, batch.columns[name]))
            continue
        for part in unpacked.parts(batch):
            frames = FrameBatch(part.frames)
            for bus, can_id, at in frames.by_identifier():
                group = sought.get((bus, can_id))
                if group is None or group.message is None:
                    continue
                whole = frames.long_enough(group.message, at)
                names = {name for home, name in foreign if home == group.name}
                for name, values in frames.signals(group.message, whole, names).items():
                    series[group.name, name].append((part.frames.t_ns[whole], values))
    return Held(series)
