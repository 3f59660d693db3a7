"""Where a channel's residual began: the first session, bench file or motor file, and the ledger's events around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.morning.changes import Change, changes
from ingest.texts.names import handle
from ingest.texts.nearest import hint
from replay.engine.files.benches import with_bench_of
from replay.engine.files.configurations import whole_motor
from replay.engine.files.models import model_of
from replay.errors import ReplayDataError
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import test_of
from replay.studies.since.acting import Acting, Fitted, Since, acting, driven, fitted
from twin.diagnosis.crudeness import crudeness
from twin.diagnosis.onset import Onsets, weighed
from twin.diagnosis.refined import Tell
from twin.fitting.model import Model
from twin.fitting.noise import Series

CAUSES = 5  # that are told
MOST = 6  # versions of the motor file, the last ones


@dataclass(frozen=True)
class Began:
    """A cause and a set of sessions in which it acts, said by `since`, with probability; `amplitude` with `sd` in its
    unit at features of 1 (of a factor its logarithm)."""

    cause: str
    since: tuple[str, ...]
    probability: float
    amplitude: float
    sd: float


@dataclass(frozen=True)
class Residual:
    """What a channel reads beyond the model in the mean of a session [K]: as published, and with everything healthy
    fitted (None where it has no usable sample); `probability` that something acts there."""

    session: SessionRecorded
    published_K: float | None
    fitted_K: float | None
    probability: float


@dataclass(frozen=True)
class MotorVersion:
    """A version of the motor file, and the mean error of the channel over all sessions with it [K], nothing fitted;
    None where it cannot run them."""

    model: str
    mae_K: float | None


@dataclass(frozen=True)
class Bisected:
    """Where the residual of a channel began. `none`: probability that nothing did; `since` as of `SeenMotor`; `causes`
    the most probable pairs of cause and set; `before` and `first`: the sessions between which it most probably began,
    None where that is before the first or nothing began; `changed` between them; the motor's `versions`; how far
    the file's numbers had to move, over what is usual (`twin.diagnosis.crudeness`)."""

    channel: str
    specimen: str | None
    motor: str
    model: str
    residuals: tuple[Residual, ...]
    none: float
    since: tuple[Since, ...]
    causes: tuple[Began, ...]
    before: SessionRecorded | None
    first: SessionRecorded | None
    changed: tuple[Change, ...]
    versions: tuple[MotorVersion, ...]
    crudeness: float


def sessions_of(facts: Facts, only: Sequence[SessionRecorded], specimen: str | None) -> list[SessionRecorded]:
    """The sessions to look in: those given, or all of the one motor that there is, of one specimen. Raises
    ReplayDataError where there are several."""
    motors = {
        facts.models[bench.model].motor for one in facts.sessions if (bench := facts.bench_of(one)) and bench.model
    }
    every = [one for motor in sorted(motors) for one in driven(facts, motor)]
    chosen = [one for one in only or every if specimen in (None, one.specimen)]
    specimens = sorted({one.specimen or "none given" for one in chosen})
    if len(specimens) > 1:
        raise ReplayDataError(f"sessions of {len(specimens)} specimens ({', '.join(specimens)}): say --specimen.")
    if len(chosen) < 2:
        there = {one.specimen for one in every if one.specimen}
        if specimen is not None and specimen not in there:
            raise ReplayDataError(f"--specimen {specimen}: no session here is of it.{hint(specimen, there)}")
        of = f" of specimen {specimen}" if specimen else ""
        found = f"{len(chosen)} session{'s' * (len(chosen) != 1)}"
        raise ReplayDataError(f"{found}{of} to look in: where something began needs two at least.")
    return chosen


def bisect(
    store: Store,
    facts: Facts,
    channel: str,
    sessions: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    tell: Tell,
) -> Bisected:
    """Weigh every candidate that moves the channel, from each session on and wherever an attribute, a bench file or a
    motor file is the same; the model is that of the last session where none is given.

    Raises ReplayDataError where no session has the channel, or they are too short to be fitted."""
    model = model or model_of(facts, sessions[-1])
    read = fitted(store, facts, sessions, model, level, tell, channel)
    when = acting(facts, sessions)
    tell("weighing where it began")
    told = weighed(read.fit, read.campaign.candidates, when.sets, channel)
    by_set = told.by_set()
    began = int(by_set.argmax())
    first = int(np.flatnonzero(when.sets[began])[0]) if told.none < 0.5 else 0
    before = sessions[first - 1] if first else None
    tell("running earlier versions of the motor file")
    return Bisected(
        channel=channel,
        specimen=sessions[0].specimen,
        motor=read.campaign.network.name,
        model=model,
        residuals=tuple(_residuals(read, channel, (by_set @ when.sets).tolist())),
        none=told.none,
        since=when.ordered(by_set.tolist()),
        causes=tuple(_causes(when, told)),
        before=before,
        first=sessions[first] if before else None,
        changed=tuple(changes(store, facts, before, sessions[first])) if before else (),
        versions=_versions(store, facts, sessions, model, level, channel),
        crudeness=crudeness(read.fit, read.fit.model.parameters),
    )


def _residuals(read: Fitted, channel: str, probability: Sequence[float]) -> Iterator[Residual]:
    model = read.fit.model
    published = mean_of(model.residuals(np.zeros(len(model.parameters))), channel)
    fitted_K = mean_of(read.fit.series, channel)
    for number, session in enumerate(read.sessions):
        yield Residual(session, published.get(number), fitted_K.get(number), probability[number])


def mean_of(series: Sequence[Series], channel: str) -> dict[int, float]:
    """Session -> mean residual of a channel [K]."""
    return {one.session: float(one.y.mean()) for one in series if one.channel == channel and one.y.size}


def _causes(when: Acting, told: Onsets) -> Iterator[Began]:
    order = np.argsort(-told.probability, axis=None, kind="stable")[:CAUSES]
    for h, c in zip(*np.unravel_index(order, told.probability.shape), strict=True):
        yield Began(
            cause=str(told.candidates[c].cause),
            since=when.says[h],
            probability=float(told.probability[h, c]),
            amplitude=float(told.amplitude[h, c]),
            sd=float(told.sd[h, c]),
        )


def _versions(
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
    network = whole_motor(store, facts, model)
    try:
        with fitting(f"model {handle(model)}"):
            then = with_bench_of(facts, model)
            tests = [test_of(store, then, one, network, (), level) for one in sessions]
            series = Model(network, tests, ()).residuals(np.zeros(0))
    except ReplayDataError:
        return None
    errors = [np.abs(one.y) for one in series if one.channel == channel]
    return float(np.concatenate(errors).mean()) if errors else None
