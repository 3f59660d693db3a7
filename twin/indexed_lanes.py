"""The index program for `LANES` runs side by side: the loops of `twin.indexed`, each step of them for all lanes at once.

What an index costs is shared by all lanes, and the inner loops are vector instructions; every run has the bits that it has alone. For methods
that do not look back.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from twin.drops import between, drop
from twin.indexed import Program

Floats = NDArray[np.float64]


# Numbers are written into the functions: their text is compiled on its own (`twin.kernel`).
@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble_lanes(
    program: Program,
    constant: Floats,
    coefficients: Floats,
    copper: Floats,
    factors: Floats,
    inputs: Floats,
    start: Floats,
    values: Floats,
    right: Floats,
    room: Floats,
) -> None:
    """As `twin.indexed.assemble`, every array but the parameters with a last axis of 16 lanes. `inputs` (m + b, 16): features, then
    boundaries; `room` (5, 16) to work in."""
    n, order, edge_start = program.n, program.order, program.edge_start
    edges, monomials = len(program.edge_to), program.monomials
    amount, slope, value, by_a, by_b = room[0], room[1], room[2], room[3], room[4]
    for i in range(values.shape[0]):
        own = constant[i] if i < n else 0.0
        for c in range(16):
            values[i, c] = own
    for i in range(n):
        for c in range(16):
            right[i, c] = 0.0
    for g in range(len(program.group)):
        for c in range(16):
            amount[c] = 0.0
        for t in range(program.term_start[g], program.term_start[g + 1]):
            j, coefficient = program.term_monomial[t], coefficients[program.term_coefficient[t]]
            if j < 0:
                for c in range(16):
                    amount[c] += coefficient
            else:
                phi = inputs[j]
                for c in range(16):
                    amount[c] += coefficient * phi[c]
        a, b, own_law, other = program.group[g, 0], program.group[g, 1], program.group[g, 2], program.group[g, 3]
        law, one_way = program.group[g, 4], program.group[g, 5]
        diagonal, right_a, start_a = values[program.place[g, 0]], right[a], start[a]
        if b < 0:
            for c in range(16):
                slope[c] = 0.0
            if own_law != 0:
                for c in range(16):
                    factor = 1.0 + copper[0] * (start_a[c] - copper[1])
                    own = amount[c] * copper[0]
                    if own_law < 0:
                        factor = 1.0 / factor
                        own = -own * factor * factor
                    slope[c] = own
                    amount[c] *= factor
            if other >= 0:
                start_m, crossed = start[other], values[program.place[g, 4]]
                for c in range(16):
                    factor = 1.0 + factors[g, 0] * (start_m[c] - factors[g, 1])
                    own = amount[c] * factors[g, 0]
                    slope[c] *= factor
                    amount[c] *= factor
                    crossed[c] -= own
                    right_a[c] -= own * start_m[c]
            for c in range(16):
                diagonal[c] -= slope[c]
                right_a[c] += amount[c] - slope[c] * start_a[c]
            continue
        far = inputs[monomials + b - n] if b >= n else start[b]
        for c in range(16):
            value[c] = far[c] - start_a[c]
        if law != 0:
            first, end = program.knot_start[g], program.knot_start[g + 1]
            for c in range(16):
                value[c], by_a[c], by_b[c] = drop(law, start_a[c], far[c])
            if first < end:
                for c in range(16):
                    relative, growth = between(far[c], program.knots[first:end], program.relative[first:end])
                    by_a[c] = relative * by_a[c]
                    by_b[c] = relative * by_b[c] + growth * value[c]
                    value[c] = relative * value[c]
        taken = b < n and one_way == 0
        if other >= 0:
            start_m, crossed = start[other], values[program.place[g, 4]]
            for c in range(16):
                slope[c] = amount[c] * factors[g, 0] * value[c]
                amount[c] *= 1.0 + factors[g, 0] * (start_m[c] - factors[g, 1])
                crossed[c] -= slope[c]
                right_a[c] -= slope[c] * start_m[c]
            if taken:
                crossed, right_b = values[program.place[g, 5]], right[b]
                for c in range(16):
                    crossed[c] += slope[c]
                    right_b[c] += slope[c] * start_m[c]
        if law != 0:
            for c in range(16):
                by_a[c] = -amount[c] * by_a[c]
                by_b[c] = amount[c] * by_b[c]
        else:
            for c in range(16):
                by_a[c] = amount[c]
                by_b[c] = amount[c]
        for c in range(16):
            diagonal[c] += by_a[c]
        if b >= n:
            if law == 0:
                for c in range(16):
                    right_a[c] += amount[c] * far[c]
            else:
                for c in range(16):
                    right_a[c] += amount[c] * value[c] + by_a[c] * start_a[c]
            continue
        crossed = values[program.place[g, 2]]
        for c in range(16):
            crossed[c] -= by_b[c]
        if taken:
            crossed, diagonal = values[program.place[g, 3]], values[program.place[g, 1]]
            for c in range(16):
                crossed[c] -= by_a[c]
                diagonal[c] += by_b[c]
        if law != 0:
            for c in range(16):
                value[c] = amount[c] * value[c] + by_a[c] * start_a[c] - by_b[c] * far[c]
                right_a[c] += value[c]
            if taken:
                right_b = right[b]
                for c in range(16):
                    right_b[c] -= value[c]
    u = 0
    for p in range(n):
        pivot = values[order[p]]
        for c in range(16):
            pivot[c] = 1.0 / pivot[c]
        for e in range(edge_start[p], edge_start[p + 1]):
            lower = values[n + edges + e]
            for c in range(16):
                lower[c] *= pivot[c]
            for f in range(edge_start[p], edge_start[p + 1]):
                to, upper = values[program.update[u]], values[n + f]
                for c in range(16):
                    to[c] -= lower[c] * upper[c]
                u += 1


@numba.njit(error_model="numpy", nogil=True, cache=True)
def run(
    program: Program,
    inputs: Floats,
    step_s: float,
    coefficients: Floats,
    capacities: Floats,
    copper: Floats,
    factors: Floats,
    state: Floats,
    out: Floats,
) -> None:
    """As `twin.codegen_lanes.generate_side_by_side` says: `inputs` (N, m + b, 16), `state` (n, 16), `out` (N, n, 16)."""
    n, order, edge_start, edge_to = program.n, program.order, program.edge_start, program.edge_to
    edges, stages = len(edge_to), len(program.weights)
    constant = capacities / (program.gamma * step_s)
    values, right, room = np.empty((n + 2 * edges, 16)), np.empty((n, 16)), np.empty((5, 16))
    z, delta = np.empty((n, 16)), np.empty((stages, n, 16))
    for k in range(len(inputs)):
        assemble_lanes(program, constant, coefficients, copper, factors, inputs[k], state, values, right, room)
        for s in range(stages):
            for i in range(n):
                for c in range(16):
                    base = state[i, c]
                    for j in range(s):
                        base += program.stages[s, j] * delta[j, i, c]
                    delta[s, i, c] = base
                    z[i, c] = constant[i] * base + right[i, c]
            for p in range(n):
                own = z[order[p]]
                for e in range(edge_start[p], edge_start[p + 1]):
                    to, lower = z[edge_to[e]], values[n + edges + e]
                    for c in range(16):
                        to[c] -= lower[c] * own[c]
            for p in range(n - 1, -1, -1):
                own, pivot = z[order[p]], values[order[p]]
                for e in range(edge_start[p], edge_start[p + 1]):
                    later, upper = z[edge_to[e]], values[n + e]
                    for c in range(16):
                        own[c] -= upper[c] * later[c]
                for c in range(16):
                    own[c] *= pivot[c]
            for i in range(n):
                for c in range(16):
                    delta[s, i, c] = z[i, c] - delta[s, i, c]
        for i in range(n):
            for c in range(16):
                end = state[i, c]
                for s in range(stages):
                    end += program.weights[s] * delta[s, i, c]
                state[i, c] = end
                out[k, i, c] = end
