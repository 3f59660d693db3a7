"""Fixed-interval smoother: what is known at each edge from all readings of the session, those after it included.

The filter's estimate lags behind what happens, as later readings cannot speak yet; the smoother's does not. It is the
smoother of Rauch, Tung and Striebel (doi:10.2514/3.3166) over `twin.filters.ekf`, in the form of Bryson and Frazier
as modified by Bierman (Int. J. Control 18 (1973) 65): backward from the last edge it carries l and L, what later
readings say, so that

    x_s = x - P l,    P_s = P - P L P,

through each step and its readings at once, gains k and rows h, how each reading moves with the state before the step.
F is the step's derivative at the filter's estimate; r are the rows h, and e the innovations, of the independent
readings of variance 1 that `twin.filters.readings` makes of them:

    A = F - sum k h',    L <- A' L A + sum r r',    l <- A' l - sum r e.

No covariance is inverted, so that states without noise of their own do no harm, and every F is that of its own step.
The filter's states are kept at the edges of blocks; a block is filtered again, step by step, when the way back
reaches it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import LaneStore, less, mirrored, record, row_less, scaled, sweep, within
from twin.filters.ekf import Estimate, FilterRun, columns_of, courses, estimate_of, through
from twin.filters.inputs import AnyReading, FilterStart, Given, Inputs, inputs_of
from twin.filters.plan import Plan, entry_at, x_at
from twin.filters.planning import plan
from twin.filters.readings import ReadingsPlan, at_step, correct, entries_of, entry_of, observe, readings_of
from twin.filters.step import carry, derive
from twin.filters.unknowns import Unknown
from twin.motor.network import Network
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class SmootherEstimate:
    """What is known at each edge from all readings of the session; `filtered`: from those so far. `temperatures` (N +
    1, n) [degC] and `found` (N + 1, u) of the unknowns (heat [W], logarithm of a factor, error [K]), each with its
    standard deviation. Row k is of edge k; its unknowns hold in step k."""

    filtered: Estimate
    temperatures: Floats
    temperatures_sd: Floats
    found: Floats
    found_sd: Floats


def smoothed(
    network: Network, frame: Frame, start: FilterStart, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> SmootherEstimate:
    """Temperatures and unknowns from all readings of the session. Raises as `twin.filters.ekf.filter_unknowns`."""
    inputs = inputs_of(network, frame, start, unknowns, readings)
    steps, n = len(inputs.values), len(network.nodes)
    length = block_length(steps)
    run, back = _run_of(inputs, length)
    blocks = [slice(first, min(first + length, steps)) for first in range(0, steps, length)]
    kept, filtered = _forward(inputs, run, blocks)
    states = np.empty((2, steps + 1, inputs.parts.sought))
    of = np.argsort(inputs.order).tolist()
    states[0, -1] = np.append(filtered.temperatures[-1], filtered.found[-1][list(inputs.order)])
    states[1, -1] = np.append(filtered.temperatures_sd[-1], filtered.found_sd[-1][list(inputs.order)]) ** 2
    for block, state in zip(reversed(blocks), reversed(kept), strict=True):
        run.state()[:] = state
        given, (means, spreads) = inputs.given(block), states[:, block]
        _back_through(run.plan, run.readings, back, run.m, run.at, given, means, spreads)
    sd = np.sqrt(states[1], out=states[1])
    found, found_sd = columns_of(states[0, :, n:], of), columns_of(sd[:, n:], of)
    return SmootherEstimate(filtered, states[0, :, :n], sd[:, :n], found, found_sd)


def block_length(steps: int) -> int:
    """How many steps a block has for which least is kept: a covariance for each block, and two matrices for each step
    of one block."""
    return max(1, math.isqrt(steps // 2))


class Back(NamedTuple):
    """Where the way back has its numbers: rows as long as the state's, but for `rows`. Each of `edge`, `matrix` and
    `rows` has one piece for each step of a block, `edge_of`, `matrix_of` and `rows_of` say where.

    A row of `rows` is of one reading, made independent and of variance 1: how it moves with the state at the start of
    the step, and behind that its innovation, sign changed. With the state of `twin.filters.plan`, of S = 7 numbers, a
    thermometer at the winding of variance 0.01 K^2 that reads 0.5 K more than expected has about 10 0 0 0 0 10 0 | -5.
    """

    edge: int  # [P | x] at the start of each step
    matrix: int  # of each step: how the state at its end, readings taken, moves with that at its start
    rows: int  # of each step, m + q rows of the readings' stride
    taken: int  # index: how many readings each step takes
    one: int  # the unit matrix
    before: int  # F of one step
    later: int  # [L | l], sign changed
    product: int
    by_number: int  # (S,) pairs: where each row of the state begins, and its number
    by_row: int  # (S,) pairs: where each row begins, twice


@within
def edge_of(plan: Plan, back: Back, k: int) -> int:
    """Where [P | x] begins that was kept of the start of step k of the block."""
    return back.edge + k * plan.length * plan.length


@within
def matrix_of(plan: Plan, back: Back, k: int) -> int:
    """Where the matrix of step k begins."""
    return back.matrix + k * plan.length * plan.length


@within
def rows_of(plan: Plan, taken: ReadingsPlan, back: Back, k: int) -> int:
    """Where the rows of the readings of step k begin."""
    return back.rows + k * (plan.channels + plan.meters) * taken.stride


def _run_of(inputs: Inputs, steps: int) -> tuple[FilterRun, Back]:
    """A filter, and the places of the way back through blocks of at most so many steps."""
    store = LaneStore()
    own = plan(inputs.parts, inputs.boundaries.shape[1], store)
    readings = readings_of(own, store)
    most, length = own.channels + own.meters, own.length
    back = Back(
        edge=store.rows(steps * length, length),
        matrix=store.rows(steps * length, length),
        rows=store.rows(steps * most, readings.stride),
        taken=store.index([0] * steps),
        one=store.put(np.eye(length)),
        before=store.rows(length, length),
        later=store.rows(length, length),
        product=store.rows(length, length),
        by_number=store.pairs([(i * length, i) for i in range(own.size)]),
        by_row=store.pairs([(i * length, i * length) for i in range(own.size)]),
    )
    return FilterRun(record(own), record(readings), own.size, store.numbers(), store.indices()), record(back)


def _forward(inputs: Inputs, run: FilterRun, blocks: Sequence[slice]) -> tuple[list[Floats], Estimate]:
    """The filter over all blocks: [P | x] at the start of each block, and what the filter says."""
    found, sought = courses(inputs), inputs.parts.sought
    run.begin(inputs)
    found.states[0], found.spreads[0] = inputs.x[:sought], np.diag(inputs.covariance)[:sought]
    likelihood, kept = 0.0, []
    for block in blocks:
        kept.append(run.state().copy())
        likelihood += through(run.plan, run.readings, run.m, run.at, inputs.given(block), found.of(block))
    return kept, estimate_of(inputs, found, run.covariance(), likelihood)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _back_through(
    plan: Plan,
    taken: ReadingsPlan,
    back: Back,
    numbers: Floats,
    indices: Index,
    given: Given,
    states: Floats,
    spreads: Floats,
) -> None:
    """Filter a block again from the state in `numbers`, keep what the way back needs, and go back: [L | l] from the
    block's last edge to its first. Filled: `states` and `spreads` (N, c), the first c numbers of the smoothed state
    and their variances, at all of the block's edges but the last."""
    size, length = plan.size, plan.length
    innovations, early = np.empty((given.values.shape[1], 2)), bool((given.places != 1.0).any())
    m, at = pointer(numbers, 0), pointer(indices, 0)
    for k in range(len(given.boundaries)):
        scaled(m, edge_of(plan, back, k), 1.0, plan.state, length * length)
        phi, outside, values, place, variance = at_step(given, k)
        carry(plan, m, at, phi, outside, early)
        derive(plan, m, at, back.one, back.before)
        count = observe(plan, taken, m, at, outside, values, place, variance)
        at[back.taken + k] = count
        rows, matrix = rows_of(plan, taken, back, k), matrix_of(plan, back, k)
        _reading_rows(plan, taken, back, m, at, count, rows)
        correct(plan, taken, m, at, count, pointer(innovations, 0))
        unit = plan.unit + 1
        less(m, at, plan.row, size, taken.taken, count, matrix, back.before, rows, unit, taken.gain, 1, length)
        _make_independent(plan, taken, m, at, count, innovations, rows)
    for k in range(len(given.boundaries) - 1, -1, -1):
        rows, matrix = rows_of(plan, taken, back, k), matrix_of(plan, back, k)
        _before_step(plan, taken, back, m, at, at[back.taken + k], rows, matrix)
        edge, product = edge_of(plan, back, k), back.product
        less(m, at, plan.row, size, back.by_number, size, product, product, back.later, plan.unit, edge, length, length)
        for i in range(states.shape[1]):
            left = m[entry_at(plan, edge, i, i)]
            for c in range(size):
                left -= m[entry_at(plan, product, i, c)] * m[entry_at(plan, edge, i, c)]
            states[k, i] = m[x_at(plan, edge, i)] - m[x_at(plan, product, i)]
            spreads[k, i] = max(left, 0.0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _reading_rows(plan: Plan, taken: ReadingsPlan, back: Back, m: Floats, at: Index, count: int, out: int) -> None:
    """Fill `out`, a row of the readings' stride each: how each of `count` readings moves with the state before the
    step."""
    sweep(m, at, taken.by_later, out, back.before, back.before, plan.unit, taken.later.share, plan.length)
    for q in range(count):
        first, end = entries_of(taken.earlier, at, q)
        for e in range(first, end):
            share, i = entry_of(taken.earlier, m, at, e)
            m[out + q * taken.stride + i] -= share


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _make_independent(
    plan: Plan, taken: ReadingsPlan, m: Floats, at: Index, count: int, innovations: Floats, rows: int
) -> None:
    """Make `rows` those of the independent readings of variance 1 that `correct` just made, each with its innovation
    behind it, sign changed."""
    size, length, stride, unit = plan.size, plan.length, taken.stride, plan.unit + 1
    for q in range(count):
        row = rows + q * stride
        row_less(m, at, taken.before, q, row, row, rows, unit, taken.gain + q, length)
    for q in range(count):
        row, told = rows + q * stride, at[taken.channel + q]
        scale = 1.0 / np.sqrt(innovations[told, 1])
        scaled(m, row, scale, row, length)
        m[row + size] = -scale * innovations[told, 0]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _before_step(
    plan: Plan, taken: ReadingsPlan, back: Back, m: Floats, at: Index, count: int, rows: int, matrix: int
) -> None:
    """[L | l] of before a step and its readings from that of after them, symmetric to the last bit."""
    size, length, product, later = plan.size, plan.length, back.product, back.later
    less(m, at, plan.row, size, back.by_number, size, product, product, matrix, plan.unit, later, length, length)
    for i in range(size):
        m[x_at(plan, product, i)] = -m[x_at(plan, later, i)]
    less(m, at, plan.row, size, back.by_row, size, later, later, product, plan.unit, matrix, 1, length)
    less(m, at, plan.row, size, taken.taken, count, later, later, rows, plan.unit + 1, rows, 1, length)
    mirrored(m, later, size, length)
