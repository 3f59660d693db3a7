"""Readings that no motor could give: blocks that jump away from both their neighbours and come back, such as of a loose
contact.

A temperature's residual changes slowly. A block that is further from the median of the five around it than six times
what is usual in that channel and test, than its own noise allows and than 5 K (1.4826 x the median absolute deviation:
F. R. Hampel, J. Am. Stat. Assoc. 69 (1974) 383, doi:10.1080/01621459.1974.10482962) is left out of a fit, and counted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from twin.fitting.fit import Fit
from twin.fitting.recorded import Floats, RecordedChannel, Test

Bools = NDArray[np.bool_]

AROUND = 5  # blocks
FAR = 6.0  # times the usual deviation
LEAST_K = 5.0  # within 10 s: a smaller jump may be a pulse that the model has wrong, and harms less
MAD = 1.4826  # sd of a normal over its median absolute deviation


def outliers(found: Fit) -> dict[tuple[int, str], Bools]:
    """(test, channel) -> which of the channel's blocks (B,) that are there jump, for channels where any does.
    Temperatures only."""
    marked = {}
    names = {channel.name for test in found.model.tests for channel in test.channels}
    for series in found.series:
        if series.channel in names and series.y.size >= AROUND:
            jumps = jumping(series.y, np.sqrt(series.white_variance))
            if jumps.any():
                marked[series.session, series.channel] = jumps
    return marked


def jumping(y: Floats, noise: Floats) -> Bools:
    """Which blocks of residuals `y` (B,) [K] jump, by this rule; `noise` (B,) [K]: what each block's own allows."""
    away = np.abs(y - median_filter(y, AROUND, mode="nearest"))
    usual = np.maximum(MAD * float(np.median(away)), noise)
    found: Bools = away > np.maximum(FAR * usual, LEAST_K)
    return found


def without(tests: Sequence[Test], marked: Mapping[tuple[int, str], Bools]) -> tuple[Test, ...]:
    """The tests with the samples of marked blocks taken out."""
    return tuple(
        replace(test, channels=tuple(_masked(test, c, marked.get((s, c.name))) for c in test.channels))
        for s, test in enumerate(tests)
    )


def _masked(test: Test, channel: RecordedChannel, jumps: Bools | None) -> RecordedChannel:
    """The channel without the samples of blocks that jump (B,)."""
    if jumps is None:
        return channel
    cut = channel.blocks(test.frame.step_s)
    bad = np.zeros(cut.there.size, dtype=np.bool_)
    bad[np.flatnonzero(cut.there)[jumps]] = True
    bad_steps = np.repeat(bad, cut.length)[: channel.samples.size]
    return replace(channel, samples=np.where(bad_steps, 0.0, channel.samples))
