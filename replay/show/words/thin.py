"""Long series made short without losing an extreme: first lowest and highest sample of every pixel column."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamp = TypeVar("Stamp", np.float64, np.int64)
GAP = 5  # a hole this many median steps long is drawn as a gap


def thin(t: Floats, y: Floats, columns: int) -> tuple[Floats, Floats]:
    """At most three points (N,) a column of ascending time: lowest, highest, and a NaN where one was missing."""
    if t.size <= 2 * columns:
        return t, y
    column = np.minimum((t - t[0]) / (t[-1] - t[0]) * columns, columns - 1).astype(np.int64)
    finite, missing = np.flatnonzero(np.isfinite(y)), np.flatnonzero(~np.isfinite(y))
    order = finite[np.lexsort((y[finite], column[finite]))]
    new = np.flatnonzero(np.diff(column[order])) + 1  # where the next column begins, in `order`
    lowest, highest = order[np.r_[0, new][: order.size]], order[np.r_[new, order.size][: order.size] - 1]
    gaps = missing[np.unique(column[missing], return_index=True)[1]]
    keep = np.unique(np.concatenate([lowest, highest, gaps]))
    return t[keep], y[keep]


def with_gaps(t: Floats, y: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """`y` (N,) as NaN where it is not `used`, and a NaN in every hole of `t` that is longer than 5 median steps."""
    return open_holes(t, np.where(used, y, np.nan))


def open_holes(t: NDArray[Stamp], y: Floats) -> tuple[NDArray[Stamp], Floats]:
    """`y` (N,) with a NaN in every hole of `t` that is longer than 5 median steps."""
    if t.size < 3:
        return t, y
    step = np.diff(t)
    holes = np.flatnonzero(step > GAP * np.median(step)) + 1
    return np.insert(t, holes, t[holes - 1] + step[holes - 1] / 2), np.insert(y, holes, np.nan)
