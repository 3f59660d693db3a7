"""Open loop: the model driven by the inputs alone, never by the temperatures that it is compared with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame import InputFrame, Observation
from twin.initial import steady_interpolation
from twin.network import Network
from twin.outputs import lagged

Floats = NDArray[np.float64]

FIRST_S = 10.0  # a channel that says nothing in this time sets no initial temperature


def initial_temperatures(network: Network, frame: InputFrame, level: str) -> tuple[Floats, Floats]:
    """Temperatures (n,) [degC] at the first edge and their prior sd (n,) [K]: measured where a channel of this level is,
    elsewhere the network's steady interpolation (twin.initial)."""
    return steady_interpolation(network, frame.features[0], frame.boundaries[0], _first_measured(frame, level))


def _first_measured(frame: InputFrame, level: str) -> Mapping[str, tuple[float, float]]:
    """node -> (temperature, sd). A channel that is a mean of several nodes sets none of them."""
    steps = max(1, round(FIRST_S / frame.step_s))
    seen: dict[str, list[tuple[float, float]]] = {}
    for o in frame.observations:
        if len(o.weights) == 1 and level in ("testing", o.level):
            good = np.flatnonzero(o.good[:steps])
            if good.size:
                seen.setdefault(o.label, []).append((float(o.measured[good[0]]), float(np.hypot(o.noise, o.bias_sd))))
    return {
        node: (
            float(np.mean([v for v, _ in readings])),
            float(np.mean([sd for _, sd in readings])) / len(readings) ** 0.5,
        )
        for node, readings in seen.items()
    }


def modelled(observation: Observation, frame: InputFrame, temperatures: Floats, nodes: tuple[str, ...]) -> Floats:
    """What the channel would read, (N,) [degC]: weighted nodes, through the sensor's known lag, at the samples' mean time.

    `temperatures` (N + 1, n). The lag is first order, exact for a temperature that is linear within a step.
    """
    at = [nodes.index(node) for node in observation.weights]
    truth: Floats = temperatures[:, at] @ np.array(list(observation.weights.values()))
    reading = lagged(truth, observation.time_constant_s, frame.step_s)
    return reading[:-1] + observation.place * np.diff(reading)
