"""Where the heat of a run comes from and where it goes to, step by step, and the efficiency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.results.run import HeatCourse
from replay.engine.results.summary import Efficiency
from twin.motor.network import Network
from twin.run.losses import HeatFlows, by_kind

Floats = NDArray[np.float64]


def heat_course(network: Network, flows: HeatFlows) -> HeatCourse:
    """The losses by kind and what each boundary takes, step by step."""
    return HeatCourse(
        kinds=by_kind(network, flows),
        boundaries={b.name: flows.boundaries[i] for i, b in enumerate(network.boundaries)},
    )


def efficiency_of(frame: InputFrame, flows: HeatFlows) -> Efficiency | None:
    """The efficiency of a run; None where torque or speed is not known or nothing was given out."""
    if frame.mechanical_W is None:
        return None
    modelled = efficiency(frame.mechanical_W + flows.made, frame.mechanical_W)
    if modelled is None:
        return None
    electrical = electrical_W(frame)
    return Efficiency(
        modelled=modelled,
        measured=None if electrical is None else efficiency(electrical, frame.mechanical_W),
        mechanical_J=float(frame.mechanical_W.sum()) * frame.step_s,
    )


def electrical_W(frame: InputFrame) -> Floats | None:
    """The recorded electrical power of each step (N,), NaN where there is none; None without one channel of it."""
    observed = [meter.seen.measured for meter in frame.meters if meter.what.quantity == "power"]
    given = [values for name, values in frame.inputs.items() if name == "power_W"]
    return (observed + given)[0] if len(observed + given) == 1 else None


def efficiency(electrical_W: Floats, mechanical_W: Floats) -> float | None:
    """Energy out over energy in of two powers (N,), each signed: electrical into the terminals, mechanical out of the
    shaft. None where nothing goes out."""
    known = np.isfinite(electrical_W)
    into = np.maximum(electrical_W, 0.0)[known] + np.maximum(-mechanical_W, 0.0)[known]
    out = np.maximum(mechanical_W, 0.0)[known] + np.maximum(-electrical_W, 0.0)[known]
    return float(out.sum() / into.sum()) if into.sum() > 0 and out.sum() > 0 else None
