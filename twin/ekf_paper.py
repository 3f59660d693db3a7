"""Extended Kalman filter in the paper's form (its Eq. 5-13): x = [z, zdot, rho], inputs u = [v, vdot].

z are the independent coordinates of `twin.paper_form`, z = B0 q: the temperatures of the p capacitors; rho the o unknown heats.
Rates are states beside temperatures, so that a step is a Taylor series, whatever the network,

    z <- z + h zdot + h w / 2,   zdot <- zdot + w,   rho <- rho + noise,

and all that the network says enters as a measurement without noise: the capacitor equation Gamma = C zdot - Q(z, rho, v) = 0.
With w free that is the implicit trapezoidal rule. Predicted is w = h zddot from the capacitor equation's own
derivative, (C - h Q_z / 2) zddot = Q_z zdot + Q_v vdot, so that Gamma is zero before it is measured, but for what is not linear:
the perfect measurements shape the covariance alone. It is singular after them, and kept on its rank (`twin.ekf_paper_step`).
A lagging sensor's reading is a state too, as in `twin.filter_inputs`: 2p + o numbers, and one for each of those.

Inputs are needed at edges: means of the two steps that meet there. The small form (`twin.ekf`) holds them within a step, makes one
step of the network's own integrator and keeps no rates. Both are the same filter but for the error of their integrators:
this one is the check of the other, at one and a half times its cost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf import Estimate, estimate_of
from twin.ekf_paper_step import Rates, balance, change, laws_of, rates_of, reads, solve, spread
from twin.ekf_readings import Readings, correct, readings_of, row_of
from twin.errors import FrameError
from twin.filter_inputs import READING_SD_K, Inputs, Reading, Start, inputs_of
from twin.lane_code import pointer
from twin.lanes import Store, record
from twin.law_heats import LawHeats, law_heats, psi_at
from twin.network import Network
from twin.simulate import Frame
from twin.unknowns import UnknownHeat

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end

RATE_SD = 500.0  # K/s of w where it has to be a number: above any rate, and its square rounded by less than is asked of a variance


def filter_with_rates(
    network: Network, frame: Frame, start: Start, unknowns: Sequence[UnknownHeat], readings: Sequence[Reading]
) -> Estimate:
    """Temperatures and unknown heats from the readings, as `twin.ekf.filter_unknowns`; `covariance` is that of z, zdot, rho and
    lagging readings. Raises as that, and `FrameError` for an unknown that is no heat or a reading that is no temperature."""
    for unknown in unknowns:
        if not isinstance(unknown, UnknownHeat):
            raise FrameError(
                f'unknown "{unknown.name}": this form estimates heats alone; give factors to another filter'
            )
    for reading in readings:
        if not isinstance(reading, Reading):
            raise FrameError(
                f'channel "{reading.channel}": this form reads temperatures alone; give heats to another filter'
            )
    inputs = inputs_of(network, frame, start, unknowns, readings)
    laws = law_heats(network)
    amounts, around = at_edges(laws.amounts(inputs.features)), at_edges(inputs.boundaries)
    capacities = np.array([node.capacity for node in network.nodes])
    shift, _, state = transition(inputs, frame.step_s)
    x, covariance = at_the_start(inputs, laws, amounts[0], around[0], capacities, state)
    n, (steps, m) = len(capacities), inputs.values.shape
    own = np.r_[0:n, 2 * n : len(x)]
    store = Store()
    rates = rates_of(inputs.parts, capacities, around.shape[1], frame.step_s, store)
    taken = readings_of(rates, store)
    numbers, indices = store.numbers(), store.indices()
    rows = numbers[rates.state : rates.state + rates.length**2].reshape(rates.length, rates.length)
    rows[: len(own), : len(own)], rows[: len(own), len(own)] = covariance[np.ix_(own, own)], x[own, 0]
    states, innovations = np.empty((2, steps + 1, n + len(inputs.order))), np.empty((steps, m, 2))
    likelihood = _run(
        capacities,
        inputs.parts.heats,
        inputs.parts.weights,
        np.array([reading.time_constant_s for reading in readings], dtype=np.float64),
        state,
        shift,
        frame.step_s,
        amounts,
        around,
        inputs.values,
        inputs.places,
        inputs.variances,
        record(rates),
        record(taken),
        numbers,
        indices,
        x,
        states[0],
        states[1],
        innovations,
    )
    slope = np.zeros((n, n))
    for place, i, j in indices[rates.cell : rates.cell + 3 * rates.cells].reshape(-1, 3).tolist():
        slope[i, j] = -numbers[rates.slopes + place]
    onto = np.zeros((len(x), len(own)))
    onto[own, np.arange(len(own))] = 1.0
    onto[n : 2 * n, :n] = slope / capacities[:, None]
    onto[n + inputs.parts.heats, n + np.arange(len(inputs.order))] = 1 / capacities[inputs.parts.heats]
    covariance = onto @ rows[: len(own), : len(own)] @ onto.T
    return estimate_of(inputs, states, innovations, (covariance + covariance.T) / 2, float(likelihood))


def at_edges(means: Floats) -> Floats:
    """(N + 1, c) at the edges of N steps, from their means (N, c)."""
    beyond = np.concatenate([means[:1], means, means[-1:]])
    edges: Floats = (beyond[:-1] + beyond[1:]) / 2
    return edges


def transition(inputs: Inputs, step_s: float) -> tuple[Floats, Floats, Index]:
    """F (S, S) and the variances Q (S, S) of a step, with `RATE_SD` for w as other filters need one, and the place of each channel's
    lagging reading (m,), -1 without lag."""
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
    """State (S, 1) and covariance (S, S): rates as the capacitor equation has them, sensors in equilibrium but for
    `READING_SD_K`."""
    n, o = len(capacities), len(inputs.order)
    heat, slope = np.empty(n), np.empty((n, n))
    heats_of(laws, amounts, inputs.x[:n, 0].copy(), around, heat, slope)
    lagging = state[state >= 0]
    onto = np.zeros((2 * n + o + len(lagging), n + o))
    onto[:n, :n], onto[2 * n : 2 * n + o, n:] = np.eye(n), np.eye(o)
    onto[n : 2 * n, :n] = slope / capacities[:, None]
    onto[n + inputs.parts.heats, n + np.arange(o)] = 1 / capacities[inputs.parts.heats]
    onto[lagging, :n] = inputs.parts.weights[state >= 0]
    own = np.zeros(len(onto))
    own[lagging] = READING_SD_K**2
    x = onto @ inputs.x[: n + o, 0]
    x[n : 2 * n] = heat / capacities
    return x[:, None], onto @ inputs.covariance[: n + o, : n + o] @ onto.T + np.diag(own)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def heats_of(laws: LawHeats, amounts: Floats, z: Floats, around: Floats, heat: Floats, slope: Floats) -> None:
    """Q (n,) into the capacitors without unknown heats [W], and Q_z (n, n) [W/K]."""
    n = laws.n
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
    """`right` (n,) becomes the solution; storage outweighs what losses take from the diagonal, so no pivot is sought."""
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
    """x (S, 1) one step on, from edge k; `heat` (n,) and `slope` (n, n) are left as they are there. The filter's own step before its
    perfect measurements, in plain matrices: what other filters are given."""
    n, size = len(capacities), len(x)
    z, rate = x[:n, 0].copy(), x[n : 2 * n, 0].copy()
    second, matrix = np.empty(n), np.empty((n, n))
    heats_of(laws, amounts[k], z, around[k], second, matrix)
    heats_of(laws, amounts[k + 1], z, around[k + 1], heat, slope)
    for i in range(n):
        second[i] = (heat[i] - second[i]) / step_s
        for j in range(n):
            second[i] += slope[i, j] * rate[j]
            matrix[i, j] = -0.5 * step_s * slope[i, j]
        matrix[i, i] += capacities[i]
    _solve(matrix, second)
    moved = np.zeros(size)
    for i in range(size):
        for j in range(size):
            if shift[i, j] != 0.0:
                moved[i] += shift[i, j] * x[j, 0]
    for i in range(2 * n, size):  # a lagging reading follows the temperatures as they end
        for j in range(n):
            moved[i] += 0.5 * step_s * shift[i, n + j] * second[j]
    for i in range(n):
        moved[i] += 0.5 * step_s * step_s * second[i]
        moved[n + i] += step_s * second[i]
    for i in range(size):
        x[i, 0] = moved[i]
    heats_of(laws, amounts[k + 1], x[:n, 0].copy(), around[k + 1], heat, slope)
    for o in range(len(heats)):
        heat[heats[o]] += x[2 * n + o, 0]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(
    capacities: Floats,
    heats: Index,
    weights: Floats,
    time_constants: Floats,
    state: Index,
    shift: Floats,
    step_s: float,
    amounts: Floats,
    around: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    rates: Rates,
    taken: Readings,
    numbers: Floats,
    indices: Index,
    x: Floats,
    states: Floats,
    spreads: Floats,
    innovations: Floats,
) -> float:
    """The filter over all steps, from `state` of `rates`; the log likelihood of the readings. Arrays as in `twin.ekf.through`."""
    n, size, length, likelihood, h = rates.n, rates.size, rates.length, 0.0, np.empty(len(x))
    m, at = pointer(numbers, 0), pointer(indices, 0)
    laws_of(rates, m, at, x, around[0])
    balance(rates, m, at, amounts[0], rates.slopes)
    for k in range(len(readings) + 1):
        if k > 0:
            laws_of(rates, m, at, x, around[k - 1])
            change(rates, m, at, amounts[k - 1], amounts[k], around[k], step_s, x)
            _move(rates, shift, step_s, m, x)
            laws_of(rates, m, at, x, around[k])
            spread(rates, m, at, amounts[k])
            _meet(rates, capacities, heats, shift, step_s, m, at, x)
            count = 0
            for j in range(len(weights)):
                if np.isnan(readings[k - 1, j]):
                    continue
                sensor_row(
                    weights[j], time_constants[j], state[j], (1.0 - places[row_of(places, k - 1), j]) * step_s, n, h
                )
                _observe(rates, taken, capacities, heats, m, at, h, x, readings[k - 1, j], count)
                noise = taken.crossed + count * taken.stride + rates.length + count
                m[u(noise)], at[u(taken.channel + count)] = m[u(noise)] + variances[row_of(variances, k - 1), j], j
                count += 1
            likelihood += correct(rates, taken, m, at, count, pointer(innovations, 2 * (k - 1) * len(weights)))
            _follow(rates, capacities, heats, m, at, x)
        for i in range(states.shape[1]):
            states[k, i], spreads[k, i] = m[u(rates.state + i * length + size)], m[u(rates.state + i * length + i)]
    return likelihood


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _move(rates: Rates, shift: Floats, step_s: float, m: Floats, x: Floats) -> None:
    """x (S, 1) one step on by its rates and `right`, zddot."""
    n, right = rates.n, rates.right
    for i in range(2 * n + rates.heats, len(x)):  # a lagging reading follows the temperatures as they end
        moved = shift[i, i] * x[i, 0]
        for j in range(n):
            moved += shift[i, j] * x[j, 0] + shift[i, n + j] * (x[n + j, 0] + 0.5 * step_s * m[u(right + j)])
        x[i, 0] = moved
    for i in range(n):
        second = m[u(right + i)]
        x[i, 0] += step_s * (x[n + i, 0] + 0.5 * step_s * second)
        x[n + i, 0] += step_s * second


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _meet(
    rates: Rates, capacities: Floats, heats: Index, shift: Floats, step_s: float, m: Floats, at: Index, x: Floats
) -> None:
    """x (S, 1) as predicted meets the capacitor equation, linear about it, by what w has to be more; into `ahead` as well."""
    n, size, length = rates.n, rates.size, rates.length
    for o in range(len(heats)):
        m[u(rates.heat + heats[o])] += x[2 * n + o, 0]
    for i in range(n):
        m[u(rates.right + i)] = 2.0 / step_s * (m[u(rates.heat + i)] - capacities[i] * x[n + i, 0])
    solve(rates, m, at)
    for i in range(2 * n + rates.heats, len(x)):
        for j in range(n):
            x[i, 0] += 0.5 * shift[i, n + j] * m[u(rates.right + j)]
    for i in range(n):
        more = m[u(rates.right + i)]
        x[i, 0] += 0.5 * step_s * more
        x[n + i, 0] += more
        m[u(rates.ahead + i * length + size)] = x[i, 0]
    for i in range(n, size):
        m[u(rates.ahead + i * length + size)] = x[n + i, 0]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _observe(
    rates: Rates,
    taken: Readings,
    capacities: Floats,
    heats: Index,
    m: Floats,
    at: Index,
    h: Floats,
    x: Floats,
    reading: float,
    q: int,
) -> None:
    """A reading `h x` (S,) becomes row q of `crossed`."""
    n, size, shares, off, late = rates.n, rates.size, rates.shares + q * rates.length, -reading, False
    for i in range(n):
        m[u(shares + i)] = -h[i]
        off += h[i] * x[i, 0]
    for i in range(n, 2 * n):
        late |= h[i] != 0.0
        off += h[i] * x[i, 0]
    for i in range(n, size):
        m[u(shares + i)] = -h[n + i]
        off += h[n + i] * x[n + i, 0]
    if late:  # what it takes of rates is what the capacitor equation makes of them
        for c in range(rates.cell, rates.cell + 3 * rates.cells, 3):
            i = at[u(c + 1)]
            m[u(shares + at[u(c + 2)])] += h[n + i] * m[u(rates.slopes + at[u(c)])] / capacities[i]
        for o in range(len(heats)):
            m[u(shares + n + o)] -= h[n + heats[o]] / capacities[heats[o]]
    reads(rates, m, at, q, taken.crossed, taken.stride)
    m[u(taken.crossed + q * taken.stride + size)] = off


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _follow(rates: Rates, capacities: Floats, heats: Index, m: Floats, at: Index, x: Floats) -> None:
    """x (S, 1) becomes what it is in `state`; the rates move with the rest as the capacitor equation has it."""
    n, size, length, moved = rates.n, rates.size, rates.length, rates.right
    for i in range(n):
        after = m[u(rates.state + i * length + size)]
        m[u(moved + i)], x[i, 0] = after - x[i, 0], after
    for c in range(rates.cell, rates.cell + 3 * rates.cells, 3):
        i = at[u(c + 1)]
        x[n + i, 0] -= m[u(rates.slopes + at[u(c)])] * m[u(moved + at[u(c + 2)])] / capacities[i]
    for i in range(n, size):
        after = m[u(rates.state + i * length + size)]
        if i < n + len(heats):
            node = heats[i - n]
            x[n + node, 0] += (after - x[n + i, 0]) / capacities[node]
        x[n + i, 0] = after


@numba.njit(error_model="numpy", nogil=True, cache=True)
def sensor_row(weights: Floats, time_constant: float, state: int, before_s: float, n: int, h: Floats) -> None:
    """`h` (S,): what a channel reads `before_s` before the end of the step: its own rate is known, zdot or (T - reading) / lag."""
    h[:] = 0.0
    if state >= 0:
        share = before_s / time_constant
        h[state] = 1.0 + share
        for i in range(n):
            h[i] = -share * weights[i]
        return
    for i in range(n):
        h[i] = weights[i]
        h[n + i] = -before_s * weights[i]
