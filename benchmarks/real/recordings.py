"""Recordings as the regressions take them: inputs and readings in blocks of 10 s, and the start that was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.motor_file import read_motor
from replay.engine.frame.frame_of import session_frame
from replay.studies.diagnosis.kept_sessions import node_of
from replay.studies.sessions.recorded import test_of
from twin.fitting.model import Test
from twin.motor.configured import configured
from twin.motor.outputs import BLOCK_S, Blocks

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """A session as the twin takes it (`test`), and as a regression does: `inputs` (B, k) means over blocks of 10 s, of
    what drives the motor and of the coolant and the ambient [degC]; `coolant` (B,) [degC]."""

    session: SessionRecorded
    test: Test
    inputs: Floats
    coolant: Floats

    @property
    def name(self) -> str:
        """The name of the session."""
        return self.session.name

    @cached_property
    def blocks(self) -> Mapping[str, Blocks]:
        """Node -> the blocks of its channel."""
        return {node_of(c): c.blocks(self.test.frame.step_s) for c in self.test.channels}

    @cached_property
    def readings(self) -> Mapping[str, Floats]:
        """Node -> what was read in those blocks that have samples [degC]."""
        return {node_of(c): self.blocks[node_of(c)].measured(c.measured) for c in self.test.channels}

    @cached_property
    def rises(self) -> Mapping[str, Floats]:
        """Node -> how far these readings are above the coolant [K]."""
        return {node: read - self.coolant[self.blocks[node].there] for node, read in self.readings.items()}

    @cached_property
    def start(self) -> Floats:
        """How far each node began above the coolant [K]: the same measured start that the twin gets."""
        start: Floats = self.test.initial - self.coolant[0]
        return start


def recordings(store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str) -> list[Recording]:
    """The sessions, read for a motor file whose first boundary is the coolant."""
    network = configured(read_motor(store.archive.read(model), facts.models[model].file), None)
    found = []
    for session in sessions:
        channels = load(store, facts, session)
        test = test_of(store, facts, session, network, (), "testing", loaded=channels)
        frame = session_frame(session, channels, network)
        every = np.column_stack([*frame.inputs.values(), frame.features, frame.boundaries])
        inputs = _means(every, round(BLOCK_S / frame.step_s))
        found.append(Recording(session, test, inputs, inputs[:, -frame.boundaries.shape[1]]))
    return found


def _means(of_step: Floats, length: int) -> Floats:
    """Means (B, k) over blocks of so many steps (N, k), whole blocks only."""
    whole = of_step[: len(of_step) // length * length]
    means: Floats = whole.reshape(-1, length, whole.shape[1]).mean(axis=1)
    return means
