"""The filters' step, compiled once for all motors: the network's own step on a state and its covariance.

The state, S = n + o + u + b + lagging channels: n node temperatures, o unknown heats, u logarithms of unknown factors, b errors of
channels, and the reading now of each channel whose sensor lags. It stands beside its covariance, [P | x], as rows of one matrix
(`twin.lanes`), so that what is done to P is done to x in the same breath.

F, the derivative of a step, is never formed by the filter: F P F' is the step on the columns of P twice, with a transpose between,
by the sparse elimination that the step needs anyway. It is exact for the step as it is made, linearised about its start: the
derivative by a factor is the heat that it multiplies, at the temperatures of each stage. Those are known once the step is
made; so the factors' columns B of F are found beside F P', and P gets what they add to it afterwards.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from twin.drops import LINEAR, between, drop
from twin.indexed import Program
from twin.lanes import Store, Sweep, less, scaled, sweep, transposed, width
from twin.structure import NOBODY

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Parts(NamedTuple):
    """What the steps of one run share. `coefficients` (K,) are overwritten with `nominal` times the factors of `factor_of`
    (K,), -1 where there is none; `heats` (o,): nodes of the unknown heats; `places`, `numbers`: the groups as `twin.laws.Table`;
    `unknown_factors` u; `last`: place of the first channel's last reading. Per channel: `weights` (m, n), `bias` (m,) place of its
    constant error and `state` (m,) of its reading now, -1 where there is none, `lag` (m, 3) factors of the last reading, the
    last temperature and the temperature now. Per meter of heat, behind the channels: `signs` (q, G) of the groups whose heat it
    adds up, `of_losses` (q,) 1 where unknown heats are part of it; `bias` (m + q,). `process` (S,) variances added at the end
    of each step."""

    program: Program
    constant: Floats  # (n,) C / (gamma h) [W/K]
    coefficients: Floats
    copper: Floats
    factors: Floats
    nominal: Floats
    factor_of: Index
    heats: Index
    places: Index
    numbers: Floats
    unknown_factors: int
    last: int
    weights: Floats
    bias: Index
    state: Index
    lag: Floats
    signs: Floats
    of_losses: Floats
    process: Floats


class Plan(NamedTuple):
    """Where the numbers and indices of a run's step are in its two arrays (`twin.lanes`), and how many there are.

    `values` of the step matrix: n diagonals, E upper and E lower entries in the order of elimination, -1, the right-hand side (n),
    one that nobody reads, and for both stages the heats that factors multiply, sign changed. A stage has rows behind its nodes:
    the unknown heats, the unknown factors. Tables are flat, a row after the other.
    """

    n: int
    heats: int
    factors: int
    size: int  # S
    length: int  # of a row
    laws: int  # groups, G
    monomials: int  # F
    groups: int  # numbers of a row of amounts
    terms: int
    plains: int
    others: int
    bents: int
    edges: int  # E
    drives: int
    drivens: int
    channels: int  # m
    meters: int  # q
    lagging: int
    knots: int
    # numbers
    unit: int  # 0, 1
    own: int  # (n,) C / (gamma h) [W/K]
    inverse: int  # (n,) 1 / own
    process: int  # (S,)
    share: int  # what the second stage begins with of the first; the same less 1, which the start is given less
    copper: int
    law_numbers: int  # (G, 3 + 2 knots) as `twin.laws.Table`
    constant: int  # (G,) of each group's amount, what no feature changes
    by_monomial: int  # F rows (G,) of what a feature adds to it, sign changed
    nominal: int  # (terms,) coefficients that have a factor
    node_share: int  # of each channel's nodes, sign changed
    before: int  # the same times what a lagging reading takes of temperatures before the step
    now: int  # and after
    kept: int  # 1, and (m,) of itself
    signs: int  # (q, G)
    of_losses: int  # (q,)
    features: int  # (F,) of the step
    amounts: int  # (G,)
    scale: int  # (factors,) what they multiply by
    psi: int  # (G, 4) what multiplies the amounts, and its slopes with T_a, T_b, T_m
    temperatures: int  # (n + b,) nodes and boundaries
    values: int
    beyond: int  # (2, n) stages of x less their start
    stage: int
    state: int  # [P | x]
    moved: int  # F P, but for the factors' part
    turned: int  # its transpose; in the column of x, x before the step. Behind it, the factors' columns and rows
    ahead: int  # [P | x] as predicted
    # indices
    each: int  # 0, 1, ...
    row: int  # the same times `length`
    law: int  # (G, 7) as `twin.laws.Table`
    term: int  # (terms, 3) group, factor, monomial or -1
    plain: int  # (plains, 5) links of the difference itself: group, (a,a) (b,b) (a,b) (b,a) in `values`
    other: int  # (others, 8) group, (a,a) (a,b) (a,m) (b,a) (b,b) (b,m), right-hand side of b
    bent: int  # groups of which a step needs more than their difference
    order: int
    edge_start: int
    update: int
    driven: int  # (drivens, 4) group, factor, which of a stage's drives goes into a and which comes out of b, or -1
    by_factor: int  # starts and shares of what the factors add, behind `turned`
    by_factor_share: int
    by_column: int  # starts of the factors' columns
    node_start: int  # (m + 1,)
    node: int
    channel_state: int  # (m,) of a lagging channel, else -1
    channel_bias: int  # (m + q,) or -1
    sum: Sweep  # amounts, from `constant` and `by_monomial`
    forward: Sweep  # the elimination on a stage's rows, heats included
    driven_first: Sweep  # and the factors', in the first stage
    driven_second: Sweep
    backward: Sweep
    blend: Sweep  # the second stage's base
    unmoved: Sweep  # rows that a step leaves, lagging readings included
    follow: Sweep  # what lagging readings take of the temperatures after the step


class Laws(Protocol):
    """Of a `Plan` or another form: what `laws_at` takes."""

    @property
    def temperatures(self) -> int: ...
    @property
    def law(self) -> int: ...
    @property
    def law_numbers(self) -> int: ...
    @property
    def psi(self) -> int: ...
    @property
    def knots(self) -> int: ...
    @property
    def copper(self) -> int: ...


class Matrix(Protocol):
    """Of a `Plan` or another form: what `eliminate` takes."""

    @property
    def n(self) -> int: ...
    @property
    def edges(self) -> int: ...
    @property
    def values(self) -> int: ...
    @property
    def order(self) -> int: ...
    @property
    def edge_start(self) -> int: ...
    @property
    def update(self) -> int: ...


def plan(parts: Parts, boundaries: int, store: Store) -> Plan:
    """The places of a run's step, put into `store`."""
    program, m, meters = parts.program, len(parts.weights), len(parts.signs)
    n, edges, heats, factors = program.n, len(program.edge_to), len(parts.heats), parts.unknown_factors
    share = float(program.stages[1, 0])
    assert program.stages.shape == (2, 2) and program.weights.tolist() == [share, 1.0], "it ends at its second stage"
    state = np.where(parts.state >= 0, parts.state - m, -1).tolist()
    lagging = [j for j in range(m) if state[j] >= 0]
    size = parts.last + len(lagging)
    length = width(size + 1 + factors)
    amounts, terms, nominal = _amounts(parts)
    plain, others = _assembly(parts)
    driven, drives, drive = _drives(parts)
    bent = sorted({row[0] for row in others} | {row[0] for row in driven})
    order, edge_to = program.order.tolist(), (program.edge_to * length).tolist()
    rows = [length * i for i in range(max(size, n))]
    pivots = [rows[i] for i in order]
    backward = [range(int(b) - 1, int(a) - 1, -1) for a, b in itertools.pairwise(program.edge_start)]
    forward = _forward(parts, length)
    nodes = [np.flatnonzero(weights).tolist() for weights in parts.weights]
    first = list(itertools.accumulate([len(own) for own in nodes], initial=0))
    shares = np.array([-parts.weights[j, i] for j, own in enumerate(nodes) for i in own])
    lag = np.array([parts.lag[j] for j, own in enumerate(nodes) for _ in own]).reshape(-1, 3)
    reads = [[(rows[i], first[j] + k) for k, i in enumerate(nodes[j])] for j in lagging]
    lags = [rows[state[j]] for j in lagging]
    columns, q_rows, t_rows = (
        [i + p * length for p in range(factors)]
        for i in (size * length, (size + factors) * length, (n + heats) * length)
    )

    def with_drives(stage: int) -> list[list[tuple[int, int]]]:
        at = {
            i: [
                (length * (n + heats + p), 2 * n + 2 * edges + 1 + stage * drives + k)
                for (j, p), k in drive.items()
                if j == i
            ]
            for i in order
        }
        return [[*own, *at[i]] for i, own in zip(order, forward, strict=True)]

    return Plan(
        n=n,
        heats=heats,
        factors=factors,
        size=size,
        length=length,
        laws=len(parts.places),
        monomials=len(amounts) - 1,
        groups=amounts.shape[1],
        terms=len(terms),
        plains=len(plain),
        others=len(others),
        bents=len(bent),
        edges=edges,
        drives=drives,
        drivens=len(driven),
        channels=m,
        meters=meters,
        lagging=len(lagging),
        knots=(parts.numbers.shape[1] - 3) // 2,
        unit=store.put(np.array([0.0, 1.0])),
        own=store.put(parts.constant),
        inverse=store.put(1 / parts.constant),
        process=store.put(np.append(parts.process[: parts.last], parts.process[parts.last + m :])),
        share=store.put(np.array([share, share - 1.0, 1.0 / (share - 1.0)])),
        copper=store.put(parts.copper),
        law_numbers=store.put(parts.numbers),
        constant=store.put(amounts[-1]),
        by_monomial=store.put(-amounts[:-1]),
        nominal=store.put(np.array(nominal)),
        node_share=store.put(shares),
        before=store.put(shares * lag[:, 1]),
        now=store.put(shares * lag[:, 2]),
        kept=store.put(np.append(1.0, parts.lag[:, 0])),
        signs=store.put(parts.signs),
        of_losses=store.put(parts.of_losses),
        features=store.rows(1, len(amounts)),
        amounts=store.rows(1, amounts.shape[1]),
        scale=store.rows(1, factors),
        psi=store.rows(len(parts.places), 4),
        temperatures=store.rows(1, n + boundaries),
        values=store.rows(1, 2 * n + 2 * edges + 1 + 2 * drives),
        beyond=store.rows(2, n),
        stage=store.rows(n + heats + factors, length),
        state=store.rows(length, length),
        moved=store.rows(length, length),
        turned=store.rows(length + 2 * factors, length),
        ahead=store.rows(length, length),
        each=store.index(np.arange(max(length, len(parts.places), size * (m + meters)))),
        row=store.index(np.arange(length) * length),
        law=store.index(parts.places),
        term=store.index(terms),
        plain=store.index(plain),
        other=store.index(others),
        bent=store.index(bent),
        order=store.index(order),
        edge_start=store.index(program.edge_start),
        update=store.index(program.update),
        driven=store.index(driven),
        by_factor=store.index([*columns, *t_rows, -1]),
        by_factor_share=store.index([*q_rows, *columns]),
        by_column=store.index([*columns, -1]),
        node_start=store.index(first),
        node=store.index([i for own in nodes for i in own]),
        channel_state=store.index(state),
        channel_bias=store.index(parts.bias),
        sum=store.sweep([0], [1], [[(j * amounts.shape[1], j) for j in range(len(amounts) - 1)]]),
        forward=store.sweep(pivots, order, forward),
        driven_first=store.sweep(pivots, order, with_drives(0)),
        driven_second=store.sweep(pivots, order, with_drives(1)),
        backward=store.sweep(pivots[::-1], order[::-1], [[(edge_to[e], n + e) for e in own] for own in backward[::-1]]),
        blend=store.sweep(rows[:n], [0] * n, [[(row, 1)] for row in rows[:n]]),
        unmoved=store.sweep(
            [*rows[n : parts.last], *lags],
            [*[0] * (parts.last - n), *(1 + j for j in lagging)],
            [*[[]] * (parts.last - n), *reads],
        ),
        follow=store.sweep(lags, [0] * len(lags), reads),
    )


def _amounts(parts: Parts) -> tuple[Floats, list[tuple[int, int, int]], list[float]]:
    """(F + 1, G) what each monomial, then 1, adds to each group's amount; the terms that have a factor, and their coefficients."""
    program, groups = parts.program, len(parts.places)
    amounts = np.zeros((int(program.term_monomial.max(initial=-1)) + 2, width(groups)))
    terms, nominal = [], []
    for g in range(groups):
        for t in range(program.term_start[g], program.term_start[g + 1]):
            i, j = int(program.term_coefficient[t]), int(program.term_monomial[t])
            if parts.factor_of[i] < 0:
                amounts[j, g] += parts.nominal[i]  # -1 is the last row
            else:
                terms.append((g, int(parts.factor_of[i]), j))
                nominal.append(float(parts.nominal[i]))
    return amounts, terms, nominal


def _assembly(parts: Parts) -> tuple[list[list[int]], list[list[int]]]:
    """Rows of `plain` and `other`."""
    n, edges = parts.program.n, len(parts.program.edge_to)
    right = n + 2 * edges + 1
    plain, others = [], []
    for g, (_, b, _, other, one_way, law, knots) in enumerate(parts.places.tolist()):
        aa, bb, ab, ba, am, bm = parts.program.place[g].tolist()
        if not 0 <= b < n or one_way:
            others.append([g, aa, ab, am, -1, -1, -1, -1])
        elif other != NOBODY or law != LINEAR or knots:
            others.append([g, aa, ab, am, ba, bb, bm, right + b])
        else:
            plain.append([g, aa, bb, ab, ba])
    return plain, others


def _forward(parts: Parts, length: int) -> list[list[tuple[int, int]]]:
    """For each pivot: the rows of a stage that it takes and which of `values`, heats included."""
    program = parts.program
    n, edges, order = program.n, len(program.edge_to), program.order.tolist()
    found: dict[int, list[tuple[int, int]]] = {i: [] for i in order}
    for p, i in enumerate(order):
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            found[int(program.edge_to[e])].append((i * length, n + edges + e))
    for o, node in enumerate(parts.heats.tolist()):
        found[node].append(((n + o) * length, n + 2 * edges))
    return [found[i] for i in order]


def _drives(parts: Parts) -> tuple[list[list[int]], int, dict[tuple[int, int], int]]:
    """Rows of `driven`; how many numbers a stage has, and (node, factor) -> number."""
    program, n = parts.program, parts.program.n
    where: dict[tuple[int, int], int] = {}
    found = []
    for g, (a, b, _, _, one_way, _, _) in enumerate(parts.places.tolist()):
        own = parts.factor_of[program.term_coefficient[program.term_start[g] : program.term_start[g + 1]]]
        for p in sorted({int(p) for p in own if p >= 0}):
            into = where.setdefault((a, p), len(where))
            out = where.setdefault((b, p), len(where)) if 0 <= b < n and not one_way else -1
            found.append([g, p, into, out])
    return found, len(where), where


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def laws_at(plan: Laws, m: Floats, at: Index, listed: int, count: int) -> None:
    """`psi`: what multiplies the amounts of `count` groups at `temperatures`, and its slopes with T_a, T_b and T_m, as
    `twin.laws`."""
    T = plan.temperatures
    for e in range(listed, listed + count):
        g = at[u(e)]
        law, numbers, psi = plan.law + 7 * g, plan.law_numbers + g * (3 + 2 * plan.knots), plan.psi + 4 * g
        a, b, own, other, kind, knots = (
            at[u(law)],
            at[u(law + 1)],
            at[u(law + 2)],
            at[u(law + 3)],
            at[u(law + 5)],
            at[u(law + 6)],
        )
        value, by_a, by_b, by_m = 1.0, 0.0, 0.0, 0.0
        if b >= 0:
            value, by_a, by_b = m[u(T + b)] - m[u(T + a)], -1.0, 1.0
            if kind != 0:
                value, by_a, by_b = drop(kind, m[u(T + a)], m[u(T + b)])
            if knots > 0:
                table = m[numbers + 3 : numbers + 3 + 2 * knots]
                factor, growth = between(m[u(T + b)], table[:knots], table[knots:])
                value, by_a, by_b = factor * value, factor * by_a, factor * by_b + growth * value
        if own != 0:
            alpha = m[u(plan.copper)]
            factor = 1.0 + alpha * (m[u(T + a)] - m[u(plan.copper + 1)])
            if own < 0:
                factor = 1.0 / factor
                alpha *= -factor * factor
            value, by_a, by_b = factor * value, factor * by_a + alpha * value, factor * by_b
        if other >= 0:
            slope = m[u(numbers)]
            factor = 1.0 + slope * (m[u(T + other)] - m[u(numbers + 1)])
            value, by_a, by_b, by_m = factor * value, factor * by_a, factor * by_b, slope * value
        m[u(psi)], m[u(psi + 1)], m[u(psi + 2)], m[u(psi + 3)] = value, by_a, by_b, by_m


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def amounts_at(plan: Plan, m: Floats, at: Index, state: int) -> None:
    """`amounts` of all groups, by the step's features and the factors of [P | x] at `state`."""
    first = plan.n + plan.heats
    sweep(m, at, plan.sum, plan.amounts, plan.constant, plan.by_monomial, plan.unit, plan.features, plan.groups)
    for p in range(plan.factors):
        m[u(plan.scale + p)] = np.exp(m[u(state + (first + p) * plan.length + plan.size)])
    for t in range(plan.terms):
        m[u(plan.amounts + at[u(plan.term + 3 * t)])] += term_at(plan, m, at, t)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def term_at(plan: Plan, m: Floats, at: Index, t: int) -> float:
    """What a term that has a factor adds to the amount of its group."""
    p, j = at[u(plan.term + 3 * t + 1)], at[u(plan.term + 3 * t + 2)]
    amount: float = m[u(plan.nominal + t)] * m[u(plan.scale + p)]
    if j >= 0:
        amount *= m[u(plan.features + j)]
    return amount


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def surround(plan: Plan, m: Floats, state: int, outside: Floats) -> None:
    """`temperatures`: those of [P | x] at `state`, and `outside` (b,)."""
    for i in range(plan.n):
        m[u(plan.temperatures + i)] = m[u(state + i * plan.length + plan.size)]
    for i in range(len(outside)):
        m[u(plan.temperatures + plan.n + i)] = outside[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble(plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, state: int) -> None:
    """`values`: the step matrix, eliminated, and its right-hand side, linear about [P | x] at `state`; `phi` (F,) features."""
    n, values, amounts, T = plan.n, plan.values, plan.amounts, plan.temperatures
    right = values + n + 2 * plan.edges + 1
    for j in range(plan.monomials):
        m[u(plan.features + j)] = phi[j]
    surround(plan, m, state, outside)
    amounts_at(plan, m, at, state)
    laws_at(plan, m, at, plan.bent, plan.bents)
    for i in range(n):
        m[u(values + i)] = m[u(plan.own + i)]
    for i in range(n, 2 * n + 2 * plan.edges + 1):
        m[u(values + i)] = 0.0
    m[u(right - 1)] = -1.0
    for r in range(plan.plain, plan.plain + 5 * plan.plains, 5):
        amount = m[u(amounts + at[u(r)])]
        m[u(values + at[u(r + 1)])] += amount
        m[u(values + at[u(r + 2)])] += amount
        m[u(values + at[u(r + 3)])] -= amount
        m[u(values + at[u(r + 4)])] -= amount
    for r in range(plan.other, plan.other + 8 * plan.others, 8):
        g = at[u(r)]
        a, b, other = at[u(plan.law + 7 * g)], at[u(plan.law + 7 * g + 1)], at[u(plan.law + 7 * g + 3)]
        psi = plan.psi + 4 * g
        value, by_a, by_b, by_m = m[u(psi)], m[u(psi + 1)], m[u(psi + 2)], m[u(psi + 3)]
        amount = m[u(amounts + g)]
        rest = value - by_a * m[u(T + a)]
        if other >= 0:
            rest -= by_m * m[u(T + other)]
            m[u(values + at[u(r + 3)])] -= amount * by_m
        if 0 <= b < n:
            rest -= by_b * m[u(T + b)]
            m[u(values + at[u(r + 2)])] -= amount * by_b
            if at[u(r + 5)] >= 0:
                m[u(values + at[u(r + 4)])] += amount * by_a
                m[u(values + at[u(r + 5)])] += amount * by_b
                m[u(values + at[u(r + 7)])] -= amount * rest
                if other >= 0:
                    m[u(values + at[u(r + 6)])] += amount * by_m
        m[u(values + at[u(r + 1)])] -= amount * by_a
        m[u(right + a)] += amount * rest
    for i in range(n):  # heat that does not depend on the state is a rise of x that its own storage would give
        m[u(right + i)] *= m[u(plan.inverse + i)]
        m[u(state + i * plan.length + plan.size)] += m[u(right + i)]
    eliminate(plan, m, at)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def eliminate(plan: Matrix, m: Floats, at: Index) -> None:
    """Pivots become their inverses, lower entries what takes a pivot's row from theirs, upper ones are divided by the pivot."""
    values, upper, update = plan.values, plan.values + plan.n, plan.update
    for p in range(plan.n):
        first, last = at[u(plan.edge_start + p)], at[u(plan.edge_start + p + 1)]
        pivot = 1.0 / m[u(values + at[u(plan.order + p)])]
        m[u(values + at[u(plan.order + p)])] = pivot
        for e in range(first, last):
            multiplier = m[u(upper + plan.edges + e)] * pivot
            m[u(upper + plan.edges + e)] = multiplier
            for f in range(first, last):
                m[u(values + at[u(update)])] -= multiplier * m[u(upper + f)]
                update += 1
        for e in range(first, last):
            m[u(upper + e)] *= pivot


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _others_follow(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """Rows of `out` that are no temperature, from `source` before the step and the temperatures of `out` after it."""
    sweep(m, at, plan.unmoved, out, source, source, plan.kept, plan.before, plan.length)
    if plan.lagging > 0:
        sweep(m, at, plan.follow, out, out, out, plan.kept, plan.now, plan.length)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _drive(plan: Plan, m: Floats, at: Index) -> None:
    """`drive`: what factors multiply, at the stages of the step of x that was just made, as linearised about its start."""
    n, drives, beyond = plan.n, plan.drives, plan.beyond
    drive = plan.values + 2 * n + 2 * plan.edges + 1
    for i in range(2 * drives):
        m[u(drive + i)] = 0.0
    for r in range(plan.driven, plan.driven + 4 * plan.drivens, 4):
        g, p, into, out = at[u(r)], at[u(r + 1)], at[u(r + 2)], at[u(r + 3)]
        amount = 0.0
        for t in range(plan.terms):
            if at[u(plan.term + 3 * t)] == g and at[u(plan.term + 3 * t + 1)] == p:
                amount += term_at(plan, m, at, t)
        psi = plan.psi + 4 * g
        value, by_a, by_b, by_m = m[u(psi)], m[u(psi + 1)], m[u(psi + 2)], m[u(psi + 3)]
        a, b, other = at[u(plan.law + 7 * g)], at[u(plan.law + 7 * g + 1)], at[u(plan.law + 7 * g + 3)]
        for s in range(2):
            heat = value + by_a * m[u(beyond + s * n + a)]
            if 0 <= b < n:
                heat += by_b * m[u(beyond + s * n + b)]
            if other >= 0:
                heat += by_m * m[u(beyond + s * n + other)]
            m[u(drive + s * drives + into)] -= amount * heat
            if out >= 0:
                m[u(drive + s * drives + out)] += amount * heat


@numba.njit(error_model="numpy", nogil=True, cache=True)
def move(plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, source: int, out: int) -> None:
    """`out` (S rows): [F P | x one step on] from [P | x] at `source`, but for the factors' part of F. Filled: `values`."""
    n, size, length, stage, values = plan.n, plan.size, plan.length, plan.stage, plan.values
    assemble(plan, m, at, phi, outside, source)
    heat = values + n + 2 * plan.edges + 1
    for o in range(plan.heats):
        scaled(m, at, stage + (n + o) * length, plan.unit + 1, source + (n + o) * length, length)
    sweep(m, at, plan.forward, stage, source, stage, plan.own, values, length)
    for i in range(n):  # so that the second stage begins with as much more
        m[u(source + i * length + size)] = m[u(plan.temperatures + i)] - m[u(plan.share + 2)] * m[u(heat + i)]
    sweep(m, at, plan.backward, stage, stage, stage, values, values, length)
    for i in range(n):
        m[u(plan.beyond + i)] = m[u(stage + i * length + size)] - m[u(plan.temperatures + i)]
    sweep(m, at, plan.blend, stage, stage, source, plan.share, plan.share, length)
    for i in range(n):
        m[u(source + i * length + size)] = m[u(plan.temperatures + i)]
    sweep(m, at, plan.forward, stage, stage, stage, plan.own, values, length)
    sweep(m, at, plan.backward, out, stage, out, values, values, length)
    _others_follow(plan, m, at, source, out)
    if plan.factors > 0:
        for i in range(n):
            m[u(plan.beyond + n + i)] = m[u(out + i * length + size)] - m[u(plan.temperatures + i)]
        _drive(plan, m, at)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def derive(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """`out` (S rows): every column of `source` (S rows) one step on, by F of the step that `move` just made. The last rows of `stage` are
    those of the factors in `source`."""
    n, length, stage, values = plan.n, plan.length, plan.stage, plan.values
    for o in range(plan.heats):
        scaled(m, at, stage + (n + o) * length, plan.unit + 1, source + (n + o) * length, length)
    sweep(m, at, plan.driven_first, stage, source, stage, plan.own, values, length)
    sweep(m, at, plan.backward, stage, stage, stage, values, values, length)
    sweep(m, at, plan.blend, stage, stage, source, plan.share, plan.share, length)
    sweep(m, at, plan.driven_second, stage, stage, stage, plan.own, values, length)
    sweep(m, at, plan.backward, out, stage, out, values, values, length)
    _others_follow(plan, m, at, source, out)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def carry(plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, early: bool) -> None:
    """`ahead`: [P | x] of `state` one step on, F P F' + Q, symmetric to rounding; `turned`: the covariance of each number before the
    step, and x then, with all numbers after it; what unknown factors add to it is left out unless `early`, where readings need it."""
    n, size, length, state, moved, turned, ahead = (
        plan.n,
        plan.size,
        plan.length,
        plan.state,
        plan.moved,
        plan.turned,
        plan.ahead,
    )
    move(plan, m, at, phi, outside, state, moved)
    transposed(m, turned, moved, size, length)
    for i in range(size):
        m[u(turned + i * length + size)] = m[u(state + i * length + size)]
    for p in range(plan.factors):
        m[u(plan.stage + (n + plan.heats + p) * length + size + 1 + p)] = 1.0
    derive(plan, m, at, turned, ahead)
    if plan.factors > 0:
        _add_factors(plan, m, at, early)
    for i in range(size):
        m[u(ahead + i * length + size)] = m[u(moved + i * length + size)]
        m[u(ahead + i * length + i)] += m[u(plan.process + i)]


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _add_factors(plan: Plan, m: Floats, at: Index, early: bool) -> None:
    """What the factors' columns B of F, which are behind x in `ahead`, add to `turned` and to F P F'; behind `turned`: -B', and what its
    rows of the factors were without B."""
    size, length, factors, turned, ahead = plan.size, plan.length, plan.factors, plan.turned, plan.ahead
    columns, first = turned + size * length, (plan.n + plan.heats) * length
    for p in range(factors):
        here = columns + p * length
        scaled(m, at, here, plan.unit, ahead, length)
        for i in range(size):
            m[u(here + i)] = -m[u(ahead + i * length + size + 1 + p)]
        scaled(m, at, here + factors * length, plan.unit + 1, turned + first + p * length, length)
    by, unit = plan.by_column, plan.unit + 1
    rows, count = (0, size) if early else (first, factors)  # the factors' own are needed below
    here, shares = turned + rows, plan.state + rows + plan.n + plan.heats
    less(m, at, plan.row, count, by, plan.each, here, here, turned, unit, shares, length, length)
    by, which = plan.by_factor, plan.by_factor_share
    less(m, at, plan.row, size, by, which, ahead, ahead, turned, unit, turned, 1, length)
