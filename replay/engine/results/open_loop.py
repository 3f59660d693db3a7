"""Open loop: the model driven by the inputs alone, never by the temperatures that it is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Meter, Observation
from twin.motor.network import Network
from twin.motor.observables import Measurand, lagged_means
from twin.motor.outputs import lagged
from twin.run.initial import steady_interpolation
from twin.run.losses import HeatFlows

Floats = NDArray[np.float64]

FIRST_S = 10.0  # a channel that says nothing in this time sets no initial temperature


def initial_temperatures(network: Network, frame: InputFrame, level: str) -> tuple[Floats, Floats]:
    """Temperatures (n,) [degC] at the first edge and their prior sd (n,) [K]: measured where a channel of this level
    is, elsewhere the network's steady interpolation (twin.run.initial)."""
    measured, weights, _ = _first_measured(frame, level)
    return steady_interpolation(network, frame.features[0], frame.boundaries[0], measured, weights)


def initial_by_reading(network: Network, frame: InputFrame, level: str) -> dict[str, Floats]:
    """Channel -> what 1 K of its reading adds to the initial temperatures (n,) [K/K]; they are linear in it."""
    measured, weights, names = _first_measured(frame, level)
    found: dict[str, Floats] = {}
    for node, channels in names.items():
        one = {other: (float(other == node), sd) for other, (_, sd) in measured.items()}
        moved, _ = steady_interpolation(network, frame.features[0], np.zeros_like(frame.boundaries[0]), one, weights)
        found |= {channel: moved / len(channels) for channel in channels}
    return found


def _first_measured(
    frame: InputFrame, level: str
) -> tuple[dict[str, tuple[float, float]], dict[str, dict[str, float]], dict[str, list[str]]]:
    """What the channels of a level say of the start: node -> (temperature, sd), means of the channels that follow it by
    more than half; node -> their weights, where they follow other nodes too; and node -> their names."""
    steps = max(1, round(FIRST_S / frame.step_s))
    seen: dict[str, list[tuple[float, float, Mapping[str, float]]]] = {}
    names: dict[str, list[str]] = {}
    for o in frame.observations:
        node, good = o.sensor.followed, np.flatnonzero(o.good[:steps])
        if node and good.size and level in ("testing", o.sensor.level):
            reading = (float(o.measured[good[0]]), float(np.hypot(o.sensor.noise, o.sensor.bias_sd)), o.sensor.weights)
            seen.setdefault(node, []).append(reading)
            names.setdefault(node, []).append(o.sensor.name)
    measured = {
        node: (float(np.mean([v for v, _, _ in own])), float(np.mean([sd for _, sd, _ in own])) / len(own) ** 0.5)
        for node, own in seen.items()
    }
    weights = {
        node: {other: sum(w.get(other, 0.0) for _, _, w in own) / len(own) for _, _, mixed in own for other in mixed}
        for node, own in seen.items()
    }
    return measured, {node: own for node, own in weights.items() if len(own) > 1}, names


def modelled(observation: Observation, frame: InputFrame, temperatures: Floats, nodes: tuple[str, ...]) -> Floats:
    """What the channel would read, (N,) [degC], at the samples' mean time: weighted nodes of `temperatures` (N + 1, n)
    through the sensor's known lag, of first order, exact for a temperature that is linear within a step."""
    truth = np.zeros(len(temperatures))
    # no product of matrices: BLAS adds in an order of the processor's
    for node, share in observation.sensor.weights.items():
        truth += share * temperatures[:, nodes.index(node)]
    reading = lagged(truth, observation.sensor.time_constant_s, frame.step_s)
    return reading[:-1] + observation.place * np.diff(reading)


def referenced(meter: Meter, initial: Mapping[str, float]) -> Measurand:
    """What a meter measures, with a reference: where the bench file gives none, its first good sample is what it reads
    at the `initial` temperatures (node -> degC)."""
    law, good = meter.what.law, np.flatnonzero(meter.seen.good)
    if law is None or meter.what.referenced or not good.size:
        return meter.what
    begins = sum(share * initial[node] for node, share in meter.seen.sensor.weights.items())
    return replace(meter.what, law=law.through(float(meter.seen.measured[good[0]]), begins), referenced=True)


def metered(
    meter: Meter, what: Measurand, frame: InputFrame, network: Network, temperatures: Floats, flows: HeatFlows
) -> Floats:
    """What the meter would read, (N,) in the unit of its quantity; a power or heat is the mean over the step. `what`:
    its measurand with a reference; `temperatures` (N + 1, n), `flows` the run's heats."""
    if what.law is not None:
        return what.law.reading(modelled(meter.seen, frame, temperatures, tuple(node.name for node in network.nodes)))
    if what.boundary is not None:
        heat: Floats = flows.boundaries[[b.name for b in network.boundaries].index(what.boundary)]
    else:
        assert frame.mechanical_W is not None  # `replay.engine.frame.meters` refuses a power without
        heat = frame.mechanical_W + flows.made
    return lagged_means(heat, meter.seen.sensor.time_constant_s, frame.step_s)
