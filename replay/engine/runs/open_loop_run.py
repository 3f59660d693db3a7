"""A session run open loop with a model, and what was observed beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame
from replay.engine.results.compared import metered_of, observed_of
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import initial_temperatures
from replay.engine.results.run import Metered, Observed
from replay.engine.specimen.aged import OfSpecimen
from replay.errors import ReplayDataError
from twin.compiled.integrators import DEFAULT, INTEGRATORS, Tableau
from twin.errors import TwinError
from twin.motor.network import Network
from twin.run.losses import HeatFlows, heat_flows
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

MELTED_DEGC = 2000.0  # no motor is hotter, or colder below: the model or an input is wrong by orders of magnitude


@dataclass(frozen=True)
class OpenLoop:
    """A session run open loop. `recorded`: its channels; `start`: temperatures at the first edge and their sd (n,);
    `temperatures` (N + 1, n) by the `integrator` asked for, `reference` by the default one; `flows`: heats of the
    latter; `observed`, `meters`: what was recorded beside the run."""

    session: SessionRecorded
    model: str
    level: str
    integrator: str
    specimen: OfSpecimen
    recorded: Sequence[ChannelData]
    frame: InputFrame
    inputs: Frame
    start: tuple[Floats, Floats]
    reference: Floats
    temperatures: Floats
    flows: HeatFlows
    observed: tuple[Observed, ...]
    meters: tuple[Metered, ...]

    @property
    def network(self) -> Network:
        return self.specimen.network

    @property
    def nodes(self) -> tuple[str, ...]:
        return tuple(node.name for node in self.network.nodes)


def run_of(
    session: SessionRecorded,
    model: str,
    level: str,
    integrator: str,
    specimen: OfSpecimen,
    recorded: Sequence[ChannelData],
) -> OpenLoop:
    """The run of a session from its `recorded` channels, with the network of its specimen. `integrator`: one of
    `twin.compiled.integrators.INTEGRATORS`. Raises ReplayDataError where an input is missing or the model runs away."""
    network = specimen.network
    frame = session_frame(session, recorded, network, specimen.hours)
    start = initial_temperatures(network, frame, level)
    inputs = Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries)
    reference = _simulated(network, inputs, start[0], session, DEFAULT)
    method = INTEGRATORS[integrator]
    temperatures = reference if method is DEFAULT else _simulated(network, inputs, start[0], session, method)
    flows = heat_flows(network, inputs, reference)
    nodes = tuple(node.name for node in network.nodes)
    begins = dict(zip(nodes, start[0].tolist(), strict=True))
    return OpenLoop(
        session=session,
        model=model,
        level=level,
        integrator=integrator,
        specimen=specimen,
        recorded=recorded,
        frame=frame,
        inputs=inputs,
        start=start,
        reference=reference,
        temperatures=temperatures,
        flows=flows,
        observed=tuple(observed_of(o, frame, temperatures, nodes) for o in frame.observations),
        meters=tuple(metered_of(m, frame, network, temperatures, flows, begins) for m in frame.meters),
    )


def _simulated(network: Network, inputs: Frame, initial: Floats, session: SessionRecorded, method: Tableau) -> Floats:
    try:
        temperatures = simulate(load_kernel(network, method), inputs, initial)
    except TwinError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
    hot = np.argwhere(np.abs(temperatures) > MELTED_DEGC)
    if hot.size:
        step, node = (int(i) for i in hot[0])
        raise ReplayDataError(
            f'session {session.name}: node "{network.nodes[node].name}" of the model is beyond {MELTED_DEGC:,.0f} '
            f"degC at {step * inputs.step_s:,.0f} s: check its losses and links in the motor file, and the units of "
            "the inputs."
        )
    return temperatures
