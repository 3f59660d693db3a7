"""Unscented Kalman filter: the filter of `twin.ekf` with its step taken from many points at once instead of its derivative.

Sigma points after Van der Merwe (The scaled unscented transformation: Julier, doi:10.1109/ACC.2002.1025369; Wan and Van der Merwe,
doi:10.1109/ASSPCC.2000.882463): the estimate, and the estimate plus and minus each column of the root of its covariance, times
`spread`. Each is a state of its own with its own factors, carried by the network's own step linearised about itself, so
that mean and covariance hold the curvature that the extended filter leaves out. Readings are taken as there: those of
temperatures are linear in the state. In a network whose heats are linear in temperatures and unknowns both filters are one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.ekf import Estimate, estimate_of
from twin.ekf_step import Parts, Work, correct, move, work
from twin.filter_inputs import AnyReading, Start, inputs_of
from twin.network import Network
from twin.simulate import Frame
from twin.unknowns import Unknown

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

ALPHA, BETA, KAPPA = 0.5, 2.0, 0.0  # points at half of sqrt(size) standard deviations: about 2.5 for 25 numbers


def filter_unscented(
    network: Network, frame: Frame, start: Start, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Estimate:
    """Temperatures and unknowns from the readings, as `twin.ekf.filter_unknowns`. Raises as that."""
    inputs = inputs_of(network, frame, start, unknowns, readings)
    x, covariance = inputs.x.copy(), inputs.covariance.copy()
    steps, m = inputs.values.shape
    states, innovations = np.empty((2, steps + 1, inputs.parts.last)), np.empty((steps, m, 2))
    drawn = np.array([*range(inputs.parts.last), *(at for at in inputs.parts.state.tolist() if at >= 0)])
    likelihood = _run(
        inputs.parts,
        inputs.features,
        inputs.boundaries,
        inputs.values,
        inputs.places,
        inputs.variances,
        drawn,
        x,
        covariance,
        states[0],
        states[1],
        innovations,
        work(inputs.parts, inputs.boundaries.shape[1]),
    )
    return estimate_of(inputs, states, innovations, covariance, float(likelihood))


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _run(
    parts: Parts,
    features: Floats,
    boundaries: Floats,
    readings: Floats,
    places: Floats,
    variances: Floats,
    drawn: Index,
    x: Floats,
    covariance: Floats,
    states: Floats,
    spreads: Floats,
    innovations: Floats,
    work: Work,
) -> float:
    """As `twin.ekf_step.run`; `drawn`: the numbers of the state that a step begins with (not what was read before it)."""
    likelihood, kept = 0.0, np.empty((2, readings.shape[1], len(x)))
    root, points = np.empty((len(drawn), len(drawn))), np.empty((2 * len(drawn) + 1, len(x)))
    for k in range(len(features) + 1):
        if k > 0:
            _carry(parts, features[k - 1], boundaries[k - 1], drawn, x, covariance, root, points, work)
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


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _carry(
    parts: Parts,
    phi: Floats,
    outside: Floats,
    drawn: Index,
    x: Floats,
    covariance: Floats,
    root: Floats,
    points: Floats,
    work: Work,
) -> None:
    """State (S, 1) and P (S, S) one step on, through the sigma points; `root` (c, c) and `points` (2c + 1, S) are overwritten."""
    size, count = len(x), len(drawn)
    scale = ALPHA * ALPHA * (count + KAPPA)
    spread, weight = np.sqrt(scale), 0.5 / scale
    _root(covariance, drawn, root)
    for p in range(2 * count + 1):
        column, sign = (p - 1) // 2, 0.0 if p == 0 else 1.0 if p % 2 else -1.0
        for i in range(size):
            work.x[i, 0] = x[i, 0]
        if p > 0:
            for i in range(column, count):
                work.x[drawn[i], 0] += sign * spread * root[i, column]
        move(parts, phi, outside, work.x, points[p].reshape((size, 1)), work)
    middle = 1.0 - count / scale
    for i in range(size):
        mean = 0.0
        for p in range(1, 2 * count + 1):
            mean += points[p, i] - points[0, i]
        x[i, 0] = points[0, i] + weight * mean
        for j in range(size):
            covariance[i, j] = 0.0
    middle += 1.0 - ALPHA * ALPHA + BETA
    for p in range(2 * count + 1):
        share = middle if p == 0 else weight
        for i in range(size):
            points[p, i] -= x[i, 0]
        for i in range(size):
            mine = share * points[p, i]
            for j in range(i + 1):
                covariance[i, j] += mine * points[p, j]
    for i in range(size):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
        covariance[i, i] += parts.process[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _root(covariance: Floats, drawn: Index, root: Floats) -> None:
    """Lower triangle (c, c) of Cholesky of the drawn part of P; a number that the others determine gets a column of zeros."""
    for j in range(len(drawn)):
        own = covariance[drawn[j], drawn[j]]
        left = own
        for q in range(j):
            left -= root[j, q] * root[j, q]
        pivot = np.sqrt(left) if left > 1e-14 * own else 0.0
        root[j, j] = pivot
        for i in range(j + 1, len(drawn)):
            entry = covariance[drawn[i], drawn[j]]
            for q in range(j):
                entry -= root[i, q] * root[j, q]
            root[i, j] = entry / pivot if pivot > 0.0 else 0.0
