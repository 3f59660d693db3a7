"""Long series made short without losing an extreme: first lowest and highest sample of every pixel column, and both
ends."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamp = TypeVar("Stamp", np.float64, np.int64)
GAP = 5  # a hole this many median steps long is drawn as a gap


def thin(t: Floats, y: Floats, columns: int) -> tuple[Floats, Floats]:
    """At most three points (N,) a column of ascending time: lowest, highest, and a NaN where one was missing; and the
    first and last of all, where the line begins and ends."""
    if t.size <= 2 * columns:
        return t, y
    column = np.minimum((t - t[0]) / (t[-1] - t[0]) * columns, columns - 1).astype(np.int64)
    finite, missing = np.flatnonzero(np.isfinite(y)), np.flatnonzero(~np.isfinite(y))
    order = finite[np.lexsort((y[finite], column[finite]))]
    new = np.flatnonzero(np.diff(column[order])) + 1  # where the next column begins, in `order`
    lowest, highest = order[np.r_[0, new][: order.size]], order[np.r_[new, order.size][: order.size] - 1]
    gaps = missing[np.unique(column[missing], return_index=True)[1]]
    keep = np.unique(np.concatenate([[0, t.size - 1], lowest, highest, gaps]))
    return t[keep], y[keep]


def with_gaps(t: Floats, y: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """`y` (N,) as NaN where it is not `used`, and a NaN in every hole of `t` that is longer than 5 median steps."""
    return open_holes(t, np.where(used, y, np.nan))


def next_samples(t: NDArray[Stamp], at: NDArray[Stamp]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Index of the sample of ascending times (N,) at or after each instant (M,), and whether there is one: not in what
    is drawn as a gap, nor behind the end."""
    i = np.minimum(np.searchsorted(t, at), t.size - 1)
    there: NDArray[np.bool_] = np.abs(t[i] - at) <= (GAP * np.median(np.diff(t)) if t.size > 1 else 0)
    return i, there


def open_holes(t: NDArray[Stamp], y: Floats) -> tuple[NDArray[Stamp], Floats]:
    """`y` (N,) with a NaN in every hole of `t` that is longer than 5 median steps."""
    if t.size < 3:
        return t, y
    step = np.diff(t)
    holes = np.flatnonzero(step > GAP * np.median(step)) + 1
    return np.insert(t, holes, t[holes - 1] + step[holes - 1] / 2), np.insert(y, holes, np.nan)
