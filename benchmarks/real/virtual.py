"""A virtual sensor: what filter and smoother say of a node that they do not read."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts.events import SessionRecorded
from replay.engine.files.motor_file import read_motor
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame
from replay.engine.frame.observations import Observation
from replay.engine.results.filtered import Estimated, filter_session, mean_losses
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import initial_temperatures, modelled
from replay.studies.diagnosis.as_recorded import under
from replay.studies.diagnosis.extension import Version
from replay.studies.diagnosis.question import Question
from twin.motor.configured import configured
from twin.motor.network import Network
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

BAND = 1.96  # standard deviations to 95 %


@dataclass(frozen=True)
class Sensed:
    """Mean absolute errors of the open loop from the same start, of filter and of smoother against the reading as
    recorded [K], and the share of the time in which it lies within the smoother's 95 % band, the sensor's own error
    included."""

    open_loop: float
    filter: float
    smoother: float
    coverage: float


def sensed(question: Question, version: Version, session: SessionRecorded, node: str) -> Sensed:
    """Of the one channel that follows a node, from all others, under a version of the motor and bench file."""
    store, facts = question.store, question.facts
    network = configured(read_motor(store.archive.read(version.motor), facts.models[question.model].file), None)
    recorded = session_frame(session, load(store, facts, session), network)
    frame = session_frame(session, load(store, under(question, version), session), network)
    others = [o for o in frame.observations if o.sensor.followed != node]
    inputs = Frame(frame.step_s, frame.features, frame.boundaries)
    begun, _ = initial_temperatures(network, replace(frame, observations=tuple(others)), "testing")
    open_loop = simulate(load_kernel(network), inputs, begun)
    losses = mean_losses(network, inputs, open_loop)
    found = filter_session(network, frame, losses, "testing", measured=[o.sensor.name for o in others])
    assert found is not None  # the motor has a rotor
    return _against(_of(recorded, node), open_loop, found, frame, network, node)


def _of(frame: InputFrame, node: str) -> Observation:
    return next(o for o in frame.observations if o.sensor.followed == node)


def _against(
    recorded: Observation, open_loop: Floats, found: Estimated, frame: InputFrame, network: Network, node: str
) -> Sensed:
    """An estimate against a reading as recorded."""
    nodes = tuple(n.name for n in network.nodes)
    own, there = _of(frame, node), recorded.good & frame.live
    assert found.smoothed is not None
    alone, filtered, smoothed = (
        (recorded.measured - modelled(own, frame, one, nodes))[there]
        for one in (open_loop, found.temperatures, found.smoothed.temperatures)
    )
    sensor = own.sensor
    sd = np.hypot(found.smoothed_sd_K[1:, nodes.index(node)], np.hypot(sensor.noise, sensor.bias_sd))[there]
    inside = float(np.mean(np.abs(smoothed) <= BAND * sd))
    means = [float(np.abs(one).mean()) for one in (alone, filtered, smoothed)]
    return Sensed(open_loop=means[0], filter=means[1], smoother=means[2], coverage=inside)
