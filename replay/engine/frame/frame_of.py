"""A session's input frame as every run and study takes it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from ingest.texts.quantities import STORED_UNIT, column_suffix
from replay.engine.frame import frame as frames
from replay.engine.frame.frame import InputFrame
from replay.errors import ReplayDataError
from twin.compiled.integrators import DEFAULT
from twin.motor.features import beyond, monomials, placed_terms
from twin.motor.network import Map, Network

DC_CHECK = "dc_check"
DIRECT = {"current_dc": "current", "voltage_dc": "voltage"}  # what a DC check feeds the phases with
AT_REST = ("speed", "torque", "current_q", "flux")  # 0 in a stator that is fed so: axis d lies along the current


def session_frame(
    session: SessionRecorded,
    channels: Sequence[ChannelData],
    network: Network,
    given: Mapping[str, float] | None = None,
) -> InputFrame:
    """The frame of a session's channels for a network, samples of bad quality masked; its note also says how often a
    map of the network was left. `given`: features that are one number in the session (`replay.engine.specimen.aged`).
    Raises ReplayDataError, with the session's name, where it lacks an input."""
    channels = as_fed(session, channels, network)
    good = [found.good for found in quality.assess(channels)]
    try:
        frame = frames.build(channels, good, network, monomials(network), DEFAULT.step_s, given)
    except ReplayDataError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
    notes = [note for note in (frame.note, *beyond_maps(network, frame)) if note]
    return replace(frame, note="; ".join(notes) or None)


def as_fed(session: SessionRecorded, channels: Sequence[ChannelData], network: Network) -> list[ChannelData]:
    """The channels of a session as the motor was fed. In a DC check `current_dc` is the phases' current and
    `voltage_dc` their voltage; speed is 0, and so are torque, q current and flux where the network or an observed power
    needs them: each where no input of that quantity is recorded."""
    if session.kind != DC_CHECK:
        return list(channels)
    given = {c.spec.quantity for c in channels if c.spec.role == "input"}
    renamed = {direct: phase for direct, phase in DIRECT.items() if phase not in given}
    found = [replace(c, spec=replace(c.spec, quantity=renamed.get(c.spec.quantity, c.spec.quantity))) for c in channels]
    current = next((c for c in found if (c.spec.role, c.spec.quantity) == ("input", "current")), None)
    if current is not None:
        needed = {"speed", *(feature for m in monomials(network) for feature in m.features)}
        if any((c.spec.role, c.spec.quantity) == ("observed", "power") for c in found):
            needed.add("torque")
        found += [_zero(current, quantity) for quantity in AT_REST if quantity in needed - given]
    return found


def _zero(like: ChannelData, quantity: str) -> ChannelData:
    """A channel of 0 at another one's stamps."""
    unit = STORED_UNIT[quantity]
    spec = replace(like.spec, name=f"standstill_{quantity}", quantity=quantity, unit=unit, resolution=None, noise=0.0)
    return replace(like, spec=spec, value=np.zeros_like(like.value), read=None)


def beyond_maps(network: Network, frame: InputFrame) -> Iterator[str]:
    """A line for each map that the session's step means leave, with the share of time."""
    for place, term in placed_terms(network):
        if not isinstance(term.shape, Map):
            continue
        columns = {feature: feature + column_suffix(feature) for feature in ("speed", term.shape.over)}
        if all(column in frame.inputs for column in columns.values()):
            u = {feature: frame.inputs[column] / network.scale[feature] for feature, column in columns.items()}
            share = float(beyond(term.shape, u).mean())
            if share > 0:
                yield f"{100 * share:.3g} % of the time outside the map of {place}: its edge was taken"
