"""The filter's arithmetic, compiled once for all motors: the network's own step on the state, on a covariance, and updates.

State, S = n + 1 + m + lagged channels: n node temperatures, the unknown heat, each channel's reading at the start of the step
just made, and the reading now of each channel whose sensor lags. Both readings are kept because the samples of a step have
their mean time somewhere within it.

Covariance and state stand side by side, [P | x], S x (S + 1). F, the derivative of a step, is never formed: F P F' is the step
on the columns of P twice, with a transpose after each.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.indexed import Program

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class Parts(NamedTuple):
    """What the steps of one run share. `node` takes the unknown heat; per channel: `weights` (m, n), `state` (m,) place of its
    reading now, -1 without lag, `lag` (m, 3) factors of the last reading, the last temperature and the temperature now;
    `process` (S,) variances added at the end of each step."""

    program: Program
    constant: Floats  # (n,) C / (gamma h) [W/K]
    coefficients: Floats
    copper: Floats
    factors: Floats
    node: int
    weights: Floats
    state: Index
    lag: Floats
    process: Floats


@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble(parts: Parts, phi: Floats, outside: Floats, start: Floats, values: Floats, right: Floats) -> None:
    """The step matrix, eliminated, into `values` (n + 2E,) and its right-hand side into `right` (n,), as `twin.indexed.run`:
    what is not linear in temperature is linearised about `start` (n,)."""
    program, copper, factors = parts.program, parts.copper, parts.factors
    n, edges = program.n, len(program.edge_to)
    for i in range(len(values)):
        values[i] = parts.constant[i] if i < n else 0.0
    for i in range(n):
        right[i] = 0.0
    for g in range(len(program.group)):
        amount = 0.0
        for t in range(program.term_start[g], program.term_start[g + 1]):
            j = program.term_monomial[t]
            amount += parts.coefficients[program.term_coefficient[t]] * (1.0 if j < 0 else phi[j])
        a, b, own, other = program.group[g]
        aa, bb, ab, ba, am, bm = program.place[g]
        if b < 0:
            own_slope = 0.0
            if own != 0:
                factor = 1.0 + copper[0] * (start[a] - copper[1])
                own_slope = amount * copper[0]
                if own < 0:
                    factor = 1.0 / factor
                    own_slope = -own_slope * factor * factor
                amount *= factor
            if other >= 0:
                factor = 1.0 + factors[g, 0] * (start[other] - factors[g, 1])
                slope = amount * factors[g, 0]
                own_slope *= factor
                amount *= factor
                values[am] -= slope
                right[a] -= slope * start[other]
            values[aa] -= own_slope
            right[a] += amount - own_slope * start[a]
            continue
        far = outside[b - n] if b >= n else start[b]
        if other >= 0:
            slope = amount * factors[g, 0] * (far - start[a])
            amount *= 1.0 + factors[g, 0] * (start[other] - factors[g, 1])
            values[am] -= slope
            right[a] -= slope * start[other]
            if b < n:
                values[bm] += slope
                right[b] += slope * start[other]
        values[aa] += amount
        if b >= n:
            right[a] += amount * far
        else:
            values[bb] += amount
            values[ab] -= amount
            values[ba] -= amount
    u = 0
    for p in range(n):
        pivot = program.order[p]
        values[pivot] = 1.0 / values[pivot]
        for e in range(program.edge_start[p], program.edge_start[p + 1]):
            multiplier = values[n + edges + e] * values[pivot]
            values[n + edges + e] = multiplier
            for f in range(program.edge_start[p], program.edge_start[p + 1]):
                values[program.update[u]] -= multiplier * values[n + f]
                u += 1


@numba.njit(error_model="numpy", nogil=True, cache=True)
def advance(parts: Parts, values: Floats, right: Floats, x: Floats, out: Floats, delta: Floats) -> None:
    """`out` (S, c): every column of `x` (S, c) one step on. The last column is a state, with the step's own heat `right` (n,);
    the others are derivatives. `delta` (stages, n, c) is overwritten."""
    program, constant = parts.program, parts.constant
    order, edge_start, edge_to = program.order, program.edge_start, program.edge_to
    n, edges, columns = program.n, len(edge_to), x.shape[1]
    for s in range(len(program.weights)):
        for i in range(n):
            for c in range(columns):
                delta[s, i, c] = x[i, c]
            for j in range(s):
                share = program.stages[s, j]
                for c in range(columns):
                    delta[s, i, c] += share * delta[j, i, c]
            own = constant[i]
            for c in range(columns):
                out[i, c] = own * delta[s, i, c]
            out[i, columns - 1] += right[i]
        for c in range(columns):
            out[parts.node, c] += x[n, c]
        for p in range(n):
            i = order[p]
            for e in range(edge_start[p], edge_start[p + 1]):
                factor, j = values[n + edges + e], edge_to[e]
                for c in range(columns):
                    out[j, c] -= factor * out[i, c]
        for p in range(n - 1, -1, -1):
            i = order[p]
            for e in range(edge_start[p], edge_start[p + 1]):
                factor, j = values[n + e], edge_to[e]
                for c in range(columns):
                    out[i, c] -= factor * out[j, c]
            pivot = values[i]
            for c in range(columns):
                out[i, c] *= pivot
                delta[s, i, c] = out[i, c] - delta[s, i, c]
    for i in range(n):
        for c in range(columns):
            out[i, c] = x[i, c]
        for s in range(len(program.weights)):
            share = program.weights[s]
            for c in range(columns):
                out[i, c] += share * delta[s, i, c]
    for c in range(columns):
        out[n, c] = x[n, c]
    _read(parts, x, out)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _read(parts: Parts, x: Floats, out: Floats) -> None:
    """The readings' rows of `out`, from temperatures at both ends of the step."""
    n, columns = parts.program.n, x.shape[1]
    for j in range(len(parts.weights)):
        last, now = n + 1 + j, parts.state[j]
        if now >= 0:
            for c in range(columns):
                out[last, c] = x[now, c]
                out[now, c] = parts.lag[j, 0] * x[now, c]
        else:
            for c in range(columns):
                out[last, c] = 0.0
        for i in range(n):
            weight = parts.weights[j, i]
            if weight == 0.0:
                continue
            if now >= 0:
                before, after = parts.lag[j, 1] * weight, parts.lag[j, 2] * weight
                for c in range(columns):
                    out[now, c] += before * x[i, c] + after * out[i, c]
            else:
                for c in range(columns):
                    out[last, c] += weight * x[i, c]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def row(parts: Parts, channel: int, place: float, h: Floats) -> None:
    """`h` (S,): what a channel reads at `place` within the step just made, as shares of the state."""
    n, now = parts.program.n, parts.state[channel]
    for i in range(len(h)):
        h[i] = place * parts.weights[channel, i] if i < n and now < 0 else 0.0
    h[n + 1 + channel] = 1.0 - place
    if now >= 0:
        h[now] = place


@numba.njit(error_model="numpy", nogil=True, cache=True)
def update(h: Floats, reading: float, variance: float, both: Floats, gain: Floats) -> tuple[float, float]:
    """Innovation and its variance; [P | x] of `both` (S, S + 1) given a reading `h x` with white noise. P stays symmetric to
    the last bit. `gain` (S + 1,) is overwritten."""
    size = len(h)
    for c in range(size + 1):
        gain[c] = 0.0
    for i in range(size):
        share = h[i]
        if share != 0.0:
            for c in range(size + 1):
                gain[c] += share * both[i, c]
    innovation, spread = reading - gain[size], variance
    for i in range(size):
        spread += h[i] * gain[i]
    scale = 1.0 / np.sqrt(spread)
    gain[size] = -innovation
    for c in range(size + 1):
        gain[c] *= scale
    for i in range(size):
        mine = gain[i]
        for c in range(size + 1):
            both[i, c] -= mine * gain[c]
    return innovation, spread


@numba.njit(error_model="numpy", nogil=True, cache=True)
def run(
    parts: Parts,
    features: Floats,
    boundaries: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    both: Floats,
    temperatures: Floats,
    heat: Floats,
    innovations: Floats,
) -> float:
    """The filter over all steps; the log likelihood of the readings.

    Read: `readings` (N, m) [degC], NaN where there is none, `places` and `variances` (N, m). Changed: [P | x] of `both`
    (S, S + 1), from the first edge to the last. Filled: `temperatures` (N + 1, n), `heat` (N, 2) estimate and variance,
    `innovations` (N, m, 2) with their variances, NaN where there is no reading.
    """
    n, size, m = parts.program.n, len(both), len(parts.weights)
    start, right, values = np.empty(n), np.empty(n), np.empty(n + 2 * len(parts.program.edge_to))
    moved, delta = np.empty((size, size + 1)), np.empty((len(parts.program.weights), n, size + 1))
    x, h, gain = np.empty(size), np.empty(size), np.empty(size + 1)
    likelihood = 0.0
    for i in range(n):
        temperatures[0, i] = both[i, size]
    for k in range(len(features)):
        for i in range(n):
            start[i] = both[i, size]
        assemble(parts, features[k], boundaries[k], start, values, right)
        for turn in range(2):
            advance(parts, values, right, both, moved, delta)
            for i in range(size):
                if turn == 0:
                    x[i] = moved[i, size]
                for j in range(size):
                    both[i, j] = moved[j, i]
        for i in range(size):
            for j in range(i):
                both[i, j] = both[j, i] = 0.5 * (both[i, j] + both[j, i])
            both[i, i] += parts.process[i]
            both[i, size] = x[i]
        for j in range(m):
            if np.isnan(readings[k, j]):
                innovations[k, j, 0] = innovations[k, j, 1] = np.nan
                continue
            row(parts, j, places[k, j], h)
            innovation, spread = update(h, readings[k, j], variances[k, j], both, gain)
            innovations[k, j, 0], innovations[k, j, 1] = innovation, spread
            likelihood -= 0.5 * (np.log(2 * np.pi * spread) + innovation * innovation / spread)
        for i in range(n):
            temperatures[k + 1, i] = both[i, size]
        heat[k, 0], heat[k, 1] = both[n, size], both[n, n]
    return likelihood
