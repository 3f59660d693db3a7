"""Extended Kalman filter: unknown heats and coefficients, estimated from measured temperatures while the motor runs.

The paper's filter (its section 4) estimates the magnets' loss from endwindings and rotor surface; its state is z,
dz/dt and the unknown input, of size 2p + o (`twin.paper.ekf`). This is the small form of the same: the network's own
step (`twin.compiled.integrators`, with the inputs held) on [temperatures, unknowns, readings].

Extended: each step is linearised about the estimate at its start. For losses linear in temperature (copper) that is
exact; of resistances, temperature factors and unknown factors the second derivative is left out of the covariance,
never of the estimate (`twin.filters.ukf` keeps it). Readings of a step are independent and taken together; a missing
one is left out.

A filter is told where the unknown heat is. Told the wrong node it still finds a history that fits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar, assert_never

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import LaneStore, aligned, record
from twin.compiled.once import once_a_network
from twin.filters.inputs import AnyReading, FilterStart, Given, Inputs, inputs_of, with_walks
from twin.filters.plan import Plan, entry_at, x_at
from twin.filters.planning import plan
from twin.filters.readings import ReadingsPlan, at_step, correct, observe, readings_of
from twin.filters.step import carry
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.run.simulate import Frame, check_finite

Floats = NDArray[np.float64]
Index = NDArray[np.int64]
U = TypeVar("U", bound=Unknown)

PACES = (1 / 30, 300.0)  # within which the walks of the unknowns are sought, as factors of what is given
PACE_ENOUGH = 0.3  # to which the logarithm of a pace is sought: the likelihood is flat there


@dataclass(frozen=True)
class Estimate:
    """What a filter knows at each edge from all readings up to it: row 0 is the start, row k + 1 is after step k.

    `temperatures` (N + 1, n) [degC] and `found` (N + 1, u) of the `unknowns` (heat [W] beside the model's own,
    logarithm of a factor, error [K]), each with its standard deviation. `innovations` (N, channels) [K, W]: each
    reading less what those before it let expect, with `variances` [K^2, W^2], NaN where a channel says nothing;
    thermometers first. `covariance` (S, S) of the state after the last step; `log_likelihood` of all readings.
    """

    unknowns: tuple[Unknown, ...]
    temperatures: Floats
    temperatures_sd: Floats
    found: Floats
    found_sd: Floats
    innovations: Floats
    variances: Floats
    covariance: Floats
    log_likelihood: float

    @property
    def nis(self) -> float:
        """Mean squared innovation over its variance: 1 where noise and model are as said; NaN without a reading. It
        hardly sees the unknowns' random walks, which is why those are chosen by likelihood."""
        there = np.isfinite(self.innovations)
        return float(np.mean(self.innovations[there] ** 2 / self.variances[there])) if there.any() else float("nan")


def filter_unknowns(
    network: Network, frame: Frame, start: FilterStart, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Estimate:
    """Temperatures and unknowns from the readings. Without a reading the temperatures are those of `simulate` to
    rounding.

    Raises as `twin.filters.inputs.inputs_of`, and `DivergedError` where the temperatures leave the finite numbers.
    """
    return filtered_by(through, inputs_of(network, frame, start, unknowns, readings))


def filtered_by(way: Callable[..., float], inputs: Inputs) -> Estimate:
    """The estimate of a filter whose steps are made as by `through`, or in another `way`."""
    run, found = run_of(inputs), courses(inputs)
    run.begin(inputs)
    likelihood = way(run.plan, run.readings, run.m, run.at, inputs.given(), found)
    return estimate_of(inputs, found, run.covariance(), float(likelihood))


@dataclass(frozen=True)
class FilterRun:
    """A filter ready to go: numbers `m` and indices `at` (`twin.arithmetic.lanes`), the records of where in them the
    step and its readings are, and the `size` S of the state."""

    plan: Plan
    readings: ReadingsPlan
    size: int
    m: Floats
    at: Index

    def begin(self, inputs: Inputs) -> None:
        """Set the state and its covariance to those at the first edge, and what every step adds."""
        self.m[self.plan.process : self.plan.process + self.size] = inputs.parts.process
        rows = self.state()
        rows[: self.size, : self.size], rows[: self.size, self.size] = inputs.covariance, inputs.x

    def state(self) -> Floats:
        """The rows [P | x] (length, length), to read or to write."""
        length = self.plan.length
        return self.m[self.plan.state : self.plan.state + length**2].reshape(length, length)

    def covariance(self) -> Floats:
        """A copy of P (S, S)."""
        return self.state()[: self.size, : self.size].copy()


def run_of(inputs: Inputs) -> FilterRun:
    """A filter for these inputs, not begun. Where the last one for this network read and sought the same, only its
    arrays are copied."""
    p, known = inputs.parts, _last_run(inputs.network)
    arrays = (p.constant, p.factor_of, p.heats, p.weights, p.bias, p.state, p.lag, p.signs, p.of_losses)
    key = (inputs.boundaries.shape[1], *(array.tobytes() for array in arrays))
    if key not in known:
        store = LaneStore()
        steps = plan(p, inputs.boundaries.shape[1], store)
        readings = readings_of(steps, store)
        known.clear()
        known[key] = FilterRun(record(steps), record(readings), steps.size, store.numbers(), store.indices())
    kept = known[key]
    return replace(kept, m=aligned(kept.m), at=kept.at.copy())


@once_a_network
def _last_run(network: Network) -> dict[tuple[object, ...], FilterRun]:
    """The run made last for a network, never begun, by all that it is made of."""
    return {}


class FilterCourse(NamedTuple):
    """What a filter finds over N steps: the first c numbers of the `states` and their variances `spreads` at all
    edges, both (N + 1, c), and `innovations` (N, m + q, 2) of the readings with theirs (`correct`)."""

    states: Floats
    spreads: Floats
    innovations: Floats

    def of(self, block: slice) -> FilterCourse:
        """The course over a block of steps, with the edge behind it."""
        edges = slice(block.start, block.stop + 1)
        return FilterCourse(self.states[edges], self.spreads[edges], self.innovations[block])


def courses(inputs: Inputs) -> FilterCourse:
    """Room, not filled, for temperatures and unknowns at all edges, and for the innovations of all readings."""
    steps, channels = inputs.values.shape
    states, spreads = np.empty((2, steps + 1, inputs.parts.sought))
    return FilterCourse(states, spreads, np.empty((steps, channels, 2)))


@numba.njit(error_model="numpy", nogil=True, cache=True)
def through(
    plan: Plan, taken: ReadingsPlan, numbers: Floats, indices: Index, given: Given, found: FilterCourse
) -> float:
    """The filter over the steps of `given`, from the state in `numbers` to that at the last edge: fills `found`, and
    returns the log likelihood of the readings."""
    states, spreads, innovations = found
    likelihood, early = 0.0, bool((given.places != 1.0).any())
    m, at, channels = pointer(numbers, 0), pointer(indices, 0), given.values.shape[1]
    for k in range(len(given.boundaries) + 1):
        if k > 0:
            phi, outside, values, place, variance = at_step(given, k - 1)
            carry(plan, m, at, phi, outside, early)
            count = observe(plan, taken, m, at, outside, values, place, variance)
            likelihood += correct(plan, taken, m, at, count, pointer(innovations, 2 * (k - 1) * channels))
        for i in range(states.shape[1]):
            states[k, i], spreads[k, i] = m[x_at(plan, plan.state, i)], m[entry_at(plan, plan.state, i, i)]
    return likelihood


def estimate_of(inputs: Inputs, found: FilterCourse, covariance: Floats, log_likelihood: float) -> Estimate:
    """The estimate, from what a filter `found`, whose arrays it takes over. Raises `DivergedError` where the
    temperatures leave the finite numbers."""
    n, unknown = len(inputs.network.nodes), np.argsort(inputs.order).tolist()
    check_finite(inputs.network, inputs.frame, found.states[:, :n])
    sd, told = np.sqrt(found.spreads, out=found.spreads), columns_of(found.innovations, inputs.channels)
    return Estimate(
        unknowns=inputs.unknowns,
        temperatures=found.states[:, :n],
        temperatures_sd=sd[:, :n],
        found=columns_of(found.states[:, n:], unknown),
        found_sd=columns_of(sd[:, n:], unknown),
        innovations=told[..., 0],
        variances=told[..., 1],
        covariance=covariance,
        log_likelihood=log_likelihood,
    )


def columns_of(array: Floats, which: Sequence[int]) -> Floats:
    """Columns of `array`: itself where they are all of them, in their order."""
    return array if list(which) == list(range(array.shape[1])) else array[:, list(which)]


def at_their_pace(
    network: Network,
    frame: Frame,
    start: FilterStart,
    unknowns: Sequence[U],
    readings: Sequence[AnyReading],
    beside: Sequence[Unknown] = (),
) -> tuple[U, ...]:
    """The unknowns with the random walks of heats and factors times one number, within `PACES`: the one that makes
    the readings most likely (marginal likelihood, by Brent's bounded search over its logarithm). `beside`: other
    unknowns of the filter, whose walks stay. Raises as `filter_unknowns`."""
    if all(isinstance(unknown, UnknownBias) for unknown in unknowns):
        return tuple(unknowns)
    inputs = inputs_of(network, frame, start, [*unknowns, *beside], readings)

    def surprise(log_pace: float) -> float:
        walks = [*_paced(unknowns, np.exp(log_pace)), *beside]
        return -filtered_by(through, with_walks(inputs, walks)).log_likelihood

    best = minimize_scalar(surprise, bounds=np.log(PACES), method="bounded", options={"xatol": PACE_ENOUGH})
    return _paced(unknowns, float(np.exp(best.x)))


def _paced(unknowns: Sequence[U], pace: float) -> tuple[U, ...]:
    return tuple(_at_pace(unknown, pace) for unknown in unknowns)


def _at_pace(unknown: U, pace: float) -> U:
    match unknown:
        case UnknownHeat():
            return replace(unknown, walk_W=unknown.walk_W * pace)
        case UnknownFactor():
            return replace(unknown, walk=unknown.walk * pace)
        case UnknownBias():
            return unknown
        case _:
            assert_never(unknown)
