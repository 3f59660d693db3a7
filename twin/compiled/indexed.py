"""The index program: the arithmetic of the straight-line kernel with the network as data, compiled once for all
networks.

One text serves one run and `twin.arithmetic.vectors.LANES` side by side, which then share what its indices cost.

The entries of a step's matrix are kept in one row, `values`: n diagonals, then the upper and the lower off-diagonals,
both in the order of elimination. A network of the nodes 0 - 1 - 2, eliminated in this order, has

    values   (0,0) (1,1) (2,2)   (0,1) (1,2)   (1,0) (2,1)

so that every access is one index that is known before the run.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.vectors import vectors
from twin.compiled.heat import LINEAR, SOURCE, STREAM
from twin.compiled.heat import heat_capacity_of_vectors as heat_capacity
from twin.compiled.heat import heat_of_vectors as heat
from twin.compiled.integrators import Tableau
from twin.compiled.structure import Group, Structure
from twin.motor.heat_laws import NUMBER

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class Program(NamedTuple):
    """A network and a method as arrays of indices.

    Group g has the terms `term_start[g]:term_start[g + 1]` of `term_coefficient` and `term_monomial` (K,), and the
    table `knot_start[g]:knot_start[g + 1]` of `knots` and `rises` where it is a fluid
    (`twin.compiled.structure.Ramps`).

    `group` (G, 5): a, b, number of the law (`twin.motor.heat_laws.NUMBER`), other, 1 where one way. `place` (G, 6):
    where (a,a) (b,b) (a,b) (b,a) (a,other) (b,other) are in `values`, -1 where there is none. A plain link of the
    nodes 0 and 1 of the three above: group 0 1 0 -1 0, place 0 1 3 5 -1 -1.

    `order` (n,): nodes as they are eliminated; the p-th of them has the off-diagonals `edge_start[p]:edge_start[p +
    1]`, whose other nodes are `edge_to` (E,). `update` (U,): where each product of the elimination is taken off, in
    the order of its loops. `stages` and `weights` are the tableau's, divided by its gamma.
    """

    n: int
    symmetric: bool
    gamma: float
    back: float
    term_start: Index
    term_coefficient: Index
    term_monomial: Index
    group: Index
    knot_start: Index
    knots: Floats
    rises: Floats
    place: Index
    order: Index
    edge_start: Index
    edge_to: Index
    update: Index
    stages: Floats  # (s, s) strictly lower
    weights: Floats  # (s,)


def program(structure: Structure, tableau: Tableau) -> Program:
    """The network and the method as arrays."""
    n, pattern = structure.n, structure.pattern
    edges = [(p, j) for p in pattern.order for j in pattern.later[p]]
    where = {(i, i): i for i in range(n)}
    where |= {edge: n + e for e, edge in enumerate(edges)}
    where |= {(j, i): n + len(edges) + e for e, (i, j) in enumerate(edges)}
    lengths = [len(pattern.later[p]) for p in pattern.order]
    terms = [term for group in structure.groups for term in group.terms]
    stages = np.zeros((len(tableau.b), len(tableau.b)))
    for i, row in enumerate(tableau.a):
        stages[i, :i] = np.array(row) / tableau.gamma
    return Program(
        n=n,
        symmetric=structure.symmetric,
        gamma=tableau.gamma,
        back=tableau.back,
        term_start=_index(np.cumsum([0, *(len(group.terms) for group in structure.groups)])),
        term_coefficient=_index([i for i, _ in terms]),
        term_monomial=_index([j for _, j in terms]),
        group=_index([(g.a, g.b, NUMBER[g.law], g.other, g.one_way) for g in structure.groups]).reshape(-1, 5),
        knot_start=_index(np.cumsum([0, *(len(g.fluid) for g in structure.groups)])),
        knots=np.array([degC for g in structure.groups for degC, _ in g.fluid], dtype=np.float64),
        rises=np.array([rise for g in structure.groups for _, rise in g.fluid], dtype=np.float64),
        place=_index([_places(g, n, where) for g in structure.groups]).reshape(-1, 6),
        order=_index(pattern.order),
        edge_start=_index(np.cumsum([0, *lengths])),
        edge_to=_index([j for _, j in edges]),
        update=_index([where[i, j] for p in pattern.order for i in pattern.later[p] for j in pattern.later[p]]),
        stages=stages,
        weights=np.array(tableau.b) / tableau.gamma,
    )


def _index(values: Any) -> Index:
    return np.array(values, dtype=np.int64)


def _places(group: Group, n: int, where: dict[tuple[int, int], int]) -> list[int]:
    a, b, m = group.a, group.b, group.other
    between = 0 <= b < n
    crossed = 0 <= m < n
    return [
        where[a, a],
        where[b, b] if between else -1,
        where[a, b] if between else -1,
        where[b, a] if between else -1,
        where[a, m] if crossed else -1,
        where[b, m] if crossed and between else -1,
    ]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble(
    program: Program,
    constant: Floats,
    coefficients: Floats,
    copper: Floats,
    factors: Floats,
    phi: Any,
    outside: Any,
    start: Any,
    values: Any,
    right: Any,
) -> None:
    """One step: its matrix, eliminated, into `values` (n + 2E,) and its right-hand side into `right` (n,) [W].

    `constant` (n,) C / (gamma h) [W/K]; `phi` (m,) features; `outside` (b,) [degC]. What is not linear in temperature
    is linearised about `start` (n,).
    """
    n, order, edge_start = program.n, program.order, program.edge_start
    edges = len(program.edge_to)
    for i in range(len(values)):
        values[i] = constant[i] if i < n else 0.0
    for i in range(n):
        right[i] = 0.0
    for g in range(len(program.group)):
        amount = 0.0
        for t in range(program.term_start[g], program.term_start[g + 1]):
            j, coefficient = program.term_monomial[t], coefficients[program.term_coefficient[t]]
            if j < 0:
                amount += coefficient
            else:
                amount += coefficient * phi[j]
        a, b, law, other, one_way = program.group[g]
        aa, bb, ab, ba, am, bm = program.place[g]
        between, gives = 0 <= b < n, 0 <= b < n and one_way == 0
        if law == LINEAR and other < 0:  # as most are
            values[aa] += amount
            if between:
                values[ab] -= amount
            else:
                right[a] += amount * outside[b - n]
            if gives:
                values[ba] -= amount
                values[bb] += amount
            continue
        if law == SOURCE and other < 0:
            right[a] += amount
            continue
        own = start[a]
        far = start[b] if between else outside[b - n] if b >= n else own
        relative, growth = 1.0, 0.0
        if law == STREAM:
            first, end = program.knot_start[g], program.knot_start[g + 1]
            relative, growth = heat_capacity(far, program.knots[first:end], program.rises[first:end], end - first)
        crossed = start[other] if 0 <= other < n else outside[other - n] if other >= n else own
        value, by_own, by_far, by_other = heat(
            law, amount, own, far, crossed, copper[0], copper[1], factors[g, 0], factors[g, 1], relative, growth
        )
        if 0 <= other < n:
            values[am] -= by_other
            right[a] -= by_other * crossed
            if gives:
                values[bm] += by_other
                right[b] += by_other * crossed
        values[aa] -= by_own
        if between:
            values[ab] -= by_far
        if gives:
            values[ba] += by_own
            values[bb] += by_far
        if law != LINEAR:
            rest = value - by_own * own
            if between:
                rest -= by_far * far
            right[a] += rest
            if gives:
                right[b] -= rest
        elif not between:  # what drives it is linear in both temperatures: the slopes say it all
            right[a] += by_far * far
    u = 0
    for p in range(n):
        first, end = edge_start[p], edge_start[p + 1]
        pivot = 1.0 / values[order[p]]
        values[order[p]] = pivot
        for e in range(first, end):
            multiplier = values[n + e if program.symmetric else n + edges + e] * pivot
            values[n + edges + e] = multiplier
            begin = e if program.symmetric else first  # entries left of the diagonal are had from those right of it
            for f in range(begin, end):
                values[program.update[u + f - first]] -= multiplier * values[n + f]
            u += end - first


@numba.njit(error_model="numpy", nogil=True, cache=True)
def run(
    program: Program,
    features: Floats,
    boundaries: Floats,
    step_s: float,
    coefficients: Floats,
    capacities: Floats,
    copper: Floats,
    factors: Floats,
    out: Floats,
    stage: Floats,
) -> None:
    """Fill `out` (N + 1, n) from its first row; `stage` (s, n) is left holding the last step's stage temperatures.

    With a last axis of `twin.arithmetic.vectors.LANES` in `features`, `boundaries`, `out` and `stage`: so many runs,
    each with the bits that it has alone.
    """
    n, order, edge_start, edge_to = program.n, program.order, program.edge_start, program.edge_to
    edges, lanes = len(edge_to), features.shape[2:]
    values, right = vectors(np.empty((n + 2 * edges, *lanes)), lanes), vectors(np.empty((n, *lanes)), lanes)
    delta, stages = vectors(np.empty(stage.shape), lanes), vectors(stage, lanes)
    phi, outside, course = vectors(features, lanes), vectors(boundaries, lanes), vectors(out, lanes)
    constant = capacities / (program.gamma * step_s)
    looking, back, before = program.back != 0.0, 0.0, course[0]
    if looking:
        constant = capacities / step_s
    for k in range(len(phi)):
        start = course[k]
        assemble(program, constant, coefficients, copper, factors, phi[k], outside[k], start, values, right)
        for s in range(len(stages)):
            z = stages[s]
            for i in range(n):
                base = start[i] + back * (start[i] - before[i])
                for j in range(s):
                    base += program.stages[s, j] * delta[j, i]
                delta[s, i] = base
                z[i] = constant[i] * base + right[i]
            for p in range(n):
                own = z[order[p]]
                for e in range(edge_start[p], edge_start[p + 1]):
                    z[edge_to[e]] -= values[n + edges + e] * own
            for p in range(n - 1, -1, -1):
                i = order[p]
                total = z[i]
                for e in range(edge_start[p], edge_start[p + 1]):
                    total -= values[n + e] * z[edge_to[e]]
                z[i] = total * values[i]
            for i in range(n):
                delta[s, i] = z[i] - delta[s, i]
        for i in range(n):
            end = start[i] + back * (start[i] - before[i])
            for s in range(len(stages)):
                end += program.weights[s] * delta[s, i]
            course[k + 1, i] = end
        if looking:
            constant, back, before = capacities / (program.gamma * step_s), program.back, start
