"""When sessions leave the tables of a motor's maps, said by every verb that learns or predicts from them."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.catalogue.channels import load
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.frame.frame_of import beyond_maps, session_frame
from replay.engine.specimen.aged import hours_of
from twin.motor.features import terms
from twin.motor.network import Map


def maps_left(store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str) -> list[str]:
    """A line for each session and map of `model` (SHA-256 of a motor file) whose table its inputs leave. Sessions are
    read for a motor with maps only. Raises ReplayDataError where one lacks an input."""
    found = []
    for session in sessions:
        network = network_of(store, facts, session, model)
        if any(isinstance(term.shape, Map) for term in terms(network)):
            hours = hours_of(store, facts, session, network)
            frame = session_frame(session, load(store, facts, session), network, hours)
            found += [f"session {session.name}: {line}." for line in beyond_maps(network, frame)]
    return found
