"""Open loop: the model driven by the inputs alone, never by the temperatures that it is compared with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame import InputFrame, Observation
from twin.initial import steady_interpolation
from twin.network import Network
from twin.outputs import followed, lagged

Floats = NDArray[np.float64]

FIRST_S = 10.0  # a channel that says nothing in this time sets no initial temperature


def initial_temperatures(network: Network, frame: InputFrame, level: str) -> tuple[Floats, Floats]:
    """Temperatures (n,) [degC] at the first edge and their prior sd (n,) [K]: measured where a channel of this level is,
    elsewhere the network's steady interpolation (twin.initial)."""
    measured, weights = _first_measured(frame, level)
    return steady_interpolation(network, frame.features[0], frame.boundaries[0], measured, weights)


def _first_measured(
    frame: InputFrame, level: str
) -> tuple[dict[str, tuple[float, float]], dict[str, dict[str, float]]]:
    """node -> (temperature, sd) of the channels that follow it by more than half, and for those that follow others too, node -> what
    they follow; means where there are several."""
    steps = max(1, round(FIRST_S / frame.step_s))
    seen: dict[str, list[tuple[float, float, Mapping[str, float]]]] = {}
    for o in frame.observations:
        node, good = followed(o.weights), np.flatnonzero(o.good[:steps])
        if node and good.size and level in ("testing", o.level):
            reading = (float(o.measured[good[0]]), float(np.hypot(o.noise, o.bias_sd)), o.weights)
            seen.setdefault(node, []).append(reading)
    measured = {
        node: (float(np.mean([v for v, _, _ in own])), float(np.mean([sd for _, sd, _ in own])) / len(own) ** 0.5)
        for node, own in seen.items()
    }
    weights = {
        node: {other: sum(w.get(other, 0.0) for _, _, w in own) / len(own) for _, _, mixed in own for other in mixed}
        for node, own in seen.items()
    }
    return measured, {node: own for node, own in weights.items() if len(own) > 1}


def modelled(observation: Observation, frame: InputFrame, temperatures: Floats, nodes: tuple[str, ...]) -> Floats:
    """What the channel would read, (N,) [degC]: weighted nodes, through the sensor's known lag, at the samples' mean time.

    `temperatures` (N + 1, n). The lag is first order, exact for a temperature that is linear within a step.
    """
    at = [nodes.index(node) for node in observation.weights]
    truth: Floats = temperatures[:, at] @ np.array(list(observation.weights.values()))
    reading = lagged(truth, observation.time_constant_s, frame.step_s)
    return reading[:-1] + observation.place * np.diff(reading)
