"""Every observed channel beside the model, of a run that has just been made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Meter, Observation
from replay.engine.results.open_loop import metered, modelled, referenced
from replay.engine.results.run import Metered, Observed
from twin.motor.network import Network
from twin.run.losses import HeatFlows

Floats = NDArray[np.float64]


def observed_of(o: Observation, frame: InputFrame, temperatures: Floats, nodes: tuple[str, ...]) -> Observed:
    """A thermometer beside the run's `temperatures` (N + 1, n) of `nodes`."""
    return Observed(
        **_steps(o, frame, modelled(o, frame, temperatures, nodes)),
        node=o.sensor.label,
        sd_K=_sd_of_mean(o),
        bias_sd_K=o.sensor.bias_sd,
    )


def metered_of(
    meter: Meter,
    frame: InputFrame,
    network: Network,
    temperatures: Floats,
    flows: HeatFlows,
    begins: Mapping[str, float],
) -> Metered:
    """Another meter beside the run's `temperatures` (N + 1, n) and heats; `begins`: node -> temperature at start."""
    what, seen = referenced(meter, begins), meter.seen
    return Metered(
        **_steps(seen, frame, metered(meter, what, frame, network, temperatures, flows)),
        quantity=what.quantity,
        unit=what.unit,
        place="motor" if what.quantity == "power" else what.boundary or seen.sensor.label,
        sd=_sd_of_mean(seen),
        bias_sd=seen.sensor.bias_sd,
        gain_sd=what.gain_sd,
    )


def _steps(o: Observation, frame: InputFrame, modelled: Floats) -> dict[str, Any]:
    """What all observed channels have, of the steps in which there is a sample. `modelled` (N,)."""
    there = np.isfinite(o.measured)
    return {
        "channel": o.sensor.name,
        "t_ns": (frame.t_ns[:-1] + np.round(o.place * np.diff(frame.t_ns)).astype(np.int64))[there],
        "measured": o.measured[there],
        "modelled": modelled[there],
        "used": (o.good & frame.live)[there],
        "first_record": o.first_record[there],
        "last_record": o.last_record[there],
        "raw": o.raw[there],
    }


def _sd_of_mean(o: Observation) -> float:
    """One standard deviation of the mean of a step's samples, by noise and resolution."""
    per_step = float(np.median(o.samples[o.good])) if o.good.any() else 1.0
    return float(np.hypot(o.sensor.noise, o.sensor.resolution / 12**0.5) / per_step**0.5)
