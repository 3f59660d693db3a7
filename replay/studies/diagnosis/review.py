"""A change of motor and bench file to be signed: what it replaces, and what it does to every recorded reading."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.facts.events import CauseAccepted, SessionRecorded
from ingest.facts.facts import Facts, at
from ingest.facts.ledger_row import Recorded
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.results.run import Observed, Run
from replay.engine.results.sealed import load_run
from replay.engine.runs.campaign import replay_sessions
from replay.studies.diagnosis.accept import find_diagnosis, would_accept
from replay.studies.diagnosis.answer import Diagnosis
from replay.studies.diagnosis.formulas import text_diff

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Replaced:
    """A file that another takes the place of: "motor file" or "bench file", both SHA-256, and their unified diff."""

    what: str
    old: str
    new: str
    diff: str


@dataclass(frozen=True)
class ReviewedReading:
    """A channel of a session: mean absolute error [K] against its readings as recorded, over `steps`, `before` the
    change and `after` it (None where the motor file stays, or runs away); `runs` that say so, and where the readings
    lie: records `first` to `last` of `log`."""

    session: SessionRecorded
    kept: bool
    channel: str
    node: str
    steps: int
    before_K: float
    after_K: float | None
    runs: tuple[str, ...]
    log: str
    first: int
    last: int


@dataclass(frozen=True)
class ReviewedKind:
    """All sessions of a kind, kept ones apart: of a node the mean errors as of `ReviewedReading`."""

    kind: str
    kept: bool
    node: str
    sessions: int
    before_K: float
    after_K: float | None


@dataclass(frozen=True)
class Review:
    """The change of a diagnosis: `causes` that go into the files, `accepted` by which event (None: offered only),
    `replaced` files, and what they do to `readings`; `built_on`: what else was made with its motor file since, in
    words."""

    diagnosis: Diagnosis
    causes: tuple[str, ...]
    accepted: Recorded | None
    replaced: tuple[Replaced, ...]
    sessions: tuple[SessionRecorded, ...]
    readings: tuple[ReviewedReading, ...]
    built_on: tuple[str, ...]

    def by_kind(self) -> list[ReviewedKind]:
        """In the order of the sessions, those learnt from first; means over all steps."""
        groups: dict[tuple[bool, str, str], list[ReviewedReading]] = {}
        for one in sorted(self.readings, key=lambda one: one.kept):
            groups.setdefault((one.kept, one.session.kind, one.node), []).append(one)
        return [_of_kind(own) for own in groups.values()]


def review(store: Store, text: str, tell: Tell) -> Review:
    """The change that a diagnosis made or offers; its sessions are replayed with both motor files, where the ledger
    does not have these runs. Raises ReplayDataError where it changes no file."""
    facts = at(store.ledger)
    found = find_diagnosis(store, facts, text)
    events, accepted = _events(store, found)
    pairs = [("motor file", one.parent, one.model) for one in events]
    pairs += [("bench file", one.parent_bench, one.bench) for one in events]
    sessions = [facts.session(one) for one in (*found.train, *found.held_out)]
    model = next((one.model for one in events if one.model), None)
    runs = [_runs(store, sessions, one, found.level, tell) for one in (found.model, model) if one]
    return Review(
        diagnosis=found,
        causes=tuple(events[0].causes),
        accepted=accepted,
        replaced=tuple(
            Replaced(what, old, new, text_diff(store.archive.read(old), store.archive.read(new)))
            for what, old, new in pairs
            if old and new
        ),
        sessions=tuple(sessions),
        readings=tuple(one for session in sessions for one in _readings(facts, found, session, runs)),
        built_on=tuple(_built_on(facts, model, found)) if model else (),
    )


def _events(store: Store, found: Diagnosis) -> tuple[list[CauseAccepted], Recorded | None]:
    """What was accepted last, and the event that says so; what would be where nothing was."""
    recorded = store.ledger.events(CauseAccepted, stream=f"diagnosis-{found.diagnosis}")
    events = [one.event for one in recorded if isinstance(one.event, CauseAccepted)]
    if not events:
        return would_accept(store, found), None
    return [one for one in events if one.causes == events[-1].causes], recorded[-1]


def _runs(store: Store, sessions: Sequence[SessionRecorded], model: str, level: str, tell: Tell) -> dict[str, Run]:
    """Session -> its run with a model."""
    outcomes = replay_sessions(store, sessions, model, level, None, tell)
    facts = at(store.ledger)
    return {one.session.session: load_run(store, facts, one.run) for one in outcomes if one.run}


def _built_on(facts: Facts, model: str, own: Diagnosis) -> Iterator[str]:
    """What stands that was made with a motor file, or with one that was made from it, beside the replays of the
    diagnosis' `own` sessions: the review makes these itself."""
    made = {model}
    while more := {one.model for one in facts.models.values() if one.parent in made} - made:
        made |= more
    asked = {*own.train, *own.held_out}
    if replays := sum(one.model in made and one.session not in asked for one in facts.runs.values()):
        yield f"{replays} replay{'s' * (replays != 1)} of other sessions"
    for one in facts.calibrations.values():
        if one.parent in made:
            yield f"calibration {handle(one.calibration)}"
    for key, completed in facts.diagnoses.items():
        if key != own.diagnosis and completed.key.get("model") in made:
            yield f"diagnosis d-{handle(key)}"


def _readings(
    facts: Facts, found: Diagnosis, session: SessionRecorded, runs: Sequence[dict[str, Run]]
) -> list[ReviewedReading]:
    own = [of_model[session.session] for of_model in runs if session.session in of_model]
    if not own or session.session not in runs[0]:
        return []
    after = {one.channel: one for one in own[1].observed} if len(own) > 1 else {}
    names = [facts.files[file["raw"]].name for file in session.files]
    return [
        _reading(
            session, session.session in found.held_out, one, after.get(one.channel), names, [run.run for run in own]
        )
        for one in own[0].observed
        if one.usable.any()
    ]


def _reading(
    session: SessionRecorded,
    kept: bool,
    before: Observed,
    after: Observed | None,
    logs: Sequence[str],
    runs: Sequence[str],
) -> ReviewedReading:
    """The reading as recorded is that of the run before the change: a new bench file may correct it."""
    there = before.usable
    modelled = None if after is None else np.interp(before.t_ns[there], after.t_ns, after.modelled)
    at_first = int(np.flatnonzero(there)[0])
    of_log = there & (before.raw == before.raw[at_first])
    return ReviewedReading(
        session=session,
        kept=kept,
        channel=before.channel,
        node=before.node,
        steps=int(there.sum()),
        before_K=float(np.abs(before.residual[there]).mean()),
        after_K=None if modelled is None else float(np.abs(before.measured[there] - modelled).mean()),
        runs=tuple(runs),
        log=logs[int(before.raw[at_first])],
        first=int(before.first_record[at_first]),
        last=int(before.last_record[of_log][-1]),
    )


def _of_kind(own: Sequence[ReviewedReading]) -> ReviewedKind:
    steps = [one.steps for one in own]
    after = [one.after_K for one in own if one.after_K is not None]
    return ReviewedKind(
        kind=own[0].session.kind,
        kept=own[0].kept,
        node=own[0].node,
        sessions=len({one.session.session for one in own}),
        before_K=float(np.average([one.before_K for one in own], weights=steps)),
        after_K=float(np.average(after, weights=steps)) if len(after) == len(own) else None,
    )
