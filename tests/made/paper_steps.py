"""The paper's filter in plain matrices, as other filters are given it: its states with rates, F, Q and the step of x.

A state is x = [z, zdot, rho, lagging readings] (S,) as `twin.paper.ekf` has it, and here its covariance is whole: of
w, the change of the rates, it has the variance `RATE_SD` squared.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from made.law_heats import LawHeats, psi_at
from twin.filters.inputs import READING_SD_K, Inputs
from twin.paper.rates import shares_of

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

# Of w [K/s]: above any rate, and its square rounded by less than is asked of a variance.
RATE_SD = 500.0


def transition(inputs: Inputs, step_s: float) -> tuple[Floats, Floats, Index]:
    """F (S, S) and the variances Q (S, S) of a step, and where each channel's lagging reading is in the
    state (m,), -1 without lag."""
    parts = inputs.parts
    n, o = parts.program.n, len(inputs.order)
    lagging = np.flatnonzero(parts.state >= 0)
    state = np.full(len(parts.state), -1, dtype=np.int64)
    state[lagging] = 2 * n + o + np.arange(len(lagging))
    size = 2 * n + o + len(lagging)
    shift, by_rate = np.eye(size), np.zeros((size, n))
    shift[:n, n : 2 * n] = step_s * np.eye(n)
    by_rate[:n], by_rate[n : 2 * n] = step_s / 2 * np.eye(n), np.eye(n)
    for j in lagging:
        own, before, after = parts.lag[j]
        shift[state[j]] = after * (parts.weights[j] @ shift[:n])
        shift[state[j], :n] += before * parts.weights[j]
        shift[state[j], state[j]] = own
        by_rate[state[j]] = after * (parts.weights[j] @ by_rate[:n])
    process = RATE_SD**2 * by_rate @ by_rate.T
    walks = np.concatenate([parts.process[:n], np.zeros(n), parts.process[n : n + o], np.zeros(len(lagging))])
    return shift, process + np.diag(walks), state


def at_the_start(
    inputs: Inputs, laws: LawHeats, amounts: Floats, around: Floats, capacities: Floats, state: Index
) -> tuple[Floats, Floats]:
    """State (S, 1) and covariance (S, S) at the first edge, by the laws' amounts (L,) and boundaries (b,) there:
    rates as the capacitor equation has them, sensors in equilibrium but for `READING_SD_K`."""
    n, o, parts = len(capacities), len(inputs.order), inputs.parts
    heat, slope, z = np.empty(n), np.empty((n, n)), inputs.x[:n].copy()
    shares, multiplied = shares_of(parts, inputs.features.shape[1])
    found, by_factor = inputs.features[0] @ shares[:-1] + shares[-1], np.empty((parts.unknown_factors, n))
    for p in range(parts.unknown_factors):
        own = np.zeros(len(amounts))
        for t, (g, factor) in enumerate(multiplied):
            own[g] = found[len(own) + t] if factor == p else own[g]
        heats_of(laws, own, z, around, by_factor[p], slope)
    heats_of(laws, amounts, z, around, heat, slope)
    lagging = state[state >= 0]
    onto = np.zeros((2 * n + o + len(lagging), n + o))
    onto[:n, :n], onto[2 * n : 2 * n + o, n:] = np.eye(n), np.eye(o)
    onto[n : 2 * n, :n] = slope / capacities[:, None]
    first = n + len(parts.heats)
    onto[n + parts.heats, np.arange(n, first)] = 1 / capacities[parts.heats]
    onto[n : 2 * n, first : first + parts.unknown_factors] = by_factor.T / capacities[:, None]
    onto[lagging, :n] = parts.weights[state >= 0]
    own = np.zeros(len(onto))
    own[lagging] = READING_SD_K**2
    x = onto @ inputs.x[: n + o]
    x[n : 2 * n] = heat / capacities
    return x[:, None], onto @ inputs.covariance[: n + o, : n + o] @ onto.T + np.diag(own)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def heats_of(laws: LawHeats, amounts: Floats, z: Floats, around: Floats, heat: Floats, slope: Floats) -> None:
    """Fill Q (n,) [W], the heat into the capacitors without unknown heats, and Q_z (n, n) [W/K], of laws with these
    amounts (L,)."""
    n = len(heat)
    at, found = np.empty((n + len(around), 1)), np.empty((len(laws.places), 4))
    at[:n, 0] = z
    at[n:, 0] = around
    psi_at(laws.places, laws.numbers, laws.copper, at, found)
    heat[:] = 0.0
    slope[:] = 0.0
    for w in range(len(found)):
        a, b, one_way = laws.places[w, 0], laws.places[w, 1], laws.places[w, 4]
        ends = 2 if 0 <= b < n and not one_way else 1
        for e in range(ends):
            to, amount = (a, amounts[w]) if e == 0 else (b, -amounts[w])
            heat[to] += amount * found[w, 0]
            for i in range(3):
                by = laws.places[w, i if i < 2 else 3]
                if 0 <= by < n:
                    slope[to, by] += amount * found[w, i + 1]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve for `right` (n,) in place. Storage outweighs what losses take from the diagonal, so no pivot is sought."""
    n = len(right)
    for p in range(n):
        for i in range(p + 1, n):
            if matrix[i, p] != 0.0:
                share = matrix[i, p] / matrix[p, p]
                for j in range(p + 1, n):
                    matrix[i, j] -= share * matrix[p, j]
                right[i] -= share * right[p]
    for p in range(n - 1, -1, -1):
        for j in range(p + 1, n):
            right[p] -= matrix[p, j] * right[j]
        right[p] /= matrix[p, p]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def predict(
    laws: LawHeats,
    capacities: Floats,
    heats: Index,
    shift: Floats,
    step_s: float,
    amounts: Floats,
    around: Floats,
    k: int,
    x: Floats,
    heat: Floats,
    slope: Floats,
) -> None:
    """Move x (S, 1) one step on, from edge k: the filter's own step before its perfect measurements. `amounts` (edges,
    L) are those with the factors of x. `heat` (n,) and `slope` (n, n) are left as they are after the step."""
    n, size = len(capacities), len(x)
    z, rate = x[:n, 0].copy(), x[n : 2 * n, 0].copy()
    more, matrix = np.empty(n), np.empty((n, n))
    heats_of(laws, amounts[k + 1], z, around[k + 1], heat, slope)
    for o in range(len(heats)):
        heat[heats[o]] += x[2 * n + o, 0]
    for i in range(n):
        more[i] = heat[i] - capacities[i] * rate[i]
        for j in range(n):
            more[i] += step_s * slope[i, j] * rate[j]
            matrix[i, j] = -0.5 * step_s * slope[i, j]
        matrix[i, i] += capacities[i]
    _solve(matrix, more)
    moved = np.zeros(size)
    for i in range(size):
        for j in range(size):
            if shift[i, j] != 0.0:
                moved[i] += shift[i, j] * x[j, 0]
    for i in range(2 * n, size):  # a lagging reading follows the temperatures as they end
        for j in range(n):
            moved[i] += 0.5 * shift[i, n + j] * more[j]
    for i in range(n):
        moved[i] += 0.5 * step_s * more[i]
        moved[n + i] += more[i]
    for i in range(size):
        x[i, 0] = moved[i]
    heats_of(laws, amounts[k + 1], x[:n, 0].copy(), around[k + 1], heat, slope)
    for o in range(len(heats)):
        heat[heats[o]] += x[2 * n + o, 0]
