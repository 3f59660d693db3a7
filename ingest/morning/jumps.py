"""Thermometers that jump together: no heat does that, an inverter, a ground loop or their amplifier does.

A body follows its heat through its capacity, so a change of load gives its temperature a kink and never a step. Where
several thermometers step at one moment, what they share has stepped: the voltage that an inverter induces in their
wires, their ground, their reference junction. On the public recordings of `examples/hust_motor` nine of eleven
thermometers, from copper to end cap, read 1.5 to 2 K more as soon as the motor stops under a live inverter.

Of each thermometer a line is fitted to the `SIDE_s` before and after a moment, `BETWEEN_s` left out on both sides.
Where the two lines do not meet there, it jumped: by more than `SIGMAS` of what that difference usually is, by more than
`LEAST_K`, and by more than its change of slope makes in `KINK_s`. A pulse of load that is shorter than a side looks the
same: a moment counts at which `TOGETHER` jump to one side while the current stays below half of its largest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData, current, find
from ingest.catalogue.kinds import STANDSTILL_rpm

SIDE_s, BETWEEN_s = 15, 3
TOGETHER = 3  # thermometers
LEAST_K, SIGMAS, KINK_s = 0.8, 6.0, 15.0
ACCELERATED = 0.1  # share of the largest speed
APART_s = 30  # two jumps to one side that are closer are one
SLOWEST_s = 2.0  # between samples: of a slower channel nobody knows what is a jump

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Jumps:
    """Thermometers that jumped together. `channels`: those with a part in half of the jumps; `at_s` (j,) [s] since the
    first sample; `size_K` (j,) by how much, the median over those that jumped; `standing`: how many came
    while the motor stood, None where no speed is known."""

    channels: tuple[str, ...]
    at_s: NDArray[np.int64]
    size_K: Array
    standing: int | None


def jumps_together(thermometers: Sequence[ChannelData], channels: Sequence[ChannelData]) -> Jumps | None:
    """The moments at which at least `TOGETHER` of the `thermometers` jump to one side; None where there are none.
    `channels`: all of the session, for its speed and current."""
    fast = [one for one in thermometers if 0.0 < one.median_ns <= SLOWEST_s * 1e9]
    if len(fast) < TOGETHER:
        return None
    begin = min(int(one.t_ns[0]) for one in fast)
    seconds = int((max(int(one.t_ns[-1]) for one in fast) - begin) // 1_000_000_000) + 1
    if seconds > sum(len(one.t_ns) for one in fast):  # a far stamp: nothing is as long as its samples say
        return None
    jumped = np.where(
        _unloaded(channels, begin, seconds), [_jumped(_each_second(one, begin, seconds)) for one in fast], 0.0
    )
    jumped[jumped * _accelerated(channels, begin, seconds) > 0.0] = 0.0
    at = np.array(sorted(s for side in (1, -1) for s in _moments((side * jumped > 0).sum(axis=0))), dtype=np.int64)
    if not at.size:
        return None
    part = np.array([jumped[:, max(0, s - BETWEEN_s) : s + BETWEEN_s + 1].any(axis=1) for s in at]).mean(axis=0)
    size = np.array([np.median(np.abs(jumped[jumped[:, s] != 0.0, s])) for s in at])
    names = tuple(one.spec.name for one, share in zip(fast, part, strict=True) if share >= 0.5)
    return Jumps(names, at, size, _standing(channels, begin, at))


def _each_second(one: ChannelData, begin: int, seconds: int) -> Array:
    """(seconds,) means, those of empty seconds between two samples that are not far apart filled in."""
    at = (one.t_ns - begin) // 1_000_000_000
    count = np.bincount(at, minlength=seconds)
    total = np.bincount(at, one.value, minlength=seconds)
    there = np.flatnonzero(count)
    means = np.interp(np.arange(seconds), there, total[there] / count[there])
    ends = np.flatnonzero(np.diff(there) > 2 * SLOWEST_s)
    means[: there[0]] = means[there[-1] + 1 :] = np.nan
    for first, last in zip(there[ends], there[ends + 1], strict=True):
        means[first + 1 : last] = np.nan
    return means


def _jumped(x: Array) -> Array:
    """(N,) by how much it jumps at each second [K], 0 where it does not."""
    jumped, margin = np.zeros(len(x)), SIDE_s + BETWEEN_s
    if len(x) > 2 * margin:
        about = np.arange(SIDE_s) - (SIDE_s - 1) / 2
        windows = sliding_window_view(x, SIDE_s)
        middle, slope = windows.mean(axis=1), windows @ about / (about @ about)
        reach = BETWEEN_s + SIDE_s / 2  # from the middle of a side to the moment
        own, ahead = slice(0, len(x) - 2 * margin), slice(margin + BETWEEN_s, len(x) - margin + BETWEEN_s)
        step = middle[ahead] - middle[own] - (slope[ahead] + slope[own]) * reach
        usual = 1.4826 * float(np.nanmedian(np.abs(step))) if np.isfinite(step).any() else 0.0
        least = np.maximum(max(LEAST_K, SIGMAS * usual), KINK_s * np.abs(slope[ahead] - slope[own]))
        jumped[margin:-margin] = np.where(np.abs(step) > least, step, 0.0)
    return jumped


def _unloaded(channels: Sequence[ChannelData], begin: int, seconds: int) -> NDArray[np.bool_]:
    """(seconds,) whether the current stays below half of its largest from a side before to a side after."""
    load = current(channels) or find(channels, "torque")
    if load is None:
        return np.zeros(seconds, dtype=np.bool_)
    at = (load.t_ns - begin) // 1_000_000_000
    loaded = np.zeros(seconds, dtype=np.int64)
    high = at[np.abs(load.value) > np.abs(load.value).max() / 2]
    loaded[high[(high >= 0) & (high < seconds)]] = 1
    reach = 2 * (SIDE_s + BETWEEN_s) + 1
    calm: NDArray[np.bool_] = np.convolve(loaded, np.ones(reach, dtype=np.int64), "same")[:seconds] == 0
    return calm


def _accelerated(channels: Sequence[ChannelData], begin: int, seconds: int) -> Array:
    """(seconds,) 1 where the motor turns faster in the side after than in the side before, by more than `ACCELERATED`
    of its largest speed, -1 where slower, else 0."""
    changed, speed, margin = np.zeros(seconds), find(channels, "speed"), SIDE_s + BETWEEN_s
    if speed is None or seconds <= 2 * margin:
        return changed
    ends = (begin, begin + seconds * 1_000_000_000)
    meanwhile = speed.samples(slice(*(int(np.searchsorted(speed.t_ns, end)) for end in ends)))
    if not len(meanwhile.t_ns):
        return changed
    turns = replace(meanwhile, value=np.abs(meanwhile.value))
    sides = sliding_window_view(_each_second(turns, begin, seconds), SIDE_s).mean(axis=1)
    change = sides[margin + BETWEEN_s : seconds - margin + BETWEEN_s] - sides[: seconds - 2 * margin]
    changed[margin:-margin] = np.where(np.abs(change) > ACCELERATED * turns.value.max(), np.sign(change), 0.0)
    return changed


def _moments(together: NDArray[np.int64]) -> list[int]:
    """The middle of those seconds at which most jump, of each run of seconds at which enough do."""
    at = np.flatnonzero(together >= TOGETHER)
    runs = np.split(at, np.flatnonzero(np.diff(at) > APART_s) + 1) if at.size else []
    return [int(np.median(run[together[run] == together[run].max()])) for run in runs]


def _standing(channels: Sequence[ChannelData], begin: int, at_s: NDArray[np.int64]) -> int | None:
    """How many of the moments came while the motor stood."""
    speed = find(channels, "speed")
    if speed is None:
        return None
    stands = speed.t_ns[np.abs(speed.value) <= STANDSTILL_rpm]
    nearest = [np.abs(stands - (begin + second * 1_000_000_000)).min(initial=2**62) for second in at_s]
    return sum(bool(distance <= BETWEEN_s * 1_000_000_000) for distance in nearest)
