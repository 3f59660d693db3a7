"""What was computed from facts that are others by now: taken back, corrected, or joined by a late log.

An answer is stale where its sessions, their logs, or what these are read with are not those that it was computed from,
or where it began from a model that is stale itself. Once the same was asked again it is history, and no more stale; so
it is where what asking again would give is recorded already, as a replay with the file that is current again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ingest.facts.events import (
    AgeingAssessed,
    CalibrationCompleted,
    CauseAccepted,
    DecodeCompleted,
    DiagnosisCompleted,
    ModelExtended,
    ReplayCompleted,
    SessionRecorded,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.texts.names import handle
from replay.engine.files.benches import MADE
from replay.studies.ageing.assess import is_of_now

Answer = ReplayCompleted | CalibrationCompleted | DiagnosisCompleted | AgeingAssessed
KINDS = {
    ReplayCompleted: "replay",
    CalibrationCompleted: "calibration",
    DiagnosisCompleted: "diagnosis",
    AgeingAssessed: "ageing",
}


@dataclass(frozen=True)
class Stale:
    """An answer that is not of what stands now. `name` of it; `why`: what is other; `sessions`, `kept`: ids of those
    that it is of now; `model`: the one to begin from, None for the one that the bench file names now."""

    event: Answer
    name: str
    why: str
    sessions: tuple[str, ...]
    kept: tuple[str, ...]
    model: str | None

    @property
    def kind(self) -> str:
        return KINDS[type(self.event)]


class StaleAnswers(NamedTuple):
    """`answers`: in the order in which they were computed; `in_use`: a line for each accepted diagnosis whose files are
    current though it is stale, asked again or not; `answered`: what is stale, and would be again what is recorded."""

    answers: Sequence[Stale]
    in_use: Sequence[str]
    answered: Sequence[Stale] = ()


class _Asked(NamedTuple):
    """What an answer was asked for: `key` as it was stored, but of an assessment, which is of all sessions; the `model`
    that it began from."""

    name: str
    key: Mapping[str, Any]
    model: str
    sessions: Sequence[str]
    kept: Sequence[str] = ()


def stale(recorded: Iterable[Recorded], facts: Facts) -> StaleAnswers:
    """All that is stale; `facts` follow from `recorded`."""
    events = list(recorded)
    look = _Look(facts, events)
    found: dict[Any, Stale] = {}
    standing = [one.event for one in events if one.stream not in facts.retractions]
    for event in standing:
        if isinstance(event, Answer):
            look.at(event, found)
    current = {*facts.successors.values()}
    accepted = [one for one in standing if isinstance(one, CauseAccepted) and {one.model, one.bench} & current]
    in_use = [look.in_use(one) for one in accepted if one.diagnosis in look.whys]
    return StaleAnswers([*found.values()], list(dict.fromkeys(in_use)), [*look.answered.values()])


def became_stale(recorded: Iterable[Recorded], before: Facts, after: Facts) -> StaleAnswers:
    """What is stale by the facts `after` and was not by those `before`, or for another reason."""
    events = list(recorded)
    was, now = stale(events, before), stale(events, after)
    known = {(id(one.event), one.why) for one in (*was.answers, *was.answered)}

    def fresh(found: Sequence[Stale]) -> list[Stale]:
        return [one for one in found if (id(one.event), one.why) not in known]

    in_use = [line for line in now.in_use if line not in was.in_use]
    return StaleAnswers(fresh(now.answers), in_use, fresh(now.answered))


class _Look:
    """The answers of a ledger looked at in turn: `models` are those that are stale by then, and why."""

    def __init__(self, facts: Facts, events: Sequence[Recorded]) -> None:
        self.facts = facts
        self.current = {session.session: session for session in facts.sessions}
        self.names = {one.event.session: one.event.name for one in events if isinstance(one.event, SessionRecorded)}
        self.first = _first_versions(facts)
        self.motors = _motors(events)
        self.extended = [one.event for one in events if isinstance(one.event, ModelExtended)]
        self.whys: dict[str, str] = {}  # stale diagnosis -> why
        self.of_now: set[Any] = set()  # questions, each with the model of an answer that is not stale
        self.answered: dict[Any, Stale] = {}
        back = (model for one in facts.retractions.values() for model in one.event.models)
        self.back = {model: f"model {handle(model)} was taken back" for model in back}
        self.models = dict(self.back)

    def at(self, event: Answer, found: dict[Any, Stale]) -> None:
        """Add `event` to `found` if it is stale; what it answers anew is found no more."""
        asked = self._asked(event)
        now, kept = self._now(asked.sessions), self._now(asked.kept)
        question = (type(event), now, kept, asked.key.get("level")) if asked.key else type(event)
        found.pop(question, None)
        why = self.back.get(asked.model) or self._why([*asked.sessions, *asked.kept], asked)
        why = why or self.models.get(asked.model)
        if isinstance(event, AgeingAssessed) and not is_of_now(self.facts, event):
            why = why or "sessions came, or are others by now"
        if why is None:
            self.of_now.add((question, asked.model))
            return
        self.models |= dict.fromkeys(self._made(event), f"{asked.name} is stale")
        if isinstance(event, DiagnosisCompleted):
            self.whys[event.diagnosis] = why
        begins = self._begins(asked)
        one = Stale(event, asked.name, why, now, kept, begins)
        if (question, begins or self._named(now)) in self.of_now:
            self.answered[question] = one
        elif now or not isinstance(event, ReplayCompleted):  # a replay of what is gone is gone
            found[question] = one

    def in_use(self, accepted: CauseAccepted) -> str:
        files = [
            f"{what} {handle(one)}" for what, one in (("model", accepted.model), ("bench file", accepted.bench)) if one
        ]
        name = f"d-{handle(accepted.diagnosis)}"
        return f"{' and '.join(files)}, accepted from {name}: {self.whys[accepted.diagnosis]}"

    def _asked(self, event: Answer) -> _Asked:
        match event:
            case ReplayCompleted():
                return _Asked(f"replay of {self._name(event.session)}", event.key, event.model, [event.session])
            case CalibrationCompleted():
                return _Asked(f"calibration {handle(event.calibration)}", event.key, event.parent, event.sessions)
            case DiagnosisCompleted():
                key = event.key
                name, sessions = f"diagnosis d-{handle(event.diagnosis)}", key.get("train", [])
                return _Asked(name, key, key.get("model", ""), sessions, key.get("kept", []))
            case AgeingAssessed():
                return _Asked("assessment of the ageing", {}, event.key.get("motor") or "", event.sessions)

    def _name(self, session: str) -> str:
        return self.names.get(session, handle(session))

    def _now(self, sessions: Iterable[str]) -> tuple[str, ...]:
        """What sessions became, those that are gone left out."""
        became = dict.fromkeys(self.facts.became(session) for session in sessions)
        return tuple(session for session in became if session in self.current)

    def _why(self, sessions: Sequence[str], asked: _Asked) -> str | None:
        """What is other than it was computed from, None where nothing is."""
        key = asked.key
        is_run = "bench" in key  # it depends on what its session holds, not on which it is
        for session in sessions:
            now = self.facts.became(session)
            if now not in self.current:
                return f"{self._name(session)} was taken back"
            if now != session and not is_run:
                return f"{self._name(session)} is now session {handle(now)}"
        its = [self.current[self.facts.became(session)] for session in sessions]
        told: tuple[tuple[str, Iterable[str], Callable[[SessionRecorded], set[str]]], ...] = (
            ("holds other logs", key.get("raw", ()), lambda one: {decode.raw for decode in self._read(one)}),
            (
                "is read with another bench file",
                map(self._first, _benches(key)),
                lambda one: {self._first(one.bench)} if one.bench else set(),
            ),
            (
                "is read with other signal databases",
                key.get("databases", ()),
                lambda one: {sha256 for decode in self._read(one) for sha256 in decode.databases},
            ),
            (
                "was decoded by another version",
                key.get("decoder", ()),
                lambda one: {d.decoder for d in self._read(one)},
            ),
        )
        for what, then, of in told:
            old = {*then}
            if key and old != {value for one in its for value in of(one)}:
                return _are([one.name for one in its if not of(one) <= old] or [one.name for one in its], what)
        if other := [one.name for one in its if key and asked.model in self._motors_before(one)]:
            return _are(other, "is read with another motor file")
        known = key.get("decodes")  # keys of before had none
        other = [one.name for one in its if known is not None and not {d.decode for d in self._read(one)} <= {*known}]
        return _are(other, "is read with other files") if other else None

    def _read(self, session: SessionRecorded) -> list[DecodeCompleted]:
        return [self.facts.decodes[file["decode"]] for file in session.files]

    def _motors_before(self, session: SessionRecorded) -> set[str]:
        """The motor files, as accepted too, that its logs were read beside before, and are not now."""
        before = {model for file in session.files for model in self.motors.get(file["raw"], ())}
        now = {session.model} if session.model else before
        return {*before, *map(self.facts.current, before)} - {*now, *map(self.facts.current, now)}

    def _first(self, bench: str) -> str:
        """The bench file that this one is a version of."""
        seen = {bench}
        while bench in self.first and self.first[bench] not in seen:
            bench = self.first[bench]
            seen.add(bench)
        return bench

    def _begins(self, asked: _Asked) -> str | None:
        """None where the model was only what the bench file named; the last before the stale ones where that, as it was
        accepted since, is stale."""
        named = [self.facts.benches.get(self._first(one)) for one in _benches(asked.key)]
        given = [one.model for one in named if one and one.model]
        usual = [*given, *map(self.facts.current, given)]
        its = [self.current[one] for one in self._now([*asked.sessions, *asked.kept])]
        before = {model for one in its for model in self._motors_before(one)}
        if {*usual}.isdisjoint(self.models) and asked.model in (*usual, *self.models, *before):
            return None
        return next((one for one in (asked.model, *given) if one and one not in self.models), None)

    def _named(self, sessions: Sequence[str]) -> str | None:
        """The model that the bench file of these sessions names now."""
        benches = [self.facts.benches.get(self._first(self.current[one].bench or "")) for one in sessions]
        return next((self.facts.current(one.model) for one in benches if one and one.model), None)

    def _made(self, event: Answer) -> Iterator[str]:
        """The models that an answer published."""
        match event:
            case CalibrationCompleted():
                yield event.model
            case DiagnosisCompleted():
                yield from event.summary.get(MADE, {}).get("of_model", {}).keys() - {event.key.get("model")}
                yield from (one.model for one in self.extended if one.diagnosis == event.diagnosis and one.model)


def _benches(key: Mapping[str, Any]) -> list[str]:
    """The bench files of a key: a run has one."""
    found = key.get("benches", [key.get("bench")])
    return [one for one in found if one]


def _are(names: Sequence[str], what: str) -> str:
    """ "a and b are read with another bench file now"."""
    verb, rest = what.split(" ", 1)
    verb = {"is": "are", "was": "were", "holds": "hold"}[verb] if len(names) > 1 else verb
    return f"{', '.join(names[:-1])}{' and ' if names[1:] else ''}{names[-1]} {verb} {rest} now"


def _motors(events: Iterable[Recorded]) -> dict[str, set[str]]:
    """Log -> the motor files that it was ever read beside."""
    found: dict[str, set[str]] = {}
    for one in events:
        if isinstance(one.event, DecodeCompleted) and one.event.model:
            found.setdefault(one.event.raw, set()).add(one.event.model)
    return found


def _first_versions(facts: Facts) -> dict[str, str]:
    """Version of a bench file -> the one that it was made from, by all diagnoses that stand."""
    made = {new: old for old, new in facts.successors.items() if old in facts.benches}
    for completed in facts.diagnoses.values():
        for versions in completed.summary.get(MADE, {}).get("of_model", {}).values():
            if isinstance(versions, dict):
                made |= {new: old for old, new in versions.items() if new != old}
    return made
