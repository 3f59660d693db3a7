"""Meters of power and heat as a filter reads them: all losses, or what a boundary takes, with an error of its own.

Whatever such a meter shows beyond the model, a filter would take for the one heat that it seeks. But the meter may be
wrong, and so may the model's other losses. As much as the bench file says of the meter and the motor file of its losses
and links is therefore added twice: to the variance of each step, where it changes with the operating point, and as an
unknown that wanders.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Meter
from twin.filters.inputs import HeatReading
from twin.filters.unknowns import UnknownBias
from twin.motor.network import Network
from twin.motor.observables import lagged_means
from twin.run.losses import HeatFlows

Floats = NDArray[np.float64]

WANDERS_S = 60.0  # in which the error wanders by its own size: the operating point has changed
LEAST_W = 1.0


def heat_readings(
    meters: Sequence[Meter], network: Network, frame: InputFrame, flows: HeatFlows, node: str
) -> list[tuple[HeatReading, UnknownBias]]:
    """Of each meter of power or heat that has a sample: its reading, and the unknown that is its error. `flows`: heats
    of the open loop. The loss of `node`, where the filter seeks the unknown heat, counts as no error."""
    return [_reading(m, network, frame, flows, node) for m in meters if m.what.law is None and m.seen.good.any()]


def _reading(
    meter: Meter, network: Network, frame: InputFrame, flows: HeatFlows, node: str
) -> tuple[HeatReading, UnknownBias]:
    o, what = meter.seen, meter.what
    if what.boundary is None:
        assert frame.mechanical_W is not None  # `replay.engine.frame.meters` refuses a power without
        value, modelled, model_sd = o.measured - frame.mechanical_W, flows.made, _of_losses(network, flows, node)
    else:
        value, modelled = o.measured, flows.boundaries[[b.name for b in network.boundaries].index(what.boundary)]
        model_sd = _of_links(network, what.boundary) * np.abs(modelled)
    there = o.good & frame.live
    sd = np.sqrt(o.sensor.bias_sd**2 + (what.gain_sd * o.measured) ** 2 + model_sd**2)
    # fast power, read at other moments than torque and speed, scatters more than the meter's own noise
    beyond = (value - lagged_means(modelled, o.sensor.time_constant_s, frame.step_s))[there]
    scatter = max(float(np.mean(np.diff(beyond) ** 2)) / 2 if beyond.size > 1 else 0.0, o.sensor.noise**2, LEAST_W**2)
    size = max(float(np.sqrt(np.mean(sd[there] ** 2))) if there.any() else 0.0, LEAST_W)
    reading = HeatReading(
        channel=o.sensor.name, value=np.where(there, value, np.nan), variance=scatter + sd**2, boundary=what.boundary
    )
    return reading, UnknownBias(o.sensor.name, size, size / np.sqrt(WANDERS_S))


def _of_losses(network: Network, flows: HeatFlows, node: str) -> Floats:
    """Standard deviation (N,) [W] of all losses but those of `node`, by the `sd` of each term in the motor file."""
    open_ = [0.0 if source.node == node else term.sd for source in network.sources for term in source.terms]
    found: Floats = np.sqrt(((np.array(open_)[:, None] * flows.terms) ** 2).sum(axis=0))
    return found


def _of_links(network: Network, boundary: str) -> float:
    """Relative standard deviation of the heat that a boundary takes: the largest `sd` of its links in the motor file; 0
    for the inlet of a circuit, which has none."""
    links = (link for link in network.links if boundary in (link.a, link.b))
    return max((term.sd for link in links for term in link.terms), default=0.0)
