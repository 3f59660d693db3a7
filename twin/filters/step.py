"""The filters' step, compiled once for all motors: the network's own step on a state and its covariance
(`twin.filters.plan`).

F, the derivative of a step, is never formed by the filter: F P F' is the step on the columns of P twice, with a
transpose between, by the sparse elimination that the step needs anyway. It is exact for the step as it is made,
linearised about its start: the derivative by a factor is the heat that it multiplies, at the temperatures of each
stage. These are known only when x has made its step, which it does beside F P. So F P is made without the factors'
columns B of F; what they add is found when F is applied to the transpose, and added then.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import as_rows, less, scaled, sweep, sweep_mixed, transposed, within
from twin.filters.matrix import assemble, term_at
from twin.filters.plan import Plan, driven_of, drives_at, ends_of, entry_at, psi_of, right_hand_side, x_at

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


@within
def _others_follow(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """Fill the rows of `out` that are no temperature: from those of `source`, before the step, and for readings that
    lag from the temperatures' rows of both."""
    sweep(m, at, plan.unmoved, out, source, source, plan.kept, plan.before, plan.length)
    if plan.lagging > 0:
        sweep(m, at, plan.follow, out, out, out, plan.kept, plan.now, plan.length)


@within
def _drive(plan: Plan, m: Floats, at: Index) -> None:
    """Fill the drives: the heats [W] that unknown factors multiply, at both stages of the step of x that was just
    made, linear about its start."""
    n, drives, beyond, drive = plan.n, plan.drives, plan.beyond, drives_at(plan)
    for i in range(2 * drives):
        m[u(drive + i)] = 0.0
    for d in range(plan.terms):
        t, g, into, out = driven_of(plan, at, d)
        amount = term_at(plan, m, at, t)
        value, by_a, by_b, by_m = psi_of(plan.laws, m, g)
        a, b, other = ends_of(plan.laws, at, g)
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
    """One step of a state and its covariance: S rows at `out` become [F P | x one step on] from [P | x] at `source`,
    but for the columns of F that are the unknown factors'. `phi` (F,) monomials of the step, `outside` (boundaries,)
    [degC].

    Left behind: the eliminated step matrix in `values`, the temperatures before the step in `temperatures`. Those in
    `source` are overwritten.
    """
    n, length, stage, values = plan.n, plan.length, plan.stage, plan.values
    assemble(plan, m, at, phi, outside, source)
    heat = right_hand_side(plan)
    for o in range(plan.heats):
        scaled(m, stage + (n + o) * length, 1.0, source + (n + o) * length, length)
    sweep(m, at, plan.forward, stage, source, stage, plan.own, values, length)
    for i in range(n):  # the second stage takes this s - 1 times away, and so has the heat's rise added
        m[x_at(plan, source, i)] = m[u(plan.laws.temperatures + i)] - m[u(plan.more)] * m[u(heat + i)]
    sweep(m, at, plan.backward, stage, stage, stage, values, values, length)
    if plan.factors > 0:
        for i in range(n):
            m[u(plan.beyond + i)] = m[x_at(plan, stage, i)] - m[u(plan.laws.temperatures + i)]
    sweep_mixed(m, at, plan.forward, stage, stage, source, stage, plan.own_begun, plan.own_less, values, length)
    sweep(m, at, plan.backward, out, stage, out, values, values, length)
    if plan.lagging > 0:
        for i in range(n):
            m[x_at(plan, source, i)] = m[u(plan.laws.temperatures + i)]
    _others_follow(plan, m, at, source, out)
    if plan.factors > 0:
        for i in range(n):
            m[u(plan.beyond + n + i)] = m[x_at(plan, out, i)] - m[u(plan.laws.temperatures + i)]
        _drive(plan, m, at)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def derive(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """S rows at `out` become F times those at `source`, column by column, F of the step that `move` just made."""
    n, length, stage, values = plan.n, plan.length, plan.stage, plan.values
    for o in range(plan.heats + plan.factors):
        scaled(m, stage + (n + o) * length, 1.0, source + (n + o) * length, length)
    sweep(m, at, plan.driven_first, stage, source, stage, plan.own, values, length)
    sweep(m, at, plan.backward, stage, stage, stage, values, values, length)
    sweep_mixed(m, at, plan.driven_second, stage, stage, source, stage, plan.own_begun, plan.own_less, values, length)
    sweep(m, at, plan.backward, out, stage, out, values, values, length)
    _others_follow(plan, m, at, source, out)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def carry(plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, early: bool) -> None:
    """One step of the filter: `ahead` becomes [P | x] of `state` one step on, its covariance F P F' + Q, symmetric to
    rounding. `phi` (F,) monomials of the step, `outside` (boundaries,) [degC].

    Where readings have their mean time within the step they need its start too. `early` then keeps in `turned` the
    covariance of each number before the step with all numbers after it, and x before it. Else `state` is overwritten,
    as two matrices stay in the processor's first cache and three do not.
    """
    n, size, length, state, moved, ahead = plan.n, plan.size, plan.length, plan.state, plan.moved, plan.ahead
    turned = plan.turned if early else state
    move(plan, m, at, phi, outside, state, moved)
    transposed(m, turned, moved, length, length)  # rows behind the state are 0, the row `size` is x one step on
    after = turned + size * length
    if early:
        for i in range(size):
            m[x_at(plan, turned, i)] = m[x_at(plan, state, i)]
        for i in range(n):
            m[x_at(plan, turned, i)] = m[u(plan.laws.temperatures + i)]
    for p in range(plan.factors):  # columns of F, sign changed, behind x
        m[entry_at(plan, turned, n + plan.heats + p, size + 1 + p)] = -1.0
    derive(plan, m, at, turned, ahead)
    if plan.factors > 0:
        _add_factors(plan, m, at, turned, early)
    for i in range(size):
        m[x_at(plan, ahead, i)] = m[u(after + i)]
        m[entry_at(plan, ahead, i, i)] += m[u(plan.process + i)]


@within
def _add_factors(plan: Plan, m: Floats, at: Index, turned: int, early: bool) -> None:
    """Add to F P F' what the unknown factors' columns B of F bring, by their rows of F P, and to `turned` if `early`.
    -B stands behind x in `ahead`."""
    size, length, factors, ahead, b = plan.size, plan.length, plan.factors, plan.ahead, plan.driven_rows
    first, unit = plan.n + plan.heats, plan.unit + 1
    block = size + 1 - (size + 1) % 8
    as_rows(m, b, ahead, size, length, block, size + 1 + factors)
    for p in range(factors):
        m[u(b + (size + 1 + p - block) * length + first + p)] = 0.0  # a factor's own
    if early:
        before = plan.state + first
        less(m, at, plan.row, size, plan.by_factor, factors, turned, turned, b, unit, before, length, length)
    less(m, at, plan.row, size, plan.by_factor, factors, ahead, ahead, b, unit, ahead + first, length, length)
