"""The covariance of the paper's filter, on its rank: what `twin.ekf_paper` does to P, with w free.

After the capacitor equations are measured without noise, the errors of the rates are those of the rest, C dzdot = Q_z dz + drho.
So P = T P_y T' with y = [z, rho, lagging readings], and a step, its perfect measurements included, is one of y alone: the trapezoidal rule

    (2 C / h - Q_z+) z+ = (2 C / h + Q_z) z + rho + rho+,   rho+ = rho + noise,

linearised at the edges. What w is does not matter while it may be anything; of the covariance nothing has to cancel that is 1e6 of what is left.
P_y is positive definite as long as every number has noise at the start or in a step: F P_y F' + Q is made of products with its rows, and
the readings take from it what elimination of their covariance leaves (`twin.ekf_readings`), which is less than
P_y while a reading's variance is above what P_y is rounded by, 1e-16 of its largest. Walks put back in every step what rounding takes.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf_matrix import eliminate, laws_at
from twin.ekf_plan import Parts
from twin.lanes import NOWHERE, Store, Sweep, less, paired, sweep, transposed, width, within

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Rates(NamedTuple):
    """Where the numbers and indices of a run are (`twin.lanes`), and how many there are. `values`: n diagonals, E upper and E lower entries
    of 2 C / h - Q_z, eliminated; `slopes`: in the same order those of -Q_z at the edge where P_y is, one that nobody reads, and
    what does not change of `reach`."""

    n: int
    heats: int
    size: int  # S_y
    length: int  # of a row
    edges: int  # E
    cells: int
    channels: int
    meters: int
    laws: int
    around: int  # boundaries
    knots: int
    # numbers
    unit: int  # 0, 1
    own: int  # (n,) 2 C / h [W/K]
    copper: int
    law_numbers: int  # as `twin.ekf_plan.Plan`, like all that `laws_at` takes
    psi: int
    temperatures: int  # (n + b,)
    changes: int  # (n + b,) h zdot, and 0 of boundaries
    heat: int  # (n,) into the capacitors, and one that nobody reads
    slopes: int
    values: int
    right: int  # (n,)
    after: int  # what lagging readings take of the temperatures after a step, sign changed
    noise: int  # (S_y rows) of the right-hand side
    shares: int  # (m rows) of each reading, sign changed
    state: int  # [P_y | y]
    moved: int
    turned: int
    ahead: int  # [P_y | y] as predicted
    # indices
    each: int  # 0, 1, ... of all groups
    row: int  # the same times `length`
    order: int
    edge_start: int
    edge_to: int
    update: int
    law: int
    into: int  # (laws, 8) a, b, and in `values` (a,a) (a,b) (a,m) (b,a) (b,b) (b,m), for each what nobody reads where there is none
    cell: int  # (cells, 3) place in `values`, row and column of Q_z
    taken: int  # (m, S_y) pairs: rows and shares that each reading takes
    number: int  # (m,) of them
    reach: Sweep  # the right-hand side
    forward: Sweep
    backward: Sweep
    unmoved: Sweep  # heats, and lagging readings with the temperatures after a step


def rates_of(parts: Parts, capacities: Floats, boundaries: int, step_s: float, store: Store) -> Rates:
    """The places of a run, put into `store`."""
    program, m = parts.program, len(parts.weights)
    n, edges, o = program.n, len(program.edge_to), len(parts.heats)
    lagging = np.flatnonzero(parts.state >= 0).tolist()
    size = n + o + len(lagging)
    length = width(size + 1)
    order, own = program.order.tolist(), 2 * capacities / step_s
    where = {i: (i, i) for i in range(n)}
    forward: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    backward: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    for p, i in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            j = int(program.edge_to[e])
            where[n + e], where[n + edges + e] = (i, j), (j, i)
            forward[j].append((i * length, n + edges + e))
            backward[i].insert(0, (j * length, n + e))
    used = sorted({*range(n), *(int(e) for e in program.place.ravel() if 0 <= e < n + 2 * edges)})
    fixed = [-2.0, -1.0, *(-own)]  # behind the slopes
    nobody, two, one = n + 2 * edges, n + 2 * edges + 1, n + 2 * edges + 2
    into = []
    for (a, b, _, _, one_way, _, _), places in zip(parts.places.tolist(), program.place.tolist(), strict=True):
        aa, bb, ab, ba, am, bm = (e if 0 <= e < nobody else nobody for e in places)
        both = 0 <= b < n and not one_way
        into.append([a, b, aa, ab, am, ba, bb, bm] if both else [a, n, aa, ab, am, nobody, nobody, nobody])
    takes: list[list[tuple[int, int]]] = [[(i * length, one + 1 + i)] for i in range(n)]
    for e in used:
        i, j = where[e]
        takes[i].append((j * length, e))
    for k, node in enumerate(parts.heats.tolist()):
        takes[node].append(((n + k) * length, two))
        takes.append([((n + k) * length, one)])
    by_noise = np.zeros((size, n + o))
    by_noise[:n, :n], by_noise[n : n + o, n:] = np.diag(own), np.eye(o)
    by_noise[parts.heats, n + np.arange(o)] = 1.0
    after: list[float] = []
    follows = []
    for k, j in enumerate(lagging):
        kept, before, now = parts.lag[j].tolist()
        nodes = np.flatnonzero(parts.weights[j]).tolist()
        takes.append(
            [
                ((n + o + k) * length, two + len(fixed)),
                *((i * length, two + len(fixed) + 1 + q) for q, i in enumerate(nodes)),
            ]
        )
        fixed += [-kept, *(-before * parts.weights[j, nodes])]
        follows.append([(i * length, len(after) + q) for q, i in enumerate(nodes)])
        after += (-now * parts.weights[j, nodes]).tolist()
        by_noise[n + o + k, :n] = -now * parts.weights[j]
    noise = np.zeros((length, length))
    noise[:size, :size] = (by_noise * parts.process[: n + o]) @ by_noise.T
    rows = [i * length for i in range(size)]
    pivots = [rows[i] for i in order]
    return Rates(
        n=n,
        heats=o,
        size=size,
        length=length,
        edges=edges,
        cells=len(used),
        channels=m,
        meters=0,
        laws=len(parts.places),
        around=boundaries,
        knots=(parts.numbers.shape[1] - 3) // 2,
        unit=store.put(np.array([0.0, 1.0])),
        own=store.put(own),
        copper=store.put(parts.copper),
        law_numbers=store.put(parts.numbers),
        psi=store.rows(len(parts.places), 4),
        temperatures=store.rows(1, n + boundaries),
        changes=store.rows(1, n + boundaries),
        heat=store.rows(1, n + 1),
        slopes=store.put(np.append(np.zeros(two), fixed)),
        values=store.rows(1, two),
        right=store.rows(1, n),
        after=store.put(np.array(after)),
        noise=store.put(noise),
        shares=store.rows(m, length),
        state=store.rows(length, length),
        moved=store.rows(length, length),
        turned=store.rows(length, length),
        ahead=store.rows(length, length),
        each=store.index(range(len(parts.places))),
        row=store.index(range(0, length * length, length)),
        order=store.index(order),
        edge_start=store.index(program.edge_start.tolist()),
        edge_to=store.index(program.edge_to.tolist()),
        update=store.index(program.update.tolist()),
        law=store.table(parts.places.tolist()),
        into=store.table(into),
        cell=store.table([e, *where[e]] for e in used),
        taken=store.index([0] * (m * size)),
        number=store.index([0] * m),
        reach=store.sweep(rows, [0] * size, takes),
        forward=store.sweep(pivots, [0] * n, [forward[i] for i in order]),
        backward=store.sweep(pivots[::-1], order[::-1], [backward[i] for i in order[::-1]]),
        unmoved=store.sweep(rows[n:], [0] * (size - n), [*[[]] * o, *follows]),
    )


@numba.njit(error_model="numpy", nogil=True, cache=True)
def laws_of(rates: Rates, m: Floats, at: Index, x: Floats, outside: Floats) -> None:
    """`psi` at the temperatures of x (S, 1), and what they are beside `outside` (b,)."""
    for i in range(rates.n):
        m[u(rates.temperatures + i)] = x[i, 0]
    for i in range(rates.around):
        m[u(rates.temperatures + rates.n + i)] = outside[i]
    laws_at(rates, m, at, rates.each, rates.laws)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def balance(rates: Rates, m: Floats, at: Index, amounts: Floats, slopes: int) -> None:
    """`heat` without unknown heats [W] and -Q_z at `slopes` [W/K], by `psi` and `amounts` (L,)."""
    n, heat = rates.n, rates.heat
    for i in range(n):
        m[u(heat + i)] = 0.0
    for e in range(n + 2 * rates.edges):
        m[u(slopes + e)] = 0.0
    for g in range(rates.laws):
        to, psi, amount = rates.into + 8 * g, rates.psi + 4 * g, amounts[g]
        value, by_a, by_b, by_m = (
            amount * m[u(psi)],
            amount * m[u(psi + 1)],
            amount * m[u(psi + 2)],
            amount * m[u(psi + 3)],
        )
        m[u(heat + at[u(to)])] += value
        m[u(heat + at[u(to + 1)])] -= value
        m[u(slopes + at[u(to + 2)])] -= by_a
        m[u(slopes + at[u(to + 3)])] -= by_b
        m[u(slopes + at[u(to + 4)])] -= by_m
        m[u(slopes + at[u(to + 5)])] += by_a
        m[u(slopes + at[u(to + 6)])] += by_b
        m[u(slopes + at[u(to + 7)])] += by_m


@numba.njit(error_model="numpy", nogil=True, cache=True)
def change(
    rates: Rates, m: Floats, at: Index, before: Floats, after: Floats, outside: Floats, step_s: float, x: Floats
) -> None:
    """`right`: zddot [K/s2] at the edge of x (S, 1), where `psi` is of it, with amounts (L,) `before` and `after` the step; `outside` (b,)
    after it. `psi` is left as it is with these."""
    n, heat, right = rates.n, rates.heat, rates.right
    balance(rates, m, at, before, rates.values)
    eliminated(rates, m, at, rates.values)
    for i in range(n):
        m[u(right + i)], m[u(heat + i)], m[u(rates.changes + i)] = -m[u(heat + i)], 0.0, step_s * x[n + i, 0]
    laws_of(rates, m, at, x, outside)
    for g in range(rates.laws):
        to, psi, law = rates.into + 8 * g, rates.psi + 4 * g, rates.law + 7 * g
        a, b, other = at[u(law)], at[u(law + 1)], at[u(law + 3)]
        value = m[u(psi)] + m[u(psi + 1)] * m[u(rates.changes + a)]
        if b >= 0:
            value += m[u(psi + 2)] * m[u(rates.changes + b)]
        if other >= 0:
            value += m[u(psi + 3)] * m[u(rates.changes + other)]
        m[u(heat + at[u(to)])] += after[g] * value
        m[u(heat + at[u(to + 1)])] -= after[g] * value
    for i in range(n):
        m[u(right + i)] = 2.0 / (step_s * step_s) * (m[u(right + i)] + m[u(heat + i)])
    solve(rates, m, at)


@within
def eliminated(rates: Rates, m: Floats, at: Index, slopes: int) -> None:
    """`values` by -Q_z at `slopes`."""
    for e in range(rates.n + 2 * rates.edges):
        m[u(rates.values + e)] = m[u(slopes + e)]
    for i in range(rates.n):
        m[u(rates.values + i)] += m[u(rates.own + i)]
    eliminate(rates, m, at)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def spread(rates: Rates, m: Floats, at: Index, amounts: Floats) -> None:
    """`ahead`: P_y one step on from `state`, given the capacitor equations, by `psi` and `amounts` (L,) at the end of the step; symmetric
    to rounding. Filled: `values`, `slopes` and `heat` there."""
    size, length, slopes, unit = rates.size, rates.length, rates.slopes, rates.unit
    sweep(m, at, rates.reach, rates.moved, rates.noise, rates.state, unit, slopes, length)
    transposed(m, rates.turned, rates.moved, size, length)
    sweep(m, at, rates.reach, rates.moved, rates.noise, rates.turned, unit + 1, slopes, length)
    balance(rates, m, at, amounts, slopes)
    eliminated(rates, m, at, slopes)
    _solved(rates, m, at, rates.moved, rates.ahead)
    transposed(m, rates.turned, rates.ahead, size, length)
    _solved(rates, m, at, rates.turned, rates.ahead)


@within
def _solved(rates: Rates, m: Floats, at: Index, right: int, out: int) -> None:
    """The rows of a step whose right-hand sides are the rows at `right`."""
    length, unit, values = rates.length, rates.unit + 1, rates.values
    sweep(m, at, rates.forward, out, right, out, unit, values, length)
    sweep(m, at, rates.backward, out, out, out, values, values, length)
    sweep(m, at, rates.unmoved, out, right, out, unit, rates.after, length)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def solve(rates: Rates, m: Floats, at: Index) -> None:
    """`right` becomes the solution with the matrix that `values` are of."""
    values, right, upper = rates.values, rates.right, rates.values + rates.n
    for p in range(rates.n):
        own = m[u(right + at[u(rates.order + p)])]
        for e in range(at[u(rates.edge_start + p)], at[u(rates.edge_start + p + 1)]):
            m[u(right + at[u(rates.edge_to + e)])] -= m[u(upper + rates.edges + e)] * own
    for p in range(rates.n - 1, -1, -1):
        i = at[u(rates.order + p)]
        own = m[u(right + i)] * m[u(values + i)]
        for e in range(at[u(rates.edge_start + p)], at[u(rates.edge_start + p + 1)]):
            own -= m[u(upper + e)] * m[u(right + at[u(rates.edge_to + e)])]
        m[u(right + i)] = own


@within
def reads(rates: Rates, m: Floats, at: Index, q: int, gain: int, stride: int) -> None:
    """Row q of `gain`, rows of `stride`: the covariance of what takes `shares` with y as predicted, and with those before it there."""
    count, size, length, own = 0, rates.size, rates.length, gain + q * stride
    shares, taken = rates.shares + q * length, rates.taken + q * size
    for i in range(size):
        if m[u(shares + i)] != 0.0:
            at[u(taken + count)] = paired(i * length, i)
            count += 1
    at[u(rates.number + q)] = count
    less(m, at, NOWHERE, 1, taken, count, own, rates.noise, rates.ahead, rates.unit, shares, 0, length)
    for p in range(q + 1):
        total = 0.0
        for e in range(rates.taken + p * size, rates.taken + p * size + at[u(rates.number + p)]):
            i = at[u(e)] >> 32
            total -= m[u(rates.shares + p * length + i // length)] * m[u(own + i // length)]
        m[u(gain + p * stride + length + q)] = m[u(own + length + p)] = total
