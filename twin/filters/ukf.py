"""Unscented Kalman filter: the filter of `twin.filters.ekf` with its step taken from many points at once instead of
its derivative.

Sigma points after Van der Merwe (The scaled unscented transformation: Julier, doi:10.1109/ACC.2002.1025369; Wan and
Van der Merwe, doi:10.1109/ASSPCC.2000.882463): the estimate, and the estimate plus and minus each column of the root
of its covariance, times `spread`. Each is a state of its own with its own factors, carried by the network's own step
linearised about itself, so that mean and covariance hold the curvature that the extended filter leaves out. Readings
are taken as there: those of temperatures are linear in the state. In a network whose heats are linear in temperatures
and unknowns both filters are one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lane_code import pointer
from twin.filters.ekf import Estimate, FilterCourse, filtered_by
from twin.filters.inputs import AnyReading, FilterStart, Given, inputs_of
from twin.filters.plan import Plan, entry_at, x_at
from twin.filters.readings import ReadingsPlan, at_step, correct, observe
from twin.filters.step import move
from twin.filters.unknowns import Unknown
from twin.motor.network import Network
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end

ALPHA, BETA, KAPPA = 0.5, 2.0, 0.0  # points at half of sqrt(size) standard deviations: about 2.5 for 25 numbers


def filter_unscented(
    network: Network, frame: Frame, start: FilterStart, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Estimate:
    """Temperatures and unknowns from the readings by sigma points. Takes, returns and raises what
    `twin.filters.ekf.filter_unknowns` does."""
    return filtered_by(_through, inputs_of(network, frame, start, unknowns, readings))


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _through(
    plan: Plan, taken: ReadingsPlan, numbers: Floats, indices: Index, given: Given, found: FilterCourse
) -> float:
    """The filter over N steps; takes, fills and returns what `twin.filters.ekf.through` does."""
    states, spreads, innovations = found
    likelihood, size, length = 0.0, plan.size, plan.length
    m, at, channels = pointer(numbers, 0), pointer(indices, 0), given.values.shape[1]
    covariance = numbers[plan.state : plan.state + size * length].reshape((size, length))
    root, points = np.empty((size, size)), np.empty((2, 2 * size + 1, size))
    for k in range(len(given.boundaries) + 1):
        if k > 0:
            phi, outside, values, place, variance = at_step(given, k - 1)
            _root(covariance, root)
            _carry(plan, m, at, phi, outside, root, points[0], points[1])
            count = observe(plan, taken, m, at, outside, values, place, variance)
            likelihood += correct(plan, taken, m, at, count, pointer(innovations, 2 * (k - 1) * channels))
        for i in range(states.shape[1]):
            states[k, i], spreads[k, i] = m[x_at(plan, plan.state, i)], m[entry_at(plan, plan.state, i, i)]
    return likelihood


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _carry(
    plan: Plan, m: Floats, at: Index, phi: Floats, outside: Floats, root: Floats, before: Floats, after: Floats
) -> None:
    """One step as by `twin.filters.step.carry`, through sigma points by the Cholesky factor `root` (S, S) of the
    covariance. Filled: those `before` the step and `after` it (2 S + 1, S)."""
    size, state, turned, ahead = plan.size, plan.state, plan.turned, plan.ahead
    scale = ALPHA * ALPHA * (size + KAPPA)
    spread, weight = np.sqrt(scale), 0.5 / scale
    for p in range(2 * size + 1):
        column, sign = (p - 1) // 2, 0.0 if p == 0 else 1.0 if p % 2 else -1.0
        for i in range(size):
            before[p, i] = m[x_at(plan, state, i)]
            if p > 0 and i >= column:
                before[p, i] += sign * spread * root[i, column]
            m[x_at(plan, turned, i)] = before[p, i]
        move(plan, m, at, phi, outside, turned, ahead)
        for i in range(size):
            after[p, i] = m[x_at(plan, ahead, i)]
    _gather(plan, m, before, after, weight, 1.0 - size / scale)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _gather(plan: Plan, m: Floats, before: Floats, after: Floats, weight: float, middle: float) -> None:
    """`ahead` and `turned` as `carry` leaves them, from the sigma points; a point counts `weight` in the mean, the
    one in the middle `middle`."""
    size = plan.size
    begun = before[0].copy()
    mean = np.empty(size)
    for i in range(size):
        total = 0.0
        for p in range(1, len(after)):
            total += after[p, i] - after[0, i]
        mean[i] = after[0, i] + weight * total
    for i in range(size):
        for c in range(size):
            m[entry_at(plan, plan.ahead, i, c)] = m[entry_at(plan, plan.turned, i, c)] = 0.0
    for p in range(len(after)):
        share = middle + 1.0 - ALPHA * ALPHA + BETA if p == 0 else weight
        for i in range(size):
            after[p, i] -= mean[i]
            before[p, i] -= begun[i]
        for i in range(size):
            mine, earlier = share * after[p, i], share * before[p, i]
            for c in range(size):
                m[entry_at(plan, plan.ahead, i, c)] += mine * after[p, c]
                m[entry_at(plan, plan.turned, i, c)] += earlier * after[p, c]
    for i in range(size):
        m[entry_at(plan, plan.ahead, i, i)] += m[u(plan.process + i)]
        m[x_at(plan, plan.ahead, i)], m[x_at(plan, plan.turned, i)] = mean[i], begun[i]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _root(covariance: Floats, root: Floats) -> None:
    """The lower triangle (S, S) of Cholesky of P into `root`; a number that the others determine gets a column of
    zeros."""
    for j in range(len(root)):
        own = covariance[j, j]
        left = own
        for q in range(j):
            left -= root[j, q] * root[j, q]
        pivot = np.sqrt(left) if left > 1e-14 * own else 0.0
        root[j, j] = pivot
        for i in range(j + 1, len(root)):
            entry = covariance[i, j]
            for q in range(j):
                entry -= root[i, q] * root[j, q]
            root[i, j] = entry / pivot if pivot > 0.0 else 0.0
