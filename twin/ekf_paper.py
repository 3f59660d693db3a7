"""Extended Kalman filter in the paper's form (its Eq. 5-13): x = [z, zdot, rho], inputs u = [v, vdot].

z are the independent coordinates of `twin.paper_form`, z = B0 q: the temperatures of the p capacitors; rho the o unknown heats.
Rates are states beside temperatures, so that a step is a Taylor series, whatever the network,

    z <- z + h zdot + h w / 2,   zdot <- zdot + w,   rho <- rho + noise,

and all that the network says enters as a measurement without noise: the capacitor equation Gamma = C zdot - Q(z, rho, v) = 0.
With w free (`RATE_SD`, far above any rate) that is the implicit trapezoidal rule. Predicted is w = h zddot from the capacitor equation's own
derivative, (C - h Q_z / 2) zddot = Q_z zdot + Q_v vdot, so that Gamma is zero before it is measured, but for what is not linear:
the perfect measurements shape the covariance alone. It is singular after them, in Joseph's form to rounding and no further.
A lagging sensor's reading is a state too, as in `twin.filter_inputs`: 2p + o numbers, and one for each of those.

Inputs are needed at edges: means of the two steps that meet there. The small form (`twin.ekf`) holds them within a step, makes one
step of the network's own integrator and keeps no rates. Both are the same filter but for the error of their integrators:
this one is the check of the other, at several times its cost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf import Estimate, estimate_of
from twin.errors import FrameError
from twin.filter_inputs import READING_SD_K, Inputs, Reading, Start, inputs_of
from twin.law_heats import LawHeats, law_heats, psi_at
from twin.network import Network
from twin.simulate import Frame
from twin.unknowns import UnknownHeat

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

RATE_SD = 1e3  # K/s of w: any rate is as likely as any other


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
    shift, process, state = transition(inputs, frame.step_s)
    x, covariance = at_the_start(inputs, laws, amounts[0], around[0], capacities, state)
    steps, m = inputs.values.shape
    kept = [*range(len(capacities)), *range(2 * len(capacities), 2 * len(capacities) + len(inputs.order))]
    states, innovations = np.empty((2, steps + 1, len(kept))), np.empty((steps, m, 2))
    likelihood = _run(
        laws,
        capacities,
        inputs.parts.heats,
        inputs.parts.weights,
        np.array([reading.time_constant_s for reading in readings], dtype=np.float64),
        state,
        shift,
        process,
        frame.step_s,
        amounts,
        around,
        inputs.values,
        inputs.places,
        inputs.variances,
        np.array(kept),
        x,
        covariance,
        states[0],
        states[1],
        innovations,
    )
    return estimate_of(inputs, states, innovations, covariance, float(likelihood))


def at_edges(means: Floats) -> Floats:
    """(N + 1, c) at the edges of N steps, from their means (N, c)."""
    beyond = np.concatenate([means[:1], means, means[-1:]])
    edges: Floats = (beyond[:-1] + beyond[1:]) / 2
    return edges


def transition(inputs: Inputs, step_s: float) -> tuple[Floats, Floats, Index]:
    """F (S, S) and the variances Q (S, S) of a step, and the place of each channel's lagging reading (m,), -1 without lag."""
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
    """x (S, 1) one step on, from edge k; `heat` (n,) and `slope` (n, n) are left as they are there."""
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
def _spread(shift: Floats, process: Floats, covariance: Floats, moved: Floats) -> None:
    """P (S, S) one step on: F P F' + Q, symmetric to the last bit; `moved` (S, S) is overwritten."""
    size = len(covariance)
    for _ in range(2):
        for i in range(size):
            for c in range(size):
                moved[i, c] = 0.0
            for j in range(size):
                share = shift[i, j]
                if share != 0.0:
                    for c in range(size):
                        moved[i, c] += share * covariance[j, c]
        for i in range(size):
            for j in range(size):
                covariance[i, j] = moved[j, i]
    for i in range(size):
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i]) + process[i, j]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(
    laws: LawHeats,
    capacities: Floats,
    heats: Index,
    weights: Floats,
    time_constants: Floats,
    state: Index,
    shift: Floats,
    process: Floats,
    step_s: float,
    amounts: Floats,
    around: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    kept: Index,
    x: Floats,
    covariance: Floats,
    states: Floats,
    spreads: Floats,
    innovations: Floats,
) -> float:
    """The filter over all steps; the log likelihood of the readings. Arrays as in `twin.ekf_step.run`."""
    n, size = len(capacities), len(x)
    heat, slope, moved = np.empty(n), np.empty((n, n)), np.empty((size, size))
    h, gain, left, before = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    likelihood = 0.0
    for k in range(len(readings) + 1):
        if k > 0:
            predict(laws, capacities, heats, shift, step_s, amounts, around, k - 1, x, heat, slope)
            _spread(shift, process, covariance, moved)
            before[:] = x[:, 0]
            for i in range(n):
                h[:] = 0.0
                for j in range(n):
                    h[j] = -slope[i, j] / capacities[i]
                h[n + i] = 1.0
                for o in range(len(heats)):
                    if heats[o] == i:
                        h[2 * n + o] = -1.0 / capacities[i]
                reading = heat[i] / capacities[i] - before[n + i]
                for j in range(size):
                    reading += h[j] * before[j]
                update(h, reading, 0.0, x, covariance, gain, left)
            for j in range(len(weights)):
                if np.isnan(readings[k - 1, j]):
                    innovations[k - 1, j] = np.nan
                    continue
                sensor_row(weights[j], time_constants[j], state[j], (1.0 - places[k - 1, j]) * step_s, n, h)
                innovation, spread = update(h, readings[k - 1, j], variances[k - 1, j], x, covariance, gain, left)
                innovations[k - 1, j, 0], innovations[k - 1, j, 1] = innovation, spread
                likelihood -= 0.5 * (np.log(2 * np.pi * spread) + innovation * innovation / spread)
        for i in range(len(kept)):
            states[k, i], spreads[k, i] = x[kept[i], 0], covariance[kept[i], kept[i]]
    return likelihood


@numba.njit(error_model="numpy", nogil=True, cache=True)
def update(
    h: Floats, reading: float, variance: float, x: Floats, covariance: Floats, gain: Floats, left: Floats
) -> tuple[float, float]:
    """Innovation and its variance; state x (S, 1) and P (S, S) given a reading `h x` with white noise of `variance`, 0 for a
    perfect one. `gain` (S,) is filled, `left` (S,) overwritten.

    Joseph's form, P = (1 - k h') P (1 - k h')' + k R k': once P - k (P h)' is taken, what is left of it is
    - e k' with e = (P h) - R k, zero but for rounding; it is taken symmetrically, so that P is symmetric to the last bit.
    """
    size = len(h)
    for c in range(size):
        gain[c] = 0.0
    innovation, spread = reading, variance
    for i in range(size):
        share = h[i]
        if share != 0.0:
            innovation -= share * x[i, 0]
            for c in range(size):
                gain[c] += share * covariance[i, c]
    for i in range(size):
        spread += h[i] * gain[i]
    scale = 1.0 / np.sqrt(spread)
    for c in range(size):
        gain[c] *= scale  # k times the root of the spread: its products are P's change, symmetric to the last bit
        left[c] = -variance * scale * gain[c]
    for i in range(size):
        share = h[i]
        if share != 0.0:
            for c in range(size):
                left[c] += share * (covariance[i, c] - gain[i] * gain[c])
    for c in range(size):
        left[c] *= 0.5 * scale
    for i in range(size):
        mine, over = gain[i], left[i]
        x[i, 0] += mine * scale * innovation
        for c in range(size):
            covariance[i, c] = (covariance[i, c] - mine * gain[c]) - (mine * left[c] + over * gain[c])
    for c in range(size):
        gain[c] *= scale
    return innovation, spread


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
