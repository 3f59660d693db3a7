"""Sensitivities of a run, block by block.

A parameter's heat q in a step moves z, the mean temperature of the step, by (2 C / h + L)^-1 q: exactly, as the
implicit midpoint rule has one stage. What a block of steps does to its end and to its mean readings is a matrix, found
backwards through the block (the adjoint); so a column costs a few products a step, and one small matrix product a
block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.laws import Integers
from twin.fitting.march import System
from twin.motor.network import NOBODY
from twin.motor.outputs import Blocks, lag_factors

Floats = NDArray[np.float64]

SLAB = 128  # parameters whose states go through a block in one product: BLAS starts no threads for so few
NEAR = 8  # blocks whose heats are laid side by side, as they are used


@dataclass(frozen=True)
class SensorRow:
    """A channel as the march reads it: `weights` (n,) of the nodes and first-order lag [s]."""

    weights: Floats
    time_constant_s: float


@dataclass(frozen=True)
class Mean:
    """A mean over a block, of the sensor's reading at each step's start times `old` (N,) and at its end times `new`
    (N,). `ahead`: what a block's steps give belongs to the mean of the block so many later."""

    sensor: int
    old: Floats
    new: Floats
    ahead: int = 0


def means(sensor: int, blocks: Blocks, late: Floats) -> list[Mean]:
    """The block means of a sensor whose stamps are `late` (N + 1,) [steps] at the edges, between which it is linear."""
    if not late.any():
        return [Mean(sensor, blocks.old, blocks.new)]
    steps = blocks.old.size
    at = np.clip(np.arange(steps + 1) - late, 0, steps)
    low = np.minimum(at.astype(np.intp), steps - 1)
    own = np.arange(steps) // blocks.length
    low, share, weight = (
        np.concatenate(both)
        for both in (
            (low[:-1], low[1:]),
            (at[:-1] - low[:-1], at[1:] - low[1:]),
            (blocks.old, blocks.new),
        )
    )
    ahead = np.tile(own, 2) - low // blocks.length
    found = []
    for by in np.unique(ahead):
        here = np.where(ahead == by, weight, 0.0)
        old, new = (np.bincount(low, here * part, steps).astype(np.float64) for part in (1 - share, share))
        if old.any() or new.any():
            found.append(Mean(sensor, old, new, int(by)))
    return found


@dataclass(frozen=True)
class ParameterHeats:
    """What parameters bring: `heat` (L, N) [W per unit], each into node `a` and, where there is one, out of node `b`
    (L,), of parameter `column` (L,). Those of one place stand together."""

    heat: Floats
    a: Integers
    b: Integers
    column: Integers


def columns(
    system: System,
    sensors: Sequence[SensorRow],
    wanted: Sequence[Mean],
    loads: ParameterHeats,
    starts: Mapping[int, Sequence[int]],
    total: int,
    length: int,
    step_s: float,
) -> Floats:
    """(m, B, P): d(`wanted` of each sensor in each block of `length` steps) / d(parameter) for P = `total` parameters.

    The number of steps is a multiple of `length`. `starts`: parameter -> states whose temperature at the start it is.
    """
    (count, n), m = system.heat.shape, len(sensors)
    weights = np.array([s.weights for s in sensors])
    lags = np.array(
        [lag_factors(s.time_constant_s, step_s) if s.time_constant_s > 0 else (0.0, 0.0, 1.0) for s in sensors]
    )
    state = np.zeros((total, n + m))  # a reading at the start is the temperature itself
    for p, nodes in starts.items():
        for node in nodes:
            state[p, node] = 1.0
            state[p, n:] += weights[:, node]
    out = np.zeros((m, count // length, total))
    _columns(
        system.factors,
        system.storage,
        np.flatnonzero(weights.any(axis=0)),
        np.concatenate([np.zeros((2, n, n)), weights.T * lags[:, 1:].T[:, None]], axis=2),
        lags[:, 0].copy(),
        np.array([w.sensor for w in wanted]),
        np.array([w.ahead for w in wanted]),
        np.array([w.old for w in wanted]),
        np.array([w.new for w in wanted]),
        loads.heat,
        loads.a,
        loads.b,
        loads.column,
        length,
        state,
        out,
    )
    return out


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _columns(
    factors: Floats,
    storage: Floats,
    read: Integers,
    onto: Floats,
    decay: Floats,
    sensor: Integers,
    ahead: Integers,
    old: Floats,
    new: Floats,
    loads: Floats,
    into: Integers,
    out_of: Integers,
    column: Integers,
    length: int,
    state: Floats,
    out: Floats,
) -> None:
    """Block by block: what it does to the states (temperatures, then readings) and gives to the means, then every
    parameter's state through it. What is acted on stands side by side, in whole vectors (what fills them up stays
    0)."""
    (m, blocks, total), n = out.shape, storage.size
    states, width = n + m, -(-(n + m + len(sensor)) // 8) * 8
    through, heat = np.empty((states, width)), np.empty((n, length, width))
    moved, place = np.empty((n, width)), np.empty((NEAR * length, width))
    step, near = np.empty((total, width)), np.empty((len(loads), NEAR * length))
    for block in range(blocks):
        _backwards(factors, storage, read, onto, decay, sensor, old, new, block * length, moved, through, heat)
        for p in range(0, total, SLAB):
            np.dot(state[p : p + SLAB], through, step[p : p + SLAB])
        if block % NEAR == 0:
            for w in range(len(loads)):
                for k in range(min(NEAR, blocks - block) * length):
                    near[w, k] = loads[w, block * length + k]
        first = block % NEAR * length
        for w in range(len(loads)):
            a, b = into[w], out_of[w]
            if w == 0 or a != into[w - 1] or b != out_of[w - 1]:
                for k in range(length):
                    for r in range(width):
                        place[first + k, r] = heat[a, k, r]
                    if b != NOBODY:
                        for r in range(width):
                            place[first + k, r] -= heat[b, k, r]
            _add(near, w, first, first + length, place, step, column[w])
        for p in range(total):
            for s in range(states):
                state[p, s] = step[p, s]
        for w in range(len(sensor)):
            if 0 <= block + ahead[w] < blocks:
                for p in range(total):
                    out[sensor[w], block + ahead[w], p] += step[p, states + w]


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _backwards(
    factors: Floats,
    storage: Floats,
    read: Integers,
    onto: Floats,
    decay: Floats,
    sensor: Integers,
    old: Floats,
    new: Floats,
    first: int,
    moved: Floats,
    through: Floats,
    heat: Floats,
) -> None:
    """The adjoint of the block that begins with step `first`: `through` (n + m, width) of the state at its start,
    `heat` (n, length, width) of the heat at a node in a step [K/W]. `moved` (n, width) is room to work in."""
    n, length, width = heat.shape
    states = len(through)
    for i in range(states):
        for r in range(width):
            through[i, r] = 1.0 if r == i else 0.0
    for i in range(length - 1, -1, -1):
        step = first + i
        for w in range(len(sensor)):
            through[n + sensor[w], states + w] += new[w, step]
        for a in read:
            _add(onto[1], a, n, states, through, through, a)
        for q in range(2 * n):  # moved (1 + A) (D + B) = what stands behind the step: down with B and D, then up with A
            down = q < n
            a = q if down else 2 * n - 1 - q
            if down:
                for r in range(width):
                    moved[a, r] = through[a, r]
            _add(factors[step], a, 0 if down else a + 1, a if down else n, moved, moved, a)
            pivot = factors[step, a, a]
            if down:
                for r in range(width):
                    moved[a, r] *= pivot
            else:
                for r in range(width):
                    heat[a, i, r] = 2 * moved[a, r]
                for r in range(width):
                    through[a, r] = 2 * storage[a] * moved[a, r] - through[a, r]
        for a in read:
            _add(onto[0], a, n, states, through, through, a)
        for s in range(n, states):
            for r in range(width):
                through[s, r] *= decay[s - n]
        for w in range(len(sensor)):
            through[n + sensor[w], states + w] += old[w, step]


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _add(by: Floats, row: int, first: int, stop: int, rows: Floats, out: Floats, to: int) -> None:
    """Add to row `to` of `out` the rows from `first` to `stop`, times `by[row]` there. Five at once:
    few steps to store."""
    k = first
    while k + 5 <= stop:
        x0, x1, x2, x3, x4 = by[row, k], by[row, k + 1], by[row, k + 2], by[row, k + 3], by[row, k + 4]
        for r in range(out.shape[1]):
            total = out[to, r]
            total += x0 * rows[k, r]
            total += x1 * rows[k + 1, r]
            total += x2 * rows[k + 2, r]
            total += x3 * rows[k + 3, r]
            total += x4 * rows[k + 4, r]
            out[to, r] = total
        k += 5
    while k < stop:
        x0 = by[row, k]
        for r in range(out.shape[1]):
            out[to, r] += x0 * rows[k, r]
        k += 1
