"""A session's input frame as every run and study takes it."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData
from ingest.events import SessionRecorded
from replay.engine import frame as frames
from replay.engine.frame import InputFrame
from replay.errors import ReplayDataError
from twin.features import monomials
from twin.integrators import DEFAULT
from twin.network import Network


def session_frame(session: SessionRecorded, channels: Sequence[ChannelData], network: Network) -> InputFrame:
    """The frame of a session's channels for a network, samples of bad quality masked.

    Raises ReplayDataError, with the session's name, where it lacks an input.
    """
    good = [found.good for found in quality.assess(channels)]
    try:
        return frames.build(channels, good, network, monomials(network), DEFAULT.step_s)
    except ReplayDataError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
