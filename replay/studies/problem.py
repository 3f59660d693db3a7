"""Stored sessions as a calibration problem: frames, starts and observed channels as arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ingest.catalogue.channels import load
from ingest.events import SessionRecorded
from ingest.facts import Facts
from ingest.store import Store
from replay.engine.frame import InputFrame, Observation
from replay.engine.frame_of import session_frame
from replay.engine.open_loop import initial_temperatures
from replay.errors import ReplayDataError
from twin.calibration import Channel, Problem, Recorded
from twin.network import Network
from twin.outputs import Output
from twin.simulate import Frame


def problem_of(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded], network: Network, level: str
) -> Problem:
    """The problem of a motor and sessions; `level` production leaves out what only a testing unit measures.

    Raises ReplayDataError where a session lacks an input, or no channel of it observes a node.
    """
    return Problem(network, tuple(_recorded(store, facts, session, network, level) for session in sessions))


def _recorded(store: Store, facts: Facts, session: SessionRecorded, network: Network, level: str) -> Recorded:
    frame = session_frame(session, load(store, facts, session), network)
    seen = [o for o in frame.observations if level in ("testing", o.level) and o.good.any()]
    if not seen:
        raise ReplayDataError(
            f"session {session.name}: no usable channel of level {level} observes a node of {network.name}: there is "
            "nothing to calibrate on. Say node = ... in the bench file, or leave the session out."
        )
    initial, sd = initial_temperatures(network, frame, level)
    return Recorded(
        frame=Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries),
        initial=initial,
        initial_sd=sd,
        channels=tuple(_channel(o, frame) for o in seen),
    )


def _channel(o: Observation, frame: InputFrame) -> Channel:
    samples = np.where(o.good & frame.live, o.samples, 0).astype(np.float64)
    return Channel(
        name=o.channel,
        output=Output(weights=o.weights, time_constant_s=o.time_constant_s, samples=samples, place=o.place),
        measured=o.measured,
        white_sd=o.noise,
        resolution=o.resolution,
        bias_sd=o.bias_sd,
    )
