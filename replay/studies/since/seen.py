"""Which other sessions of a store carry the signature of a diagnosis' cause, and since when."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.sessions import order
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.errors import ReplayDataError
from replay.studies.diagnosis.answer import Diagnosis, Named
from replay.studies.since.acting import Since, acting, driven, fitted
from twin.diagnosis.onset import AS_KNOWN, KnownSize, weighed
from twin.diagnosis.refined import Tell


@dataclass(frozen=True)
class SeenSession:
    """A session and how probable it is that the cause acts in it; whether the diagnosis learnt from it."""

    session: SessionRecorded
    probability: float
    learnt_from: bool


@dataclass(frozen=True)
class SeenMotor:
    """A specimen's sessions in order; `probability` that it has the cause at all. `since`: what says the sets of
    sessions in which it acts, if it does, with their probabilities, the most probable first. `amplitude` with `sd` in
    the cause's unit at features of 1 (of a factor its logarithm), of the most probable set; None where no reading of
    these sessions would move."""

    specimen: str | None
    sessions: tuple[SeenSession, ...]
    probability: float
    since: tuple[Since, ...]
    amplitude: float | None
    sd: float | None


@dataclass(frozen=True)
class SeenElsewhere:
    """The `motors` that were asked for a cause of a diagnosis; `not_asked`: a line for each that could not be."""

    diagnosis: Diagnosis
    cause: Named
    motors: tuple[SeenMotor, ...]
    not_asked: tuple[str, ...]


def cause_of(found: Diagnosis, wanted: str | None) -> Named:
    """The cause of a diagnosis that is asked for, its first with a size where none is. Raises ReplayDataError with what
    there is."""
    name = f"diagnosis d-{handle(found.diagnosis)}"
    sized = [one for one in found.causes if one.stands is not None]
    if not found.causes:
        raise ReplayDataError(f"{name} names no cause: there is nothing to look for.")
    if not sized:
        ids = ", ".join(one.id for one in found.causes)
        raise ReplayDataError(f"{name} names {ids}, which has no size that another session could show.")
    chosen = [one for one in sized if wanted in (None, one.id)]
    if not chosen:
        raise ReplayDataError(f"{name} names no {wanted} with a size: it has {', '.join(one.id for one in sized)}.")
    return chosen[0]


def seen(
    store: Store, facts: Facts, found: Diagnosis, cause: Named, only: Sequence[SessionRecorded], tell: Tell
) -> SeenElsewhere:
    """Every motor of the store that is called as the diagnosed one, a fit each, or the sessions `only`. Raises
    ReplayDataError where there is none."""
    by_specimen: defaultdict[str | None, list[SessionRecorded]] = defaultdict(list)
    for session in sorted(only, key=order) or driven(facts, found.motor):
        by_specimen[session.specimen].append(session)
    motors, not_asked = [], []
    for specimen, sessions in by_specimen.items():
        called = specimen or "sessions without a specimen"
        tell(f"reading the sessions of {called}")
        try:
            motors.append(_asked(store, facts, found, cause, sessions, tell))
        except ReplayDataError as error:
            not_asked.append(f"{called}: not asked: {error}")
    if not motors:
        raise ReplayDataError(not_asked[0] if not_asked else f"no session of a {found.motor} in this store.")
    motors.sort(key=lambda one: -one.probability)
    return SeenElsewhere(found, cause, tuple(motors), tuple(not_asked))


def _asked(
    store: Store, facts: Facts, found: Diagnosis, cause: Named, sessions: Sequence[SessionRecorded], tell: Tell
) -> SeenMotor:
    assert cause.stands is not None, "a cause without a size is refused before"
    read = fitted(store, facts, sessions, found.model, found.level, tell)
    when = acting(facts, sessions)
    rivals = [one for one in read.campaign.candidates if str(one.cause) not in cause.indistinguishable_from]
    told = weighed(read.fit, rivals, when.sets, known={cause.id: KnownSize(cause.stands.amplitude, AS_KNOWN)})
    at, in_session = told.place(cause.id), told.in_test(cause.id)
    own = tuple(
        SeenSession(session, float(p), session.session in found.train)
        for session, p in zip(sessions, in_session, strict=True)
    )
    if at is None:
        return SeenMotor(sessions[0].specimen, own, 0.0, (), None, None)
    probability = told.probability[:, at]
    best = int(probability.argmax())
    return SeenMotor(
        specimen=sessions[0].specimen,
        sessions=own,
        probability=float(probability.sum()),
        since=when.ordered(probability.tolist()),
        amplitude=float(told.amplitude[best, at]),
        sd=float(told.sd[best, at]),
    )
