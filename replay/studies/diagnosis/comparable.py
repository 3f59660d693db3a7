"""Kept sessions as far as they can be compared: by what was learnt from; all else of them is named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ingest.facts.events import SessionRecorded
from replay.studies.diagnosis.answer import Masked
from replay.studies.diagnosis.kept_sessions import node_of
from twin.fitting.model import Test


@dataclass(frozen=True)
class Comparable:
    """The kept sessions with something to compare, one of `tests` each; `left_out`: what is not compared, and why."""

    sessions: tuple[SessionRecorded, ...]
    tests: tuple[Test, ...]
    left_out: tuple[Masked, ...]


def comparable(kept: Sequence[SessionRecorded], tests: Sequence[Test], learnt: Sequence[Test]) -> Comparable:
    """The kept sessions with the channels and meters that `learnt` has too: of others nobody knows how they err."""
    known = {c.name for test in learnt for c in (*test.channels, *test.meters)}
    sure = [_of(test, known) for test in tests]
    pairs = [(session, test) for session, test in zip(kept, sure, strict=True) if test.channels]
    left_out = [
        Masked(session=session.session, session_name=session.name, channel=channel, says=f"{channel} {why}")
        for session, own, test in zip(kept, tests, sure, strict=True)
        for channel, why in ([*_unknown(own, known), *_missing(test, learnt)] if test.channels else _nothing(own))
    ]
    return Comparable(tuple(s for s, _ in pairs), tuple(t for _, t in pairs), tuple(left_out))


def _of(test: Test, known: set[str]) -> Test:
    channels = tuple(c for c in test.channels if c.name in known)
    return replace(test, channels=channels, meters=tuple(m for m in test.meters if m.name in known))


def _unknown(test: Test, known: set[str]) -> Iterator[tuple[str, str]]:
    for c in (*test.channels, *test.meters):
        if c.name not in known:
            yield c.name, "is in no session that was learnt from: not compared"


def _nothing(test: Test) -> Iterator[tuple[str, str]]:
    """Why a session that has no channel of those learnt from is not compared: said of its first channel."""
    first, *others = (c.name for c in (*test.channels, *test.meters))
    more = f"and {len(others)} more are" if others else "is"
    why = f"{more} in no session that was learnt from: nothing of this session is compared"
    yield first, f"{why}. Sensors that only have another name here are told by [[change]] in the bench file"


def _missing(test: Test, learnt: Sequence[Test]) -> Iterator[tuple[str, str]]:
    """What was learnt from at places where this session has nothing to compare with."""
    there = {node_of(c) for c in test.channels}
    for c in {c.name: c for other in learnt for c in other.channels}.values():
        if node_of(c) not in there:
            yield c.name, f"has no usable sample in this session: {node_of(c)} is not compared"
