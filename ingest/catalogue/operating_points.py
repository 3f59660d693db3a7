"""Operating points: how long a session stayed in each cell of speed and torque, also as a map for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData, aligned, current, find
from ingest.texts.quantities import STORED_UNIT

COLUMNS, ROWS = 10, 8  # cells at most
ROUND, ROUNDISH = (1.0, 2.0, 2.5, 5.0), (1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # steps, times a power of ten
SPREAD = 0.15  # of values that are spread evenly a tenth are near an edge
SHADES = " ░▒▓█"
LABEL, CELL = 16, 8  # characters


@dataclass(frozen=True)
class OperatingPoints:
    """Time by cell, between ascending edges."""

    x: str  # "speed_rpm"
    y: str  # "torque_Nm" (signed), or "current_A" (rms) where no torque is recorded
    x_edges: tuple[float, ...]
    y_edges: tuple[float, ...]
    minutes: tuple[tuple[float, ...], ...]  # a row for each step of `y_edges`, in it one of `x_edges` each


def cells(channels: Sequence[ChannelData]) -> OperatingPoints | None:
    """Minutes in each cell of a session; None where speed, or both torque and current, are not recorded."""
    speed, load = find(channels, "speed"), find(channels, "torque") or current(channels)
    if speed is None or load is None:
        return None
    grid = aligned([speed, load])
    if not len(grid.t_ns):
        return None
    x, y = grid.values
    x_edges, y_edges = round_edges(x, COLUMNS), round_edges(y, ROWS)
    seconds, _, _ = np.histogram2d(y, x, bins=[y_edges, x_edges], weights=grid.dt_s)
    return OperatingPoints(
        x="speed_rpm",
        y=f"{'torque' if load.spec.quantity == 'torque' else 'current'}_{STORED_UNIT[load.spec.quantity]}",
        x_edges=tuple(x_edges.tolist()),
        y_edges=tuple(y_edges.tolist()),
        minutes=tuple(tuple(row) for row in (seconds / 60.0).tolist()),
    )


def round_edges(value: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Edges of at most `most` equal cells over the range of `value`, with round middles (1, 2, 2.5, 5 x 10^k).

    Tests are driven at round set points: these lie in the middle of a cell, so that noise does not spread one over
    two. Where one lies on an edge, as 1,500 does between 1,400 and 1,600, another step is taken (3, 4, 6, 8 x 10^k
    too). A cell is at least 1 % of the largest value wide.
    """
    low, high = float(value.min()), float(value.max())
    least = max((high - low) / most, 0.01 * max(abs(low), abs(high)), 1e-3)
    power = 10.0 ** np.floor(np.log10(least))

    def that_fit(words: Sequence[float]) -> list[NDArray[np.float64]]:
        steps = [power * ten * word for ten in (1.0, 10.0) for word in words]
        found = (_edges(low, high, step) for step in steps if step >= 0.999 * least)
        return [edges for edges in found if len(edges) - 1 <= most]

    tried = [*that_fit(ROUND)[:1], *that_fit(ROUNDISH)]
    return next((edges for edges in tried if _spread(value, edges) < SPREAD), tried[0])


def _edges(low: float, high: float, step: float) -> NDArray[np.float64]:
    first, last = np.floor(low / step + 0.5), np.floor(high / step + 0.5)
    edges: NDArray[np.float64] = (np.arange(first, last + 2) - 0.5) * step
    return edges


def _spread(value: NDArray[np.float64], edges: NDArray[np.float64]) -> float:
    """The share of the values that lie on both sides of an edge alike, within a twentieth of a cell of it."""
    near = 0.05 * (edges[1] - edges[0])
    inner = np.sort(value)
    below, at, above = (np.searchsorted(inner, edges[1:-1] + by) for by in (-near, 0.0, near))
    return float(2 * np.minimum(at - below, above - at).sum() / len(inner))


def draw(points: OperatingPoints, width: int = 100) -> str:
    """The map as text of at most `width` columns: a shade and the minutes a cell, named by its middle.

    Torque grows upwards, speed to the right; speed cells that do not fit are left out, and that is said below.
    """
    fit = max((width - LABEL) // CELL, 1)
    most = max(map(max, points.minutes)) or 1.0
    lines = [f"{_words(points.y):>{LABEL - 2}} │ minutes by {_words(points.x)} (darker: longer)"]
    for middle, row in reversed(list(zip(_middles(points.y_edges), points.minutes, strict=True))):
        lines.append(f"{middle:>{LABEL - 2}} │ " + "".join(_cell(minutes, most) for minutes in row[:fit]).rstrip())
    columns = _middles(points.x_edges)
    lines.append(
        f"{_words(points.x):>{LABEL - 2}} │ {''.join(middle.ljust(CELL) for middle in columns[:fit])}".rstrip()
    )
    if len(columns) > fit:
        lines.append(f"({len(columns) - fit} more columns up to {columns[-1]})")
    return "\n".join(line[:width] for line in lines)


def _middles(edges: Sequence[float]) -> list[str]:
    return [f"{(low + high) / 2:g}" for low, high in pairwise(edges)]


def _words(column: str) -> str:
    quantity, unit = column.rsplit("_", 1)
    return f"{quantity} [{unit}]"


def _cell(minutes: float, most: float) -> str:
    if minutes <= 0.0:
        return "·".ljust(CELL)
    shade = SHADES[max(int(np.ceil(4 * minutes / most)), 1)]
    number = "<0.1" if minutes < 0.05 else f"{minutes:.1f}" if minutes < 100 else f"{minutes:.0f}"
    return f"{shade * 2}{number}".ljust(CELL)
