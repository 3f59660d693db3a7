"""The filters' arithmetic, compiled once for all motors: the network's own step on the state, on a covariance, and updates.

State, S = n + o + u + b + m + lagged channels: n node temperatures, o unknown heats, u logarithms of unknown factors, b errors of
channels, each channel's reading at the start of the step just made, and the reading now of each channel whose sensor lags. Both
readings are kept because the samples of a step have their mean time somewhere within it.

F, the derivative of a step, is never formed by the filter: F P F' is the step on the columns of P twice, with a transpose
after each. It is exact for the step as it is made, linearised about its start: the derivative by a factor is the heat that it
multiplies, at the temperatures of each stage.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.indexed import Program
from twin.indexed import assemble as eliminated
from twin.laws import psi_of

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class Parts(NamedTuple):
    """What the steps of one run share. `coefficients` (K,) are overwritten with `nominal` times the factors of `factor_of`
    (K,), -1 where there is none; `heats` (o,): nodes of the unknown heats; `places`, `numbers`: the groups as `twin.laws.Table`;
    `unknown_factors` u; `last`: place of the first channel's last reading. Per channel: `weights` (m, n), `bias` (m,) place of its
    constant error and `state` (m,) of its reading now, -1 where there is none, `lag` (m, 3) factors of the last reading, the
    last temperature and the temperature now. Per meter of heat, behind the channels: `signs` (q, G) of the groups whose heat it
    adds up, `of_losses` (q,) 1 where unknown heats are part of it; `bias` (m + q,). `process` (S,) variances added at the end
    of each step."""

    program: Program
    constant: Floats  # (n,) C / (gamma h) [W/K]
    coefficients: Floats
    copper: Floats
    factors: Floats
    nominal: Floats
    factor_of: Index
    heats: Index
    places: Index
    numbers: Floats
    unknown_factors: int
    last: int
    weights: Floats
    bias: Index
    state: Index
    lag: Floats
    signs: Floats
    of_losses: Floats
    process: Floats


class Work(NamedTuple):
    """What a step is made in. `values`, `right` as `assemble` fills them; `still` (n,) 0; `none` (s, n, 0); `drive` (s, n, u): the
    heat that each factor multiplies, at each stage; the others are overwritten without meaning."""

    values: Floats
    right: Floats
    still: Floats
    none: Floats
    drive: Floats
    amounts: Floats  # (u, groups)
    at: Floats  # (n + b, 1)
    psi: Floats  # (4, 1)
    one: Floats  # (s, n, 1)
    many: Floats  # (s, n, S)
    x: Floats  # (S, 1)
    moved: Floats  # (S, S)
    left: Floats  # (S,)


def work(parts: Parts, boundaries: int) -> Work:
    """The arrays of a step."""
    n, size, stages = parts.program.n, len(parts.process), len(parts.program.weights)
    unknown = parts.unknown_factors
    return Work(
        values=np.empty(n + 2 * len(parts.program.edge_to)),
        right=np.empty(n),
        still=np.zeros(n),
        none=np.empty((stages, n, 0)),
        drive=np.zeros((stages, n, unknown)),
        amounts=np.empty((unknown, len(parts.places))),
        at=np.empty((n + boundaries, 1)),
        psi=np.empty((4, 1)),
        one=np.empty((stages, n, 1)),
        many=np.empty((stages, n, size)),
        x=np.empty((size, 1)),
        moved=np.empty((size, size)),
        left=np.empty(size),
    )


@numba.njit(error_model="numpy", nogil=True, cache=True)
def assemble(parts: Parts, phi: Floats, outside: Floats, start: Floats, values: Floats, right: Floats) -> None:
    """The step matrix, eliminated, into `values` (n + 2E,) and its right-hand side into `right` (n,), as `twin.indexed.assemble`
    makes them."""
    eliminated(
        parts.program,
        parts.constant,
        parts.coefficients,
        parts.copper,
        parts.factors,
        phi,
        outside,
        start,
        values,
        right,
    )


@numba.njit(error_model="numpy", nogil=True, cache=True)
def advance(parts: Parts, values: Floats, right: Floats, drive: Floats, x: Floats, out: Floats, delta: Floats) -> None:
    """`out` (S, c): every column of `x` (S, c) one step on: a state with the step's own heat `right` (n,) and no `drive`
    (stages, n, 0), derivatives with `right` 0 and `drive` (stages, n, u). `delta` (stages, n, c) is overwritten."""
    program, constant = parts.program, parts.constant
    order, edge_start, edge_to = program.order, program.edge_start, program.edge_to
    n, edges, columns = program.n, len(edge_to), x.shape[1]
    first, stages = n + len(parts.heats), len(program.weights)
    for s in range(stages):
        for i in range(n):
            own, heat = constant[i], right[i]
            if s == 0:
                for c in range(columns):
                    delta[s, i, c] = x[i, c]
                    out[i, c] = own * x[i, c] + heat
            else:
                share = program.stages[s, 0]
                for c in range(columns):
                    delta[s, i, c] = x[i, c] + share * delta[0, i, c]
                for j in range(1, s):
                    share = program.stages[s, j]
                    for c in range(columns):
                        delta[s, i, c] += share * delta[j, i, c]
                for c in range(columns):
                    out[i, c] = own * delta[s, i, c] + heat
            for p in range(drive.shape[2]):
                heat = drive[s, i, p]
                if heat != 0.0:
                    for c in range(columns):
                        out[i, c] += heat * x[first + p, c]
        for o in range(len(parts.heats)):
            i = parts.heats[o]
            for c in range(columns):
                out[i, c] += x[n + o, c]
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
                end = out[i, c] * pivot
                out[i, c] = end
                delta[s, i, c] = end - delta[s, i, c]
    ends = program.weights[stages - 1] == 1.0  # a stiffly accurate method ends at its last stage
    for s in range(stages - 1):
        ends = ends and program.weights[s] == program.stages[stages - 1, s]
    if not ends:
        for i in range(n):
            for c in range(columns):
                out[i, c] = x[i, c]
            for s in range(stages):
                share = program.weights[s]
                for c in range(columns):
                    out[i, c] += share * delta[s, i, c]
    for i in range(n, parts.last):
        for c in range(columns):
            out[i, c] = x[i, c]
    _read(parts, x, out)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _read(parts: Parts, x: Floats, out: Floats) -> None:
    """The readings' rows of `out`, from temperatures at both ends of the step."""
    n, columns = parts.program.n, x.shape[1]
    for j in range(len(parts.weights)):
        last, now = parts.last + j, parts.state[j]
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
def move(parts: Parts, phi: Floats, outside: Floats, x: Floats, out: Floats, work: Work) -> None:
    """`out` (S, 1): the state `x` (S, 1) one step on. Filled: `values`, `right` and `one` of `work`, which `sensitivities`, `carry`
    and `advance` use."""
    first = parts.program.n + len(parts.heats)
    for i in range(len(parts.factor_of)):
        p = parts.factor_of[i]
        if p >= 0:
            parts.coefficients[i] = parts.nominal[i] * np.exp(x[first + p, 0])
    assemble(parts, phi, outside, x[: parts.program.n, 0], work.values, work.right)
    advance(parts, work.values, work.right, work.none, x, out, work.one)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def sensitivities(parts: Parts, phi: Floats, outside: Floats, x: Floats, work: Work) -> None:
    """`drive` of `work`: the heat that each factor multiplies, at the stages of the step that `move` just made from `x` (S, 1), as
    linearised about its start."""
    program, amounts, at, psi, drive = parts.program, work.amounts, work.at, work.psi, work.drive
    n, unknown = program.n, drive.shape[2]
    if unknown == 0:
        return
    drive[:] = 0.0
    amounts[:] = 0.0
    for g in range(len(parts.places)):
        for t in range(program.term_start[g], program.term_start[g + 1]):
            i = program.term_coefficient[t]
            p, j = parts.factor_of[i], program.term_monomial[t]
            if p >= 0:
                amounts[p, g] += parts.coefficients[i] * (1.0 if j < 0 else phi[j])
    for i in range(n):
        at[i, 0] = x[i, 0]
    for i in range(len(outside)):
        at[n + i, 0] = outside[i]
    for g in range(len(parts.places)):
        if not amounts[:, g].any():
            continue
        a, b, other, one_way = parts.places[g, 0], parts.places[g, 1], parts.places[g, 3], parts.places[g, 4]
        psi_of(parts.places[g], parts.numbers[g], parts.copper, at, 0, psi)
        for s in range(len(program.weights)):
            heat = psi[0, 0]
            for end in range(3):
                i = a if end == 0 else b if end == 1 else other
                if 0 <= i < n:
                    beyond = work.one[s, i, 0]
                    for j in range(s):
                        beyond += program.stages[s, j] * work.one[j, i, 0]
                    heat += psi[end + 1, 0] * beyond
            for p in range(unknown):
                drive[s, a, p] += amounts[p, g] * heat
                if 0 <= b < n and not one_way:
                    drive[s, b, p] -= amounts[p, g] * heat


@numba.njit(error_model="numpy", nogil=True, cache=True)
def carry(parts: Parts, covariance: Floats, work: Work) -> None:
    """P (S, S) one step on: F P F' + Q, symmetric to the last bit, of the step that `move` just made."""
    size = len(covariance)
    advance(parts, work.values, work.still, work.drive, covariance, work.moved, work.many)
    for i in range(size):
        for j in range(size):
            covariance[i, j] = work.moved[j, i]
    advance(parts, work.values, work.still, work.drive, covariance, work.moved, work.many)
    for i in range(size):
        for j in range(i):
            covariance[i, j] = covariance[j, i] = 0.5 * (work.moved[i, j] + work.moved[j, i])
        covariance[i, i] = work.moved[i, i] + parts.process[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def row(parts: Parts, channel: int, place: float, h: Floats) -> None:
    """`h` (S,): what a channel reads at `place` within the step just made, as shares of the state."""
    n, now = parts.program.n, parts.state[channel]
    for i in range(len(h)):
        h[i] = place * parts.weights[channel, i] if i < n and now < 0 else 0.0
    h[parts.last + channel] = 1.0 - place
    if parts.bias[channel] >= 0:
        h[parts.bias[channel]] = 1.0
    if now >= 0:
        h[now] = place


@numba.njit(error_model="numpy", nogil=True, cache=True)
def heat_row(parts: Parts, meter: int, phi: Floats, outside: Floats, x: Floats, h: Floats, work: Work) -> float:
    """What a meter of heat reads at the state `x` (S, 1) [W]; `h` (S,) its derivative."""
    program, at, psi = parts.program, work.at, work.psi
    n, total = program.n, 0.0
    first = n + len(parts.heats)
    h[:] = 0.0
    for i in range(n):
        at[i, 0] = x[i, 0]
    for i in range(len(outside)):
        at[n + i, 0] = outside[i]
    for g in range(len(parts.places)):
        sign = parts.signs[meter, g]
        if sign == 0.0:
            continue
        psi_of(parts.places[g], parts.numbers[g], parts.copper, at, 0, psi)
        amount = 0.0
        for t in range(program.term_start[g], program.term_start[g + 1]):
            i, j, p = (
                program.term_coefficient[t],
                program.term_monomial[t],
                parts.factor_of[program.term_coefficient[t]],
            )
            own = sign * parts.nominal[i] * (1.0 if j < 0 else phi[j])
            if p >= 0:
                own *= np.exp(x[first + p, 0])
                h[first + p] += own * psi[0, 0]
            amount += own
        total += amount * psi[0, 0]
        for end in range(3):
            i = parts.places[g, end if end < 2 else 3]
            if 0 <= i < n:
                h[i] += amount * psi[end + 1, 0]
    for o in range(len(parts.heats)):
        h[n + o] = parts.of_losses[meter]
        total += parts.of_losses[meter] * x[n + o, 0]
    bias = parts.bias[len(parts.weights) + meter]
    if bias >= 0:
        h[bias] = 1.0
        total += x[bias, 0]
    return total


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
def correct(
    parts: Parts,
    phi: Floats,
    outside: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    x: Floats,
    covariance: Floats,
    innovations: Floats,
    rows: Floats,
    gains: Floats,
    work: Work,
) -> float:
    """State and P given the readings (m + q,) of a step, one after the other; their log likelihood. `innovations` (m + q, 2) with
    their variances, NaN where there is no reading; `rows` and `gains` (m + q, S) of the readings that there are."""
    likelihood, m = 0.0, len(parts.weights)
    for j in range(len(readings)):
        if np.isnan(readings[j]):
            innovations[j, 0] = innovations[j, 1] = np.nan
            continue
        reading = readings[j]
        if j < m:
            row(parts, j, places[j], rows[j])
        else:  # as if it were linear in the state, with its slopes and its value there
            reading -= heat_row(parts, j - m, phi, outside, x, rows[j], work)
            for i in range(len(x)):
                reading += rows[j, i] * x[i, 0]
        innovation, spread = update(rows[j], reading, variances[j], x, covariance, gains[j], work.left)
        innovations[j, 0], innovations[j, 1] = innovation, spread
        likelihood -= 0.5 * (np.log(2 * np.pi * spread) + innovation * innovation / spread)
    return likelihood


@numba.njit(error_model="numpy", nogil=True, cache=True)
def run(
    parts: Parts,
    features: Floats,
    boundaries: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    x: Floats,
    covariance: Floats,
    states: Floats,
    spreads: Floats,
    innovations: Floats,
    work: Work,
) -> float:
    """The filter over all steps; the log likelihood of the readings.

    Read: `readings` (N, m + q) [degC, W], NaN where there is none, `places` and `variances` (N, m + q). Changed: x (S, 1) and
    P (S, S), from the first edge to the last. Filled: `states` and `spreads` (N + 1, c), the first c numbers of the state and
    their variances at every edge, `innovations` (N, m + q, 2) with their variances, NaN where there is no reading.
    """
    likelihood, kept = 0.0, np.empty((2, readings.shape[1], len(x)))
    for k in range(len(features) + 1):
        if k > 0:
            move(parts, features[k - 1], boundaries[k - 1], x, work.x, work)
            sensitivities(parts, features[k - 1], boundaries[k - 1], x, work)
            carry(parts, covariance, work)
            x[:] = work.x
            likelihood += correct(
                parts,
                features[k - 1],
                boundaries[k - 1],
                readings[k - 1],
                places[k - 1],
                variances[k - 1],
                x,
                covariance,
                innovations[k - 1],
                kept[0],
                kept[1],
                work,
            )
        for i in range(states.shape[1]):
            states[k, i], spreads[k, i] = x[i, 0], covariance[i, i]
    return likelihood
