"""Which log counts where several hold a channel at the same time: mixed, two clocks would make one channel of steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

GAP_MEDIANS = 5.0  # median intervals without a sample are a gap
ABOUT = 0.9  # of the longer one: two logs are about as long
LOGGED_NS = 60_000_000_000  # between samples of a logger at most: what comes more rarely was measured one by one

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def counted(t_ns: Ints, value: NDArray[Any], log: Ints) -> Bools:
    """Which samples of a channel count (N,): stamps in order [ns], values as read, and the number of the log of each.

    Where two logs go on at once, as one log in two formats or two loggers on one bus, the longer one counts, of about
    equal ones that with less time between its samples, of equals the first; the other fills its gaps. So a burst of a
    fast recorder makes no gaps of all that is between the samples of the others. Of what was measured one by one all
    counts but a copy: the same value at the same stamp.
    """
    counts = np.ones(len(t_ns), np.bool_)
    if not (log != log[:1]).any():
        return counts
    copy = np.zeros(len(t_ns), np.bool_)
    copy[1:] = (np.diff(t_ns) == 0) & (value[1:] == value[:-1]) & (log[1:] != log[:-1])
    by_log = np.argsort(log, kind="stable")
    logs = np.split(by_log, np.flatnonzero(np.diff(log[by_log])) + 1)
    first, last = (np.array([t_ns[own[end]] for own in logs], np.int64) for end in (0, -1))
    median = np.array([_median(t_ns[own]) for own in logs])
    turn = in_turn(last - first, median)
    for place, one in enumerate(turn):
        own, before = logs[one], turn[:place]
        if median[one] > LOGGED_NS:
            counts[own] = ~copy[own]
            continue
        for other in before[(first[before] <= last[one]) & (last[before] >= first[one])]:
            counts[own] &= ~goes_on(t_ns[logs[other]], t_ns[own])
    return counts


def in_turn(length_ns: ArrayLike, median_ns: ArrayLike) -> NDArray[np.intp]:
    """The numbers of logs by length and median interval of each (N,) [ns], the one first that counts before all others:
    the longest, and of those about as long the one with less time between its samples; of equals the first."""
    length_ns, median_ns = np.asarray(length_ns), np.asarray(median_ns)
    left = np.argsort(-length_ns, kind="stable")
    turn = []
    while len(left):
        alike = length_ns[left] >= ABOUT * length_ns[left[0]]
        own = np.sort(left[alike])
        turn.append(own[np.argsort(median_ns[own], kind="stable")])
        left = left[~alike]
    return np.concatenate(turn)


def goes_on(t_ns: Ints, at_ns: Ints) -> Bools:
    """Whether a log with samples at `t_ns` (N,), in order, goes on at the stamps `at_ns` (M,): no gap holds them."""
    before, after = np.searchsorted(t_ns, at_ns, "right") - 1, np.searchsorted(t_ns, at_ns, "left")
    within = (before >= 0) & (after < len(t_ns))
    apart = t_ns[np.minimum(after, len(t_ns) - 1)] - t_ns[np.maximum(before, 0)]
    return np.asarray(within & (apart <= GAP_MEDIANS * _median(t_ns)))


def _median(t_ns: Ints) -> float:
    """The median interval [ns]; of one sample that of none."""
    return float(np.median(np.diff(t_ns))) if len(t_ns) > 1 else np.inf
