"""A session's input frame as every run and study takes it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData
from ingest.events import SessionRecorded
from replay.engine import frame as frames
from replay.engine.frame import InputFrame
from replay.errors import ReplayDataError
from twin.features import beyond, monomials, placed_terms
from twin.integrators import DEFAULT
from twin.network import Map, Network

MAPPED = {"speed": "speed_rpm", "torque": "torque_Nm"}  # inputs of a map -> columns of the frame


def session_frame(session: SessionRecorded, channels: Sequence[ChannelData], network: Network) -> InputFrame:
    """The frame of a session's channels for a network, samples of bad quality masked; its note also says how often a map of the
    network was left.

    Raises ReplayDataError, with the session's name, where it lacks an input.
    """
    good = [found.good for found in quality.assess(channels)]
    try:
        frame = frames.build(channels, good, network, monomials(network), DEFAULT.step_s)
    except ReplayDataError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
    notes = [note for note in (frame.note, *_beyond_maps(network, frame)) if note]
    return replace(frame, note="; ".join(notes) or None)


def _beyond_maps(network: Network, frame: InputFrame) -> Iterator[str]:
    """A line for each map that the session's step means leave, with the share of time."""
    known = {f: column for f, column in MAPPED.items() if column in frame.inputs}
    for place, term in placed_terms(network):
        if isinstance(term.shape, Map) and len(known) == len(MAPPED):
            u = {feature: frame.inputs[column] / network.scale[feature] for feature, column in known.items()}
            share = float(beyond(term.shape, u).mean())
            if share > 0:
                yield f"{100 * share:.2g} % of the time outside the map of {place}: its edge was taken"
