"""What a gain is against readings as recorded: the kept sessions replayed with the files that a diagnosis wrote.

A learnt correction of a sensor moves the ruler that errors are measured with. Here nothing is fitted on the kept
session, as in any replay, and the readings are those of the bench file as it was.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from replay.engine.files.motor_file import read_motor
from replay.studies.diagnosis.extension import Version
from replay.studies.diagnosis.kept_sessions import Measured, node_of
from replay.studies.diagnosis.question import Question
from replay.studies.sessions.recorded import test_of
from twin.fitting.actions import Late, Slowed
from twin.fitting.fit import Fit
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.configured import configured
from twin.motor.sensor_laws import SensorLaw

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class AsRecorded:
    """By channel that has samples, over all kept sessions: `residual` (B,) [K] the reading as recorded less the model,
    block means; `moved` [K] what the bench file's corrections add to the reading, in the mean."""

    residual: Mapping[str, Floats]
    moved: Mapping[str, float]


def as_recorded(
    question: Question, version: Version, sessions: Sequence[SessionRecorded], tests: Sequence[Test]
) -> AsRecorded:
    """Sessions under a version's motor and bench file; `tests`: them as the bench file says that they were decoded
    with. Raises `DivergedError` where the motor runs away."""
    facts = under(question, version)
    motor = read_motor(question.store.archive.read(version.motor), facts.models[question.model].file)
    network = configured(motor, None)
    corrected = [test_of(question.store, facts, session, network, (), question.level) for session in sessions]
    residual: defaultdict[str, list[Floats]] = defaultdict(list)
    moved: defaultdict[str, list[Floats]] = defaultdict(list)
    for test, own in zip(corrected, tests, strict=True):
        recorded = {c.name: _at_steps_of(test, own, c) for c in own.channels}
        both = [c for c in test.channels if c.name in recorded]
        for c in both:
            moved[c.name].append(_moved(c, recorded[c.name]))
        ruler = [_reading(c, recorded[c.name]) for c in both]
        for series in Model(network, [replace(test, channels=tuple(ruler))], ()).residuals(np.zeros(0)):
            residual[series.channel].append(series.y)
    seen = {name: np.concatenate(parts) for name, parts in residual.items() if any(part.size for part in parts)}
    return AsRecorded(seen, {name: float(np.concatenate(moved[name]).mean()) for name in seen})


def under(question: Question, version: Version) -> Facts:
    """The facts as if the bench files of a version were current."""
    facts = question.facts
    made = {new: replace(question.benches[old], sha256=new) for old, new in version.benches.items()}
    successors = {**facts.successors, **version.benches}
    return replace(facts, benches={**facts.benches, **made}, successors=successors)


def _at_steps_of(test: Test, own: Test, channel: RecordedChannel) -> RecordedChannel:
    """A channel of `own` over the steps of `test`, without samples where it has none: a corrected clock of a logger
    that records an input too lets the session begin and end otherwise."""
    step_s, steps = test.frame.step_s, len(channel.samples)
    at = np.arange(len(test.frame.features)) + round((test.start_ns - own.start_ns) / 1e9 / step_s)
    of = np.clip(at, 0, steps - 1)
    samples = np.where(at == of, channel.samples[of], 0.0)
    return replace(channel, measured=channel.measured[of], samples=samples, place=channel.place[of])


def _moved(corrected: RecordedChannel, recorded: RecordedChannel) -> Floats:
    """The corrected reading less the recorded one at each of its samples [K]; between samples of the recorded one, on
    a straight line."""
    at, known = np.flatnonzero(corrected.samples), np.flatnonzero(recorded.samples)
    if not known.size:
        return np.empty(0)
    moved: Floats = corrected.measured[at] - np.interp(at, known, recorded.measured[known])
    return moved


def _reading(corrected: RecordedChannel, recorded: RecordedChannel) -> RecordedChannel:
    """The reading as recorded at the place, and with the lag, of the corrected one."""
    return replace(corrected, measured=recorded.measured, samples=recorded.samples)


def measured_as_recorded(
    kept: Measured, tests: Sequence[Test], runs: Mapping[str, AsRecorded], said_wrong: Collection[str]
) -> Measured:
    """The gain over the kept `tests` with errors against readings as recorded beside it, and improved only where these
    get no worse. `runs`: `published`, `before` and `after` (with what was named), as far as there are files;
    `said_wrong`: channels that a named cause says to read wrong, which as recorded prove nothing."""
    nodes = {c.name: node_of(c) for test in tests for c in test.channels}
    seen = set(nodes).intersection(*(run.residual for run in runs.values())) if runs else set()
    places = {channel: node for channel, node in nodes.items() if channel in seen}
    gain = []
    for one in kept.gain:
        own = [channel for channel, node in places.items() if node == one.node]
        recorded = {when: _mean(run, own) for when, run in runs.items()} if own else {}
        moved = float(np.mean([list(runs.values())[-1].moved[channel] for channel in own])) if own else 0.0
        gain.append(replace(one, mae_recorded_K=recorded, reading_moved_K=moved))
    kept = replace(kept, gain=tuple(gain))
    right = [channel for channel in places if channel not in said_wrong]
    if not (kept.improved and "after" in runs and right):
        return kept
    was, now = (_mean(runs[when], right) for when in ("before", "after"))
    if now <= was:
        return kept
    digits = next((n for n in range(2, 9) if round(was, n) != round(now, n)), 9)
    why = (
        f"a replay against the readings as recorded gets worse ({was:.{digits}f} -> {now:.{digits}f} K): the gain is "
        "that of what was learnt of the sensors"
    )
    return replace(kept, improved=False, why=why)


def _mean(run: AsRecorded, channels: Sequence[str]) -> float:
    """Mean absolute error over channels [K]."""
    return float(np.abs(np.concatenate([run.residual[channel] for channel in channels])).mean())


def said_wrong(base: Fit, final: Fit) -> set[str]:
    """Channels that a named term of `final` says to read wrong."""
    healthy = {(p.action, p.test) for p in base.model.parameters}
    found: set[str] = set()
    for action in (p.action for p in final.model.parameters if (p.action, p.test) not in healthy):
        match action:
            case SensorLaw(channel):
                found.add(channel)
            case Late(channels) | Slowed(channels):
                found.update(channels)
    return found
