"""A run and its sensitivities for any network, block by block, with dense matrices and nothing compiled a motor.

Over a step of h the temperatures follow the implicit midpoint rule (A-stable, order 2: Hairer and Wanner, Solving Ordinary
Differential Equations II, IV.3), with the heats linearised about a given course:

    (2 C / h + L) z = (2 C / h) T + b,    T' = 2 z - T,

z the mean temperature of the step. A parameter's heat q in a step moves z by (2 C / h + L)^-1 q: exactly, as the rule has
one stage. What a block of steps does to its end and to its mean readings is a matrix, found backwards through the block
(the adjoint); so a column costs a few products a step, and one small matrix product a block. The matrices are eliminated
without a search for pivots: 2 C / h outweighs what losses take from the diagonal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.laws import Integers, Law, Table, every_place, psi_of
from twin.outputs import Blocks, lag_factors
from twin.structure import NOBODY

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sensor:
    """A channel as the march reads it: `weights` (n,) of the nodes and first-order lag [s]."""

    weights: Floats
    time_constant_s: float


@dataclass(frozen=True)
class Mean:
    """A mean over a block, of the sensor's reading at each step's start times `old` (N,) and at its end times `new` (N,).
    `ahead`: what a block's steps give belongs to the mean of the block so many later."""

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
class System:
    """The linear system of every step. `matrix` (n, n, N) 2 C / h + L [W/K]; `storage` (n,) 2 C / h [W/K]; `heat` (n, N) b [W]."""

    matrix: Floats
    storage: Floats
    heat: Floats

    @classmethod
    def of(
        cls, table: Table, carried: Floats, capacity: Floats, step_s: float, course: Floats, boundaries: Floats
    ) -> System:
        """Law i carries `carried[i]` (N,) times psi, linear about the course (N, n)."""
        length, n = course.shape
        storage = 2 * capacity / step_s
        matrix, heat = np.zeros((n, n, length)), np.zeros((n, length))
        matrix[range(n), range(n)] = storage[:, None]
        at = every_place(course, boundaries)
        _assemble(table.places, table.numbers, table.copper, carried, at, matrix, heat)
        return cls(matrix, storage, heat)

    @cached_property
    def inverse(self) -> Floats:
        """(N, n, n) of 2 C / h + L [K/W]."""
        found = np.ascontiguousarray(self.matrix.transpose(2, 0, 1))
        _invert(found)
        return found


def run(system: System, initial: Floats) -> tuple[Floats, Floats]:
    """Temperatures at the edges (N + 1, n) and means of the steps (N, n) [degC], from `initial` (n,) on.

    Raises `DivergedError` where they leave the finite numbers or ten thousand degrees.
    """
    n, length = system.heat.shape
    edges, found = np.empty((length + 1, n)), np.empty((length, n))
    edges[0] = initial
    _run(system.matrix, system.storage, system.heat, edges, found)
    if not (np.abs(edges[-1]) < 1e4).all():
        raise DivergedError("temperatures run away: a loss grows faster with temperature than its links carry away")
    return edges, found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _assemble(
    places: Integers,
    numbers: Floats,
    copper: Floats,
    carried: Floats,
    at: Floats,
    matrix: Floats,
    heat: Floats,
) -> None:
    """Add L to the matrix and b to the heat, law by law, all steps side by side."""
    n, length = heat.shape
    found, constant = np.empty((4, length)), np.empty(length)
    ends = np.empty(3, np.int64)
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, found)
        ends[0], ends[1], ends[2] = places[w, 0], places[w, 1], places[w, 3]
        both = 2 if 0 <= ends[1] < n and not places[w, 4] else 1
        load = carried[w]
        for k in range(length):
            constant[k] = found[0, k]
        for i in range(3):
            node = ends[i]
            if not 0 <= node < n:
                continue
            slope, course = found[i + 1], at[node]
            for k in range(length):
                constant[k] -= slope[k] * course[k]
            for e in range(both):
                sign, row = 1.0 - 2 * e, matrix[ends[e], node]
                for k in range(length):
                    row[k] -= sign * load[k] * slope[k]
        for e in range(both):
            sign, into = 1.0 - 2 * e, heat[ends[e]]
            for k in range(length):
                into[k] += sign * load[k] * constant[k]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(matrix: Floats, storage: Floats, heat: Floats, edges: Floats, found: Floats) -> None:
    n = storage.size
    m, z = np.empty((n, n)), np.empty(n)
    for k in range(len(found)):
        for i in range(n):
            for c in range(n):
                m[i, c] = matrix[i, c, k]
            z[i] = heat[i, k] + storage[i] * edges[k, i]
        for i in range(n):
            pivot = 1 / m[i, i]
            for r in range(i + 1, n):
                factor = m[r, i] * pivot
                if factor != 0.0:
                    for c in range(i + 1, n):
                        m[r, c] -= factor * m[i, c]
                    z[r] -= factor * z[i]
        for i in range(n - 1, -1, -1):
            total = z[i]
            for c in range(i + 1, n):
                total -= m[i, c] * z[c]
            z[i] = total / m[i, i]
        for i in range(n):
            found[k, i] = z[i]
            edges[k + 1, i] = 2 * z[i] - edges[k, i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _invert(matrices: Floats) -> None:
    """Each (n, n), by Gauss and Jordan, in place."""
    n = matrices.shape[1]
    for k in range(len(matrices)):
        m = matrices[k]
        for i in range(n):
            pivot = 1 / m[i, i]
            m[i, i] = 1.0
            for c in range(n):
                m[i, c] *= pivot
            for r in range(n):
                factor = m[r, i]
                if r != i and factor != 0.0:
                    m[r, i] = 0.0
                    for c in range(n):
                        m[r, c] -= factor * m[i, c]


@dataclass(frozen=True)
class Responses:
    """What blocks do. State: temperatures, then readings (n + m). `through` (B, n + m + o, n + m): the state at a block's start
    to its end, then to the o means; `heat` (n, N, n + m + o): heat at a node in a step to the same [K/W]; `lagged` (m, n):
    what the readings are at the start; `ahead` (o,) as in `Mean`."""

    through: Floats
    heat: Floats
    lagged: Floats
    ahead: tuple[int, ...]
    length: int


def responses(
    system: System, sensors: Sequence[Sensor], wanted: Sequence[Mean], length: int, step_s: float
) -> Responses:
    """Backwards through every block of `length` steps at once. The number of steps is a multiple of it."""
    (n, count), m, o = system.heat.shape, len(sensors), len(wanted)
    blocks = count // length
    weights = np.array([s.weights for s in sensors])
    factors = np.array(
        [lag_factors(s.time_constant_s, step_s) if s.time_constant_s > 0 else (0.0, 0.0, 1.0) for s in sensors]
    )
    inverse = system.inverse.reshape(blocks, length, n, n)
    old = np.array([w.old for w in wanted]).reshape(o, blocks, length)
    new = np.array([w.new for w in wanted]).reshape(o, blocks, length)
    place = np.array([w.sensor for w in wanted])
    rows, own = n + m + o, n + m + np.arange(o)
    by_state = np.zeros((blocks, rows, n))
    by_reading = np.zeros((blocks, rows, m))
    by_state[:, range(n), range(n)] = 1.0
    by_reading[:, range(n, n + m), range(m)] = 1.0
    heat = np.empty((n, blocks, length, rows))
    for i in reversed(range(length)):
        by_reading[:, own, place] += new[:, :, i].T
        by_state = by_state + (by_reading * factors[:, 2]) @ weights
        moved = 2 * np.matmul(by_state, inverse[:, i])
        heat[:, :, i] = moved.transpose(2, 0, 1)
        by_state = moved * system.storage - by_state + (by_reading * factors[:, 1]) @ weights
        by_reading = by_reading * factors[:, 0]
        by_reading[:, own, place] += old[:, :, i].T
    # an unlagged reading at a block's start is the temperature itself
    through = np.concatenate([by_state, by_reading], axis=2)
    return Responses(through, heat.reshape(n, count, rows), weights, tuple(w.ahead for w in wanted), length)


@dataclass(frozen=True)
class Push:
    """A column's heat through a law: `weight` (N,) [W per unit of psi and amplitude]."""

    law: int
    weight: Floats


def columns(
    found: Responses,
    laws: Sequence[Law],
    psi: Sequence[Floats],
    pushes: Mapping[int, Sequence[Push]],
    starts: Mapping[int, Sequence[int]],
    total: int,
) -> Floats:
    """(o, B, P): d(each mean of each block) / d(parameter) for P = `total` parameters.

    `pushes`: parameter -> its heats through laws with `psi[law]` (N,); `starts`: parameter -> states whose temperature at
    the start it is.
    """
    n, count, rows = found.heat.shape
    blocks, o = count // found.length, len(found.ahead)
    states = rows - o
    driven = np.zeros((blocks, total, rows))
    for (a, b), loads in _loads(laws, psi, pushes, n).items():
        for p, load in loads.items():
            _push(found.heat, a, b, load, found.length, driven, p)
    state = np.zeros((total, states))
    for p, nodes in starts.items():
        for node in nodes:
            state[p, node] = 1.0
            state[p, n:] += found.lagged[:, node]
    out = np.zeros((o, blocks, total))
    for b in range(blocks):
        step = driven[b]
        step += state @ found.through[b].T
        state = step[:, :states]
        for i, ahead in enumerate(found.ahead):
            if 0 <= b + ahead < blocks:
                out[i, b + ahead] = step[:, states + i]
    return out


def _loads(
    laws: Sequence[Law], psi: Sequence[Floats], pushes: Mapping[int, Sequence[Push]], n: int
) -> dict[tuple[int, int], dict[int, Floats]]:
    """Place -> parameter -> heat (N,) [W] into its first end, and out of its second where that is a node."""
    found: dict[tuple[int, int], dict[int, Floats]] = {}
    for p, own in pushes.items():
        for push in own:
            law = laws[push.law]
            place = (law.a, law.b if 0 <= law.b < n and not law.one_way else NOBODY)
            load, loads = psi[push.law] * push.weight, found.setdefault(place, {})
            loads[p] = loads[p] + load if p in loads else load
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _push(heat: Floats, a: int, b: int, load: Floats, length: int, driven: Floats, p: int) -> None:
    rows = heat.shape[2]
    for k in range(load.size):
        block, watts = k // length, load[k]
        if watts == 0.0:
            continue
        if b == NOBODY:
            for r in range(rows):
                driven[block, p, r] += watts * heat[a, k, r]
        else:
            for r in range(rows):
                driven[block, p, r] += watts * (heat[a, k, r] - heat[b, k, r])
