"""The filters' step, compiled once for all motors: the network's own step on a state and its covariance (`twin.filters.plan`).

F, the derivative of a step, is never formed by the filter: F P F' is the step on the columns of P twice, with a transpose between,
by the sparse elimination that the step needs anyway. It is exact for the step as it is made, linearised about its start: the
derivative by a factor is the heat that it multiplies, at the temperatures of each stage. Those are known once the step of x is
made, beside F P; so what the factors' columns B of F add to that is found on the way back, and added afterwards.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import as_rows, less, scaled, sweep, sweep_mixed, transposed, within
from twin.filters.matrix import assemble, term_at
from twin.filters.plan import Plan

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


@within
def _others_follow(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """Rows of `out` that are no temperature, from `source` before the step and the temperatures of `out` after it."""
    sweep(m, at, plan.unmoved, out, source, source, plan.kept, plan.before, plan.length)
    if plan.lagging > 0:
        sweep(m, at, plan.follow, out, out, out, plan.kept, plan.now, plan.length)


@within
def _drive(plan: Plan, m: Floats, at: Index) -> None:
    """`drive`: what factors multiply, at the stages of the step of x that was just made, as linearised about its start."""
    n, drives, beyond = plan.n, plan.drives, plan.beyond
    drive = plan.values + 2 * n + 2 * plan.edges + 1
    for i in range(2 * drives):
        m[u(drive + i)] = 0.0
    for r in range(plan.driven, plan.driven + 4 * plan.terms, 4):
        t, g, into, out = at[u(r)], at[u(r + 1)], at[u(r + 2)], at[u(r + 3)]
        amount = term_at(plan, m, at, t)
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
    """`out` (S rows): [F P | x one step on] from [P | x] at `source`, but for the factors' part of F. Filled: `values`, and in
    `temperatures` those before the step; `source` does not keep its own."""
    n, size, length, stage, values = plan.n, plan.size, plan.length, plan.stage, plan.values
    assemble(plan, m, at, phi, outside, source)
    heat = values + n + 2 * plan.edges + 1
    for o in range(plan.heats):
        scaled(m, stage + (n + o) * length, 1.0, source + (n + o) * length, length)
    sweep(m, at, plan.forward, stage, source, stage, plan.own, values, length)
    for i in range(n):  # so that the second stage begins with as much more
        m[u(source + i * length + size)] = m[u(plan.temperatures + i)] - m[u(plan.more)] * m[u(heat + i)]
    sweep(m, at, plan.backward, stage, stage, stage, values, values, length)
    if plan.factors > 0:
        for i in range(n):
            m[u(plan.beyond + i)] = m[u(stage + i * length + size)] - m[u(plan.temperatures + i)]
    sweep_mixed(m, at, plan.forward, stage, stage, source, stage, plan.own_begun, plan.own_less, values, length)
    sweep(m, at, plan.backward, out, stage, out, values, values, length)
    if plan.lagging > 0:
        for i in range(n):
            m[u(source + i * length + size)] = m[u(plan.temperatures + i)]
    _others_follow(plan, m, at, source, out)
    if plan.factors > 0:
        for i in range(n):
            m[u(plan.beyond + n + i)] = m[u(out + i * length + size)] - m[u(plan.temperatures + i)]
        _drive(plan, m, at)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def derive(plan: Plan, m: Floats, at: Index, source: int, out: int) -> None:
    """`out` (S rows): every column of `source` (S rows) one step on, by F of the step that `move` just made."""
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
    """`ahead`: [P | x] of `state` one step on, F P F' + Q, symmetric to rounding. If `early`, where readings need it, `turned`: the
    covariance of each number before the step with all numbers after it, and x before it; else `state` is lost, as two matrices stay
    in the processor's first cache and three do not."""
    n, size, length, state, moved, ahead = plan.n, plan.size, plan.length, plan.state, plan.moved, plan.ahead
    turned = plan.turned if early else state
    move(plan, m, at, phi, outside, state, moved)
    transposed(m, turned, moved, length, length)  # rows behind the state are 0, the row `size` is x one step on
    after = turned + size * length
    if early:
        for i in range(size):
            m[u(turned + i * length + size)] = m[u(state + i * length + size)]
        for i in range(n):
            m[u(turned + i * length + size)] = m[u(plan.temperatures + i)]
    for p in range(plan.factors):  # columns of F, sign changed, behind x
        m[u(turned + (n + plan.heats + p) * length + size + 1 + p)] = -1.0
    derive(plan, m, at, turned, ahead)
    if plan.factors > 0:
        _add_factors(plan, m, at, turned, early)
    for i in range(size):
        m[u(ahead + i * length + size)] = m[u(after + i)]
        m[u(ahead + i * length + i)] += m[u(plan.process + i)]


@within
def _add_factors(plan: Plan, m: Floats, at: Index, turned: int, early: bool) -> None:
    """What the factors' columns B of F add to F P F' by their rows of F P, and to `turned` if `early`; -B is behind x in `ahead`."""
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
