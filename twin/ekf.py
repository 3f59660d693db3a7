"""Extended Kalman filter: one unknown heat at one node, estimated from measured temperatures while the motor runs.

The paper's filter (its section 4) estimates the magnets' loss from endwindings and rotor surface; its state is z, dz/dt and
the unknown input, of size 2p + o. This is the small form of the same: the network's own step (`twin.integrators`, with the
inputs held) on [temperatures, unknown heat, readings]. The unknown heat stands *beside* the node's modelled loss, held
within a step, and is a random walk: inverting one step for it would amplify noise to kilowatts (Gillijns and De Moor, 2007,
doi:10.1016/j.automatica.2006.08.002). A sensor's known lag is a state of its own, exact for a temperature that is linear
within the step, as `twin.outputs` models it; what is read lies at the samples' mean time within the step.

Extended: each step is linearised about the estimate at its start. For losses linear in temperature (copper) that is exact;
of resistances and temperature factors the second derivative is left out of the covariance, never of the estimate. Readings
of a step are independent and taken one after the other; a missing one is left out. Constant errors of a sensor are no
state: the filter takes them for temperature, and for heat.

A filter is told where the unknown heat is. Told the wrong node it still finds a history that fits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.check import check
from twin.ekf_step import Parts, run
from twin.errors import FrameError
from twin.indexed import program
from twin.integrators import DEFAULT
from twin.network import Network
from twin.outputs import lag_factors
from twin.simulate import Frame, check_finite, check_frame
from twin.structure import parameters, structure

Floats = NDArray[np.float64]

# Of every node: what a network's form leaves open. Measured on a conduction mesh whose motor file errs by 2 to 5 K in open loop:
# 0.02 makes the innovations 5 to 13 times as large (NIS) as the filter thinks, 0.1 1.0 to 1.5 times, at the highest likelihood.
TEMPERATURE_K_PER_SQRT_S = 0.1
HEAT_SHARE = 0.05  # sd of the unknown heat at the start, of the mean loss of the whole network
HEAT_GRID = (0.0002, 0.001, 0.005)  # random walk of the heat, per square root of a second, of the same loss
READING_SD_K = 0.1  # of a lagging sensor's reading at the start, about equilibrium


@dataclass(frozen=True)
class Reading:
    """A measured channel over N steps. `weights`: node -> share, sum 1; `time_constant_s`: known first-order lag; `value` (N,)
    [degC] mean of each step's samples, NaN where there is none; `place` (N,) in [0, 1]: their mean time within the step;
    `variance` (N,) [K^2] of that mean, above 0 where there is a value."""

    channel: str
    weights: Mapping[str, float]
    time_constant_s: float
    value: Floats
    place: Floats
    variance: Floats


@dataclass(frozen=True)
class Start:
    """Temperatures (n,) [degC] at the first edge with their standard deviations (n,) [K], and that of the unknown heat [W],
    which starts at 0."""

    temperatures: Floats
    sd: Floats
    heat_sd_W: float


@dataclass(frozen=True)
class Noise:
    """Random walks between steps: of the unknown heat [W / sqrt(s)], and of every node's temperature [K / sqrt(s)]."""

    heat_W: float
    temperature_K: float = TEMPERATURE_K_PER_SQRT_S


@dataclass(frozen=True)
class Estimate:
    """What the filter knows at each edge from all readings up to it; `heat_W`, `heat_sd_W` (N,): the unknown heat beside the
    model's own, after each step; `temperatures` (N + 1, n) [degC]; `innovations`, `variances` (N, m) [K, K^2] of each
    channel given those before it in the step, NaN where it says nothing; `covariance` (S, S) after the last step."""

    noise: Noise
    temperatures: Floats
    heat_W: Floats
    heat_sd_W: Floats
    innovations: Floats
    variances: Floats
    covariance: Floats
    log_likelihood: float

    @property
    def nis(self) -> float:
        """Mean squared innovation over its variance: 1 where noise and model are as said; NaN without a reading. It hardly
        sees the heat's random walk, which is why that is chosen by likelihood."""
        there = np.isfinite(self.innovations)
        return float(np.mean(self.innovations[there] ** 2 / self.variances[there])) if there.any() else float("nan")


def filter_heat(
    network: Network, frame: Frame, start: Start, node: str, readings: Sequence[Reading], noise: Noise
) -> Estimate:
    """Temperatures and the unknown heat at `node` from the readings.

    Without a reading the temperatures are those of `simulate` to rounding. Raises `NetworkError` where the network cannot be
    a motor, `FrameError` where shapes do not fit, an input is not finite, a variance is not above 0 or a node is not the
    network's, and `DivergedError` where the temperatures leave the finite numbers.
    """
    check(network)
    check_frame(network, frame, start.temperatures)
    _check(network, frame, start, node, readings)
    parts = _parts(network, frame.step_s, node, readings, noise)
    both = _at_the_start(parts, start)
    steps, m = len(frame.features), len(readings)
    temperatures = np.empty((steps + 1, parts.program.n))
    heat, innovations = np.empty((steps, 2)), np.empty((steps, m, 2))
    likelihood = run(
        parts,
        np.ascontiguousarray(frame.features, dtype=np.float64),
        np.ascontiguousarray(frame.boundaries, dtype=np.float64),
        _columns([r.value for r in readings], steps),
        _columns([r.place for r in readings], steps),
        _columns([r.variance for r in readings], steps),
        both,
        temperatures,
        heat,
        innovations,
    )
    check_finite(network, frame, temperatures)
    return Estimate(
        noise=noise,
        temperatures=temperatures,
        heat_W=heat[:, 0],
        heat_sd_W=np.sqrt(heat[:, 1]),
        innovations=innovations[:, :, 0],
        variances=innovations[:, :, 1],
        covariance=both[:, :-1],
        log_likelihood=float(likelihood),
    )


def filter_heat_at_its_pace(
    network: Network, frame: Frame, start: Start, node: str, readings: Sequence[Reading], loss_W: float
) -> Estimate:
    """The same with the random walk of the heat that makes the readings most likely, of `HEAT_GRID` times `loss_W`, the mean
    loss of the whole network [W]. Raises as `filter_heat`."""
    tried = (filter_heat(network, frame, start, node, readings, Noise(share * loss_W)) for share in HEAT_GRID)
    return max(tried, key=lambda estimate: estimate.log_likelihood)


def _check(network: Network, frame: Frame, start: Start, node: str, readings: Sequence[Reading]) -> None:
    nodes, steps = {n.name for n in network.nodes}, len(frame.features)
    for name in (node, *(name for r in readings for name in r.weights)):
        if name not in nodes:
            raise FrameError(f'network "{network.name}" has no node "{name}": name one of {", ".join(sorted(nodes))}')
    if start.sd.shape != start.temperatures.shape or not (start.sd > 0).all() or not start.heat_sd_W > 0:
        raise FrameError(
            f"the start needs a standard deviation above 0 for each of {len(nodes)} nodes and for the heat"
        )
    for r in readings:
        if any(values.shape != (steps,) for values in (r.value, r.place, r.variance)):
            raise FrameError(f'channel "{r.channel}": give value, place and variance for each of {steps} steps')
        there = np.isfinite(r.value)
        if not (np.isfinite(r.place[there]).all() and (r.variance[there] > 0).all()):
            raise FrameError(f'channel "{r.channel}": a value without a place or a variance above 0: give it a noise')


def _parts(network: Network, step_s: float, node: str, readings: Sequence[Reading], noise: Noise) -> Parts:
    names = [n.name for n in network.nodes]
    n, m = len(names), len(readings)
    values, indices = parameters(network), program(structure(network), DEFAULT)
    weights, lag, state = np.zeros((m, n)), np.zeros((m, 3)), np.full(m, -1, dtype=np.int64)
    size = n + 1 + m
    for j, reading in enumerate(readings):
        weights[j, [names.index(name) for name in reading.weights]] = list(reading.weights.values())
        if reading.time_constant_s > 0:
            lag[j] = lag_factors(reading.time_constant_s, step_s)
            state[j], size = size, size + 1
    process = np.zeros(size)
    process[:n] = noise.temperature_K**2 * step_s
    process[n] = noise.heat_W**2 * step_s
    return Parts(
        program=indices,
        constant=values.capacities / (indices.gamma * step_s),
        coefficients=values.coefficients,
        copper=values.copper,
        factors=values.factors,
        node=names.index(node),
        weights=weights,
        state=state,
        lag=lag,
        process=process,
    )


def _at_the_start(parts: Parts, start: Start) -> Floats:
    """Covariance and state, [P | x] (S, S + 1): sensors in equilibrium but for `READING_SD_K`."""
    n, size = parts.program.n, len(parts.process)
    onto = np.zeros((size, n + 1))  # temperatures and heat -> state
    onto[: n + 1] = np.eye(n + 1)
    own = np.zeros(size)
    for j, at in enumerate(parts.state.tolist()):
        for place in {n + 1 + j, at if at >= 0 else n + 1 + j}:
            onto[place, :n] = parts.weights[j]
            own[place] = READING_SD_K**2
    x = onto @ np.append(start.temperatures, 0.0)
    spread = np.append(start.sd, start.heat_sd_W)
    return np.column_stack([(onto * spread**2) @ onto.T + np.diag(own), x])


def _columns(values: Sequence[Floats], steps: int) -> Floats:
    return np.ascontiguousarray(np.stack(values, axis=1) if values else np.empty((steps, 0)), dtype=np.float64)
