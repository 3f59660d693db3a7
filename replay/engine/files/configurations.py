"""Which network a session is about: the motor of its model, in the configuration that its bench file names."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.motor_file import read_motor
from replay.errors import ReplayDataError
from twin.errors import ConfigurationError
from twin.motor.configured import configured
from twin.motor.network import Network


def network_of(store: Store, facts: Facts, session: SessionRecorded, model: str) -> Network:
    """The network that `model` (SHA-256 of a motor file in the archive) is in a session. Raises ReplayDataError where
    the motor file does not have the session's configuration."""
    whole = read_motor(store.archive.read(model), facts.models[model].file)
    try:
        return configured(whole, session.configuration)
    except ConfigurationError as error:
        raise ReplayDataError(f"session {session.name}: {error}.") from None


def whole_motor(store: Store, facts: Facts, model: str) -> Network:
    """The motor of `model` in no configuration."""
    return configured(read_motor(store.archive.read(model), facts.models[model].file), None)


def refuse_other_rigs(sessions: Sequence[SessionRecorded]) -> None:
    """Raises ReplayDataError where a session is not of the whole motor."""
    for session in sessions:
        if session.configuration is not None:
            raise ReplayDataError(
                f'session {session.name}: is of configuration "{session.configuration}", and this asks about the '
                "whole motor: leave it out here. `whyhot calibrate` learns from it together with sessions of the whole "
                "motor; go on with the model that it gives (--model)."
            )
