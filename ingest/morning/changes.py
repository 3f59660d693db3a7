"""What the ledger knows to be different between two sessions, each with the event that says so."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.changes import differing
from ingest.facts.events import BenchRegistered, CauseAccepted, InspectionRecorded, ModelPublished, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded

if TYPE_CHECKING:
    from ingest.facts.store import Store

SHOWN = 3  # channels of a bench file whose entries differ; more are counted


@dataclass(frozen=True)
class Change:
    """Something that differs between two sessions; `position` and `recorded` of the event, None where none says it."""

    says: str
    event: str | None = None
    position: int | None = None
    recorded: str | None = None  # ISO 8601 UTC


def changes(store: Store, facts: Facts, first: SessionRecorded, second: SessionRecorded) -> list[Change]:
    """What differs between two sessions of a store: what was said of them, their bench and motor file, and findings
    on their specimen between them; in the order of the ledger, what no event says first."""
    recorded = store.ledger.events()
    found = [
        *_said(recorded, first, second),
        *_bench(store, facts, recorded, first, second),
        *_motor(facts, recorded, first, second),
        *_between(recorded, first, second),
    ]
    return sorted(found, key=lambda one: one.position or 0)


def _said(recorded: Sequence[Recorded], first: SessionRecorded, second: SessionRecorded) -> Iterator[Change]:
    """Specimen, batch, rig and attributes."""
    for name in ("specimen", "batch", "configuration"):
        before, after = getattr(first, name), getattr(second, name)
        if before != after:
            yield _of_session(recorded, second, f"{name} {after or 'not given'} (was {before or 'not given'})")
    for key in sorted({*first.attributes, *second.attributes}):
        before, after = first.attributes.get(key), second.attributes.get(key)
        if before != after:
            yield _of_session(recorded, second, f"{key} = {after or 'not given'} (was {before or 'not given'})")


def _of_session(recorded: Sequence[Recorded], session: SessionRecorded, says: str) -> Change:
    stream = f"session-{session.session}"
    return _change(says, next((one for one in recorded if one.stream == stream), None))


def _change(says: str, one: Recorded | None) -> Change:
    if one is None:
        return Change(says)
    return Change(says, type(one.event).__name__, one.position, one.recorded)


def _bench(
    store: Store, facts: Facts, recorded: Sequence[Recorded], first: SessionRecorded, second: SessionRecorded
) -> Iterator[Change]:
    before, after = (facts.current(one.bench) if one.bench else None for one in (first, second))
    if after is None:
        return
    name = facts.benches[after].name
    says = f"bench file {name}: the first session has none"
    if before:
        old, new = (_then(store, facts, sha, one) for sha, one in ((before, first), (after, second)))
        if old == new:
            return
        says = f"bench file {name}: {'; '.join(_entries(old, new)) or 'other bytes, and the same channels'}"
    yield _change(says, _last(recorded, BenchRegistered, sha256=after))


def _then(store: Store, facts: Facts, sha: str, session: SessionRecorded) -> Bench:
    """A bench file as it held for a session."""
    bench = read_bench(store.archive.read(sha), facts.benches[sha].name)
    return bench.at(session.start_ns if session.absolute else None)


def _entries(old: Bench, new: Bench) -> list[str]:
    """What differs between the channels of two bench files, in a few words each."""
    before, after = ({one.name: one for one in bench.channels} for bench in (old, new))
    told = [f"{name} is new" for name in after if name not in before]
    told += [f"{name} is gone" for name in before if name not in after]
    told += [f"{name}: {says}" for name in after if name in before and (says := differing(before[name], after[name]))]
    told += ["other corrections"] if _plain(old.corrections) != _plain(new.corrections) else []
    return told if len(told) <= SHOWN else [*told[:SHOWN], f"and {len(told) - SHOWN} more"]


def _plain(corrections: Sequence[object]) -> list[str]:
    return [str(one) for one in corrections]


def _motor(
    facts: Facts, recorded: Sequence[Recorded], first: SessionRecorded, second: SessionRecorded
) -> Iterator[Change]:
    before, after = (bench.model if (bench := facts.bench_of(one)) else None for one in (first, second))
    if before != after and after:
        published = facts.models[after]
        was = f"was {facts.models[before].motor} {before[:8]}" if before else "was not given"
        says = f"motor file {published.motor} {after[:8]} ({was})"
        yield _change(says, _last(recorded, ModelPublished, model=after))


def _last(recorded: Sequence[Recorded], kind: type, **having: str) -> Recorded | None:
    fitting = (
        one
        for one in reversed(recorded)
        if isinstance(one.event, kind) and all(getattr(one.event, key) == value for key, value in having.items())
    )
    return next(fitting, None)


def _between(recorded: Sequence[Recorded], first: SessionRecorded, second: SessionRecorded) -> Iterator[Change]:
    """What a person did between the two: models taken as current, findings on the specimen."""
    at = [next((one.position for one in recorded if one.stream == f"session-{s.session}"), 0) for s in (first, second)]
    for one in recorded:
        if isinstance(one.event, CauseAccepted) and min(at) < one.position < max(at):
            yield _change(f"accepted {', '.join(one.event.causes) or 'a calibration'} of {one.event.diagnosis}", one)
        if isinstance(one.event, InspectionRecorded) and one.event.specimen in (first.specimen, second.specimen):
            after_first = one.event.session == first.session or min(at) < one.position < max(at)
            if after_first:
                yield _change(f"on {one.event.specimen}: {one.event.finding}", one)
