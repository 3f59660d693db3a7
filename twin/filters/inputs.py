"""What every filter is given: readings of sensors and meters, a start, unknowns; and the same as the arrays that the
compiled steps take.

The unknown heat of a node stands *beside* its modelled loss, held within a step, and is a random walk: inverting one
step for it would amplify noise to kilowatts (Gillijns and De Moor, 2007, doi:10.1016/j.automatica.2006.08.002). A
sensor's known lag is a state of its own, exact for a temperature that is linear within the step, as
`twin.motor.outputs` models it; what is read lies at the samples' mean time within the step. A constant error of a
sensor that is no unknown is taken for temperature, and so for heat.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.compiled.laid_out import LaidOut, laid_out
from twin.compiled.laws import Law
from twin.compiled.once import once_a_network
from twin.errors import FrameError
from twin.filters.plan import Parts
from twin.filters.unknowns import Unknown, UnknownBias, node_place, places, variances
from twin.motor.check import check
from twin.motor.network import NOBODY, Network
from twin.motor.outputs import lag_factors
from twin.motor.sensor import Sensor
from twin.run.losses import takers
from twin.run.simulate import Frame, check_frame

Floats = NDArray[np.float64]

# Random walk of every node, for what a network's form leaves open. Measured on a conduction mesh whose motor file errs
# by 2 to 5 K in open loop: at 0.02 the squared innovations are 5 to 13 times what the filter expects (NIS), at 0.1
# they are 1.0 to 1.5 times that, and the likelihood is highest.
TEMPERATURE_K_PER_SQRT_S = 0.1
READING_SD_K = 0.1  # of a lagging sensor's reading at the start, about equilibrium


@dataclass(frozen=True)
class Reading:
    """A sensor over N steps. `value` (N,) [degC] mean of each step's samples, NaN where there is none; `place` (N,)
    in [0, 1]: their mean time within the step; `variance` (N,) [K^2] of that mean, above 0 where there is a value."""

    sensor: Sensor
    value: Floats
    place: Floats
    variance: Floats

    @property
    def channel(self) -> str:
        """The name of the channel."""
        return self.sensor.name


@dataclass(frozen=True)
class HeatReading:
    """A meter of heat over N steps: of all losses, or of what `boundary` takes. `value` (N,) [W] mean over each step,
    NaN where there is none; `variance` (N,) [W^2] of that mean, above 0 where there is a value. It is compared with
    the heat at the end of the step, linear about the estimate there; an `UnknownBias` of this channel is in W."""

    channel: str
    value: Floats
    variance: Floats
    boundary: str | None = None


AnyReading = Reading | HeatReading


@dataclass(frozen=True)
class FilterStart:
    """What is known at the first edge: temperatures (n,) [degC] of the nodes with their standard deviations (n,) [K].
    `walk_K` [K / sqrt(s)]: the random walk of every node between steps that the network's form leaves open.

    `by_reading`: channel -> what 1 K of its reading added to the temperatures (n,) [K/K], where they were set by
    readings. An `UnknownBias` of that channel is in them too; `sd` is what stays open where all readings are right.
    """

    temperatures: Floats
    sd: Floats
    walk_K: float = TEMPERATURE_K_PER_SQRT_S
    by_reading: Mapping[str, Floats] = field(default_factory=dict)


class Given(NamedTuple):
    """What N steps are given: `features` (N, F), `boundaries` (N, b) [degC], and `values` (N, m + q) [degC, W] of the
    readings, thermometers first, NaN where there is none. `places` in the step and `variances` are (N, m + q), or one
    row (1, m + q) where they are those of every step."""

    features: Floats
    boundaries: Floats
    values: Floats
    places: Floats
    variances: Floats


@dataclass(frozen=True)
class Inputs:
    """A frame, a start, readings and unknowns as arrays; copy what a step changes.

    The state `x` (S,) with its `covariance` (S, S) is that of the first edge: temperatures, unknowns in `order` (u,),
    heats first, and what each lagging thermometer reads. The arrays of the steps are as in `Given`; `channels` says
    which column of `values` each reading is, as the caller gave them.
    """

    network: Network
    frame: Frame
    unknowns: tuple[Unknown, ...]
    order: tuple[int, ...]
    channels: tuple[int, ...]
    parts: Parts
    x: Floats
    covariance: Floats
    features: Floats
    boundaries: Floats
    values: Floats
    places: Floats
    variances: Floats

    def given(self, steps: slice = slice(None)) -> Given:
        """What these steps are given."""
        places, variances = (rows[steps] if len(rows) > 1 else rows for rows in (self.places, self.variances))
        return Given(self.features[steps], self.boundaries[steps], self.values[steps], places, variances)


_checked = once_a_network(check)


def inputs_of(
    network: Network, frame: Frame, start: FilterStart, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Inputs:
    """The arrays of a frame, a start, unknowns and readings.

    Raises `NetworkError` where the network cannot be a motor, `FrameError` where shapes do not fit, an input is not
    finite, a variance or standard deviation is not above 0, or a node or coefficient is not the network's, and
    `CauseError` where an unknown factor is not written as a cause.
    """
    _checked(network)
    motor = laid_out(network)
    check_frame(network, frame, start.temperatures, motor.shape.monomials)
    _check(network, frame, start, readings)
    sensors = [r for r in readings if isinstance(r, Reading)]
    meters = [r for r in readings if isinstance(r, HeatReading)]
    parts, order, at_start = _parts(network, motor, frame.step_s, start, unknowns, sensors, meters)
    x, covariance = _at_the_start(parts, start, [unknowns[i] for i in order], at_start)
    steps = len(frame.features)
    every: list[AnyReading] = [*sensors, *meters]
    values = _columns([r.value for r in every], steps)
    at = _columns_or_row([r.place if isinstance(r, Reading) else np.ones(steps) for r in every], steps)
    noise = _columns_or_row([r.variance for r in every], steps)
    _check_noise(every, values, at, noise)
    return Inputs(
        network=network,
        frame=frame,
        unknowns=tuple(unknowns),
        order=order,
        channels=tuple(next(i for i, other in enumerate(every) if other is r) for r in readings),
        parts=parts,
        x=x,
        covariance=covariance,
        features=np.ascontiguousarray(frame.features, dtype=np.float64),
        boundaries=np.ascontiguousarray(frame.boundaries, dtype=np.float64),
        values=values,
        places=at,
        variances=noise,
    )


def with_walks(inputs: Inputs, unknowns: Sequence[Unknown]) -> Inputs:
    """`inputs` for unknowns that differ from theirs in the walks alone."""
    n, process = inputs.parts.program.n, inputs.parts.process.copy()
    _, process[n : inputs.parts.sought] = variances(unknowns, inputs.order, inputs.frame.step_s)
    return replace(inputs, unknowns=tuple(unknowns), parts=inputs.parts._replace(process=process))


def _check(network: Network, frame: Frame, start: FilterStart, readings: Sequence[AnyReading]) -> None:
    steps = len(frame.features)
    if start.sd.shape != start.temperatures.shape or not (start.sd > 0).all() or not start.walk_K >= 0:
        raise FrameError(f"the start needs a standard deviation above 0 for each of {len(network.nodes)} nodes")
    around = [boundary.name for boundary in network.boundaries]
    for r in readings:
        if isinstance(r, Reading):
            for name in r.sensor.weights:
                node_place(network, name)
        elif r.boundary is not None and r.boundary not in around:
            raise FrameError(f'channel "{r.channel}": no boundary "{r.boundary}": name one of {", ".join(around)}')
        place = r.place if isinstance(r, Reading) else np.ones(steps)
        if any(values.shape != (steps,) for values in (r.value, place, r.variance)):
            raise FrameError(f'channel "{r.channel}": give value, place and variance for each of {steps} steps')


def _check_noise(readings: Sequence[AnyReading], values: Floats, places: Floats, variances: Floats) -> None:
    missing = ~(np.isfinite(places) & (variances > 0))
    if missing.any():
        for j in np.flatnonzero((np.isfinite(values) & missing).any(axis=0)).tolist():
            channel = readings[j].channel
            raise FrameError(f'channel "{channel}": a value without a place or a variance above 0: give it a noise')


def _parts(
    network: Network,
    motor: LaidOut,
    step_s: float,
    start: FilterStart,
    unknowns: Sequence[Unknown],
    readings: Sequence[Reading],
    meters: Sequence[HeatReading],
) -> tuple[Parts, tuple[int, ...], list[float]]:
    """The parts of all steps, the order of the unknowns in the state, and their variances at the start."""
    names = [node.name for node in network.nodes]
    n, m, values = len(names), len(readings), motor.values
    channels = [*(r.channel for r in readings), *(r.channel for r in meters)]
    of = places(network, unknowns, len(values.coefficients), channels)
    at_start, walks = variances(unknowns, of.order, step_s)
    sought = n + len(of.order)
    weights, lag, state = np.zeros((m, n)), np.zeros((m, 3)), np.full(m, -1, dtype=np.int64)
    size = sought
    for j, reading in enumerate(readings):
        sensor = reading.sensor
        weights[j] = sensor.over(names)
        if sensor.time_constant_s > 0:
            lag[j] = lag_factors(sensor.time_constant_s, step_s)
            state[j], size = size, size + 1
    process = np.zeros(size)
    process[:n] = start.walk_K**2 * step_s
    process[n:sought] = walks
    parts = Parts(
        program=motor.program,
        constant=values.capacities / (motor.program.gamma * step_s),
        copper=values.copper,
        nominal=values.coefficients,
        factor_of=of.factor_of,
        heats=of.heats,
        places=motor.table.places,
        numbers=motor.table.numbers,
        unknown_factors=of.factors,
        sought=sought,
        weights=weights,
        bias=np.where(of.bias_of >= 0, n + len(of.heats) + of.factors + of.bias_of, -1),
        state=state,
        lag=lag,
        signs=_signs(network, motor.laws, meters),
        of_losses=np.array([1.0 if meter.boundary is None else 0.0 for meter in meters]),
        process=process,
    )
    return parts, of.order, at_start


def _signs(network: Network, laws: Sequence[Law], meters: Sequence[HeatReading]) -> Floats:
    """By which each meter adds up the heat of each group (q, G): 1 for sources where losses are measured, -1 for laws
    whose heat the boundary takes."""
    taker, around = takers(network), [boundary.name for boundary in network.boundaries]
    taken = np.array([-1 if (b := taker(law)) is None else b for law in laws])
    source = np.array([law.b == NOBODY for law in laws])
    rows = [source if m.boundary is None else -1.0 * (taken == around.index(m.boundary)) for m in meters]
    return np.array(rows, dtype=np.float64).reshape(-1, len(laws))


def _at_the_start(
    parts: Parts, start: FilterStart, unknowns: Sequence[Unknown], at_start: Sequence[float]
) -> tuple[Floats, Floats]:
    """State (S,) and covariance (S, S) at the first edge: `unknowns` 0, with variances `at_start`, and sensors in
    equilibrium but for `READING_SD_K`. What a channel reads too much, the temperatures that it set are too high by."""
    n, sought, size = parts.program.n, parts.sought, len(parts.process)
    onto, own = np.zeros((size, sought)), np.zeros(size)  # temperatures and unknowns -> state
    onto[:sought] = np.eye(sought)
    for i, unknown in enumerate(unknowns):
        if isinstance(unknown, UnknownBias) and unknown.channel in start.by_reading:
            onto[:n, n + i] = -start.by_reading[unknown.channel]
    onto[sought:], own[sought:] = parts.weights[parts.state >= 0] @ onto[:n], READING_SD_K**2
    x = onto @ np.append(start.temperatures, np.zeros(sought - n))
    covariance = np.diag(own)
    for column, variance in zip(onto.T, [*start.sd**2, *at_start], strict=True):  # BLAS adds in the processor's order
        covariance += variance * np.outer(column, column)
    return x, covariance


def _columns(values: Sequence[Floats], steps: int) -> Floats:
    return np.ascontiguousarray(np.stack(values, axis=1) if values else np.empty((steps, 0)), dtype=np.float64)


def _columns_or_row(values: Sequence[Floats], steps: int) -> Floats:
    """As columns (N, columns), or one row (1, columns) where no step's differs: all of them would take longer to
    write than the filter to look at them."""
    same = steps > 0 and all((column == column[0]).all() for column in values)
    return _columns([column[:1] for column in values], 1) if same else _columns(values, steps)
