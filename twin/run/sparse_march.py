"""A run by the implicit midpoint rule and what parameters do to it, for networks of any size, compiled once for all
of them.

The scheme is that of `twin.fitting.march`, which fits take. The index program (`twin.compiled.indexed`) assembles and
eliminates the steps, `LANES` of them side by side. A step is M z = S T + b, T' = 2 z - T with S = 2 C / h; a
parameter that brings the heat q moves its mean temperatures z by M dz = S dT + q. All parameters go through it side
by side, in strips of columns (`twin.arithmetic.lanes`) that stay in the nearest caches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import LaneStore, Sweep, sweep
from twin.arithmetic.vectors import LANES, vectors
from twin.compiled.indexed import Index, Program, assemble

Floats = NDArray[np.float64]

STRIP = 96  # columns at most that go through the steps together: what they need stays in the nearest caches
SETTLED_K = (
    1e-4  # heats that are linearised about what is so near are exact to 1e-8 K: what is left falls with the square
)
ROUNDS = 8  # of linearising steps about what the last round found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def run(
    program: Program,
    affine: bool,
    storage: Floats,
    coefficients: Floats,
    copper: Floats,
    factors: Floats,
    phi: Floats,
    around: Floats,
    start: Floats,
    shares: Floats,
    means: Floats,
    rises: Floats,
) -> None:
    """K steps from `start` (n,), which is left at their end.

    Out come `means` (K, n), the mean temperatures of each step; `rises` (K, n), half of what each temperature rises
    by; and `shares` (K, n + 2 E), the elimination: 1 / pivot of each node, then the shares of later nodes that a row
    takes on the way up, then those of earlier ones on the way down, both in the order of the program's edges. In go
    `phi` (K', m, LANES) and `around` (K', b, LANES) of at least so many steps, `storage` (n,) S [W/K], and `affine`:
    whether one round of linearising is exact.
    """
    n, order, edge_start, edge_to = program.n, program.order, program.edge_start, program.edge_to
    edges, lanes = len(edge_to), (LANES,)
    values, about, right = np.empty((n + 2 * edges, LANES)), np.empty((n, LANES)), np.empty((n, LANES))
    side_by_side = vectors(values, lanes), vectors(right, lanes)
    features, outside, course = vectors(phi, lanes), vectors(around, lanes), vectors(about, lanes)
    z, edge, last = np.empty(n), np.empty(n), np.zeros(n)
    for first in range(0, len(means), LANES):
        own, count = first // LANES, min(LANES, len(means) - first)
        for i in range(n):
            for k in range(LANES):
                about[i, k] = start[i] + (2 * k + 1) * last[i]
        for _ in range(1 if affine else ROUNDS):
            assemble(
                program, storage, coefficients, copper, factors, features[own], outside[own], course, *side_by_side
            )
            moved = 0.0
            for i in range(n):
                edge[i] = start[i]
            for k in range(count):
                for i in range(n):
                    z[i] = storage[i] * edge[i] + right[i, k]
                for p in range(n):
                    for e in range(edge_start[p], edge_start[p + 1]):
                        z[edge_to[e]] -= values[n + edges + e, k] * z[order[p]]
                for p in range(n - 1, -1, -1):
                    i = order[p]
                    for e in range(edge_start[p], edge_start[p + 1]):
                        z[i] -= values[n + e, k] * z[edge_to[e]]
                    z[i] *= values[i, k]
                for i in range(n):
                    moved = max(moved, abs(z[i] - about[i, k]))
                    about[i, k] = means[first + k, i] = z[i]
                    rises[first + k, i] = z[i] - edge[i]
                    edge[i] = 2 * z[i] - edge[i]
            if moved < SETTLED_K:
                break
        for i in range(n):
            start[i], last[i] = edge[i], rises[first + count - 1, i]
        for k in range(count):
            for i in range(n):
                shares[first + k, i] = values[i, k]
            for p in range(n):
                for e in range(edge_start[p], edge_start[p + 1]):
                    shares[first + k, n + e] = values[n + e, k] * values[order[p], k]
                    shares[first + k, n + edges + e] = values[n + edges + e, k]


class MarchPlan(NamedTuple):
    """Where `carry` finds its numbers and lists (`twin.arithmetic.lanes`).

    A strip is a table with a column a parameter, `wide` numbers a row. For 2 nodes and 1 sensor its rows are, one
    after the other,

        right 0, right 1    right-hand sides, which become the mean temperatures of the step
        end 0, end 1        temperatures at its end
        reading 0           what the sensor shows
        mean 0              the mean of its readings over the block

    They have `numbers` numbers and stand one after the other from `strips` on. Beside them are `units` 0, 1, -1, -2;
    `storage` S (n,); `lags`: the share of its last reading that each sensor keeps; `follows`: the shares of
    temperatures that readings take; `shares` (K, n + 2 E) of each step's elimination; `weights` (K, W) of each step's
    end in the means of blocks and `begins` (B, W) of each block's start. `right` to `mean` are the lists that one
    step goes through (`Sweep`), in this order.
    """

    n: int
    sensors: int
    size: int
    weighed: int
    units: int
    storage: int
    lags: int
    follows: int
    shares: int
    weights: int
    begins: int
    strips: int
    numbers: int
    wide: int
    right: Sweep
    down: Sweep
    up: Sweep
    end: Sweep
    read: Sweep
    mean: Sweep


class Sensors(NamedTuple):
    """Each sensor reads its `nodes` by `weights`. Its lag has three `factors`: of its last reading, of the true value
    then, and of the true value now; (0, 0, 1) is none."""

    nodes: Sequence[Sequence[int]]
    weights: Sequence[Sequence[float]]
    factors: Sequence[tuple[float, float, float]]


class Loads(NamedTuple):
    """The heats that parameters bring. Strip s takes the entries `start[s]:start[s + 1]`: each is `sign` times the
    heat of number `heat` times the feature of number `feature`, and goes to `place` within the strip, that of a row
    and a column."""

    start: Index
    place: Index
    heat: Index
    feature: Index
    sign: Floats


def planned(
    program: Program, storage: Floats, sensors: Sensors, steps: int, blocks: int, initial: Floats
) -> tuple[MarchPlan, Floats, Index, Index]:
    """The plan of `steps` in `blocks` at a time, its numbers, its indices, and (W, 2) the sensor and the share in it
    of each weight. `initial` (n, S, W): the columns at the start, in S strips."""
    wide = initial.shape[2]
    n, m, edges = program.n, len(sensors.nodes), len(program.edge_to)
    store, order = LaneStore(), program.order.tolist()
    number = {node: p for p, node in enumerate(order)}
    rows, ends = [wide * i for i in range(n)], [wide * (n + i) for i in range(n)]
    downs: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    ups: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for p, node in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            later = int(program.edge_to[e])
            downs[number[later]].append((rows[node], n + edges + e))
            ups[p].append((rows[later], n + e))
    lagged = [s for s, (kept, before, _) in enumerate(sensors.factors) if kept or before]
    follows: list[float] = []
    reads: list[list[tuple[int, int]]] = []
    for s in lagged:  # the truth at a step's start is twice its mean less that at its end
        _, before, now = sensors.factors[s]
        reads.append([])
        for node, weight in zip(sensors.nodes[s], sensors.weights[s], strict=True):
            for row, factor in ((rows[node], 2 * before), (ends[node], now - before)):
                reads[-1].append((row, len(follows)))
                follows.append(-factor * weight)
    readings = [wide * (2 * n + s) for s in range(m)]
    means: list[list[tuple[int, int]]] = []
    of: list[tuple[int, float]] = []  # sensor and weight of all that means are made of
    for s in range(m):
        parts = [(ends[i], w) for i, w in zip(sensors.nodes[s], sensors.weights[s], strict=True)]
        own = [(readings[s], 1.0)] if s in set(lagged) else parts
        means.append([(row, len(of) + j) for j, (row, _) in enumerate(own)])
        of += [(s, weight) for _, weight in own]
    strips, size = initial.shape[1], n + 2 * edges
    plan = MarchPlan(
        n=n,
        sensors=m,
        size=size,
        weighed=len(of),
        units=store.put(np.array([0.0, 1.0, -1.0, -2.0])),
        storage=store.put(storage),
        lags=store.put(np.array([kept for kept, _, _ in sensors.factors])),
        follows=store.put(np.array(follows)),
        shares=store.rows(steps, size),
        weights=store.rows(steps, len(of)),
        begins=store.rows(blocks, len(of)),
        numbers=wide * (2 * n + 2 * m),
        wide=wide,
        strips=store.rows(strips, wide * (2 * n + 2 * m)),
        right=store.sweep(rows, list(range(n)), [[]] * n),
        down=store.sweep([rows[i] for i in order], [0] * n, downs),
        up=store.sweep([rows[i] for i in order[::-1]], order[::-1], ups[::-1]),
        end=store.sweep(rows, [0] * n, [[(row, 0)] for row in rows]),
        read=store.sweep([wide * s for s in lagged], lagged, reads),
        mean=store.sweep([wide * s for s in range(m)], [0] * m, means),
    )
    numbers = store.numbers()
    begin = np.zeros((strips, 2 * n + 2 * m, wide))
    begin[:, n : 2 * n] = initial.transpose(1, 0, 2)
    for s in lagged:  # in equilibrium
        begin[:, 2 * n + s] = np.tensordot(sensors.weights[s], initial[list(sensors.nodes[s])], 1)
    numbers[plan.strips : plan.strips + begin.size] = begin.ravel()
    return plan, numbers, store.indices(), np.array(of)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def carry(
    plan: MarchPlan, m: Floats, at: Index, loads: Loads, heats: Floats, phi: Floats, length: int, means: Floats
) -> None:
    """Carry the columns of all strips through the steps whose shares and weights are in place; the means of each
    sensor over each block of `length` steps go to `means` (B, m, S, W). `heats` (L, K) [W per unit of the feature],
    features `phi` (F, K)."""
    wide = plan.wide
    for s in range(len(loads.start) - 1):
        right = plan.strips + s * plan.numbers
        end, reading = right + wide * plan.n, right + wide * 2 * plan.n
        mean = reading + wide * plan.sensors
        for k in range(heats.shape[1]):
            shares, block = plan.shares + k * plan.size, k // length
            if k % length == 0:
                begins = plan.begins + block * plan.weighed
                sweep(m, at, plan.mean, mean, mean, right, plan.units, begins, wide)
            sweep(m, at, plan.right, right, end, right, plan.storage, plan.units, wide)
            for e in range(loads.start[s], loads.start[s + 1]):
                m[right + loads.place[e]] += loads.sign[e] * heats[loads.heat[e], k] * phi[loads.feature[e], k]
            sweep(m, at, plan.down, right, right, right, plan.units + 1, shares, wide)
            sweep(m, at, plan.up, right, right, right, shares, shares, wide)
            sweep(m, at, plan.end, end, end, right, plan.units + 2, plan.units + 3, wide)
            sweep(m, at, plan.read, reading, reading, right, plan.lags, plan.follows, wide)
            sweep(m, at, plan.mean, mean, mean, right, plan.units + 1, plan.weights + k * plan.weighed, wide)
            if (k + 1) % length == 0:
                for r in range(plan.sensors):
                    for c in range(wide):
                        means[block, r, s, c] = m[mean + r * wide + c]
