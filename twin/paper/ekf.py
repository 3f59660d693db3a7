"""Extended Kalman filter in the paper's form (its Eq. 5-13): x = [z, zdot, rho], inputs u = [v, vdot].

z are the independent coordinates of the network as the paper writes it, z = B0 q: the temperatures of the p
capacitors; rho the o unknowns: heats, logarithms of factors, errors of channels. Rates are states beside temperatures,
so that a step is a Taylor series, whatever the network,

    z <- z + h zdot + h w / 2,   zdot <- zdot + w,   rho <- rho + noise,

and all that the network says enters as a measurement without noise: the capacitor equation Gamma = C zdot - Q(z, rho,
v) = 0. With w free that is the implicit trapezoidal rule. Predicted is the w of that rule, linear about z before the
step, with inputs as they are after it, v + h vdot: Gamma is zero before it is measured, but for what is not linear,
and the perfect measurements shape the covariance alone. It is singular after them, and kept on its rank
(`twin.paper.ekf_step`). A lagging sensor's reading is a state too, as in `twin.filters.inputs`: 2p + o numbers, and
one for each of those.

Inputs are needed at edges: means of the two steps that meet there. The small form (`twin.filters.ekf`) holds them
within a step, makes one step of the network's own integrator and keeps no rates. Both are the same filter but for the
error of their integrators: this one is the check of the other, at two and a half times its cost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import LaneStore, record
from twin.filters.ekf import Estimate, FilterCourse, courses, estimate_of
from twin.filters.inputs import AnyReading, FilterStart, Given, Reading, inputs_of
from twin.filters.plan import entry_at, x_at
from twin.filters.readings import ReadingsPlan, correct, readings_of, row_of
from twin.filters.unknowns import Unknown
from twin.motor.network import Network
from twin.paper.ekf_step import amounts_of, change, laws_of, linearised, metered, reads, solve, spread
from twin.paper.rates import Rates, cell_of, rates_of, share_at, shares_of
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


def filter_with_rates(
    network: Network, frame: Frame, start: FilterStart, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Estimate:
    """Temperatures and unknowns from the readings; takes, returns and raises what `twin.filters.ekf.filter_unknowns`
    does, with the `covariance` of z, zdot, rho and lagging readings. A meter of heat is linear about the state as
    predicted, with the step's own means of inputs."""
    inputs = inputs_of(network, frame, start, unknowns, readings)
    shares, multiplied = shares_of(inputs.parts, inputs.features.shape[1])
    means, around = inputs.features @ shares[:-1] + shares[-1], at_edges(inputs.boundaries)
    capacities = np.array([node.capacity for node in network.nodes])
    n, size = len(capacities), len(inputs.x)
    x = np.insert(inputs.x, [n] * n, 0.0)[:, None]  # the rates are worked out at the first edge
    store = LaneStore()
    rates = rates_of(inputs.parts, multiplied, capacities, around.shape[1], frame.step_s, store)
    taken = readings_of(rates, store)
    numbers, indices = store.numbers(), store.indices()
    rows = numbers[rates.state : rates.state + rates.length**2].reshape(rates.length, rates.length)
    rows[:size, :size], rows[:size, size] = inputs.covariance, inputs.x
    found = courses(inputs)
    likelihood = _run(
        capacities,
        inputs.parts.weights,
        np.array([r.sensor.time_constant_s for r in readings if isinstance(r, Reading)], dtype=np.float64),
        inputs.parts.bias,
        np.where(inputs.parts.state >= 0, inputs.parts.state + n, -1),
        inputs.parts.lag,
        frame.step_s,
        at_edges(means),
        around,
        means,
        inputs.given(),
        record(rates),
        record(taken),
        numbers,
        indices,
        x,
        found,
    )
    onto = np.insert(np.eye(size), [n] * n, 0.0, axis=0)
    for place, i, j in indices[rates.cell : rates.cell + 3 * rates.cells].reshape(-1, 3).tolist():
        onto[n + i, j] = -numbers[rates.slopes + place] / capacities[i]
    covariance = onto @ rows[:size, :size] @ onto.T
    return estimate_of(inputs, found, (covariance + covariance.T) / 2, float(likelihood))


def at_edges(means: Floats) -> Floats:
    """Inputs at the edges of N steps (N + 1, c), from their means (N, c)."""
    beyond = np.concatenate([means[:1], means, means[-1:]])
    edges: Floats = (beyond[:-1] + beyond[1:]) / 2
    return edges


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(
    capacities: Floats,
    weights: Floats,
    time_constants: Floats,
    bias: Index,
    state: Index,
    lag: Floats,
    step_s: float,
    amounts: Floats,
    around: Floats,
    means: Floats,
    given: Given,
    rates: Rates,
    taken: ReadingsPlan,
    numbers: Floats,
    indices: Index,
    x: Floats,
    found: FilterCourse,
) -> float:
    """The filter over all steps, from `state` of `rates`; returns the log likelihood of the readings. `amounts` (N +
    1, L + P) and `around` (N + 1, b) are at edges, `means` (N, L + P) of steps; `given` and `found` as in
    `twin.filters.ekf.through`."""
    _, boundaries, readings, places, variances = given
    states, spreads, innovations = found
    n, size, length, likelihood, h = rates.n, rates.size, rates.length, 0.0, np.empty(len(x))
    channels, m, at = readings.shape[1], pointer(numbers, 0), pointer(indices, 0)
    laws_of(rates, m, at, x, around[0])
    amounts_of(rates, m, at, amounts[0], x)
    linearised(rates, m, at, x)
    for i in range(n):
        x[n + i, 0] = m[u(rates.heat + i)] / capacities[i]
    for k in range(len(readings) + 1):
        if k > 0:
            laws_of(rates, m, at, x, around[k])
            amounts_of(rates, m, at, amounts[k], x)
            change(rates, m, at, step_s, x)
            _move(rates, weights, lag, state, step_s, m, x)
            laws_of(rates, m, at, x, around[k])
            spread(rates, m, at, x)
            _meet(rates, weights, lag, state, step_s, m, at, x)
            count, about = 0, False
            for j in range(channels):
                if np.isnan(readings[k - 1, j]):
                    continue
                if j < rates.channels:
                    before_s = (1.0 - places[row_of(places, k - 1), j]) * step_s
                    sensor_row(weights[j], time_constants[j], state[j], before_s, n, h)
                    off = _linear(rates, capacities, m, at, h, x, count)
                else:
                    if not about:
                        laws_of(rates, m, at, x, boundaries[k - 1])
                        amounts_of(rates, m, at, means[k - 1], x)
                        about = True
                    off = metered(rates, m, at, j - rates.channels, x, count)
                if bias[j] >= 0:
                    m[share_at(rates, count, bias[j])] = -1.0
                    off += x[n + bias[j], 0]
                reads(rates, m, at, count, taken.crossed, taken.stride)
                own = taken.crossed + count * taken.stride
                m[u(own + size)] = off - readings[k - 1, j]
                m[u(own + length + count)] += variances[row_of(variances, k - 1), j]
                at[u(taken.channel + count)] = j
                count += 1
            likelihood += correct(rates, taken, m, at, count, pointer(innovations, 2 * (k - 1) * channels))
            _follow(rates, capacities, m, at, x)
        for i in range(states.shape[1]):
            states[k, i] = m[x_at(rates, rates.state, i)]
            spreads[k, i] = m[entry_at(rates, rates.state, i, i)]
    return likelihood


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _move(rates: Rates, weights: Floats, lag: Floats, state: Index, step_s: float, m: Floats, x: Floats) -> None:
    """Move x (S, 1) one step on by its rates and by w in `right`."""
    n, right = rates.n, rates.right
    for j in range(len(state)):
        if state[j] < 0:
            continue
        own, before, after = lag[j]  # of its last reading, the last temperature and the temperature as it ends
        moved = own * x[state[j], 0]
        for i in range(n):
            share = weights[j, i]
            rise = after * (step_s * share) * (x[n + i, 0] + 0.5 * m[u(right + i)])
            moved += (after * share + before * share) * x[i, 0] + rise
        x[state[j], 0] = moved
    for i in range(n):
        more = m[u(right + i)]
        x[i, 0] += step_s * (x[n + i, 0] + 0.5 * more)
        x[n + i, 0] += more


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _meet(
    rates: Rates, weights: Floats, lag: Floats, state: Index, step_s: float, m: Floats, at: Index, x: Floats
) -> None:
    """Have x (S, 1) as predicted meet the capacitor equation, linear about it, by what w has to be more; x in `ahead`
    too."""
    n, size = rates.n, rates.size
    for i in range(n):
        m[u(rates.right + i)] = 2.0 / step_s * m[u(rates.heat + i)] - m[u(rates.own + i)] * x[n + i, 0]
    solve(rates, m, at)
    for j in range(len(state)):
        if state[j] >= 0:
            for i in range(n):
                x[state[j], 0] += 0.5 * (lag[j, 2] * (step_s * weights[j, i])) * m[u(rates.right + i)]
    for i in range(n):
        more = m[u(rates.right + i)]
        x[i, 0] += 0.5 * step_s * more
        x[n + i, 0] += more
        m[x_at(rates, rates.ahead, i)] = x[i, 0]
    for i in range(n, size):
        m[x_at(rates, rates.ahead, i)] = x[n + i, 0]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _linear(rates: Rates, capacities: Floats, m: Floats, at: Index, h: Floats, x: Floats, q: int) -> float:
    """`h x` (S,), a reading; its slopes with y become `shares` of reading q."""
    n, size, total, late = rates.n, rates.size, 0.0, False
    for i in range(n):
        m[share_at(rates, q, i)] = -h[i]
        total += h[i] * x[i, 0]
    for i in range(n, 2 * n):
        late |= h[i] != 0.0
        total += h[i] * x[i, 0]
    for i in range(n, size):
        m[share_at(rates, q, i)] = -h[n + i]
        total += h[n + i] * x[n + i, 0]
    if late:  # what it takes of rates is what the capacitor equation makes of them
        for c in range(rates.cells):
            entry, i, j = cell_of(rates, at, c)
            m[share_at(rates, q, j)] += h[n + i] * m[u(rates.slopes + entry)] / capacities[i]
    return total


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _follow(rates: Rates, capacities: Floats, m: Floats, at: Index, x: Floats) -> None:
    """Set x (S, 1) to what it is in `state`; the rates move with the rest as the capacitor equation has it."""
    n, size, moved = rates.n, rates.size, rates.right
    for i in range(size):
        after, own = m[x_at(rates, rates.state, i)], i if i < n else n + i
        m[u(moved + i)], x[own, 0] = after - x[own, 0], after
    for c in range(rates.cells):
        entry, i, j = cell_of(rates, at, c)
        x[n + i, 0] -= m[u(rates.slopes + entry)] * m[u(moved + j)] / capacities[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def sensor_row(weights: Floats, time_constant: float, state: int, before_s: float, n: int, h: Floats) -> None:
    """Fill `h` (S,): what a channel reads `before_s` before the end of the step, by its own rate, which is known:
    zdot, or (T - reading) / lag."""
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
