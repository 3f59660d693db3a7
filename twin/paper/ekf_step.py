"""The covariance of the paper's filter, on its rank: what `twin.paper.ekf` does to P, with w free.

After the capacitor equations are measured without noise, the errors of the rates are those of the rest, C dzdot = Q_z
dz + Q_rho drho. So P = T P_y T' with y = [z, rho, lagging readings], and a step, its perfect measurements included,
is one of y alone: the trapezoidal rule

    (2 C / h - Q_z+) z+ = (2 C / h + Q_z) z + Q_rho rho + Q_rho+ rho+,   rho+ = rho + noise,

linearised at the edges. Q_rho is 1 at the node of an unknown heat, of a factor's logarithm the heat that it
multiplies, of a channel's error 0. What w is does not matter while it may be anything; of the covariance nothing has
to cancel that is 1e6 of what is left. P_y is positive definite as long as every number has noise at the start or in a
step: F P_y F' + Q is made of products with its rows, and the readings take from it what elimination of their
covariance leaves (`twin.filters.readings`), which is less than P_y while a reading's variance is above what P_y is
rounded by, 1e-16 of its largest. Walks put back in every step what rounding takes.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import NOWHERE, less, paired, scaled, sweep, transposed, within
from twin.filters.matrix import counted, eliminate, laws_at
from twin.filters.plan import psi_of
from twin.paper.rates import Rates, cell_of, into_of, share_at, term_of

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


@numba.njit(error_model="numpy", nogil=True, cache=True)
def laws_of(rates: Rates, m: Floats, at: Index, x: Floats, outside: Floats) -> None:
    """Fill `psi` at the temperatures of x (S, 1), and `temperatures` with these and `outside` (b,) [degC]."""
    for i in range(rates.n):
        m[u(rates.laws.temperatures + i)] = x[i, 0]
    for i in range(rates.around):
        m[u(rates.laws.temperatures + rates.n + i)] = outside[i]
    laws_at(rates.laws, m, at, rates.laws.each, rates.laws.total)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def amounts_of(rates: Rates, m: Floats, at: Index, amounts: Floats, x: Floats) -> None:
    """Fill `amounts` and `terms` from `amounts` (L + P,) of an edge and the factors of x (S, 1)."""
    first = 2 * rates.n + rates.heats
    for g in range(rates.laws.total):
        m[u(rates.amounts + g)] = amounts[g]
    for t in range(rates.multiplied):
        g, p, _, _ = term_of(rates, at, t)
        m[u(rates.terms + t)] = amounts[rates.laws.total + t] * np.exp(x[first + p, 0])
        m[u(rates.amounts + g)] += m[u(rates.terms + t)]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def linearised(rates: Rates, m: Floats, at: Index, x: Floats) -> None:
    """Fill `heat` [W] of x (S, 1) and all that changes of `slopes`, from `psi`, `amounts` and `terms`."""
    slopes = rates.slopes
    _balance(rates, m, at, x, slopes)
    first = slopes + rates.n + 2 * rates.edges + 1 + rates.heats
    for e in range(first, first + rates.driven):
        m[u(e)] = 0.0
    for t in range(rates.multiplied):
        g, _, goes, comes = term_of(rates, at, t)
        heat = m[u(rates.terms + t)] * psi_of(rates.laws, m, g)[0]
        m[u(slopes + goes)] -= heat
        m[u(slopes + comes)] += heat


@within
def _balance(rates: Rates, m: Floats, at: Index, x: Floats, slopes: int) -> None:
    """Fill `heat` [W], the unknown ones of x (S, 1) included, and -Q_z at `slopes` [W/K], from `psi` and `amounts`."""
    n, heat = rates.n, rates.heat
    for i in range(n):
        m[u(heat + i)] = 0.0
    for k in range(rates.heats):
        m[u(heat + at[u(rates.node + k)])] = x[2 * n + k, 0]
    for e in range(n + 2 * rates.edges):
        m[u(slopes + e)] = 0.0
    for g in range(rates.laws.total):
        a, b, aa, ab, am, ba, bb, bm = into_of(rates, at, g)
        amount, (psi, by_a, by_b, by_m) = m[u(rates.amounts + g)], psi_of(rates.laws, m, g)
        value, by_a, by_b, by_m = amount * psi, amount * by_a, amount * by_b, amount * by_m
        m[u(heat + a)] += value
        m[u(heat + b)] -= value
        m[u(slopes + aa)] -= by_a
        m[u(slopes + ab)] -= by_b
        m[u(slopes + am)] -= by_m
        m[u(slopes + ba)] += by_a
        m[u(slopes + bb)] += by_b
        m[u(slopes + bm)] += by_m


@numba.njit(error_model="numpy", nogil=True, cache=True)
def change(rates: Rates, m: Floats, at: Index, step_s: float, x: Floats) -> None:
    """Fill `right` with the w [K/s] for which x (S, 1) has no Gamma at the end of a step, linear about its z; `psi`
    and `amounts` are of that z and of what is around it then."""
    n, heat, right, values = rates.n, rates.heat, rates.right, rates.values
    _balance(rates, m, at, x, values)
    for c in range(rates.entries):
        entry, i, j = cell_of(rates, at, c)
        m[u(heat + i)] -= step_s * m[u(values + entry)] * x[n + j, 0]
    _eliminated(rates, m, at, values)
    for i in range(n):
        m[u(right + i)] = 2.0 / step_s * m[u(heat + i)] - m[u(rates.own + i)] * x[n + i, 0]
    solve(rates, m, at)


@within
def _eliminated(rates: Rates, m: Floats, at: Index, slopes: int) -> None:
    """Fill `values` with the eliminated matrix of -Q_z at `slopes`."""
    for e in range(rates.n + 2 * rates.edges):
        m[u(rates.values + e)] = m[u(slopes + e)]
    for i in range(rates.n):
        m[u(rates.values + i)] += m[u(rates.own + i)]
    eliminate(rates, m, at)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def spread(rates: Rates, m: Floats, at: Index, x: Floats) -> None:
    """Fill `ahead` with P_y one step on from `state`, given the capacitor equations, by `psi`, `amounts` and x (S, 1)
    at the end of the step; symmetric to rounding. `values`, `slopes` and `heat` are of that end then."""
    size, length, slopes, unit = rates.size, rates.length, rates.slopes, rates.unit
    sweep(m, at, rates.reach, rates.moved, rates.noise, rates.state, unit, slopes, length)
    transposed(m, rates.turned, rates.moved, size, length)
    sweep(m, at, rates.reach, rates.moved, rates.noise, rates.turned, unit + 1, slopes, length)
    linearised(rates, m, at, x)
    _eliminated(rates, m, at, slopes)
    _solved(rates, m, at, rates.moved, rates.ahead)
    transposed(m, rates.turned, rates.ahead, size, length)
    _solved(rates, m, at, rates.turned, rates.ahead)


@within
def _solved(rates: Rates, m: Floats, at: Index, right: int, out: int) -> None:
    """Solve for the rows of a step whose right-hand sides are the rows at `right`, into `out`."""
    length, unit, values = rates.length, rates.unit + 1, rates.values
    for row in range(rates.n * length, (rates.n + rates.unknown) * length, length):
        scaled(m, out + row, 1.0, right + row, length)
    sweep(m, at, rates.forward, out, right, out, unit, values, length)
    sweep(m, at, rates.backward, out, out, out, values, values, length)
    sweep(m, at, rates.follow, out, right, out, unit, rates.after, length)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def solve(rates: Rates, m: Floats, at: Index) -> None:
    """Solve for `right` in place, with the matrix that `values` are of."""
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


@numba.njit(error_model="numpy", nogil=True, cache=True)
def metered(rates: Rates, m: Floats, at: Index, j: int, x: Floats, q: int) -> float:
    """What meter j of heat reads [W] of x (S, 1), by `psi`, `amounts` and `terms`; its slopes become `shares` of
    reading q."""
    n, heats, shares = rates.n, rates.heats, rates.shares + q * rates.length
    signs = rates.signs + j * rates.laws.total
    for i in range(rates.size):
        m[share_at(rates, q, i)] = 0.0
    total: float = counted(rates.laws, m, at, n, rates.amounts, signs, shares)
    for k in range(heats):
        m[share_at(rates, q, n + k)] = -m[u(rates.of_losses + j)]
        total += m[u(rates.of_losses + j)] * x[2 * n + k, 0]
    for t in range(rates.multiplied):
        g, p, _, _ = term_of(rates, at, t)
        value = psi_of(rates.laws, m, g)[0]
        m[share_at(rates, q, n + heats + p)] -= m[u(signs + g)] * m[u(rates.terms + t)] * value
    return total


@within
def reads(rates: Rates, m: Floats, at: Index, q: int, gain: int, stride: int) -> None:
    """Fill row q of `gain`, of rows `stride` long: the covariance of the reading that takes `shares` with y as
    predicted, and with the readings before it."""
    count, size, length, own = 0, rates.size, rates.length, gain + q * stride
    shares, taken = rates.shares + q * length, rates.taken + q * size
    for i in range(size):
        if m[share_at(rates, q, i)] != 0.0:
            at[u(taken + count)] = paired(i * length, i)
            count += 1
    at[u(rates.number + q)] = count
    less(m, at, NOWHERE, 1, taken, count, own, rates.noise, rates.ahead, rates.unit, shares, 0, length)
    for p in range(q + 1):
        total = 0.0
        for e in range(rates.taken + p * size, rates.taken + p * size + at[u(rates.number + p)]):
            i = at[u(e)] >> 32
            total -= m[share_at(rates, p, i // length)] * m[u(own + i // length)]
        m[u(gain + p * stride + length + q)] = m[u(own + length + p)] = total
