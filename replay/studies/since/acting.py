"""The sessions of one specimen as one fit, and the sets of them in which a cause may act."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.catalogue.kinds import NO_DRIVE
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from ingest.texts.nearest import hint
from replay.engine.files.benches import with_bench_of
from replay.engine.files.models import model_of
from replay.errors import ReplayDataError
from replay.studies.diagnosis.question import LEAST_S, Campaign, Question, campaign_of
from replay.studies.sessions.fitting import fitting
from twin.diagnosis.onset import Sets, from_each_on
from twin.diagnosis.refined import Tell, calibrated
from twin.fitting.fit import Fit

NOT_GIVEN = "not given"


def driven(facts: Facts, motor: str) -> list[SessionRecorded]:
    """The sessions of a motor, by its name, that a twin of the whole motor can run, in the order of the catalogue."""
    return [one for one in facts.sessions if _is_whole(one) and _motor_of(facts, one) == motor]


def _is_whole(session: SessionRecorded) -> bool:
    return session.configuration is None and session.kind not in NO_DRIVE


def _motor_of(facts: Facts, session: SessionRecorded) -> str | None:
    try:
        return facts.models[model_of(facts, session)].motor
    except ReplayDataError:
        return None


@dataclass(frozen=True)
class Fitted:
    """Sessions of one specimen, read, and the fit of a healthy motor to them."""

    sessions: Sequence[SessionRecorded]
    campaign: Campaign
    fit: Fit


def fitted(
    store: Store,
    facts: Facts,
    sessions: Sequence[SessionRecorded],
    model: str,
    level: str,
    tell: Tell,
    channel: str | None = None,
) -> Fitted:
    """The fit that a diagnosis begins with. Raises ReplayDataError where sessions are too short, lack what the model
    needs, or have no `channel` that is asked about, before anything is fitted."""
    _refuse_short(sessions)
    with fitting(f"{sessions[0].name} with model {handle(model)}"):
        campaign = campaign_of(Question(store, with_bench_of(facts, model), sessions, [], model, level))
        if channel is not None:
            _refuse_unknown(campaign, channel)
        return Fitted(sessions, campaign, calibrated(campaign.healthy, campaign.candidates, tell))


def _refuse_unknown(campaign: Campaign, channel: str) -> None:
    known = list(dict.fromkeys(one.name for test in campaign.tests for one in test.channels))
    if channel not in known:
        others = hint(channel, known) or f" These do: {', '.join(known)}."
        raise ReplayDataError(f"{channel}: observes no node in these sessions.{others}")


def _refuse_short(sessions: Sequence[SessionRecorded]) -> None:
    length_s = sum(one.end_ns - one.start_ns for one in sessions) / 1e9
    if length_s < LEAST_S:
        names = ", ".join(one.name for one in sessions)
        raise ReplayDataError(
            f"{names}: {int(length_s / 60)} min together, too short to tell: at least {LEAST_S / 60:.0f} are needed."
        )


@dataclass(frozen=True)
class Since:
    """What says a set of sessions, the least specific first, and how probable it is that a cause acts in exactly
    them."""

    says: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Acting:
    """Sets of sessions in which a cause may act (h, t), the first of them all, and what says each: "since 3_s1", and
    attributes, bench files and motor files that exactly these sessions have."""

    sets: Sets
    says: tuple[tuple[str, ...], ...]

    def ordered(self, probability: Sequence[float]) -> tuple[Since, ...]:
        """The sets with their probabilities, the most probable first."""
        every = (Since(says, p) for says, p in zip(self.says, probability, strict=True))
        return tuple(sorted(every, key=lambda one: -one.probability))


def acting(facts: Facts, sessions: Sequence[SessionRecorded]) -> Acting:
    """From each session on, and wherever an attribute, a bench file or a motor file is the same."""
    said: dict[tuple[bool, ...], list[str]] = {}
    for number, row in enumerate(from_each_on(len(sessions))):
        said[tuple(row.tolist())] = [f"since {sessions[number].name}" if number else "in all sessions"]
    for says, row in _alike(facts, sessions):
        if any(row) and not all(row):
            said.setdefault(row, []).append(says)
    return Acting(np.array(list(said), dtype=np.bool_), tuple(map(tuple, said.values())))


def _alike(facts: Facts, sessions: Sequence[SessionRecorded]) -> Iterator[tuple[str, tuple[bool, ...]]]:
    """What some of the sessions share, in words, and which of them do."""
    marks = [_marks(facts, one) for one in sessions]
    for key in dict.fromkeys(key for own in marks for key in own):
        for value in dict.fromkeys(own.get(key, NOT_GIVEN) for own in marks):
            yield f"{key} = {value}", tuple(own.get(key, NOT_GIVEN) == value for own in marks)


def _marks(facts: Facts, session: SessionRecorded) -> dict[str, str]:
    """The attributes of a session, its bench file and its motor file."""
    bench = facts.bench_of(session)
    files = {} if bench is None else {"bench file": f"{bench.name} {bench.sha256[:8]}"}
    if bench is not None and bench.model:
        files["motor file"] = f"{bench.motor} {bench.model[:8]}"
    return dict(session.attributes) | files
