"""The same test again: what two sessions of a store read differently where they were driven alike, and since when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import LOADED
from ingest.catalogue.looked import Looked, look
from ingest.catalogue.show import iso
from ingest.errors import IngestError
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.morning.changes import Change, changes
from ingest.morning.differences import ChannelDifference, beyond_of, differences
from ingest.morning.matching import Array, Matched, RunBlocks, block_length, blocks, driven_by, match

if TYPE_CHECKING:
    from ingest.facts.store import Store

EARLIER = 3  # runs of the test before the first one, that tell how well it repeats
COURSES = 4  # temperatures whose courses are kept for a picture
BETWEEN = 4  # runs between the two, that tell since when


@dataclass(frozen=True, eq=False)
class CourseBeside:
    """A channel of two runs where they were driven alike, by the time since the second one's begin: (P,) each."""

    channel: str
    unit: str
    t_s: Array
    first: Array
    second: Array


@dataclass(frozen=True)
class Comparison:
    """Two runs beside each other: how long they were driven alike, which share of each that is, and what differs."""

    by: tuple[str, ...]  # quantities that the two are laid beside each other by
    matched_s: float
    shares: tuple[float, float]  # of the first and of the second run
    driven: tuple[float, float]  # the same of the time in which it was driven
    stretches: int
    channels: tuple[ChannelDifference, ...]
    courses: tuple[CourseBeside, ...]  # of the temperatures that are furthest off, COURSES at most
    only: tuple[tuple[str, ...], tuple[str, ...]]  # channels that only the first, and only the second run has

    @property
    def exceeding(self) -> list[ChannelDifference]:
        """The channels that differ by more than floor and drive explain, the furthest first."""
        return [one for one in self.channels if one.verdict == "exceeds"]

    @property
    def explained(self) -> list[ChannelDifference]:
        """The channels that differ by more than their floor, as much as start and drive explain."""
        return [one for one in self.channels if one.verdict == "explained"]


@dataclass(frozen=True)
class Repeat:
    """The answer of `whyhot repeat`. `since`: channel -> the first of the runs from which on it differs so."""

    first: SessionRecorded
    second: SessionRecorded
    beside: Comparison
    earlier: tuple[str, ...]  # names of the runs that tell how well the test repeats
    between: tuple[str, ...]
    since: Mapping[str, str]
    changes: tuple[Change, ...]

    def to_json(self) -> dict[str, Any]:
        """The answer of `repeat --json` (schema `whyhot.repeat/1`)."""
        return {
            "schema": "whyhot.repeat/1",
            "first": _named(self.first),
            "second": _named(self.second),
            **comparison_json(self.beside),
            "earlier": list(self.earlier),
            "between": list(self.between),
            "since": dict(self.since),
            "changes": [asdict(one) for one in self.changes],
        }


def comparison_json(beside: Comparison) -> dict[str, Any]:
    """Two runs beside each other, as every answer that holds them says it."""
    channels = [asdict(one) for one in beside.channels]
    for one, entry in zip(beside.channels, channels, strict=True):
        entry["worst"] = {
            "cell": {name: list(edges) for name, edges in one.worst.cell.items()},
            "minutes": one.worst.minutes,
            "first": one.worst.first,
            "second": one.worst.second,
            "difference": one.worst.difference,
            "explained": list(one.worst.explained),
        }
    return {
        "aligned_by": list(beside.by),
        "matched_s": beside.matched_s,
        "matched_share": list(beside.shares),
        "driven_share": list(beside.driven),
        "stretches": beside.stretches,
        "channels": channels,
        "only": [list(names) for names in beside.only],
    }


def repeat(store: Store, facts: Facts, first: SessionRecorded, second: SessionRecorded) -> Repeat:
    """Compare two sessions. Raises IngestError where they are one or cannot be laid beside each other, DamageError."""
    if first.session == second.session:
        raise IngestError(f"{first.name}: is given twice: compare it with another run of the same test.")
    channels = [usable(look(store, facts, one)) for one in (first, second)]
    names = f"{first.name} and {second.name}"
    earlier = [one for one in runs_before(facts, first) if one.session != second.session][:EARLIER]
    between = _between(facts, first, second)
    repeats = [(one.name, found) for one, found in _each(store, facts, channels[0], earlier)]
    beside = lay(channels[0], channels[1], [beyond_of(found.channels) for _, found in repeats], names)
    after = [(one.name, found) for one, found in _each(store, facts, channels[0], between)]
    return Repeat(
        first=first,
        second=second,
        beside=beside,
        earlier=tuple(name for name, _ in repeats),
        between=tuple(name for name, _ in after),
        since={one.channel: _since(one, [*after, (second.name, beside)]) for one in beside.exceeding},
        changes=tuple(changes(store, facts, first, second)),
    )


def lay(
    first: Sequence[ChannelData],
    second: Sequence[ChannelData],
    earlier: Sequence[Mapping[str, float]] = (),
    names: str = "they",
) -> Comparison:
    """Two runs beside each other; `names` as a refusal calls them. Raises IngestError where nothing says how, or they
    have no operating point in common."""
    by = driven_by(first, second)
    if not by:
        raise IngestError(
            f"{names}: cannot be laid beside each other: neither speed, torque, current nor an oven's temperature is "
            "recorded in both: say in a bench file what the signals mean."
        )
    block_s = block_length((first, second))
    runs = blocks(first, block_s, by), blocks(second, block_s, by)
    matched = match(*runs, by)
    if not len(matched.first):
        raise IngestError(
            f"{names}: {' and '.join(by)} are in no minute alike, so nothing can be compared. Compare runs of one test."
        )
    shares = [len(matched.first) / len(run.drive[by[0]]) for run in runs]
    found = differences(first, second, runs, matched, earlier)
    driven = matched.shares(runs, LOADED)
    courses = tuple(_courses(found, runs, matched))
    stretches = int(matched.stretch[-1]) + 1
    return Comparison(
        by, matched.matched_s, (shares[0], shares[1]), driven, stretches, tuple(found), courses, _only(first, second)
    )


def _only(first: Sequence[ChannelData], second: Sequence[ChannelData]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    one, other = ([each.spec.name for each in run if each.spec.role != "ignored"] for run in (first, second))
    return tuple(name for name in one if name not in other), tuple(name for name in other if name not in one)


def _courses(
    found: Sequence[ChannelDifference], runs: tuple[RunBlocks, RunBlocks], matched: Matched
) -> Iterator[CourseBeside]:
    for one in [one for one in found if one.quantity == "temperature"][:COURSES]:
        first, second = runs[0].means[one.channel], runs[1].means[one.channel]
        t_s = np.asarray(matched.second * float(matched.block_s), np.float64)
        yield CourseBeside(one.channel, one.unit or "", t_s, first[matched.first], second[matched.second])


def usable(seen: Looked) -> list[ChannelData]:
    """The channels of a session without the samples in which their sensors told nothing new."""
    return [
        replace(channel.samples(quality.good), beside=channel.beside)
        if len(quality.good) and not quality.good.all()
        else channel
        for channel, quality in zip(seen.channels, seen.qualities, strict=True)
        if len(channel.t_ns)
    ]


def runs_before(facts: Facts, session: SessionRecorded) -> list[SessionRecorded]:
    """The sessions of the same kind, specimen and rig that ended before this one began, the latest first."""
    if not session.absolute:
        return []
    return [
        one
        for one in reversed(facts.sessions)
        if same_test(one, session) and one.specimen == session.specimen and one.end_ns <= session.start_ns
    ]


def same_test(one: SessionRecorded, other: SessionRecorded) -> bool:
    """Whether two sessions are of one kind and rig, and of both or of none it is known when they ran."""
    alike = (one.kind, one.configuration, one.absolute) == (other.kind, other.configuration, other.absolute)
    return alike and one.session != other.session


def _between(facts: Facts, first: SessionRecorded, second: SessionRecorded) -> list[SessionRecorded]:
    """The last runs of the test that began between the two, in the order of time."""
    if not (first.absolute and second.absolute):
        return []
    begun = sorted((first.start_ns, second.start_ns))
    found = [one for one in facts.sessions if same_test(one, first) and begun[0] < one.start_ns < begun[1]]
    return [one for one in found if one.session != second.session][-BETWEEN:]


def _each(
    store: Store, facts: Facts, first: Sequence[ChannelData], sessions: Sequence[SessionRecorded]
) -> Iterator[tuple[SessionRecorded, Comparison]]:
    """Each of these sessions beside the first run; those that cannot be are left out."""
    for session in sessions:
        try:
            yield session, lay(first, usable(look(store, facts, session)))
        except IngestError:
            continue


def _since(one: ChannelDifference, runs: Sequence[tuple[str, Comparison]]) -> str:
    """The first run from which on the channel lies at least half as far off, to the same side, in all that follow."""
    since = runs[-1][0]
    for name, beside in reversed(runs[:-1]):
        there = next((other.worst.beyond for other in beside.channels if other.channel == one.channel), 0.0)
        if there / one.worst.beyond < 0.5:
            break
        since = name
    return since


def _named(session: SessionRecorded) -> dict[str, Any]:
    start = iso(session.start_ns) if session.absolute else None
    return {"session": session.session, "name": session.name, "kind": session.kind, "start": start}
