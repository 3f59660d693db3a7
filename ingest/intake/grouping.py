"""All files of a store grouped into sessions; new ones become facts, with their kind and what to look at."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations

from ingest.bench.bench_file import Bench, read_bench
from ingest.catalogue import kinds, quality
from ingest.catalogue.channels import load_each
from ingest.catalogue.contradicting import contradicting
from ingest.catalogue.looked import Looked, is_long, look, looked
from ingest.errors import IngestError
from ingest.facts import facts as ledger_facts
from ingest.facts import sessions
from ingest.facts.events import (
    Event,
    FactReinstated,
    FactRetracted,
    LogCorrected,
    QualityFlagged,
    SessionRecorded,
    SessionRegrouped,
)
from ingest.facts.facts import Facts, LookedUp
from ingest.facts.ledger import settled
from ingest.facts.sessions import Override
from ingest.facts.store import Store

Change = SessionRecorded | SessionRegrouped
# By which of what others record meanwhile a session may be another one.
GROUPING = (SessionRecorded, SessionRegrouped, FactRetracted, FactReinstated, LogCorrected)
FEW_RECORDS = 3  # quality has no finding in so few: a gap takes four samples, a stretch seven


@dataclass
class Grouped:
    """What a person should look at in new sessions, by name; and a line for each that is left for the next ingest."""

    flags: list[tuple[str, QualityFlagged]] = field(default_factory=list)
    left: list[str] = field(default_factory=list)


def group_files(
    store: Store, raws: Collection[str], said: Mapping[str, Override], first: Sequence[tuple[str, Event]] = ()
) -> Grouped:
    """Group files into sessions and append what is new, behind the facts `first` that it follows from, all or none; a
    session whose samples cannot be read stops no other. `raws`: SHA-256 of the logs that are new; with `first` any
    session may be another one afterwards."""
    if first:  # of a person, who is to see what others changed meanwhile
        return _group(store, raws, said, first)
    return settled(partial(_group, store, raws, said, first))


def _group(
    store: Store, raws: Collection[str], said: Mapping[str, Override], first: Sequence[tuple[str, Event]]
) -> Grouped:
    known = ledger_facts.at(store.ledger)
    if isinstance(known, LookedUp) and not first:
        changes = _changes_near(known, raws, benches_of(store, known), said)
    else:
        known, changes = _changes(store, said, known, first)
    grouped = Grouped()
    events: list[tuple[str, Event]] = [*first]
    read = [one for one in changes if isinstance(one, SessionRecorded) and _is_read(one)]
    looked_at = _looked(store, known, read)
    unread: set[str] = set()
    for event in changes:
        if isinstance(event, SessionRegrouped):
            if event.into not in unread:
                events.append((f"session-{event.session}", event))
            continue
        found = _overlaps(known, event)
        if _is_read(event):
            seen = next(looked_at)
            if isinstance(seen, IngestError):
                unread.add(event.session)
                grouped.left.append(f"session {event.name}: is left for the next ingest: {seen}")
                continue
            if not event.kind:
                event = _of_kind(event, kinds.recognise(seen.channels))
            found += quality.findings(seen.qualities)
            found += contradicting(seen.channels, lambda raw: known.files[raw].name)
        elif not event.kind:
            event = _of_kind(event, kinds.EVALUATED)
        stream = f"session-{event.session}"
        events += [(stream, event), *((stream, flag) for flag in found)]
        grouped.flags += [(event.name, flag) for flag in found]
    # All or none: one wait for the disk, however many sessions a table holds.
    store.ledger.append_all(events, rests_on=GROUPING)
    return grouped


def _changes(
    store: Store, said: Mapping[str, Override], before: Facts, first: Sequence[tuple[str, Event]]
) -> tuple[Facts, Sequence[Change]]:
    """The facts with `first` behind them, and what then changes in all sessions."""
    recorded = store.ledger.proposed(first)
    known = ledger_facts.fold(recorded)
    old = {one.session: one for one in (*before.sessions, *known.sessions)}
    benches = benches_of(store, known)
    names = {sha: one.name for sha, one in known.files.items()}
    every = [one.event for one in recorded if isinstance(one.event, SessionRecorded)]
    overrides = {**sessions.overrides_of(every, benches, known.decodes), **said}
    new = sessions.group(list(known.decodes.values()), benches, names, overrides, known.gone)
    return known, sessions.regroup([*old.values()], new)


def _changes_near(
    known: LookedUp, raws: Collection[str], benches: Mapping[str, Bench], said: Mapping[str, Override]
) -> Sequence[Change]:
    """What new logs change. Only sessions that hold them, or lie so near to these in time that they may be one, are
    put together again; others near to those then too."""
    gap_ns = int(max((one.join_gap_s for one in benches.values()), default=0.0) * sessions.SECOND_NS)
    inside = {*raws, *known.loose()}
    while True:
        overrides = sessions.overrides_of(known.ever_holding(inside), benches, known.decodes)
        names = {raw: known.files[raw].name for raw in inside}
        new = sessions.group(known.decodes_in_order(inside), benches, names, {**overrides, **said})
        old = known.holding(inside)
        reached = [*old, *(near for one in new for near in known.near(one, gap_ns))]
        more = {file["raw"] for one in reached for file in one.files} - inside
        if not more:
            return sessions.regroup(old, new)
        inside |= more


def benches_of(store: Store, known: Facts) -> dict[str, Bench]:
    return {sha: read_bench(store.archive.read(sha), one.name) for sha, one in known.benches.items()}


def _looked(store: Store, known: Facts, read: Sequence[SessionRecorded]) -> Iterator[Looked | IngestError]:
    """What is seen of each of these sessions in turn, or why it cannot be read."""
    left = list(read)
    while left:
        try:
            short = load_each(store, known, [one for one in left if not is_long(known, one)])
            while left:
                seen = look(store, known, left[0]) if is_long(known, left[0]) else looked(next(short))
                left = left[1:]
                yield seen
        except IngestError as error:
            left = left[1:]
            yield error


def _of_kind(session: SessionRecorded, kind: tuple[str, str]) -> SessionRecorded:
    return replace(session, kind=kind[0], kind_why=kind[1])


def _is_read(session: SessionRecorded) -> bool:
    """Whether a session's samples must be read: nobody gave its kind, or it is no short one. Checks of a table say all
    without."""
    if any("rows" in one for one in session.files):
        return False
    return not session.kind or sum(one["last_record"] - one["first_record"] + 1 for one in session.files) > FEW_RECORDS


def _overlaps(known: Facts, session: SessionRecorded) -> list[QualityFlagged]:
    """Files of a session that hold the same channels at the same time: a copy, or the same test logged twice."""
    if len(session.files) < 2:
        return []
    decodes = [known.decodes[file["decode"]] for file in session.files]
    flags = []
    for a, b in combinations(decodes, 2):
        common = {channel["name"] for channel in a.channels} & {channel["name"] for channel in b.channels}
        from_ns, to_ns = max(a.start_ns or 0, b.start_ns or 0), min(a.end_ns or 0, b.end_ns or 0)
        if common and a.raw != b.raw and to_ns > from_ns:
            names = " and ".join(known.files[one.raw].name for one in (a, b))
            seconds = (to_ns - from_ns) / 1e9
            says = (
                f"{names} hold the same channels for {seconds:.0f} s: there one of them counts; `whyhot morning` "
                "compares their clocks"
            )
            flags.append(QualityFlagged(flag="overlap", says=says, detail={"channels": sorted(common)}))
    return flags
