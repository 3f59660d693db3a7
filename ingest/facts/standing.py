"""Which facts stand: all but what was taken back, and what was made of it. Facts are never deleted."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from ingest.facts.events import (
    AgeingAssessed,
    Event,
    FactReinstated,
    FactRetracted,
    HeldOutOpened,
    LogForgotten,
    ReplayCompleted,
    SessionRecorded,
)
from ingest.facts.ledger_row import Recorded

KINDS = {"file": "log", "session": "session", "diagnosis": "diagnosis", "inspection": "inspection"}  # by stream
ALWAYS = (FactRetracted, FactReinstated, HeldOutOpened)  # who has seen kept sessions has seen them
END = 2**63 - 1  # behind every record


class RowsOfLog(NamedTuple):
    """Records of a log, both ends included."""

    raw: str
    first: int = 0
    last: int = END

    def hold(self, raw: str, first: int, last: int) -> bool:
        return raw == self.raw and self.first <= first and last <= self.last


def runs(file: Mapping[str, Any]) -> list[tuple[int, int]]:
    """First and last record of each run of records that an entry of `SessionRecorded.files` holds."""
    return runs_of(file["rows"]) if "rows" in file else [(file["first_record"], file["last_record"])]


def records(file: Mapping[str, Any]) -> str:
    """The same in words: "records 0 to 1,199", "20 of the records 12 to 1,987"."""
    span = f"records {file['first_record']:,} to {file['last_record']:,}"
    return f"{len(file['rows']):,} of the {span}" if len(runs(file)) > 1 else span


def runs_of(records: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of those of these rising records that follow each other."""
    found: list[list[int]] = []
    for record in records:
        if found and record == found[-1][1] + 1:
            found[-1][1] = record
        else:
            found.append([record, record])
    return [(first, last) for first, last in found]


@dataclass(frozen=True)
class Retraction:
    """What was taken back, and when; `forgotten` where it is a log that had to go for good, with the time of that."""

    event: FactRetracted
    recorded: str  # ISO 8601 UTC
    position: int
    forgotten: LogForgotten | None = None

    @property
    def called(self) -> str:
        """ "log 3_wltp.blf"."""
        return f"{KINDS[self.event.fact.partition('-')[0]]} {self.event.name}"

    @property
    def says(self) -> str:
        """What became of it, when and why."""
        became = "forgotten" if self.forgotten else "taken back"
        return f"{self.called} was {became} on {self.recorded[:10]} ({(self.forgotten or self.event).why})"

    @property
    def line(self) -> str:
        """What was taken back, for whoever asks for it, with what to do."""
        if self.forgotten:
            return f"{self.says}: its bytes are gone for good, and this store takes them in no more"
        return f"{self.says}: `whyhot retract {shlex.quote(self.event.name)} --undo --reason TEXT` brings it back"


@dataclass(frozen=True)
class Standing:
    """`events`: those that count, in order. `retractions`: by stream, those that hold; `sessions`: by id, as they were
    last, those that went with them."""

    events: Sequence[Recorded]
    retractions: Mapping[str, Retraction]
    sessions: Mapping[str, SessionRecorded]


def standing(recorded: Iterable[Recorded]) -> Standing:
    """What counts of events in the order of the ledger."""
    events = list(recorded)
    return _without(events, _retractions(events))


def without_forgotten(recorded: Iterable[Recorded]) -> Standing:
    """What would count had nothing been taken back but the logs that were forgotten: what is left out never counts
    again."""
    events = list(recorded)
    return _without(events, {stream: one for stream, one in _retractions(events).items() if one.forgotten})


def _without(events: Sequence[Recorded], held: Mapping[str, Retraction]) -> Standing:
    if not held:
        return Standing(events, held, {})
    gone = rows_of(held.values())
    with_it = [one for one in events if isinstance(one.event, SessionRecorded) and holds(one.event, gone)]
    sessions = {one.event.session: one.event for one in with_it if isinstance(one.event, SessionRecorded)}
    left = [
        one
        for one in events
        if isinstance(one.event, ALWAYS)
        or not (one.stream in held or _is_of(one.event, sessions) or _counted(one, with_it, held.values()))
    ]
    return Standing(left, held, sessions)


def rows_of(retractions: Iterable[Retraction]) -> list[RowsOfLog]:
    """The records that went with what was taken back."""
    return [
        RowsOfLog(row["raw"], row["first_record"], row["last_record"]) for one in retractions for row in one.event.rows
    ]


def whole(raw: str) -> dict[str, Any]:
    """All of a log, as an entry of `FactRetracted.rows`."""
    return {"raw": raw, "first_record": 0, "last_record": END}


def holds(session: SessionRecorded, gone: Iterable[RowsOfLog]) -> bool:
    """Whether a session holds rows that were taken back."""
    held = [(file["raw"], *run) for file in session.files for run in runs(file)]
    return any(rows.hold(*one) for rows in gone for one in held)


def _retractions(events: Iterable[Recorded]) -> dict[str, Retraction]:
    held: dict[str, Retraction] = {}
    for one in events:
        match one.event:
            case FactRetracted() as event:
                held[event.fact] = Retraction(event, one.recorded, one.position)
            case FactReinstated() as event if not (event.fact in held and held[event.fact].forgotten):
                held.pop(event.fact, None)
            case LogForgotten() as event if one.stream in held:
                held[one.stream] = replace(held[one.stream], recorded=one.recorded, forgotten=event)
    return held


def _is_of(event: Event, sessions: Mapping[str, SessionRecorded]) -> bool:
    """Whether an event is one of these sessions, or a replay of one."""
    return isinstance(event, SessionRecorded | ReplayCompleted) and event.session in sessions


def _counted(one: Recorded, sessions: Iterable[Recorded], held: Iterable[Retraction]) -> bool:
    """Whether an assessment of all specimens counted one of these `sessions`, before it was taken back."""
    return isinstance(one.event, AgeingAssessed) and any(
        session.position < one.position < back.position and holds(session.event, rows_of([back]))
        for back in held
        for session in sessions
        if isinstance(session.event, SessionRecorded) and session.event.specimen
    )
