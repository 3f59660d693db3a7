"""Two runs of one test laid beside each other by where the motor was driven, not by the time that had gone by.

Both runs are cut into blocks of at least one second. Two blocks match where speed and load agree within a share of the
largest of both runs. Of all ways to pair blocks that keep the order of both runs, the one with most pairs is taken
(longest common subsequence; T. H. Cormen et al., Introduction to Algorithms, 15.4), and of equals the one that pairs
a hold from its beginning on: what came before is then the same too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData, block_means, current, find, measured_blocks

SPEED_ALIKE, LOAD_ALIKE, OVEN_ALIKE = 0.03, 0.05, 0.03  # shares of the largest in both runs
SECOND_NS = 1_000_000_000
MOST_BLOCKS = 6000  # of a run: pairing takes a byte for each pair of blocks
BREAK_s = 60  # what one run did and the other did not, beyond which the state of both is another
LEAST_s = 60  # of a stretch: shorter ones are alike by chance

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RunBlocks:
    """A run as means over blocks of `block_s` [s]: name of a channel -> (N,), NaN where it was not measured; `drive`:
    the same of what drove it, by quantity."""

    block_s: int
    means: dict[str, Array]
    drive: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Matched:
    """Pairs of blocks that were driven alike: `first`, `second` (P,) of each run, both rising.

    `stretch` (P,) numbers those that follow each other in both runs; `since_s` (P,) is the time since its begin [s].
    """

    by: tuple[str, ...]  # quantities
    first: Ints
    second: Ints
    stretch: Ints
    since_s: Array
    block_s: int

    def shares(self, runs: tuple[RunBlocks, RunBlocks], least: float) -> tuple[float, float]:
        """Which share of each run was driven alike, of the time with more than `least` of the largest speed or load; 0
        where there is none."""
        tops = {name: max(float(np.nanmax(np.abs(run.drive[name]), initial=0.0)) for run in runs) for name in self.by}
        own = []
        for run, at in zip(runs, (self.first, self.second), strict=True):
            drives = np.any([np.abs(run.drive[name]) > least * tops[name] for name in self.by], axis=0)
            own.append(float(drives[at].sum() / max(drives.sum(), 1)))
        return own[0], own[1]

    @property
    def matched_s(self) -> float:
        """How long both were driven alike [s]."""
        return float(len(self.first) * self.block_s)


def operating(channels: Sequence[ChannelData]) -> dict[str, ChannelData]:
    """What says where a motor was driven: quantity -> channel; without speed and load, an oven's temperature."""
    speed, torque, load = find(channels, "speed"), find(channels, "torque"), current(channels)
    found = {"speed": speed, "torque": torque, "current": load or find(channels, "current_dc")}
    there = {name: channel for name, channel in found.items() if channel is not None}
    if there:
        return there
    ovens = [one for one in channels if (one.place or one.spec.name).lower().startswith("oven") and len(one.t_ns)]
    return {"oven": ovens[0]} if ovens and ovens[0].spec.quantity == "temperature" else {}


def driven_by(first: Sequence[ChannelData], second: Sequence[ChannelData]) -> tuple[str, ...]:
    """The quantities that both runs can be laid beside each other by: speed and one load, or an oven's temperature."""
    both = [name for name in operating(first) if name in operating(second)]
    return tuple(name for name in both if not (name == "current" and "torque" in both))


def block_length(runs: Sequence[Sequence[ChannelData]]) -> int:
    """The length of a block [s] that cuts the longest run into MOST_BLOCKS at most."""
    spans = [max(int(one.t_ns[-1]) for one in run) - min(int(one.t_ns[0]) for one in run) for run in runs]
    return 1 + int(max(spans) / SECOND_NS / MOST_BLOCKS)


def blocks(channels: Sequence[ChannelData], block_s: int, by: Sequence[str]) -> RunBlocks:
    """A run in blocks, from where what drives it (quantities `by`) begins up to where it ends."""
    drive = {name: channel for name, channel in operating(channels).items() if name in by}
    begin = max(int(channel.t_ns[0]) for channel in drive.values())
    end = max(begin, min(int(channel.t_ns[-1]) for channel in drive.values()))
    means = {channel.spec.name: _in_blocks(channel, begin, end, block_s) for channel in channels}
    return RunBlocks(block_s, means, {name: _in_blocks(one, begin, end, block_s) for name, one in drive.items()})


def _in_blocks(channel: ChannelData, begin: int, end: int, block_s: int) -> Array:
    count = (end - begin) // (block_s * SECOND_NS) + 1
    inside = slice(*np.searchsorted(channel.t_ns, [begin, end + 1]).tolist())
    if inside.start == inside.stop:
        return np.full(count, np.nan)
    own = channel.samples(inside)
    mean = block_means(own.t_ns, own.value, (begin, end), block_s)
    return np.where(measured_blocks(own, begin, count, block_s), mean, np.nan)


def match(first: RunBlocks, second: RunBlocks, by: Sequence[str]) -> Matched:
    """Pair the blocks of two runs that were driven alike, in stretches of LEAST_s and more."""
    shares = {"speed": SPEED_ALIKE, "oven": OVEN_ALIKE}
    scaled = []
    for one in (first, second):
        tops = [max(float(np.nanmax(np.abs(run.drive[name]), initial=0.0)) for run in (first, second)) for name in by]
        widths = [max(top, 1e-9) * shares.get(name, LOAD_ALIKE) for top, name in zip(tops, by, strict=True)]
        scaled.append(np.column_stack([one.drive[name] / width for name, width in zip(by, widths, strict=True)]))
    a, b = _longest_common(scaled[0], scaled[1])
    return _in_stretches(a, b, tuple(by), first.block_s)


def _longest_common(x: Array, y: Array) -> tuple[Ints, Ints]:
    """Pairs of rows of `x` (N, k) and `y` (M, k), within 1 of each other in every column, as many as can be in order.

    From the end on, `most[j]` is how many pairs the rest of both can have; the way is then walked from the beginning.
    """
    n, m = len(x), len(y)
    alike = np.ones((n, m), np.bool_)
    for one, other in zip(x.T, y.T, strict=True):
        for i, value in enumerate(one):
            alike[i] &= (other >= value - 1.0) & (other <= value + 1.0)
    behind, most = np.zeros(m + 1, np.int32), np.zeros(m + 1, np.int32)
    more = np.zeros((n, m), np.bool_)  # whether leaving out row i of x leaves as many pairs as leaving out row j of y
    for i in range(n - 1, -1, -1):
        here = np.maximum(behind[:-1], behind[1:] + alike[i])
        np.maximum.accumulate(here[::-1], out=most[-2::-1])
        np.greater_equal(behind[:-1], most[1:], out=more[i])
        behind, most = most, behind
    pairs: list[tuple[int, int]] = []
    i = j = 0
    while i < n and j < m:
        if alike[i, j]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif more[i, j]:
            i += 1
        else:
            j += 1
    found = np.array(pairs, np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _in_stretches(a: Ints, b: Ints, by: tuple[str, ...], block_s: int) -> Matched:
    """What is left of pairs without the stretches that are too short to be one test."""
    apart = np.maximum(np.diff(a, prepend=a[:1]), np.diff(b, prepend=b[:1])) > 1 + BREAK_s / block_s
    stretch = np.cumsum(apart)
    sizes = np.bincount(stretch) if len(stretch) else np.zeros(0, np.int64)
    kept = (sizes * block_s >= LEAST_s)[stretch]
    a, b, stretch = a[kept], b[kept], stretch[kept]
    begin = np.r_[True, np.diff(stretch) != 0][: len(a)]
    since = (a - a[begin][np.cumsum(begin) - 1]) * float(block_s) if len(a) else np.zeros(0)
    return Matched(by, a, b, np.cumsum(begin) - 1, since, block_s)
