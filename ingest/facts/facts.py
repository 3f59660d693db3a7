"""What is true now, or was as of an event or a time: the events folded."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar

from ingest.errors import UnknownSessionError
from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    CalibrationCompleted,
    CauseAccepted,
    ClockAligned,
    DecodeCompleted,
    DiagnosisCompleted,
    Event,
    HeldOutOpened,
    InspectionRecorded,
    ModelPublished,
    QualityFlagged,
    RawFileSealed,
    ReplayCompleted,
    SessionRecorded,
    SessionRegrouped,
    SignalDatabaseRegistered,
)
from ingest.facts.ledger_index import BEGINS
from ingest.facts.ledger_row import Recorded
from ingest.facts.lookups import Lookup, Sessions, View, Whole
from ingest.facts.sessions import order
from ingest.facts.standing import Retraction, RowsOfLog, holds, rows_of, standing
from ingest.texts.names import first_of
from ingest.texts.nearest import nearest

if TYPE_CHECKING:
    from ingest.facts.ledger import Ledger

E = TypeVar("E", bound=Event)
NAMED = 8  # sessions or logs of one name that a refusal lists


@dataclass(frozen=True)
class Facts:
    """What is true; where an event was recorded again, the latest counts."""

    files: Mapping[str, RawFileSealed]  # by SHA-256, as are databases and benches
    databases: Mapping[str, SignalDatabaseRegistered]
    benches: Mapping[str, BenchRegistered]
    models: Mapping[str, ModelPublished]  # by SHA-256 of the motor file
    decodes: Mapping[str, DecodeCompleted]  # by decode id, the latest last
    sessions: Sequence[SessionRecorded]  # by start (null last), then name with numbers as numbers
    joined: Mapping[str, str]  # old session id -> the one that it became part of
    old_names: Mapping[str, str]  # name that a session no longer has -> its id then
    runs: Mapping[str, ReplayCompleted]  # by run id
    flags: Mapping[str, Sequence[QualityFlagged]]  # by stream: session-<id> or file-<sha256>
    clocks: Mapping[str, ClockAligned]  # by session, clock and reference as "id/can2/can1", the latest last
    calibrations: Mapping[str, CalibrationCompleted]  # by the model that each published
    diagnoses: Mapping[str, DiagnosisCompleted]  # by diagnosis id, the latest last
    opened: Mapping[str, Sequence[str]]  # current session -> the diagnoses that opened it as a kept one
    successors: Mapping[str, str]  # model or bench file -> the version that was accepted in its place
    inspections: Mapping[str, InspectionRecorded]  # by inspection id, with the session that its own became part of
    assessments: Mapping[str, AgeingAssessed]  # by assessment id, the latest last
    retractions: Mapping[str, Retraction]  # what was taken back, by its stream
    gone_sessions: Mapping[str, SessionRecorded]  # by id, those that went with it, as they were last

    def bench_of(self, session: SessionRecorded) -> BenchRegistered | None:
        """The bench file of a session, or the version accepted in its place, with the motor file that lay beside it
        when the session's files came: the same bytes may lie beside another by now."""
        bench = self.benches.get(self.current(session.bench)) if session.bench else None
        named = self.models.get(session.model) if session.model else None
        return replace(bench, motor=named.motor, model=named.model) if bench and named else bench

    @property
    def gone(self) -> Sequence[RowsOfLog]:
        """Records of logs that were taken back: no session holds them."""
        return rows_of(self.retractions.values())

    def current(self, sha256: str) -> str:
        """A model or bench file, or what was accepted in its place (and in place of that)."""
        return _end(self.successors, sha256)

    def became(self, session: str) -> str:
        """The id that a session of this id is part of by now, its own where it is of none."""
        return _end(self.joined, session)

    def whole(self) -> Facts:
        """The same with nothing left to be read, for another process."""
        return self

    def last_sessions(self, count: int) -> tuple[Sequence[SessionRecorded], int]:
        """The last `count` sessions, and how many there are."""
        return self.sessions[-count:], len(self.sessions)

    def unread(self) -> dict[str, str | None]:
        """SHA-256 of each log in which nothing could be read, and why."""
        return _unread(self.decodes.values())

    def called(self, name: str) -> list[RawFileSealed]:
        """The logs of this name."""
        return [one for one in self.files.values() if one.name == name]

    def decodes_of(self, raw: str) -> list[DecodeCompleted]:
        """The decodes of a log, the latest last."""
        return [one for one in self.decodes.values() if one.raw == raw]

    def clocks_of(self, session: SessionRecorded) -> list[ClockAligned]:
        """What is known of the clocks of a session's loggers."""
        return [one for one in self.clocks.values() if one.session == session.session]

    def runs_of(self, session: SessionRecorded) -> list[ReplayCompleted]:
        """The replays of a session, the latest last."""
        return [one for one in self.runs.values() if one.session == session.session]

    def current_run(self, session: SessionRecorded) -> ReplayCompleted | None:
        """The last run of a session with the motor file that is current for it; with any, where there is none of
        that."""
        model = self.current(session.model) if session.model else None
        runs = self.runs_of(session)[::-1]
        return next((one for one in runs if one.model == model), next(iter(runs), None))

    def holding(self, raws: Collection[str]) -> list[SessionRecorded]:
        """The sessions with records of these logs, in order."""
        return [one for one in self.sessions if any(file["raw"] in raws for file in one.files)]

    def named(self, texts: Iterable[str]) -> list[SessionRecorded]:
        """The sessions of these ids or names, in their order, each once. Raises as `session`."""
        return [*{one.session: one for one in map(self.session, texts)}.values()]

    def session(self, text: str) -> SessionRecorded:
        """The current session with this id (old ones too), beginning of one, or name. Raises UnknownSessionError."""
        current = {session.session: session for session in self.sessions}
        ids = {one: _end(self.joined, one) for one in [*current, *self.joined]}
        by_name = [session.session for session in self.sessions if session.name == text]
        if not by_name and text in self.old_names:
            by_name = [_end(self.joined, self.old_names[text])]
        by_start = {now for one, now in ids.items() if text and one.startswith(text.lower())}
        found = [ids[text]] if text in ids else by_name or sorted(by_start)
        if len(found) == 1 and found[0] in current:
            return current[found[0]]
        if len(found) > 1:
            raise UnknownSessionError(f"session {text!r}: {len(found)} are called so: give the id: {self._of(found)}")
        if line := self.taken_back(text):
            raise UnknownSessionError(line)
        raise UnknownSessionError(f"session {text!r}: is not in this store. {self._what_there_is(text)}")

    def _of(self, sessions: Sequence[str]) -> str:
        """The ids of some sessions, each with its specimen, the first `NAMED` of them."""
        of = {one.session: f"{one.session} ({one.specimen})" for one in self.sessions if one.specimen}
        return first_of([of.get(one, one) for one in sessions], NAMED)

    def taken_back(self, text: str) -> str | None:
        """The line of a session that went with what was taken back, None where there is none of this id or name."""
        for one in self.gone_sessions.values():
            if text == one.name or (text and one.session.startswith(text.lower())):
                return next(back.line for back in self.retractions.values() if holds(one, rows_of([back])))
        return None

    def _what_there_is(self, text: str) -> str:
        if not self.sessions:
            return "It holds none yet: `whyhot ingest FILE...`"
        if text.startswith("d-") and any(one.startswith(text[2:]) for one in self.diagnoses):
            return f"It is a diagnosis: `whyhot report {text}`"
        near = nearest(text, [session.name for session in self.sessions], count=3)
        return (f"Nearest: {', '.join(near)}. " if near else "") + "`whyhot sessions` lists them"


def fold(recorded: Iterable[Recorded]) -> Facts:
    """The facts that follow from events in the order of the ledger, but for what was taken back."""
    stands = standing(recorded)
    events = stands.events
    sessions, joined = _sessions(events)
    flags: dict[str, list[QualityFlagged]] = {}
    for one in events:
        if isinstance(one.event, QualityFlagged):
            flags.setdefault(one.stream, []).append(one.event)
    return Facts(
        files=_latest(events, RawFileSealed, lambda event: event.sha256),
        databases=_latest(events, SignalDatabaseRegistered, lambda event: event.sha256),
        benches=_latest(events, BenchRegistered, lambda event: event.sha256),
        models=_models(events, stands.retractions),
        decodes=_latest(events, DecodeCompleted, _decode),
        sessions=sorted(sessions.values(), key=order),
        joined=joined,
        old_names={one.event.name: one.event.session for one in events if isinstance(one.event, SessionRecorded)},
        runs=_latest(events, ReplayCompleted, lambda event: event.run),
        flags=flags,
        clocks=_latest(events, ClockAligned, _clock),
        calibrations=_latest(events, CalibrationCompleted, lambda event: event.model),
        diagnoses=_latest(events, DiagnosisCompleted, lambda event: event.diagnosis),
        opened=_opened(events, joined),
        successors=_successors(events),
        inspections=_inspections(events, joined),
        assessments=_latest(events, AgeingAssessed, lambda event: event.assessment),
        retractions=stands.retractions,
        gone_sessions=stands.sessions,
    )


def at(ledger: Ledger, as_of: str | None = None) -> Facts:
    """The facts of `ledger` now, or at an event's number or an ISO 8601 time. Raises as `Ledger.events`."""
    return _looked_up(View(ledger, ledger.index())) if as_of is None else fold(ledger.events(as_of=as_of))


def now(ledger: Ledger, known: Facts) -> Facts:
    """The facts of now where other programs may have written since `known` was; else `known`, which costs nothing."""
    return at(ledger) if ledger.place.shared else known


@dataclass(frozen=True)
class LookedUp(Facts):
    """Facts of now, with nothing taken back. Those of which there are many are read when they are asked for."""

    view: View = field(compare=False)

    def whole(self) -> Facts:
        return fold(self.view.every())

    def called(self, name: str) -> list[RawFileSealed]:
        found = _events(self.view, f"called {name}", RawFileSealed, lambda event: event.sha256)
        return [event for event in found if self.files[event.sha256] == event]

    def decodes_of(self, raw: str) -> list[DecodeCompleted]:
        return _events(self.view, f"file-{raw}", DecodeCompleted, _decode)

    def clocks_of(self, session: SessionRecorded) -> list[ClockAligned]:
        return _events(self.view, f"session-{session.session}", ClockAligned, _clock)

    def runs_of(self, session: SessionRecorded) -> list[ReplayCompleted]:
        return _events(self.view, f"replays {session.session}", ReplayCompleted, lambda event: event.run)

    def holding(self, raws: Collection[str]) -> list[SessionRecorded]:
        there = self._now(self.ever_holding(raws))
        return [one for one in there if any(file["raw"] in raws for file in one.files)]

    def decodes_in_order(self, raws: Collection[str]) -> list[DecodeCompleted]:
        """The decodes of these logs, the latest of all last."""
        return list(_latest(self.view.about(*(f"file-{raw}" for raw in raws)), DecodeCompleted, _decode).values())

    def ever_holding(self, raws: Collection[str]) -> list[SessionRecorded]:
        """All that was recorded of sessions with records of these logs, in the order of the ledger."""
        held = (one.event for one in self.view.about(*(f"holds {raw}" for raw in raws)))
        return [event for event in held if isinstance(event, SessionRecorded)]

    def near(self, session: SessionRecorded, gap_ns: int) -> list[SessionRecorded]:
        """The sessions of its specimen, with absolute time, that begin or end at most `gap_ns` from this one."""
        times = (session.start_ns - gap_ns, session.end_ns + gap_ns)
        return self.view.sessions(self.view.index.sessions_in(session.specimen, *times)) if session.absolute else []

    def loose(self) -> set[str]:
        """SHA-256 of logs with a decode that no session names: an ingest was stopped, or left them for the next."""
        return set(self.view.index.loose())

    def last_sessions(self, count: int) -> tuple[Sequence[SessionRecorded], int]:
        last = sorted(self.view.sessions(self.view.index.last_sessions(count)), key=order)
        return last[-count:], self.view.index.count

    def unread(self) -> dict[str, str | None]:
        return _unread(self.decodes_in_order(self.view.index.quarantined()))

    def session(self, text: str) -> SessionRecorded:
        like = fold(self.view.sessions_like(text))
        if like.sessions and (len(text) >= BEGINS or any(one.name == text for one in like.sessions)):
            try:
                return like.session(text)
            except UnknownSessionError:
                pass  # said of all that there are
        return fold(self.view.every()).session(text)

    def _now(self, recorded: Iterable[SessionRecorded]) -> list[SessionRecorded]:
        """What is current of these sessions, as it is now, in order."""
        now = map(self.view.session, dict.fromkeys(one.session for one in recorded))
        return sorted((one for one in now if isinstance(one, SessionRecorded)), key=order)


def _looked_up(view: View) -> Facts:
    few = view.few()
    known = fold(few)
    if known.retractions:  # what went with it is told by all other events
        return fold(view.every())
    whole = Whole(lambda: fold(view.every()))

    def joined(session: str) -> str | None:
        now = view.session(session)
        return now.into if isinstance(now, SessionRegrouped) else None

    def old_name(name: str) -> str | None:
        named = view.last(f"name {name}", SessionRecorded)
        return named.session if named else None

    def flags(stream: str) -> Sequence[QualityFlagged] | None:
        return [one.event for one in view.about(stream) if isinstance(one.event, QualityFlagged)] or None

    def clock(key: str) -> ClockAligned | None:
        found = _events(view, f"session-{key.partition('/')[0]}", ClockAligned, _clock)
        return next((event for event in found if _clock(event) == key), None)

    became = Lookup(whole, "joined", joined)
    there = vars(known) | {
        "files": Lookup(whole, "files", lambda key: view.last(f"file-{key}", RawFileSealed)),
        "decodes": Lookup(whole, "decodes", lambda key: view.last(f"decode {key}", DecodeCompleted)),
        "sessions": Sessions(whole, view.session),
        "joined": became,
        "old_names": Lookup(whole, "old_names", old_name),
        "runs": Lookup(whole, "runs", lambda key: view.last(f"run-{key}", ReplayCompleted)),
        "flags": Lookup(whole, "flags", flags),
        "clocks": Lookup(whole, "clocks", clock),
        "opened": _opened(few, became),
        "inspections": _inspections(few, became),
    }
    return LookedUp(**there, view=view)


def _events(view: View, key: str, kind: type[E], one_of: Callable[[E], str]) -> list[E]:
    """The events of `kind` about `key`; where one was recorded again, the latest counts."""
    return list(_latest(view.about(key), kind, one_of).values())


def _unread(decodes: Iterable[DecodeCompleted]) -> dict[str, str | None]:
    every = list(decodes)
    read = {decode.raw for decode in every if decode.outcome != "quarantined"}
    return {decode.raw: decode.why for decode in every if decode.raw not in read}


def _decode(event: DecodeCompleted) -> str:
    return event.decode


def _clock(event: ClockAligned) -> str:
    return f"{event.session}/{event.clock}/{event.reference}"


def _latest(events: Iterable[Recorded], kind: type[E], key: Callable[[E], str]) -> dict[str, E]:
    """The last event of `kind` for each key, in the order in which these last ones came."""
    latest: dict[str, E] = {}
    for one in events:
        if isinstance(one.event, kind):
            latest.pop(key(one.event), None)
            latest[key(one.event)] = one.event
    return latest


def _models(events: Iterable[Recorded], retractions: Mapping[str, Retraction]) -> dict[str, ModelPublished]:
    """By SHA-256, those of what was taken back first: the latest of a motor is the last that counts."""
    found = _latest(events, ModelPublished, lambda event: event.model)
    gone = {model for one in retractions.values() for model in one.event.models if model in found}
    return {model: found[model] for model in sorted(found, key=lambda model: model not in gone)}


def _sessions(events: Iterable[Recorded]) -> tuple[dict[str, SessionRecorded], dict[str, str]]:
    """The current sessions by id, and the old ids with what they became part of."""
    current: dict[str, SessionRecorded] = {}
    joined: dict[str, str] = {}
    for one in events:
        match one.event:
            case SessionRecorded() as event:
                current[event.session] = event
                joined.pop(event.session, None)
            case SessionRegrouped() as event:
                current.pop(event.session, None)
                joined[event.session] = event.into
    return current, joined


def _inspections(events: Iterable[Recorded], joined: Mapping[str, str]) -> dict[str, InspectionRecorded]:
    found = _latest(events, InspectionRecorded, lambda event: event.inspection)
    return {key: replace(one, session=one.session and _end(joined, one.session)) for key, one in found.items()}


def _opened(events: Iterable[Recorded], joined: Mapping[str, str]) -> dict[str, list[str]]:
    """A session that a late file joined was opened with what it holds of the old one."""
    opened: dict[str, dict[str, None]] = {}
    for one in events:
        if isinstance(one.event, HeldOutOpened):
            for session in one.event.sessions:
                opened.setdefault(_end(joined, session), {})[one.event.diagnosis] = None
    return {session: list(diagnoses) for session, diagnoses in opened.items()}


def _successors(events: Iterable[Recorded]) -> dict[str, str]:
    """What is accepted is current: whatever had its own place before has it no more."""
    successors: dict[str, str] = {}
    for one in events:
        if isinstance(one.event, CauseAccepted):
            accepted = one.event
            for parent, child in ((accepted.parent, accepted.model), (accepted.parent_bench, accepted.bench)):
                if parent and child:
                    successors[parent] = child
                    successors.pop(child, None)
    return successors


def _end(leads: Mapping[str, str], start: str) -> str:
    """Where `start` leads to in the end; a circle ends before it closes."""
    seen = {start}
    while start in leads and leads[start] not in seen:
        start = leads[start]
        seen.add(start)
    return start
