"""A day's logs looked through: every record accounted for, each session with its end, sensors, power, operating points,
and the last run of the same test beside it.

The logs are taken into a store, as `whyhot ingest` does: into one that is thrown away, unless they are to be kept. So
everything is judged by the same rules as later. What is compared with lies in the store that was there before.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from ingest.bench.bench_file import read_bench
from ingest.bench.derating import DeratingRule
from ingest.catalogue.channels import ChannelData
from ingest.catalogue.description import SessionDescription
from ingest.catalogue.looked import look
from ingest.catalogue.show import described, known_channels
from ingest.errors import IngestError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.intake.intake import Intake
from ingest.morning.ending import SessionEnd, broken_off, ended
from ingest.morning.loggers import LoggerClock, compared
from ingest.morning.repeat import Comparison, comparison_json, lay, same_test, usable
from ingest.morning.sensors import SensorFault, alone, jumping, since_before

if TYPE_CHECKING:
    from ingest.facts.store import Store

ALIKE, WHOLE = 0.5, 0.9  # of the driven time of both runs, or of this one if it was broken off: less is another test
TRIED = 3  # earlier runs of a test, until one can be laid beside
Held = tuple["Store", Facts]  # where sessions lie


@dataclass(frozen=True)
class Before:
    """The last run of the same test: which, and both beside each other (that one first)."""

    session: str
    name: str
    start_ns: int | None
    comparison: Comparison


@dataclass(frozen=True)
class Night:
    """One session of the logs. `channels`: its samples, for pictures."""

    description: SessionDescription
    ended: SessionEnd
    sensors: tuple[SensorFault, ...]
    before: Before | None
    channels: Sequence[ChannelData]


@dataclass(frozen=True)
class Morning:
    """The answer of `whyhot morning`. `source`: where bench file and databases are from; `kept`: in the store now."""

    intake: Intake
    nights: tuple[Night, ...]
    clocks: tuple[LoggerClock, ...]
    source: str
    kept: bool

    def clocks_json(self) -> list[dict[str, Any]]:
        """Each clock that ran beside another, with its offset or why it cannot be told."""
        return [
            {
                "session": one.session,
                "clock": one.clock,
                "reference": one.reference,
                "offset": asdict(one.offset) if one.offset else None,
                "agrees": one.agrees,
                "says": one.says,
            }
            for one in self.clocks
        ]

    def sessions_json(self) -> list[dict[str, Any]]:
        """Each session as `whyhot.show/1` has it, with what the morning adds."""
        return [
            {
                **asdict(one.description),
                "ended": asdict(one.ended),
                "sensors": [asdict(fault) for fault in one.sensors],
                "before": None if one.before is None else _before_json(one.before),
            }
            for one in self.nights
        ]


def _before_json(before: Before) -> dict[str, Any]:
    return {"session": before.session, "name": before.name, **comparison_json(before.comparison)}


def morning(store: Store, intake: Intake, past: Held | None, source: str, kept: bool) -> Morning:
    """Look through the sessions of an intake into `store`; `past`: the store that was there before, with its facts
    then, which may be the same one. Offsets of clocks are facts of a store that keeps the logs. Raises DamageError."""
    facts = ledger_facts.at(store.ledger)
    nights = tuple(_night(store, facts, session, past) for session in intake.sessions)
    of_sessions = [(session, night.channels) for session, night in zip(intake.sessions, nights, strict=True)]
    clocks = compared(of_sessions, lambda raw: facts.files[raw].name)
    if kept:
        events = [(f"session-{one.session}", one.event()) for one in clocks if one.offset]
        known = list(facts.clocks.values())
        store.ledger.append_all([(stream, event) for stream, event in events if event not in known])
    return Morning(intake, nights, tuple(clocks), source, kept)


def _night(store: Store, facts: Facts, session: SessionRecorded, past: Held | None) -> Night:
    seen = look(store, facts, session)
    channels = usable(seen)
    before = next(_before(channels, session, (store, facts), past), None)
    faults = [*alone(seen.channels, seen.qualities, known_channels(facts, session)), *jumping(channels)]
    if before:
        faults += since_before(before.comparison.channels, before.name)
    end = broken_off(before.name, before.comparison) if before else None
    end = end or ended(channels, session.kind, _limits(store, facts, session))
    return Night(described(facts, session, seen), end, tuple(faults), before, channels)


def _limits(store: Store, facts: Facts, session: SessionRecorded) -> Sequence[DeratingRule]:
    if session.bench is None:
        return ()
    sha = facts.current(session.bench)
    return read_bench(store.archive.read(sha), facts.benches[sha].name).deratings


def _before(
    channels: Sequence[ChannelData], session: SessionRecorded, own: Held, past: Held | None
) -> Iterator[Before]:
    """The earlier runs of the same test beside which this one can be laid, the latest first."""
    for (store, facts), earlier in _earlier(session, own, past)[:TRIED]:
        try:
            comparison = lay(usable(look(store, facts, earlier)), channels)
        except IngestError:
            continue
        if min(comparison.driven) < ALIKE and comparison.driven[1] < WHOLE:
            continue
        yield Before(earlier.session, earlier.name, earlier.start_ns if earlier.absolute else None, comparison)


def _earlier(session: SessionRecorded, own: Held, past: Held | None) -> list[tuple[Held, SessionRecorded]]:
    """Runs of the same test before this one, the latest first: of these logs and of the store, without a copy of it.

    Without absolute time those of the store are earlier, and of these logs those that stand before it.
    """
    mine = {file["raw"] for file in session.files}
    there = [(held, one) for held in (past, own) if held for one in held[1].sessions]
    runs = [
        (held, one)
        for held, one in there
        if same_test(one, session) and mine.isdisjoint(file["raw"] for file in one.files)
    ]
    if session.absolute:
        runs = [pair for pair in runs if pair[1].end_ns <= session.start_ns]
        return sorted(runs, key=lambda pair: pair[1].start_ns, reverse=True)
    names = [one.session for one in own[1].sessions]
    behind = set(names[names.index(session.session) :])
    return [pair for pair in runs if pair[0] is not own or pair[1].session not in behind][::-1]
