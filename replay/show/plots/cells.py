"""Where the error lies: residuals of all sessions pooled by node, then averaged in cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.engine.results.run import Observed, Run

Floats = NDArray[np.float64]

ENOUGH_S = 60.0  # a cell with less time than this says nothing
LOADS = ("current_A", "torque_Nm")  # the load axis of the map: the first that every run has


@dataclass(frozen=True)
class Pool:
    """All usable samples of one node. Arrays (K,): residual [K], the time that it stands for [s], and where it was."""

    residual: Floats
    seconds: Floats
    measured: Floats  # degC
    since_start: Floats  # s
    inputs: Mapping[str, Floats]  # column -> absolute value


@dataclass(frozen=True)
class Cells:
    """Mean residual [K] (X, Y) by cell of `x_edges` (X + 1,) and `y_edges` (Y + 1,), NaN under ENOUGH_S `seconds`."""

    x_edges: Floats
    y_edges: Floats
    mean: Floats
    seconds: Floats


def pool_by_node(runs: Sequence[Run], columns: Sequence[str] = ()) -> dict[str, Pool]:
    """Node -> its samples in all runs, with the inputs `columns`; largest mean absolute residual first."""
    parts: dict[str, list[Pool]] = {}
    for run in runs:
        for observed in run.observed:
            parts.setdefault(observed.node, []).append(_samples(run, observed, columns))
    pools = {node: _joined(pools, columns) for node, pools in parts.items()}
    full = {node: pool for node, pool in pools.items() if pool.residual.size}
    return dict(sorted(full.items(), key=lambda item: -float(np.abs(item[1].residual).mean())))


def _samples(run: Run, observed: Observed, columns: Sequence[str]) -> Pool:
    use = observed.usable
    t_ns = observed.t_ns[use]
    step = np.clip(np.searchsorted(run.t_ns, t_ns, side="right") - 1, 0, run.t_ns.size - 2)
    return Pool(
        residual=observed.residual[use],
        seconds=np.diff(run.t_ns)[step] / 1e9,
        measured=observed.measured[use],
        since_start=(t_ns - run.t_ns[0]) / 1e9,
        inputs={column: np.abs(run.inputs[column][step]) for column in columns},
    )


def _joined(pools: Sequence[Pool], columns: Sequence[str]) -> Pool:
    def all_of(name: str) -> Floats:
        parts: list[Floats] = [getattr(pool, name) for pool in pools]
        return np.concatenate(parts)

    inputs = {column: np.concatenate([pool.inputs[column] for pool in pools]) for column in columns}
    return Pool(all_of("residual"), all_of("seconds"), all_of("measured"), all_of("since_start"), inputs)


def load_column(runs: Sequence[Run]) -> str | None:
    """The load axis: current if every run has it, else torque, else None."""
    return next((column for column in LOADS if all(column in run.inputs for run in runs)), None)


def round_step(span: float, cells: int) -> float:
    """A round width [unit of `span`] of which about `cells` fill the span."""
    width = (span or 1.0) / cells
    power = 10.0 ** np.floor(np.log10(width))
    steps = (float(factor * power) for factor in (1.0, 2.0, 2.5, 5.0, 10.0))
    return min(steps, key=lambda step: abs(np.log(step / width)))


def round_edges(smallest: float, largest: float, cells: int) -> Floats:
    """Edges at round numbers that hold all from `smallest` to `largest`, about `cells` cells."""
    step = round_step(largest - smallest, cells)
    first, last = np.floor(smallest / step + 1e-9), np.ceil(largest / step - 1e-9)
    return np.asarray(np.arange(first, max(last, first + 1) + 1) * step, dtype=np.float64)


def round_centres(largest: float, cells: int) -> Floats:
    """Edges from 0 of about `cells` cells around round numbers: a bench holds these, and must not straddle an edge."""
    step = round_step(largest, cells)
    return np.asarray(np.r_[0.0, (np.arange(np.floor(largest / step + 0.5) + 1) + 0.5) * step], dtype=np.float64)


def in_cells(pool: Pool, x: Floats, y: Floats, x_edges: Floats, y_edges: Floats) -> Cells:
    """Mean residual of a node in the cells of two quantities `x`, `y` (K,), weighted by time."""
    there = np.isfinite(x) & np.isfinite(y)
    edges, weight = [x_edges, y_edges], pool.seconds[there]
    seconds = np.histogram2d(x[there], y[there], edges, weights=weight)[0]
    total = np.histogram2d(x[there], y[there], edges, weights=weight * pool.residual[there])[0]
    mean = np.divide(total, seconds, out=np.full_like(total, np.nan), where=seconds >= ENOUGH_S)
    return Cells(x_edges, y_edges, mean, seconds)


def along(pool: Pool, x: Floats, edges: Floats) -> Floats:
    """Mean residual of a node [K] in the cells of one quantity `x` (K,): (edges - 1,), NaN where under ENOUGH_S."""
    return in_cells(pool, x, np.zeros_like(x), edges, np.array([-1.0, 1.0])).mean[:, 0]
