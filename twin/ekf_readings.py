"""The readings of a step, all at once: what they say of the state, and the state given them.

Each reading y is linear in the state before the step and after it, as its samples have their mean time somewhere within it. Its row
holds cov(y, x after) for every number of the state, then the reading predicted less the one made, then cov(y, y') with
those behind it. Cholesky's elimination of the readings' covariance, on these rows, leaves independent ones of variance 1: the
products of their rows are all that the covariance loses, and, as x stands beside it, what the state moves by. So P is touched
once a step, and only above its diagonal.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf_step import Plan, amounts_at, laws_at, surround, term_at
from twin.lanes import Store, Sweep, less, mirrored, scaled, sweep, width

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Readings(NamedTuple):
    """Where the readings of a step are, r of them at most. `gain` (r rows of `stride`): cov(y, x), the prediction less the reading,
    anything to the end of a row of the state, then cov(y, y'); after `correct` the same of independent readings of variance 1.
    `later` and `earlier`: what each takes, sign changed, of which numbers of the state after and before the step, one reading after
    the other from `later_start` and `earlier_start` on; `later_row` and `earlier_row` end each with a number below 0. `noise` (r,)
    variances, `scale` (r,) what makes a variance 1, `channel` (r,); `taken`: rows of the gain so far, then a number below 0."""

    stride: int
    # numbers
    gain: int
    nothing: int
    later_share: int
    earlier_share: int
    noise: int
    scale: int
    # indices
    later: int
    later_row: int
    later_start: int
    earlier: int
    earlier_row: int
    earlier_start: int
    channel: int
    taken: int
    covariance_row: int
    by_later: Sweep
    by_earlier: Sweep


class Layout(Protocol):
    """What rows of a state, a `Plan` or another form, say of themselves to `readings_of` and `correct`."""

    @property
    def size(self) -> int: ...
    @property
    def length(self) -> int: ...
    @property
    def channels(self) -> int: ...
    @property
    def meters(self) -> int: ...
    @property
    def unit(self) -> int: ...
    @property
    def state(self) -> int: ...
    @property
    def ahead(self) -> int: ...
    @property
    def each(self) -> int: ...
    @property
    def row(self) -> int: ...


def readings_of(plan: Layout, store: Store) -> Readings:
    """The places of a step's readings, put into `store`."""
    most = plan.channels + plan.meters
    stride = plan.length + width(most)
    none = np.zeros(most * (plan.size + 2) + 1, dtype=np.int64)
    rows, later_row, earlier_row = np.arange(most) * stride, store.index(none), store.index(none)
    gain_row = store.index(rows)
    by_later = Sweep(gain_row, store.index(none[:most]), later_row, plan.each, most)
    return Readings(
        stride=stride,
        gain=store.rows(most, stride),
        nothing=store.rows(1, width(most)),
        later_share=store.put(np.zeros(len(none))),
        earlier_share=store.put(np.zeros(len(none))),
        noise=store.rows(1, most),
        scale=store.rows(1, most),
        later=store.index(none),
        later_row=later_row,
        later_start=store.index(none[: most + 1]),
        earlier=store.index(none),
        earlier_row=earlier_row,
        earlier_start=store.index(none[: most + 1]),
        channel=store.index(none[:most]),
        taken=store.index(none[: most + 1]),
        covariance_row=store.index(rows + plan.length),
        by_later=by_later,
        by_earlier=by_later._replace(starts=earlier_row),
    )


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _takes(plan: Plan, r: Readings, m: Floats, at: Index, q: int, i: int, share: float, place: float) -> None:
    """Reading q takes `share` of number i of the state, `place` of it after the step and the rest before it."""
    if place != 0.0:
        e = at[u(r.later_start + q + 1)]
        at[u(r.later + e)], at[u(r.later_row + e)], m[u(r.later_share + e)] = i, i * plan.length, share * place
        at[u(r.later_start + q + 1)] = e + 1
    if place != 1.0:
        e = at[u(r.earlier_start + q + 1)]
        at[u(r.earlier + e)], at[u(r.earlier_row + e)], m[u(r.earlier_share + e)] = (
            i,
            i * plan.length,
            share * (1 - place),
        )
        at[u(r.earlier_start + q + 1)] = e + 1


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _ended(r: Readings, at: Index, q: int) -> None:
    """All that reading q takes is there."""
    for row, start in ((r.later_row, r.later_start), (r.earlier_row, r.earlier_start)):
        end = at[u(start + q + 1)]
        at[u(row + end)], at[u(start + q + 1)] = -1, end + 1


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _sensor(plan: Plan, r: Readings, m: Floats, at: Index, j: int, place: float, q: int) -> None:
    """What channel j reads at `place` within the step becomes reading q: shares of the state, an error of its own included."""
    if at[u(plan.channel_state + j)] >= 0:
        _takes(plan, r, m, at, q, at[u(plan.channel_state + j)], -1.0, place)
    else:
        for e in range(at[u(plan.node_start + j)], at[u(plan.node_start + j + 1)]):
            _takes(plan, r, m, at, q, at[u(plan.node + e)], m[u(plan.node_share + e)], place)
    if at[u(plan.channel_bias + j)] >= 0:
        _takes(plan, r, m, at, q, at[u(plan.channel_bias + j)], -1.0, 1.0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def meter(plan: Plan, r: Readings, m: Floats, at: Index, j: int, outside: Floats, state: int, q: int) -> float:
    """What meter j of heat reads [W] at [P | x] at `state`, with the step's features; its slopes there become reading q."""
    n, size, length, first = plan.n, plan.size, plan.length, plan.n + plan.heats
    begun = at[u(r.later_start + q)]
    slope, total = r.later_share + begun, 0.0
    for i in range(size):
        _takes(plan, r, m, at, q, i, 0.0, 1.0)
    surround(plan, m, state, outside)
    amounts_at(plan, m, at, state)
    laws_at(plan, m, at, plan.each, plan.laws)
    signs = plan.signs + j * plan.laws
    for t in range(plan.terms):
        g, p = at[u(plan.term + 3 * t)], at[u(plan.term + 3 * t + 1)]
        m[u(slope + first + p)] -= m[u(signs + g)] * term_at(plan, m, at, t) * m[u(plan.psi + 4 * g)]
    for g in range(plan.laws):
        if m[u(signs + g)] == 0.0:
            continue
        psi = plan.psi + 4 * g
        value, by_a, by_b, by_m = m[u(psi)], m[u(psi + 1)], m[u(psi + 2)], m[u(psi + 3)]
        amount = m[u(signs + g)] * m[u(plan.amounts + g)]
        a, b, other = at[u(plan.law + 7 * g)], at[u(plan.law + 7 * g + 1)], at[u(plan.law + 7 * g + 3)]
        total += amount * value
        m[u(slope + a)] -= amount * by_a
        if 0 <= b < n:
            m[u(slope + b)] -= amount * by_b
        if other >= 0:
            m[u(slope + other)] -= amount * by_m
    for i in range(n, first):
        m[u(slope + i)] = -m[u(plan.of_losses + j)]
        total += m[u(plan.of_losses + j)] * m[u(state + i * length + size)]
    bias = at[u(plan.channel_bias + plan.channels + j)]
    if bias >= 0:
        m[u(slope + bias)] = -1.0
        total += m[u(state + bias * length + size)]
    return total


@numba.njit(error_model="numpy", nogil=True, cache=True)
def observe(
    plan: Plan,
    r: Readings,
    m: Floats,
    at: Index,
    outside: Floats,
    values: Floats,
    places: Floats,
    variances: Floats,
) -> int:
    """How many readings the step has that `carry` just made; their rows. Meters are linear about the state as predicted."""
    length, size, stride = plan.length, plan.size, r.stride
    q = len(values[:0])  # 0, but no literal: for one, numba would compile all that takes it a second time
    for j in range(len(values)):
        if np.isnan(values[j]):
            continue
        at[u(r.later_start + q + 1)], at[u(r.earlier_start + q + 1)] = (
            at[u(r.later_start + q)],
            at[u(r.earlier_start + q)],
        )
        m[u(r.scale + q)] = 0.0
        if j < plan.channels:
            _sensor(plan, r, m, at, j, places[j], q)
        else:
            m[u(r.scale + q)] = meter(plan, r, m, at, j - plan.channels, outside, plan.ahead, q)
        _ended(r, at, q)
        m[u(r.noise + q)], at[u(r.channel + q)] = variances[j], j
        q += 1
    rows, scales, starts, which, _ = r.by_later
    sweep(
        m, at, Sweep(rows, scales, starts, which, q), r.gain, plan.ahead, plan.ahead, plan.unit, r.later_share, length
    )
    if at[u(r.earlier_start + q)] > q:
        rows, scales, starts, which, _ = r.by_earlier
        sweep(
            m,
            at,
            Sweep(rows, scales, starts, which, q),
            r.gain,
            r.gain,
            plan.turned,
            plan.unit + 1,
            r.earlier_share,
            length,
        )
    for p in range(q):
        gain, j = r.gain + p * stride, at[u(r.channel + p)]
        if j >= plan.channels:
            m[u(gain + size)] = m[u(r.scale + p)]
        m[u(gain + size)] -= values[j]
        for other in range(p):
            m[u(gain + length + other)] = 0.0
        for other in range(p, q):
            m[u(gain + length + other)] = _together(plan, r, m, at, p, other)
    return q


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def _together(plan: Plan, r: Readings, m: Floats, at: Index, p: int, q: int) -> float:
    """cov(y_p, y_q) without noise, once row q is there."""
    total, gain = 0.0, r.gain + q * r.stride
    for e in range(at[u(r.later_start + p)], at[u(r.later_start + p + 1)] - 1):
        total -= m[u(r.later_share + e)] * m[u(gain + at[u(r.later + e)])]
    for e in range(at[u(r.earlier_start + p)], at[u(r.earlier_start + p + 1)] - 1):
        row, own = at[u(r.earlier_row + e)], 0.0
        for f in range(at[u(r.later_start + q)], at[u(r.later_start + q + 1)] - 1):
            own -= m[u(r.later_share + f)] * m[u(plan.turned + row + at[u(r.later + f)])]
        for f in range(at[u(r.earlier_start + q)], at[u(r.earlier_start + q + 1)] - 1):
            own -= m[u(r.earlier_share + f)] * m[u(plan.state + row + at[u(r.earlier + f)])]
        total -= m[u(r.earlier_share + e)] * own
    return total


@numba.njit(error_model="numpy", nogil=True, cache=True)
def correct(plan: Layout, r: Readings, m: Floats, at: Index, count: int, innovations: Floats) -> float:
    """`state`: [P | x] given the first `count` readings, from `ahead`, symmetric to the last bit; the log likelihood of the readings.
    `innovations` (m + q, 2) of each given those before it, with their variances, NaN where there is no reading."""
    length, size, stride, likelihood = plan.length, plan.size, r.stride, 0.0
    for j in range(len(innovations)):
        innovations[j, 0] = innovations[j, 1] = np.nan
    at[u(r.taken)] = -1
    for q in range(count):
        gain, unit = r.gain + q * stride, plan.unit + 1
        less(m, at, plan.each, 1, r.taken, r.covariance_row, gain, gain, r.gain, unit, r.gain + q, 0, stride)
        spread, innovation = m[u(gain + length + q)] + m[u(r.noise + q)], -m[u(gain + size)]
        m[u(r.scale + q)] = 1.0 / np.sqrt(spread)
        scaled(m, at, gain, r.scale + q, gain, stride)
        at[u(r.taken + q)], at[u(r.taken + q + 1)] = q * stride, -1
        innovations[at[u(r.channel + q)], 0], innovations[at[u(r.channel + q)], 1] = innovation, spread
        likelihood -= 0.5 * (np.log(2 * np.pi * spread) + innovation * innovation / spread)
    for i in range(0, size, 8):
        out, ahead, gain = plan.state + i * length + i, plan.ahead + i * length + i, r.gain + i
        less(m, at, plan.row, min(8, size - i), r.taken, r.taken, out, ahead, gain, plan.unit + 1, gain, 1, length - i)
    mirrored(m, plan.state, size, length)
    return likelihood
