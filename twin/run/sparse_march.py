"""A run by the implicit midpoint rule and what parameters do to it, for networks of any size, compiled once for all
of them.

Over a step of h the temperatures follow the rule (A-stable, order 2: Hairer and Wanner, Solving Ordinary Differential
Equations II, IV.3)

    M z = S T + b,    T' = 2 z - T,    S = 2 C / h

with z the mean temperature of the step, and M and b of heats that are linearised about z itself. The index program
(`twin.compiled.indexed`) assembles and eliminates the steps, `LANES` of them side by side. A parameter that brings
the heat q moves the mean temperatures by M dz = S dT + q, exactly, as the rule has one stage: the columns of all
parameters are right-hand sides of one linear system that changes from step to step. They go through it side by side,
in strips (`twin.arithmetic.lanes`) that stay in the nearest caches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from twin.arithmetic.lanes import LaneStore, Sweep, sweep, width
from twin.arithmetic.vectors import LANES, vectors
from twin.compiled.indexed import Index, Program, assemble
from twin.compiled.structure import Parameters
from twin.errors import DivergedError
from twin.motor.network import NOBODY
from twin.motor.outputs import lag_factors

Floats = NDArray[np.float64]

STRIP = 96  # columns at most that go through the steps together: what they need stays in the nearest caches
SETTLED_K = (
    1e-4  # heats that are linearised about what is so near are exact to 1e-8 K: what is left falls with the square
)
MELTED_DEGC = 1e4  # beyond, a run has diverged
ROUNDS = 8  # of linearising steps about what the last round found


@dataclass(frozen=True)
class MarchRun:
    """Temperatures at the edges of the steps `edges` (N + 1, n) and their means over the steps `means` (N, n) [degC];
    `storage` (n,) S [W/K].

    `shares` (N, n + 2 E) is M of each step, eliminated: 1 / pivot of each node, then the shares of later nodes that a
    row takes on the way up, then those of earlier ones on the way down, both in the order of the program's edges. For
    the nodes 0 - 1 - 2, eliminated in this order, M = A D B with D of the pivots and a row of `shares` is

        1/D_0  1/D_1  1/D_2    B_01  B_12    A_10  A_21
    """

    program: Program
    storage: Floats
    shares: Floats
    edges: Floats
    means: Floats

    @property
    def matrix(self) -> Floats:
        """M (N, n, n) [W/K] of each step."""
        n, order, to = self.program.n, self.program.order, self.program.edge_to
        earlier = np.repeat(order, np.diff(self.program.edge_start))
        pivots, up, down = np.split(self.shares, [n, n + len(to)], axis=1)
        a, b = (np.tile(np.eye(n), (len(self.shares), 1, 1)) for _ in range(2))
        a[:, to, earlier], b[:, earlier, to] = down, up
        found: Floats = (a / pivots[:, None, :]) @ b
        return found


def run(
    program: Program,
    affine: bool,
    values: Parameters,
    step_s: float,
    features: Floats,
    boundaries: Floats,
    initial: Floats,
    names: Sequence[str],
) -> MarchRun:
    """From `initial` (n,) on with `features` (N, m) and `boundaries` (N, b) [degC]. `affine`: whether all heats are
    linear in temperature, so that one round of linearising is exact.

    Raises `DivergedError` where the temperatures leave the finite numbers or ten thousand degrees, with the name of the
    node, of the nodes' `names` (n,), that does so first.
    """
    steps, storage = len(features), 2 * values.capacities / step_s
    shares = np.empty((steps, program.n + 2 * len(program.edge_to)))
    edges, means = np.empty((steps + 1, program.n)), np.empty((steps, program.n))
    edges[0] = initial
    constants = values.coefficients, values.copper, values.factors
    _run(program, affine, storage, *constants, _in_lanes(features), _in_lanes(boundaries), shares, edges, means)
    if not (np.abs(edges[-1]) < MELTED_DEGC).all():
        raise _ran_away(edges, names)
    return MarchRun(program, storage, shares, edges, means)


def _ran_away(edges: Floats, names: Sequence[str]) -> DivergedError:
    """Which node runs away, by the temperatures at the edges of the steps (N + 1, n): the one that is furthest off at
    the first edge where one has melted."""
    size = np.nan_to_num(np.abs(edges), nan=np.inf)
    first = int(np.argmax((size >= MELTED_DEGC).any(axis=1)))
    return DivergedError(
        f'node "{names[int(size[first].argmax())]}" runs away: more heat comes in than its links carry away; check its '
        "losses and their slopes with temperature, its links and its capacity"
    )


def _in_lanes(rows: Floats) -> Floats:
    """Rows (N, m) as (N / LANES, m, LANES); the last row again where there are too few of them."""
    whole, rest = divmod(len(rows), LANES)
    found = np.empty((whole + (rest > 0), rows.shape[1], LANES))
    found[:whole] = rows[: whole * LANES].T.reshape(rows.shape[1], whole, LANES).transpose(1, 0, 2)
    if rest:
        found[-1] = rows[-1][:, None]
        found[-1, :, :rest] = rows[-rest:].T
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(
    program: Program,
    affine: bool,
    storage: Floats,
    coefficients: Floats,
    copper: Floats,
    factors: Floats,
    phi: Floats,
    around: Floats,
    shares: Floats,
    edges: Floats,
    means: Floats,
) -> None:
    """Fill the arrays of a `MarchRun` from the first of `edges` on; `phi` (N', m, LANES) and `around` (N', b, LANES)
    are of at least so many steps."""
    n, order, edge_start, edge_to = program.n, program.order, program.edge_start, program.edge_to
    size, lanes = len(edge_to), (LANES,)
    values, about, right = np.empty((n + 2 * size, LANES)), np.empty((n, LANES)), np.empty((n, LANES))
    side_by_side = vectors(values, lanes), vectors(right, lanes)
    features, outside, course = vectors(phi, lanes), vectors(around, lanes), vectors(about, lanes)
    z, rise = np.empty(n), np.zeros(n)
    for first in range(0, len(means), LANES):
        own, count = first // LANES, min(LANES, len(means) - first)
        for i in range(n):
            for k in range(LANES):
                about[i, k] = edges[first, i] + (2 * k + 1) * rise[i]
        for _ in range(1 if affine else ROUNDS):
            assemble(
                program, storage, coefficients, copper, factors, features[own], outside[own], course, *side_by_side
            )
            moved = 0.0
            for k in range(count):
                edge = edges[first + k]
                for i in range(n):
                    z[i] = storage[i] * edge[i] + right[i, k]
                for p in range(n):
                    for e in range(edge_start[p], edge_start[p + 1]):
                        z[edge_to[e]] -= values[n + size + e, k] * z[order[p]]
                for p in range(n - 1, -1, -1):
                    i = order[p]
                    for e in range(edge_start[p], edge_start[p + 1]):
                        z[i] -= values[n + e, k] * z[edge_to[e]]
                    z[i] *= values[i, k]
                for i in range(n):
                    moved = max(moved, abs(z[i] - about[i, k]))
                    about[i, k] = means[first + k, i] = z[i]
                    edges[first + k + 1, i] = 2 * z[i] - edge[i]
            if moved < SETTLED_K:
                break
        last = first + count - 1
        for i in range(n):
            rise[i] = means[last, i] - edges[last, i]
        for k in range(count):
            for i in range(n):
                shares[first + k, i] = values[i, k]
            for p in range(n):
                for e in range(edge_start[p], edge_start[p + 1]):
                    shares[first + k, n + e] = values[n + e, k] * values[order[p], k]
                    shares[first + k, n + size + e] = values[n + size + e, k]


@dataclass(frozen=True)
class ColumnSensor:
    """What reads the columns at the edges of steps: `weights` (n,), or (n, N) where they change from step to step, of
    the nodes' temperatures make the truth; the reading is `kept` times the last one, plus `before` times the truth at
    the step's start and `now` times that at its end."""

    weights: Floats
    kept: float = 0.0
    before: float = 0.0
    now: float = 1.0

    @classmethod
    def thermometer(cls, weights: Floats, time_constant_s: float, step_s: float) -> ColumnSensor:
        """A thermometer of nodes by `weights` (n,), with a first-order lag; in equilibrium at the start."""
        return cls(weights, *(lag_factors(time_constant_s, step_s) if time_constant_s > 0 else ()))

    @classmethod
    def of_means(cls, weights: Floats) -> ColumnSensor:
        """The sum of `weights` (n, N) times the mean temperatures of each step, as the reading at its end."""
        return cls(weights, 0.0, 0.5, 0.5)


class Loads(NamedTuple):
    """Where the heats of parameters enter, each (L,): into node `a` and, where there is one, out of node `b`, as a
    part of parameter `column`. Three heats: of parameter 0 from node 2 into 1, of parameter 1 into 1 and into 3:

    a 1 1 3    b 2 -1 -1    column 0 1 1
    """

    a: Index
    b: Index
    column: Index


class ColumnPlan(NamedTuple):
    """Where `_carry` finds its numbers and lists (`twin.arithmetic.lanes`).

    A strip is a table with a column a parameter, `wide` numbers a row. For 2 nodes and 1 sensor its rows are, one
    after the other,

        right 0, right 1    right-hand sides, which become the mean temperatures of the step
        end 0, end 1        temperatures at its end
        reading 0           what the sensor shows there

    They have `numbers` numbers and stand one after the other from `strips` on. Beside them are `units` 0, 1, -1, -2;
    `storage` S (n,); `kept`: the share of its last reading that each sensor keeps; `taken` (K, `follows`): the shares
    of temperatures that readings take in each step; `shares` (K, `size`) of each step's elimination; `shown`
    (m, K + 1, wide): the readings of the strip that is carried, at every edge. `right` to `read` are the lists that
    one step goes through (`Sweep`), in this order.
    """

    n: int
    sensors: int
    steps: int
    size: int
    follows: int
    units: int
    storage: int
    kept: int
    taken: int
    shares: int
    shown: int
    strips: int
    numbers: int
    wide: int
    right: Sweep
    down: Sweep
    up: Sweep
    end: Sweep
    read: Sweep


class MarchedColumns:
    """The columns of parameters, which go through runs of one program and `storage` that follow each other, of at most
    `steps` each. `begin` (n, P): what they are at the start."""

    def __init__(
        self,
        program: Program,
        storage: Floats,
        sensors: Sequence[ColumnSensor],
        loads: Loads,
        begin: Floats,
        steps: int,
    ) -> None:
        n, count = begin.shape
        strips = max(1, -(-count // STRIP))
        wide = width(-(-count // strips))
        weights = [own.weights.reshape(n, -1) for own in sensors]
        follows = [
            (row, sensor, -factor * weights[sensor][node])
            for sensor, own in enumerate(sensors)
            for node in np.flatnonzero(weights[sensor].any(axis=1)).tolist()
            for row, factor in ((node, 2 * own.before), (n + node, own.now - own.before))
            if factor != 0.0  # the truth at a step's start is twice its mean less that at its end
        ]
        store = LaneStore()
        reads = [[(wide * row, f) for f, (row, of, _) in enumerate(follows) if of == s] for s in range(len(sensors))]
        kept = np.array([own.kept for own in sensors])
        self._plan = _planned(program, storage, store, kept, reads, strips, wide, steps)
        self._entries = _entries(loads, wide, strips)
        self._numbers, self._at = store.numbers(), store.indices()
        taken = self._table(self._plan.taken, steps, len(follows))
        for f, (_, _, share) in enumerate(follows):
            taken[:, f] = share
        first = csr_array(np.array([own[:, 0] for own in weights]).reshape(-1, n))
        for strip in range(strips):
            own = begin[:, strip * wide : (strip + 1) * wide]
            table = self._table(self._plan.strips + strip * self._plan.numbers, 2 * n + len(sensors), wide)
            table[n : 2 * n, : own.shape[1]] = own
            table[2 * n :, : own.shape[1]] = first @ own

    def _table(self, place: int, rows: int, length: int) -> Floats:
        return self._numbers[place : place + rows * length].reshape(rows, length)

    def through(self, ran: MarchRun, heats: Floats) -> Iterator[Floats]:
        """Strip by strip, `wide` columns at a time: the readings (m, K + 1, wide) of all sensors at the edges of the
        run's K steps, to be read before the next are asked for. Behind the last column there is nothing but zeros, as
        behind the last edge of a run that is shorter than the longest. `heats` (L, K) of the loads [W per unit]."""
        plan = self._plan
        self._table(plan.shares, len(ran.shares), plan.size)[:] = ran.shares
        shown = self._table(plan.shown, plan.sensors * (plan.steps + 1), plan.wide)
        start, place, row, sign = self._entries
        heats = np.asfortranarray(heats)  # those of a step side by side, as they are read
        for strip in range(len(start) - 1):
            own = slice(start[strip], start[strip + 1])
            _carry(plan, self._numbers, self._at, strip, place[own], row[own], sign[own], heats)
            yield shown.reshape(plan.sensors, plan.steps + 1, plan.wide)


def _planned(
    program: Program,
    storage: Floats,
    store: LaneStore,
    kept: Floats,
    reads: Sequence[Sequence[tuple[int, int]]],
    strips: int,
    wide: int,
    steps: int,
) -> ColumnPlan:
    """The plan, and its lists in `store`; `reads`: of each sensor the rows that it takes, and which share of each."""
    n, sensors, edges = program.n, len(kept), len(program.edge_to)
    order = program.order.tolist()
    number = {node: p for p, node in enumerate(order)}
    rows = [wide * i for i in range(n)]
    downs: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    ups: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for p, node in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            later = int(program.edge_to[e])
            downs[number[later]].append((rows[node], n + edges + e))
            ups[p].append((rows[later], n + e))
    size, of_strip, follows = n + 2 * edges, wide * (2 * n + sensors), sum(len(own) for own in reads)
    return ColumnPlan(
        n=n,
        sensors=sensors,
        steps=steps,
        size=size,
        follows=follows,
        units=store.put(np.array([0.0, 1.0, -1.0, -2.0])),
        storage=store.put(storage),
        kept=store.put(kept),
        taken=store.rows(steps, follows),
        shares=store.rows(steps, size),
        shown=store.rows(sensors * (steps + 1), wide),
        strips=store.rows(strips, of_strip),
        numbers=of_strip,
        wide=wide,
        right=store.sweep(rows, list(range(n)), [[]] * n),
        down=store.sweep([rows[i] for i in order], [0] * n, downs),
        up=store.sweep([rows[i] for i in order[::-1]], order[::-1], ups[::-1]),
        end=store.sweep(rows, [0] * n, [[(row, 0)] for row in rows]),
        read=store.sweep([wide * (steps + 1) * s for s in range(sensors)], list(range(sensors)), reads),
    )


def _entries(loads: Loads, wide: int, strips: int) -> tuple[Index, Index, Index, Floats]:
    """Every heat that enters or leaves a node: its place within its strip, that of a row and a column, the row of
    the heats, and the sign; strip s has those of `start[s]:start[s + 1]`."""
    out = np.flatnonzero(loads.b != NOBODY)
    heat = np.concatenate([np.arange(len(loads.a)), out])
    node, sign = np.concatenate([loads.a, loads.b[out]]), np.where(np.arange(len(heat)) < len(loads.a), 1.0, -1.0)
    strip, column = np.divmod(loads.column[heat], max(wide, 1))
    sort = np.lexsort((wide * node + column, strip))
    start = np.searchsorted(strip[sort], np.arange(strips + 1))
    return start, (wide * node + column)[sort], heat[sort], sign[sort]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _carry(
    plan: ColumnPlan, m: Floats, at: Index, strip: int, place: Index, row: Index, sign: Floats, heats: Floats
) -> None:
    """Carry a strip through the steps whose shares are in place, its readings from edge to edge. Entry e brings
    `sign[e]` times the heat of row `row[e]` of `heats` (L, K) to `place[e]` within the strip."""
    wide = plan.wide
    right = plan.strips + strip * plan.numbers
    end, reading = right + wide * plan.n, right + wide * 2 * plan.n
    steps, apart = heats.shape[1], wide * (plan.steps + 1)
    for r in range(plan.sensors):
        for c in range(wide):
            m[plan.shown + r * apart + c] = m[reading + r * wide + c]
    for k in range(steps):
        shares, shown = plan.shares + k * plan.size, plan.shown + k * wide
        sweep(m, at, plan.right, right, end, right, plan.storage, plan.units, wide)
        for e in range(len(place)):
            m[right + place[e]] += sign[e] * heats[row[e], k]
        sweep(m, at, plan.down, right, right, right, plan.units + 1, shares, wide)
        sweep(m, at, plan.up, right, right, right, shares, shares, wide)
        sweep(m, at, plan.end, end, end, right, plan.units + 2, plan.units + 3, wide)
        sweep(m, at, plan.read, shown + wide, shown, right, plan.kept, plan.taken + k * plan.follows, wide)
    for r in range(plan.sensors):
        for c in range(wide):
            m[reading + r * wide + c] = m[plan.shown + r * apart + steps * wide + c]
