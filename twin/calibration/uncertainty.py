"""How uncertain a run is at single places and times, as its network and its start are not known exactly.

The exact derivatives of a node's block mean by every ln coefficient, ln capacity and initial temperature
(`twin.run.sparse_march`) are multiplied with the covariance of these: linear, so good as long as what is not known
moves the node by little. Errors of the network's form, of inputs and of boundaries are not in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.calibration.calibrate import freedom
from twin.fitting.model import Floats, Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.network import Network
from twin.motor.outputs import BLOCK_S
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

STEP_S = 2.0  # of a run for its derivatives: they need no more


def sd_K(network: Network, test: Test, at: Sequence[tuple[str, float]], covariance: Floats) -> tuple[float, ...]:
    """Standard deviation [K] of the temperature at each (node, time [s]) of a test, by `covariance` (P, P) of ln
    coefficients and ln capacities in the order of `twin.calibration.calibrate.freedom`, and the test's own
    `initial_sd`.

    Raises `DivergedError` where the network's own run leaves the finite numbers.
    """
    steps = len(test.frame.features)
    always, middle = np.ones(steps), np.full(steps, 0.5)
    channels = tuple(
        RecordedChannel(Sensor(str(i), {node: 1.0}, noise=0.1), np.zeros(steps), always, middle)
        for i, (node, _) in enumerate(at)
    )
    watched = replace(test, channels=channels, meters=())
    parameters = freedom(network, [replace(watched, channels=())])
    parts = Model(network, [watched], parameters).linearise(np.zeros(len(parameters)))
    shared = len(covariance)
    start = np.array([p.sd for p in parameters[shared:]])
    found = []
    for part, (_, time_s) in zip(parts, at, strict=True):
        moved = np.zeros(len(parameters))
        moved[part.at] = part.columns[min(int(time_s // BLOCK_S), len(part.columns) - 1)]
        own = moved[:shared]
        found.append(float(np.sqrt(own @ covariance @ own + ((moved[shared:] * start) ** 2).sum())))
    return tuple(found)


def coarse(frame: Frame, until_s: float) -> Frame:
    """The inputs of a run up to a time [s] as means over steps of `STEP_S`, in whole blocks; behind its end the last
    step goes on."""
    of_step = max(1, round(STEP_S / frame.step_s))
    length = of_step * max(1, round(BLOCK_S / (of_step * frame.step_s)))
    wanted = (int(until_s // (length * frame.step_s)) + 1) * length

    def means(values: Floats) -> Floats:
        whole = values[np.minimum(np.arange(wanted), len(values) - 1)]
        found: Floats = whole.reshape(-1, of_step, values.shape[1]).mean(axis=1)
        return np.ascontiguousarray(found)

    return Frame(frame.step_s * of_step, means(frame.features), means(frame.boundaries))
