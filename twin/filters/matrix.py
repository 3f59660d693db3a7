"""The matrix of a filter's step and its right-hand side: the network's laws, linear about the estimate, eliminated.

The same step as `twin.compiled.indexed`, with amounts that unknown factors multiply. Its loops go through the tables
of a `Plan`, whose rows are read here by name: that of a link of the difference itself between nodes 0 and 1 of a
network 0 - 1 - 2 is `g aa bb ab ba` = 0 0 1 3 5, its group and the places in `values` that its amount goes to.
"""

from __future__ import annotations

from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import both, scaled, within
from twin.arithmetic.powers import exp_of_number
from twin.compiled.heat import heat, heat_capacity
from twin.filters.pivots import eliminate_few
from twin.filters.plan import LawTable, Plan, ends_of, law_of, psi_of, term_of

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Matrix(Protocol):
    """What `eliminate` takes of a `Plan` or of another form."""

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


@within
def laws_at(laws: LawTable, m: Floats, at: Index, listed: int, count: int) -> None:
    """`psi` of `count` groups at `temperatures`."""
    T, alpha, reference = laws.temperatures, m[u(laws.copper)], m[u(laws.copper + 1)]
    for e in range(listed, listed + count):
        g = at[u(e)]
        a, b, other = ends_of(laws, at, g)
        law, knots = law_of(laws, at, g)
        numbers, psi = laws.numbers + g * (2 + 2 * laws.knots), laws.psi + 4 * g
        own = m[u(T + a)]
        far, crossed = m[u(T + b)] if b >= 0 else own, m[u(T + other)] if other >= 0 else own
        relative, growth = 1.0, 0.0
        if knots > 0:
            relative, growth = heat_capacity(far, pointer(m, numbers + 2), pointer(m, numbers + 2 + knots), knots)
        m[u(psi)], m[u(psi + 1)], m[u(psi + 2)], m[u(psi + 3)] = heat(
            law, 1.0, own, far, crossed, alpha, reference, m[u(numbers)], m[u(numbers + 1)], relative, growth
        )


@within
def amounts_at(plan: Plan, m: Floats, at: Index, state: int) -> None:
    """`amounts` of all groups, by the step's features and the factors of [P | x] at `state`."""
    first = plan.n + plan.heats
    scaled(m, plan.amounts, 1.0, plan.constant, plan.groups)
    for v in range(plan.varied):
        g, j = both(at[u(plan.vary + v)])
        m[u(plan.amounts + g)] += m[u(plan.by_monomial + v)] * m[u(plan.features + j)]
    for p in range(plan.factors):
        m[u(plan.scale + p)] = exp_of_number(m[u(state + (first + p) * plan.length + plan.size)])
    for t in range(plan.terms):
        g, _, _ = term_of(plan, at, t)
        m[u(plan.amounts + g)] += term_at(plan, m, at, t)


@within
def term_at(plan: Plan, m: Floats, at: Index, t: int) -> float:
    """What a term that has a factor adds to the amount of its group."""
    _, p, j = term_of(plan, at, t)
    amount: float = m[u(plan.nominal + t)] * m[u(plan.scale + p)]
    if j >= 0:
        amount *= m[u(plan.features + j)]
    return amount


@within
def surround(plan: Plan, m: Floats, state: int, outside: Floats) -> None:
    """`temperatures`: those of [P | x] at `state`, and `outside` (b,)."""
    for i in range(plan.n):
        m[u(plan.laws.temperatures + i)] = m[u(state + i * plan.length + plan.size)]
    for i in range(plan.around):
        m[u(plan.laws.temperatures + plan.n + i)] = outside[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble(plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, state: int) -> None:
    """The step's matrix, eliminated, and its right-hand side, into `values`: linear about [P | x] at `state`, with
    features `phi` (F,) and boundaries `outside` (b,)."""
    n, values, amounts, T = plan.n, plan.values, plan.amounts, plan.laws.temperatures
    right = values + n + 2 * plan.edges + 1
    for j in range(plan.monomials):
        m[u(plan.features + j)] = phi[j]
    surround(plan, m, state, outside)
    amounts_at(plan, m, at, state)
    laws_at(plan.laws, m, at, plan.bent, plan.bents)
    scaled(m, values, 1.0, plan.fixed, plan.filled)
    for r in range(plan.plain, plan.plain + 5 * plan.plains, 5):
        g, aa, bb, ab, ba = at[u(r)], at[u(r + 1)], at[u(r + 2)], at[u(r + 3)], at[u(r + 4)]
        amount = m[u(amounts + g)]
        m[u(values + aa)] += amount
        m[u(values + bb)] += amount
        m[u(values + ab)] -= amount
        m[u(values + ba)] -= amount
    for r in range(plan.rim, plan.rim + 4 * plan.rims, 4):
        g, aa, right_a, boundary = at[u(r)], at[u(r + 1)], at[u(r + 2)], at[u(r + 3)]
        amount = m[u(amounts + g)]
        m[u(values + aa)] += amount
        m[u(values + right_a)] += amount * m[u(T + boundary)]
    for r in range(plan.constant_heat, plan.constant_heat + 2 * plan.constants, 2):
        g, right_a = at[u(r)], at[u(r + 1)]
        m[u(values + right_a)] += m[u(amounts + g)]
    for r in range(plan.other, plan.other + 8 * plan.others, 8):
        g, aa, ab, am = at[u(r)], at[u(r + 1)], at[u(r + 2)], at[u(r + 3)]
        ba, bb, bm, right_b = at[u(r + 4)], at[u(r + 5)], at[u(r + 6)], at[u(r + 7)]
        a, b, other = ends_of(plan.laws, at, g)
        value, by_a, by_b, by_m = psi_of(plan.laws, m, g)
        amount = m[u(amounts + g)]
        rest = value - by_a * m[u(T + a)]
        if other >= 0:
            rest -= by_m * m[u(T + other)]
            m[u(values + am)] -= amount * by_m
        if 0 <= b < n:
            rest -= by_b * m[u(T + b)]
            m[u(values + ab)] -= amount * by_b
            if bb >= 0:  # the heat is taken out of b
                m[u(values + ba)] += amount * by_a
                m[u(values + bb)] += amount * by_b
                m[u(values + right_b)] -= amount * rest
                if other >= 0:
                    m[u(values + bm)] += amount * by_m
        m[u(values + aa)] -= amount * by_a
        m[u(right + a)] += amount * rest
    for i in range(n):  # heat that does not depend on the state is a rise of x that its own storage would give
        m[u(right + i)] *= m[u(plan.inverse + i)]
        m[u(state + i * plan.length + plan.size)] += m[u(right + i)]
    eliminate(plan, m, at)


@within
def eliminate(plan: Matrix, m: Floats, at: Index) -> None:
    """The matrix in `values` becomes its factors, in place: 1 / pivot on the diagonal, below it the shares by which a
    pivot's row is taken from later rows, right of it the entries of a row divided by its pivot."""
    values, update, edges = plan.values, plan.update, plan.edges
    for p in range(plan.n):
        first, own = at[u(plan.edge_start + p)], values + at[u(plan.order + p)]
        count = at[u(plan.edge_start + p + 1)] - first
        pivot = 1.0 / m[u(own)]
        m[u(own)] = pivot
        upper = values + plan.n + first
        lower = upper + edges
        if count == 1:
            eliminate_few(m, at, values, upper, lower, update, pivot, 1)
        elif count == 2:
            eliminate_few(m, at, values, upper, lower, update, pivot, 2)
        elif count == 3:
            eliminate_few(m, at, values, upper, lower, update, pivot, 3)
        elif count == 4:
            eliminate_few(m, at, values, upper, lower, update, pivot, 4)
        else:
            for e in range(count):
                m[u(lower + e)] *= pivot
                for f in range(count):
                    m[u(values + at[u(update + e * count + f)])] -= m[u(lower + e)] * m[u(upper + f)]
            for f in range(count):
                m[u(upper + f)] *= pivot
        update += count * count


@within
def counted(laws: LawTable, m: Floats, at: Index, n: int, amounts: int, signs: int, slopes: int) -> float:
    """The heat [W] that a meter adds up by the `signs` of all groups with these `amounts`, among n nodes, by `psi`;
    what it changes by with temperatures is taken from the numbers at `slopes`."""
    total = 0.0
    for g in range(laws.total):
        if m[u(signs + g)] == 0.0:
            continue
        value, by_a, by_b, by_m = psi_of(laws, m, g)
        amount = m[u(signs + g)] * m[u(amounts + g)]
        a, b, other = ends_of(laws, at, g)
        total += amount * value
        m[u(slopes + a)] -= amount * by_a
        if 0 <= b < n:
            m[u(slopes + b)] -= amount * by_b
        if other >= 0:
            m[u(slopes + other)] -= amount * by_m
    return total
