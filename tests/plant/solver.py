"""The mesh in time and at rest: implicit, sparse, steps of two stages, energy counted as it goes.

C dT/dt = -K(u, T) T + s(u, T). The copper's temperature coefficient is part of K; radiation, free convection and the
slow shape of AC loss are taken at the beginning of a step. Steps by the L-stable two-stage SDIRK of order 2
(Alexander 1977, DOI 10.1137/0714068), whose stages share one factorisation. Elimination without pivoting in an order
of least degree: the matrix is an M-matrix, diagonally dominant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit as _njit
from numpy.typing import NDArray

from plant.mesh import BOILS, GAPES, RADIATES, RISES, Mesh

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

njit: Any = _njit  # untyped

GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
SIGMA = 5.670374419e-8  # W/(m2 K4), CODATA
FREE = 1.9  # W/(m2 K^1.25): free convection on the housing, h = 1.9 |dT|^0.25


class Elimination(NamedTuple):
    """Sparse elimination as indices into `values`: n diagonals, then entries. Pivot p of `order[p]` has the later
    neighbours `start[p]:start[p + 1]`, `row` their cells, `lower` and `upper` their entries; `update` the targets."""

    order: Index
    start: Index
    row: Index
    lower: Index
    upper: Index
    update: Index
    place: dict[tuple[int, int], int]


@cache
def eliminate(n: int, pairs: frozenset[tuple[int, int]]) -> Elimination:
    """The elimination of a matrix, in an order of least degree. `pairs`: (i, j), both ways, of its entries."""
    near: list[set[int]] = [set() for _ in range(n)]
    for i, j in pairs:
        near[i].add(j)
        near[j].add(i)
    left, order, later = set(range(n)), [], []
    while left:
        p = min(left, key=lambda i: (len(near[i]), i))
        left.remove(p)
        mine = sorted(near[p])
        for i in mine:
            near[i] |= set(mine) - {i}
            near[i].discard(p)
        order.append(p)
        later.append(mine)
    place = {(i, i): i for i in range(n)}
    for p, mine in zip(order, later, strict=True):
        for i in mine:
            place[i, p] = len(place)
            place[p, i] = len(place)
    start = np.cumsum([0, *(len(mine) for mine in later)])
    flat = [(p, i) for p, mine in zip(order, later, strict=True) for i in mine]
    update = [place[i, j] for mine in later for i in mine for j in mine]
    rows, lower = [i for _, i in flat], [place[i, p] for p, i in flat]
    upper = [place[p, i] for p, i in flat]
    return Elimination(_ints(order), _ints(start), _ints(rows), _ints(lower), _ints(upper), _ints(update), place)


def _ints(values: object) -> Index:
    return np.array(values, np.int64)


@dataclass(frozen=True)
class System:
    """The mesh as arrays. Joints (J,): ends `a`, `b` (boundaries from n on), `resistance`, `film` (-1 none), `area`,
    `kind`, thresholds, and their entries in the matrix `at` (J, 2), -1 at a boundary. `flow` (W,): cells of the
    coolant, each behind the one before it, `flow_at` their entries towards that (-1: from the inlet), `share` of the
    coolant in each and what `leaves` the motor there. `dc` (n,) W/A2 at 20 degC; `slope` (n,) 1/K of
    the other heat."""

    capacity: Floats
    a: Index
    b: Index
    resistance: Floats
    film: Index
    area: Floats
    kind: Index
    low: Floats
    high: Floats
    at: Index
    flow: Index
    flow_at: Index
    share: Floats
    leaves: Floats
    dc: Floats
    slope: Floats
    alpha: float
    films: tuple[str, ...]
    elimination: Elimination

    @property
    def n(self) -> int:
        """Cells."""
        return len(self.capacity)


@dataclass(frozen=True)
class Loads:
    """What drives the cells, one row for each of N steps: `film` (N, F) W/(m2 K), `stream` (N,) W/K of the coolant,
    `outside` (N, 2) degC of inlet and ambient, `current2` (N,) A2, `ac` (N, n) W at 20 degC, `heat` (N, n) W at 100
    degC."""

    film: Floats
    stream: Floats
    outside: Floats
    current2: Floats
    ac: Floats
    heat: Floats

    def first(self, steps: int) -> Loads:
        """Those of the first steps."""
        return Loads(*(getattr(self, name)[:steps] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Solution:
    """`temperatures` (N + 1, n) degC; per step (N,) W: `heat` made, `to_coolant`, `to_ambient` carried away; `gapes`
    (J,): which gaps were open at the end."""

    temperatures: Floats
    heat: Floats
    to_coolant: Floats
    to_ambient: Floats
    gapes: Floats


def system(mesh: Mesh, capacity: Floats, scale: Floats, dc: Floats, slope: Floats, alpha: float) -> System:
    """The arrays of `mesh`; `scale` (J,) multiplies each joint's conductance."""
    index, n = mesh.index, len(mesh.cells)
    a = np.array([index[j.a] for j in mesh.joints], np.int64)
    b = np.array([index[j.b] for j in mesh.joints], np.int64)
    films = tuple(dict.fromkeys(j.film for j in mesh.joints if j.film))
    stations = [(index[s.cell], index[s.before] if s.before else -1, s.share) for s in mesh.stations]
    pairs = {(int(i), int(j)) for i, j in zip(a, b, strict=True) if j < n}
    pairs |= {(i, before) for i, before, _ in stations if before >= 0}
    program = eliminate(n, frozenset(pairs))
    at = [
        (program.place[i, j], program.place[j, i]) if j < n else (-1, -1)
        for i, j in zip(a.tolist(), b.tolist(), strict=True)
    ]
    with np.errstate(divide="ignore"):
        return System(
            capacity=capacity,
            a=a,
            b=b,
            resistance=np.array([j.resistance for j in mesh.joints]) / scale,
            film=np.array([films.index(j.film) if j.film else -1 for j in mesh.joints], np.int64),
            area=np.array([j.area for j in mesh.joints]) * np.where([j.kind == GAPES for j in mesh.joints], 1.0, scale),
            kind=np.array([j.kind for j in mesh.joints], np.int64),
            low=np.array([j.low for j in mesh.joints]),
            high=np.array([j.high for j in mesh.joints]),
            at=np.array(at, np.int64),
            flow=np.array([i for i, _, _ in stations], np.int64),
            flow_at=np.array([program.place[i, before] if before >= 0 else -1 for i, before, _ in stations], np.int64),
            share=np.array([share for _, _, share in stations]),
            leaves=np.array([share - sum(s for _, b, s in stations if b == i) for i, _, share in stations]),
            dc=dc,
            slope=slope,
            alpha=alpha,
            films=films,
            elimination=program,
        )


@njit(cache=True)
def _joints(t, outside, film, a, b, resistance, which, area, kind, low, high, gapes, g):  # type: ignore[no-untyped-def]
    """Conductance of every joint [W/K] at temperatures `t` into `g`; moves `gapes`."""
    n = len(t)
    for j in range(len(a)):
        ta = t[a[j]]
        tb = t[b[j]] if b[j] < n else outside[b[j] - n]
        if kind[j] == RADIATES:
            ka, kb = ta + 273.15, tb + 273.15
            g[j] = SIGMA * area[j] * (ka * ka + kb * kb) * (ka + kb)
        elif kind[j] == RISES:
            g[j] = FREE * area[j] * (abs(ta - tb) + 0.01) ** 0.25
        elif kind[j] == BOILS:
            g[j] = area[j] * min(max(ta - low[j], 0.0), high[j])
        elif kind[j] == GAPES:
            if ta > high[j]:
                gapes[j] = 1.0
            elif ta < low[j]:
                gapes[j] = 0.0
            g[j] = (area[j] if gapes[j] > 0.5 else 1.0) / resistance[j]
        elif which[j] >= 0:
            h = area[j] * film[which[j]]
            g[j] = h / (1.0 + h * resistance[j])
        else:
            g[j] = 1.0 / resistance[j]


@njit(cache=True)
def _matrix(v, diagonal, weight, g, a, b, at, own, stream, coolant):  # type: ignore[no-untyped-def]
    """diag(diagonal) + weight K into the entries `v`; `own` (n,) is subtracted from K's diagonal."""
    n = len(diagonal)
    v[:] = 0.0
    for i in range(n):
        v[i] = diagonal[i] - weight * own[i]
    for j in range(len(a)):
        x = weight * g[j]
        v[a[j]] += x
        if b[j] < n:
            v[b[j]] += x
            v[at[j, 0]] -= x
            v[at[j, 1]] -= x
    flow, flow_at, share, _ = coolant
    for k in range(len(flow)):
        v[flow[k]] += weight * (stream * share[k])
        if flow_at[k] >= 0:
            v[flow_at[k]] -= weight * (stream * share[k])


@njit(cache=True)
def _factor(v, order, start, lower, upper, update):  # type: ignore[no-untyped-def]
    u = 0
    for p in range(len(order)):
        inverse = 1.0 / v[order[p]]
        for i in range(start[p], start[p + 1]):
            l = v[lower[i]] * inverse
            v[lower[i]] = l
            for j in range(start[p], start[p + 1]):
                v[update[u]] -= l * v[upper[j]]
                u += 1


@njit(cache=True)
def _solve(v, x, order, start, row, lower, upper):  # type: ignore[no-untyped-def]
    for p in range(len(order)):
        for i in range(start[p], start[p + 1]):
            x[row[i]] -= v[lower[i]] * x[order[p]]
    for p in range(len(order) - 1, -1, -1):
        total = x[order[p]]
        for i in range(start[p], start[p + 1]):
            total -= v[upper[i]] * x[row[i]]
        x[order[p]] = total / v[order[p]]


@njit(cache=True)
def _count(t, s, own, outside, g, a, b, stream, coolant_at):  # type: ignore[no-untyped-def]
    """(heat made, to the coolant, to the ambient) [W] at temperatures `t`."""
    n = len(t)
    made = coolant = ambient = 0.0
    for i in range(n):
        made += s[i] + own[i] * t[i]
    for j in range(len(a)):
        if b[j] == n:
            coolant += g[j] * (t[a[j]] - outside[0])
        elif b[j] > n:
            ambient += g[j] * (t[a[j]] - outside[1])
    flow, _, _, leaves = coolant_at
    for k in range(len(flow)):
        if leaves[k] != 0.0:
            coolant += stream * leaves[k] * (t[flow[k]] - outside[0])
    return made, coolant, ambient


@njit(cache=True)
def _sources(t, current2, ac, heat, dc, slope, alpha, s, own):  # type: ignore[no-untyped-def]
    """Heat of each cell as s + own t: DC exactly, AC by its tangent at `t`, the rest by its slope about 100 degC."""
    for i in range(len(t)):
        direct = dc[i] * current2
        hot = 1.0 + alpha * (t[i] - 20.0)
        tangent = -ac[i] * alpha / (hot * hot)
        own[i] = direct * alpha + tangent + heat[i] * slope[i]
        s[i] = direct * (1.0 - 20.0 * alpha) + ac[i] / hot - tangent * t[i] + heat[i] * (1.0 - 100.0 * slope[i])


@njit(cache=True)
def _right(x, s, weight, g, a, b, outside, stream, coolant):  # type: ignore[no-untyped-def]
    """x += weight (s + what comes from the boundaries)."""
    n = len(x)
    for i in range(n):
        x[i] += weight * s[i]
    for j in range(len(a)):
        if b[j] >= n:
            x[a[j]] += weight * g[j] * outside[b[j] - n]
    flow, flow_at, share, _ = coolant
    for k in range(len(flow)):
        if flow_at[k] < 0:
            x[flow[k]] += weight * (stream * share[k]) * outside[0]


@njit(cache=True)
def _march(t0, dt, capacity, joints, at, coolant, dc, slope, alpha, program, size, loads, gapes):  # type: ignore[no-untyped-def]
    a, b, resistance, which, area, kind, low, high = joints
    order, start, row, lower, upper, update = program
    film, streams, outsides, current2, ac, heat = loads
    steps, n = len(streams), len(t0)
    out, counted = np.empty((steps + 1, n)), np.empty((steps, 3))
    v, g, s, own = np.empty(size), np.empty(len(a)), np.empty(n), np.empty(n)
    y, z = np.empty(n), np.empty(n)
    for i in range(n):  # here and below cell by cell: numba takes seconds to compile the assignment of a row
        out[0, i] = t0[i]
    weight = GAMMA * dt
    for k in range(steps):
        t, outside, stream = out[k], outsides[k], streams[k]
        _joints(t, outside, film[k], a, b, resistance, which, area, kind, low, high, gapes, g)
        _sources(t, current2[k], ac[k], heat[k], dc, slope, alpha, s, own)
        _matrix(v, capacity, weight, g, a, b, at, own, stream, coolant)
        _factor(v, order, start, lower, upper, update)
        for i in range(n):
            y[i] = capacity[i] * t[i]
        _right(y, s, weight, g, a, b, outside, stream, coolant)
        _solve(v, y, order, start, row, lower, upper)
        for i in range(n):
            z[i] = capacity[i] * (t[i] + (1.0 - GAMMA) / GAMMA * (y[i] - t[i]))
        _right(z, s, weight, g, a, b, outside, stream, coolant)
        _solve(v, z, order, start, row, lower, upper)
        for i in range(n):
            out[k + 1, i] = z[i]
        for part, share in ((y, 1.0 - GAMMA), (z, GAMMA)):
            made, to_coolant, ambient = _count(part, s, own, outside, g, a, b, stream, coolant)
            first = part is y
            counted[k, 0] = share * made if first else counted[k, 0] + share * made
            counted[k, 1] = share * to_coolant if first else counted[k, 1] + share * to_coolant
            counted[k, 2] = share * ambient if first else counted[k, 2] + share * ambient
    return out, counted


@njit(cache=True)
def _rest(t, rounds, joints, at, coolant, dc, slope, alpha, program, size, loads, gapes):  # type: ignore[no-untyped-def]
    a, b, resistance, which, area, kind, low, high = joints
    order, start, row, lower, upper, update = program
    film, stream, outside, current2, ac, heat = loads
    n = len(t)
    v, g, s, own, none = np.empty(size), np.empty(len(a)), np.empty(n), np.empty(n), np.zeros(n)
    change = 0.0
    for _ in range(rounds):
        _joints(t, outside, film, a, b, resistance, which, area, kind, low, high, gapes, g)
        _sources(t, current2, ac, heat, dc, slope, alpha, s, own)
        _matrix(v, none, 1.0, g, a, b, at, own, stream, coolant)
        _factor(v, order, start, lower, upper, update)
        y = np.zeros(n)
        _right(y, s, 1.0, g, a, b, outside, stream, coolant)
        _solve(v, y, order, start, row, lower, upper)
        change = np.abs(y - t).max()
        t = 0.3 * t + 0.7 * y
    return t, change


def march(system: System, loads: Loads, start: Floats, step_s: float, gapes: Floats | None = None) -> Solution:
    """Temperatures over the steps of `loads` from `start` (n,)."""
    open_gaps = np.zeros(len(system.a)) if gapes is None else gapes.copy()
    rows = (loads.film, loads.stream, loads.outside, loads.current2, loads.ac, loads.heat)
    out, counted = _march(np.ascontiguousarray(start), step_s, system.capacity, *_fixed(system), rows, open_gaps)
    heat, to_coolant, to_ambient = (np.ascontiguousarray(column) for column in counted.T)
    return Solution(out, heat, to_coolant, to_ambient, open_gaps)


def steady(system: System, loads: Loads, row: int = 0) -> Floats:
    """Temperatures (n,) at which `loads` of one row do not change them any more. Raises ArithmeticError without
    balance."""
    one = (
        *(loads.film[row], loads.stream[row], loads.outside[row], loads.current2[row]),
        *(loads.ac[row], loads.heat[row]),
    )
    first = np.full(system.n, loads.outside[row].mean())
    t, change = _rest(first, 60, *_fixed(system), one, np.zeros(len(system.a)))
    if not change < 1e-6:
        raise ArithmeticError(f"no thermal balance: still {change:.3g} K from one round to the next")
    return np.asarray(t)


def _fixed(s: System) -> tuple[Any, ...]:
    """The arguments that a system does not change."""
    joints = (s.a, s.b, s.resistance, s.film, s.area, s.kind, s.low, s.high)
    e = s.elimination
    program = (e.order, e.start, e.row, e.lower, e.upper, e.update)
    return joints, s.at, (s.flow, s.flow_at, s.share, s.leaves), s.dc, s.slope, s.alpha, program, len(e.place)
