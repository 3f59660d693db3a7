"""What each version of a motor file gets wrong of one channel: a residual may have begun with a version."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.files.bench_versions import with_bench_of
from replay.engine.files.motor_file import read_motor
from replay.errors import ReplayDataError
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import test_of
from twin.fitting.model import Model
from twin.motor.configured import configured

MOST = 6  # versions, the last ones


@dataclass(frozen=True)
class MotorVersion:
    """A version of the motor file, and the mean error of the channel over all sessions with it [K], nothing fitted;
    None where it cannot run them."""

    model: str
    mae_K: float | None


def versions(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str, level: str, channel: str
) -> tuple[MotorVersion, ...]:
    """The motor file and those that it was made from, the first one first."""
    line = [model]
    while (parent := facts.models[line[-1]].parent) and parent in facts.models and parent not in line:
        line.append(parent)
    return tuple(MotorVersion(one, _mae(store, facts, sessions, one, level, channel)) for one in reversed(line[:MOST]))


def _mae(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str, level: str, channel: str
) -> float | None:
    network = configured(read_motor(store.archive.read(model), facts.models[model].file), None)
    try:
        with fitting(f"model {handle(model)}"):
            then = with_bench_of(facts, model)
            tests = [test_of(store, then, one, network, (), level) for one in sessions]
            series = Model(network, tests, ()).residuals(np.zeros(0))
    except ReplayDataError:
        return None
    errors = [np.abs(one.y) for one in series if one.channel == channel]
    return float(np.concatenate(errors).mean()) if errors else None
