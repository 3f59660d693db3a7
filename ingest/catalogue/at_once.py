"""Which log counts where several hold a channel at the same time: mixed, two clocks would make one channel of steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

GAP_MEDIANS = 5.0  # median intervals without a sample are a gap
LOGGED_NS = 60_000_000_000  # between samples of a logger at most: what comes more rarely was measured one by one

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def counted(t_ns: Ints, value: NDArray[Any], log: Ints) -> Bools:
    """Which samples of a channel count (N,): stamps in order [ns], values as read, and the number of the log of each.

    Where two logs go on at once the one with less time between its samples counts, of equals the first, as of one log
    in two formats or of two loggers on one bus; the other fills its gaps. Of what was measured one by one all counts
    but a copy: the same value at the same stamp.
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
    finest = np.argsort(median, kind="stable")
    for place, one in enumerate(finest):
        own, finer = logs[one], finest[:place]
        if median[one] > LOGGED_NS:
            counts[own] = ~copy[own]
            continue
        for other in finer[(first[finer] <= last[one]) & (last[finer] >= first[one])]:
            counts[own] &= ~goes_on(t_ns[logs[other]], t_ns[own])
    return counts


def goes_on(t_ns: Ints, at_ns: Ints) -> Bools:
    """Whether a log with samples at `t_ns` (N,), in order, goes on at the stamps `at_ns` (M,): no gap holds them."""
    before, after = np.searchsorted(t_ns, at_ns, "right") - 1, np.searchsorted(t_ns, at_ns, "left")
    within = (before >= 0) & (after < len(t_ns))
    apart = t_ns[np.minimum(after, len(t_ns) - 1)] - t_ns[np.maximum(before, 0)]
    return np.asarray(within & (apart <= GAP_MEDIANS * _median(t_ns)))


def _median(t_ns: Ints) -> float:
    """The median interval [ns]; of one sample that of none."""
    return float(np.median(np.diff(t_ns))) if len(t_ns) > 1 else np.inf
