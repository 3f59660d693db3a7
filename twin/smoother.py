"""Fixed-interval smoother: what is known at each edge from all readings of the session, those after it included.

The filter's estimate lags behind what happens, as later readings cannot speak yet; the smoother's does not. It is the smoother of
Rauch, Tung and Striebel (doi:10.2514/3.3166) over `twin.ekf`, in the form of Bryson and Frazier as modified by Bierman
(Int. J. Control 18 (1973) 65): backward from the last edge it carries l and L, what later readings say, so that

    x_s = x - P l,    P_s = P - P L P,

through each reading (innovation e, variance s, gain k = P h / s) and each step (F its derivative at the filter's estimate):

    l <- l - h (k' l + e / s),  L <- (1 - h k') L (1 - k h') + h h' / s;    l <- F' l,  L <- F' L F.

No covariance is inverted, so that states without noise of their own do no harm, and every F is that of its own step. The filter's
states are kept at the edges of blocks; a block is filtered again, step by step, when the way back reaches it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf import Estimate, estimate_of
from twin.ekf_step import Parts, Work, advance, carry, correct, move, run, sensitivities, work
from twin.filter_inputs import AnyReading, Inputs, Start, inputs_of
from twin.network import Network
from twin.simulate import Frame
from twin.unknowns import Unknown

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Smoothed:
    """What is known at each edge from all readings, with standard deviations: `temperatures` (N + 1, n) [degC] and `found`
    (N + 1, u) of the unknowns (heat [W], logarithm of a factor, error [K]); row k holds in step k. `filtered`: from the
    readings so far."""

    filtered: Estimate
    temperatures: Floats
    temperatures_sd: Floats
    found: Floats
    found_sd: Floats


def smoothed(
    network: Network, frame: Frame, start: Start, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Smoothed:
    """Temperatures and unknowns from all readings of the session. Raises as `twin.ekf.filter_unknowns`."""
    inputs = inputs_of(network, frame, start, unknowns, readings)
    steps, n = len(inputs.values), len(network.nodes)
    length = block_length(steps)
    blocks = [slice(first, min(first + length, steps)) for first in range(0, steps, length)]
    kept, filtered = _forward(inputs, blocks)
    states = np.empty((2, steps + 1, inputs.parts.last))
    of = np.argsort(inputs.order)
    states[0, -1] = np.append(filtered.temperatures[-1], filtered.found[-1][list(inputs.order)])
    states[1, -1] = np.append(filtered.temperatures_sd[-1], filtered.found_sd[-1][list(inputs.order)]) ** 2
    later = np.zeros((len(inputs.x), len(inputs.x) + 1))
    for block, (x, covariance) in zip(reversed(blocks), reversed(kept), strict=True):
        _back_through(inputs, block, x, covariance, later, states)
    sd = np.sqrt(states[1])
    return Smoothed(filtered, states[0, :, :n], sd[:, :n], states[0, :, n:][:, of], sd[:, n:][:, of])


def block_length(steps: int) -> int:
    """Steps of a block for which least is kept: a covariance a block, and two matrices a step of one block."""
    return max(1, math.isqrt(steps // 2))


def _forward(inputs: Inputs, blocks: Sequence[slice]) -> tuple[list[tuple[Floats, Floats]], Estimate]:
    """State and covariance at the start of each block, and what the filter says."""
    x, covariance = inputs.x.copy(), inputs.covariance.copy()
    steps, m = inputs.values.shape
    states, innovations = np.empty((2, steps + 1, inputs.parts.last)), np.empty((steps, m, 2))
    states[:, 0] = x[: inputs.parts.last, 0], np.diag(covariance)[: inputs.parts.last]
    spare, likelihood = work(inputs.parts, inputs.boundaries.shape[1]), 0.0
    kept = []
    for block in blocks:
        kept.append((x.copy(), covariance.copy()))
        edges = slice(block.start, block.stop + 1)
        likelihood += run(
            inputs.parts,
            inputs.features[block],
            inputs.boundaries[block],
            inputs.values[block],
            inputs.places[block],
            inputs.variances[block],
            x,
            covariance,
            states[0, edges],
            states[1, edges],
            innovations[block],
            spare,
        )
    return kept, estimate_of(inputs, states, innovations, covariance, likelihood)


def _back_through(inputs: Inputs, block: slice, x: Floats, covariance: Floats, later: Floats, states: Floats) -> None:
    """Filter a block again, keep what the way back needs, and go back: `later` [L | l] from its last edge to its first, `states`
    at all of its edges but the last."""
    steps, size, m = block.stop - block.start, len(x), inputs.values.shape[1]
    estimates, spreads, matrices = np.empty((steps, size)), np.empty((steps, size, size)), np.empty((steps, size, size))
    rows, gains, innovations = np.empty((steps, m, size)), np.empty((steps, m, size)), np.empty((steps, m, 2))
    _keep(
        inputs.parts,
        inputs.features[block],
        inputs.boundaries[block],
        inputs.values[block],
        inputs.places[block],
        inputs.variances[block],
        x,
        covariance,
        estimates,
        spreads,
        matrices,
        rows,
        gains,
        innovations,
        work(inputs.parts, inputs.boundaries.shape[1]),
    )
    edges = slice(block.start, block.stop)
    _back(
        estimates,
        spreads,
        matrices,
        rows,
        gains,
        innovations,
        later,
        states[0, edges],
        states[1, edges],
    )


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _keep(
    parts: Parts,
    features: Floats,
    boundaries: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    x: Floats,
    covariance: Floats,
    estimates: Floats,
    spreads: Floats,
    matrices: Floats,
    rows: Floats,
    gains: Floats,
    innovations: Floats,
    work: Work,
) -> None:
    """`twin.ekf_step.run` over N steps that keeps the state (N, S) and P (N, S, S) at the start of each, F (N, S, S), and of each
    reading its row and gain (N, m, S) and innovation (N, m, 2)."""
    one = np.eye(len(x))
    for k in range(len(features)):
        estimates[k] = x[:, 0]
        spreads[k] = covariance
        move(parts, features[k], boundaries[k], x, work.x, work)
        sensitivities(parts, features[k], boundaries[k], x, work)
        advance(parts, work.values, work.still, work.drive, one, matrices[k], work.many)
        carry(parts, covariance, work)
        x[:] = work.x
        correct(
            parts,
            features[k],
            boundaries[k],
            readings[k],
            places[k],
            variances[k],
            x,
            covariance,
            innovations[k],
            rows[k],
            gains[k],
            work,
        )


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _back(
    estimates: Floats,
    spreads: Floats,
    matrices: Floats,
    rows: Floats,
    gains: Floats,
    innovations: Floats,
    later: Floats,
    states: Floats,
    variances: Floats,
) -> None:
    """From the last edge of N steps to the first. Changed: `later` (S, S + 1), [L | l]. Filled: `states` and `variances` (N, c), the
    first c numbers of the state at the start of each step."""
    size, m = estimates.shape[1], rows.shape[1]
    shared, moved = np.empty(size + 1), np.empty((size, size + 1))
    for k in range(len(estimates) - 1, -1, -1):
        for j in range(m - 1, -1, -1):
            if np.isnan(innovations[k, j, 0]):
                continue
            _before_reading(rows[k, j], gains[k, j], innovations[k, j, 0], innovations[k, j, 1], later, shared)
        _before_step(matrices[k], later, moved)
        for i in range(states.shape[1]):
            known, less = estimates[k, i], spreads[k, i, i]
            for a in range(size):
                says = 0.0
                for b in range(size):
                    says += later[a, b] * spreads[k, i, b]
                less -= spreads[k, i, a] * says
                known -= spreads[k, i, a] * later[a, size]
            states[k, i], variances[k, i] = known, max(less, 0.0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _before_reading(h: Floats, gain: Floats, innovation: float, spread: float, later: Floats, shared: Floats) -> None:
    """[L | l] before a reading, from after it; `shared` (S + 1,) is overwritten."""
    size = len(h)
    for c in range(size + 1):
        shared[c] = 0.0
    for i in range(size):
        for c in range(size + 1):
            shared[c] += gain[i] * later[i, c]
    twice = 1.0 / spread
    for i in range(size):
        twice += shared[i] * gain[i]
    for i in range(size):
        if h[i] != 0.0:
            later[i, size] -= h[i] * (shared[size] + innovation / spread)
    for i in range(size):
        for c in range(size):
            if h[i] != 0.0 or h[c] != 0.0:
                later[i, c] += h[i] * h[c] * twice - (h[i] * shared[c] + shared[i] * h[c])


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _before_step(matrix: Floats, later: Floats, moved: Floats) -> None:
    """[L | l] at the start of a step with derivative F (S, S), from its end; `moved` (S, S + 1) is overwritten."""
    size = len(matrix)
    for i in range(size):
        for c in range(size + 1):
            moved[i, c] = 0.0
        for a in range(size):
            share = matrix[a, i]
            if share != 0.0:
                for c in range(size + 1):
                    moved[i, c] += share * later[a, c]
    for i in range(size):
        later[i, size] = moved[i, size]
        for c in range(size):
            later[i, c] = 0.0
        for a in range(size):
            share = moved[i, a]
            if share != 0.0:
                for c in range(size):
                    later[i, c] += share * matrix[a, c]
    for i in range(size):
        for c in range(i):
            later[i, c] = later[c, i] = 0.5 * (later[i, c] + later[c, i])
