"""The index program: the arithmetic of the straight-line kernel with the topology as data, compiled once for all motors.

Row and column of the step matrix are kept as `values` (n diagonals, then the upper and the lower off-diagonals, both in the
order of elimination), so every access is one precomputed index.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.integrators import Tableau
from twin.structure import NOBODY, Group, Structure

Index = NDArray[np.int64]


class Program(NamedTuple):
    """Arrays of indices, and the tableau divided by its gamma.

    `term_*` (K,) are grouped, group g holds `term_start[g]:term_start[g + 1]`. `group` (G, 4): a, b, own, other.
    `place` (G, 6): positions of (a,a) (b,b) (a,b) (b,a) (a,other) (b,other) in `values`, -1 where there is none.
    `order` (n,); pivot p of `order[p]` has the entries `edge_start[p]:edge_start[p + 1]` with rows `edge_to` (E,);
    `update` (U,): position of the entry that each product of elimination is taken from, in the order of the loops.
    """

    n: int
    gamma: float
    term_start: Index
    term_coefficient: Index
    term_monomial: Index
    group: Index
    place: Index
    order: Index
    edge_start: Index
    edge_to: Index
    update: Index
    stages: NDArray[np.float64]  # (s, s) strictly lower
    weights: NDArray[np.float64]  # (s,)


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
        gamma=tableau.gamma,
        term_start=_index(np.cumsum([0, *(len(group.terms) for group in structure.groups)])),
        term_coefficient=_index([i for i, _ in terms]),
        term_monomial=_index([j for _, j in terms]),
        group=_index([(g.a, g.b, g.own, g.other) for g in structure.groups]).reshape(-1, 4),
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
    crossed = m != NOBODY
    return [
        where[a, a],
        where[b, b] if between else -1,
        where[a, b] if between else -1,
        where[b, a] if between else -1,
        where[a, m] if crossed else -1,
        where[b, m] if crossed and between else -1,
    ]


def run(
    program: Program,
    features: NDArray[np.float64],
    boundaries: NDArray[np.float64],
    step_s: float,
    coefficients: NDArray[np.float64],
    capacities: NDArray[np.float64],
    copper: NDArray[np.float64],
    factors: NDArray[np.float64],
    out: NDArray[np.float64],
    stage: NDArray[np.float64],
) -> None:
    """Fill `out` (N + 1, n) from its first row; `stage` (s, n) is left holding the last step's stage temperatures."""
    n, order, edge_start, edge_to = program.n, program.order, program.edge_start, program.edge_to
    edges = len(edge_to)
    constant = capacities / (program.gamma * step_s)
    values, right, delta = np.empty(n + 2 * edges), np.empty(n), np.empty(stage.shape)
    for k in range(len(features)):
        start = out[k]
        values[:n] = constant
        values[n:] = 0.0
        right[:] = 0.0
        for g in range(len(program.group)):
            conductance = 0.0
            for t in range(program.term_start[g], program.term_start[g + 1]):
                j = program.term_monomial[t]
                phi = 1.0 if j < 0 else features[k, j]
                conductance += coefficients[program.term_coefficient[t]] * phi
            a, b, own, other = program.group[g]
            aa, bb, ab, ba, am, bm = program.place[g]
            if b < 0:
                heat, own_slope, other_slope = conductance, 0.0, 0.0
                if own != 0:
                    factor = 1.0 + copper[0] * (start[a] - copper[1])
                    own_slope = heat * copper[0]
                    if own < 0:
                        factor = 1.0 / factor
                        own_slope = -own_slope * factor * factor
                    heat *= factor
                if other >= 0:
                    factor = 1.0 + factors[g, 0] * (start[other] - factors[g, 1])
                    other_slope = heat * factors[g, 0]
                    own_slope *= factor
                    heat *= factor
                    values[am] -= other_slope
                    right[a] -= other_slope * start[other]
                values[aa] -= own_slope
                right[a] += heat - own_slope * start[a]
                continue
            far = boundaries[k, b - n] if b >= n else start[b]
            if other >= 0:
                slope = conductance * factors[g, 0] * (far - start[a])
                conductance *= 1.0 + factors[g, 0] * (start[other] - factors[g, 1])
                values[am] -= slope
                right[a] -= slope * start[other]
                if b < n:
                    values[bm] += slope
                    right[b] += slope * start[other]
            values[aa] += conductance
            if b >= n:
                right[a] += conductance * far
            else:
                values[bb] += conductance
                values[ab] -= conductance
                values[ba] -= conductance
        u = 0
        for p in range(n):
            values[order[p]] = 1.0 / values[order[p]]
            for e in range(edge_start[p], edge_start[p + 1]):
                multiplier = values[n + edges + e] * values[order[p]]
                values[n + edges + e] = multiplier
                for f in range(edge_start[p], edge_start[p + 1]):
                    values[program.update[u]] -= multiplier * values[n + f]
                    u += 1
        for s in range(len(stage)):
            z = stage[s]
            for i in range(n):
                base = start[i]
                for j in range(s):
                    base += program.stages[s, j] * delta[j, i]
                delta[s, i] = base
                z[i] = constant[i] * base + right[i]
            for p in range(n):
                for e in range(edge_start[p], edge_start[p + 1]):
                    z[edge_to[e]] -= values[n + edges + e] * z[order[p]]
            for p in range(n - 1, -1, -1):
                i = order[p]
                total = z[i]
                for e in range(edge_start[p], edge_start[p + 1]):
                    total -= values[n + e] * z[edge_to[e]]
                z[i] = total * values[i]
            for i in range(n):
                delta[s, i] = z[i] - delta[s, i]
        for i in range(n):
            end = start[i]
            for s in range(len(stage)):
                end += program.weights[s] * delta[s, i]
            out[k + 1, i] = end
