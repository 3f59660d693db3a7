"""Held signals over steps: the mean of a function of the inputs over each step, at the inputs' own rates.

A bench samples torque at 100 Hz and the model steps once a second. What heats the motor in a step is the mean of I^2,
so every feature is evaluated wherever an input changes, and averaged over the step after that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

GAP_INTERVALS = 5.0  # longer than this many median intervals is a gap: bridged linearly and marked
CUT_S = 600.0  # longer than this the session is cut


@dataclass(frozen=True)
class InputSamples:
    """One input as samples. `t_ns` int64 (M,) ascending; `value` float64 (M,), finite; each value holds until the next.
    `gaps`: (start_ns, end_ns) of stretches without samples that were bridged."""

    t_ns: Times
    value: Floats
    gaps: tuple[tuple[int, int], ...] = ()


def bridge(t_ns: Times, value: Floats) -> InputSamples:
    """Fill gaps (over 5 median intervals) by a straight line sampled at the median interval, and list them."""
    if t_ns.size < 3:
        return InputSamples(t_ns, value)
    step = np.diff(t_ns)
    interval = int(np.median(step))
    at = np.flatnonzero((step > GAP_INTERVALS * interval) & (step <= CUT_S * 1e9))
    if interval <= 0 or at.size == 0:
        return InputSamples(t_ns, value)
    filled_t = [np.arange(t_ns[i] + interval, t_ns[i + 1], interval) for i in at]
    filled_v = [np.interp(t, t_ns[i : i + 2], value[i : i + 2]) for i, t in zip(at, filled_t, strict=True)]
    places = np.repeat(at + 1, [t.size for t in filled_t])
    return InputSamples(
        np.insert(t_ns, places, np.concatenate(filled_t)),
        np.insert(value, places, np.concatenate(filled_v)),
        tuple((int(t_ns[i]), int(t_ns[i + 1])) for i in at),
    )


def longest_stretch(signals: Mapping[str, InputSamples]) -> tuple[int, int]:
    """The longest stretch [ns] in which every signal has samples and none is silent for more than 10 minutes."""
    start = max(int(s.t_ns[0]) for s in signals.values())
    end = min(int(s.t_ns[-1]) for s in signals.values())
    cuts = [(start, start), (end, end)]
    for signal in signals.values():
        at = np.flatnonzero(np.diff(signal.t_ns) > CUT_S * 1e9)
        cuts += [(int(signal.t_ns[i]), int(signal.t_ns[i + 1])) for i in at]
    cuts.sort()
    best, reach = (start, start), start
    for silent_from, silent_to in cuts:
        if min(silent_from, end) - reach > best[1] - best[0]:
            best = (reach, min(silent_from, end))
        reach = max(reach, silent_to)
    return best


def held(signal: InputSamples, at_ns: Times) -> Floats:
    """The value in force at each time: that of the last sample at or before it (the first one before any)."""
    index = np.searchsorted(signal.t_ns, at_ns, side="right") - 1
    return signal.value[np.maximum(index, 0)]


@dataclass(frozen=True)
class Pieces:
    """The finest intervals on which no input changes, K of them. `values`: input -> (K,); `weight` (K,) [ns]: their
    lengths; `first` (N,): the first piece of each step."""

    values: Mapping[str, Floats]
    weight: Floats
    first: NDArray[np.intp]
    step_ns: int

    def mean(self, values: Floats) -> Floats:
        """Time-weighted mean over each step: (K,) or (K, m) -> (N,) or (N, m)."""
        weighted = values * (self.weight if values.ndim == 1 else self.weight[:, None])
        mean: Floats = np.add.reduceat(weighted, self.first, axis=0) / self.step_ns
        return mean


def pieces(signals: Mapping[str, InputSamples], edges_ns: Times) -> Pieces:
    """Cut the time between `edges_ns` (N + 1,) (equal steps) wherever any signal has a sample."""
    inside = [s.t_ns[(s.t_ns > edges_ns[0]) & (s.t_ns < edges_ns[-1])] for s in signals.values()]
    cuts = np.unique(np.concatenate([edges_ns, *inside]))
    return Pieces(
        values={name: held(signal, cuts[:-1]) for name, signal in signals.items()},
        weight=np.diff(cuts).astype(np.float64),
        first=np.searchsorted(cuts, edges_ns[:-1]),
        step_ns=int(edges_ns[1] - edges_ns[0]),
    )
