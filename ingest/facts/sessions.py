"""Sessions: which files are one test. A pure function of facts, so that any order of arrival gives the same sessions.

Files of one bench file and specimen with absolute time, that overlap or follow each other within `join_gap_s`, are one
session; a file without absolute time is one by itself, and so is a file without a bench file: nothing says then what it
belongs to. A table with `specimen_column` holds one session for each run of rows of one specimen; where each row is a
check (`Bench.of_checks`) one for each specimen, wherever its rows stand. A file that holds nothing readable belongs to
no session.
"""

from __future__ import annotations

import hashlib
import json
import re
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench
from ingest.facts.events import DecodeCompleted, SessionRecorded, SessionRegrouped
from ingest.facts.standing import RowsOfLog, runs, runs_of

ID_LENGTH = 16  # hexadecimal characters, 64 bits: two of a million sessions share one with a chance of 3e-8
SECOND_NS = 1_000_000_000
BY_FLAG = "given when the file was ingested"
BY_BENCH = "given by the bench file"


@dataclass(frozen=True)
class Override:
    """What was said on the command line for one file; it beats the bench file."""

    specimen: str | None = None
    batch: str | None = None
    kind: str | None = None


@dataclass(frozen=True)
class _Part:
    """A file, or the rows of one specimen in it: what sessions are put together from."""

    raw: str
    first: int
    last: int
    whole: bool
    specimen: str | None
    batch: str | None
    absolute: bool
    start_ns: int
    end_ns: int
    rows: tuple[int, ...] = ()  # of a table of evaluated checks: its records, which need not follow each other

    @property
    def runs(self) -> list[tuple[int, int]]:
        """First and last of the records that follow each other."""
        return runs_of(self.rows) if self.rows else [(self.first, self.last)]

    @property
    def place(self) -> tuple[int, int, str, int]:
        """Where it sorts: by start, and of two that start together the longer first: the shorter may be a cut copy."""
        return self.start_ns, -self.end_ns, self.raw, self.first


def natural(name: str) -> list[tuple[int, int, str]]:
    """Sort key of a name with its numbers compared as numbers: `2_s2` before `10_s1`."""
    pieces = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(0, int(piece), "") if piece.isdecimal() else (1, 0, piece) for piece in pieces]


def order(session: SessionRecorded) -> tuple[Any, ...]:
    """Sort key of sessions: start (without absolute time last), name with numbers as numbers, place in the file."""
    start = session.start_ns if session.absolute else 0
    return (not session.absolute, start, natural(session.name), session.start_ns, session.session)


Label = tuple[str | None, str | None]  # specimen and batch


def parts(
    record: NDArray[np.int64],
    t_ns: NDArray[np.int64],
    which: NDArray[np.int64],
    labels: Sequence[Label],
    of_checks: bool = False,
) -> list[dict[str, Any]]:
    """The runs of rows of one specimen and batch in a table: the `parts` of its `DecodeCompleted`.

    `record`, `t_ns` [ns], `which` (N,) in the order of the file; `which` is the place of each row's specimen and batch
    (None without such a column) in `labels`. `of_checks`: all rows of one specimen and batch together, whose records
    are listed then as `rows`.
    """
    order = np.argsort(which, kind="stable") if of_checks else np.arange(len(which))
    starts = np.flatnonzero(np.diff(which[order], prepend=-1))
    cuts = [*starts.tolist(), len(which)]
    return [
        {
            "first_record": int(record[own[0]]),
            "last_record": int(record[own[-1]]),
            "start_ns": int(t_ns[own].min()),
            "end_ns": int(t_ns[own].max()),
            "specimen": specimen,
            "batch": batch,
        }
        | ({"rows": record[own].tolist()} if of_checks else {})
        for own in (order[a:b] for a, b in pairwise(cuts))
        for specimen, batch in (labels[int(which[own[0]])],)
    ]


def session_id(raws: Iterable[str], specimen: str | None, rows: Iterable[tuple[str, int, int]] = ()) -> str:
    """Identity of a session: SHA-256 of its raw hashes, specimen and, for parts of files, `(raw, first, last)` rows."""
    identity = {"raws": sorted(set(raws)), "specimen": specimen, "rows": sorted(list(row) for row in rows)}
    text = json.dumps(identity, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH]


def group(
    decodes: Sequence[DecodeCompleted],
    benches: Mapping[str, Bench],
    names: Mapping[str, str],
    overrides: Mapping[str, Override] | None = None,
    gone: Sequence[RowsOfLog] = (),
) -> list[SessionRecorded]:
    """All sessions of these decodes, in the order of `order`.

    `decodes` are in the order in which they were given: of several versions of bench and motor file the last is the
    current one. `benches`: SHA-256 -> bench file; `names`: raw SHA-256 -> file name; `overrides`: raw SHA-256 -> what
    was said for that file; `gone`: records that were taken back. `kind` is "" where neither says one: the data is to
    tell.
    """
    overrides = overrides or {}
    versions, place = _versions(decodes), {decode.decode: k for k, decode in enumerate(decodes)}
    every = [part for raw in versions for part in _parts(versions[raw], benches, overrides.get(raw, Override()))]
    whole = [one for one in every if not any(rows.hold(one.raw, *run) for rows in gone for run in one.runs)]
    sets = _join(whole, versions, benches)
    sessions = [_session(members, versions, place, benches, names, overrides) for members in sets]
    return sorted(sessions, key=order)


def regroup(old: Sequence[SessionRecorded], new: Sequence[SessionRecorded]) -> list[SessionRecorded | SessionRegrouped]:
    """The events that turn the sessions `old` into `new`: what is new or changed, then where each vanished id went.

    A session whose files and decodes are as before keeps the kind that was recognised in them.
    """
    before, heir_of = {session.session: session for session in old}, _Heirs(new).of
    now = [_with_known_kind(session, before.get(session.session)) for session in new]
    events: list[SessionRecorded | SessionRegrouped] = [
        session for session in now if before.get(session.session) != session
    ]
    ids = {session.session for session in now}
    for session in old:
        if session.session not in ids and (heir := heir_of(session)):
            events.append(SessionRegrouped(session=session.session, into=heir.session, why=_why(session, heir)))
    return events


def overrides_of(
    sessions: Iterable[SessionRecorded], benches: Mapping[str, Bench], decodes: Mapping[str, DecodeCompleted]
) -> dict[str, Override]:
    """What was said on the command line for these sessions' files: what differs from their bench file, and from the
    columns of the file that it names. Of a file that was in several, the last tells."""
    found: dict[str, Override] = {}
    parts_in = lru_cache(lambda decode: _Parts.of(decodes.get(decode)))  # of a fleet's table it is asked for each motor
    for session in sessions:
        bench = benches.get(session.bench or "", Bench(sha256="", name=""))
        for file in session.files:
            rows = parts_in(file["decode"]).within(file)
            specimens = {row["specimen"] for row in rows} if bench.specimen_column else {bench.specimen}
            batches = {row["batch"] for row in rows} if bench.batch_column else {bench.batch}
            found[file["raw"]] = Override(
                specimen=None if specimens == {session.specimen} else session.specimen,
                batch=None if batches == {session.batch} else session.batch,
                kind=session.kind if session.kind_why == BY_FLAG else None,
            )
    return {raw: said for raw, said in found.items() if said != Override()}


@dataclass(frozen=True)
class _Parts:
    """The parts of a decode in the order of their first records."""

    parts: list[dict[str, Any]]
    first: list[int]

    @classmethod
    def of(cls, decode: DecodeCompleted | None) -> _Parts:
        parts = sorted(decode.parts if decode else [], key=lambda one: int(one["first_record"]))
        return cls(parts, [one["first_record"] for one in parts])

    def within(self, file: Mapping[str, Any]) -> list[dict[str, Any]]:
        """The parts that an entry of `SessionRecorded.files` holds."""
        at, end = (bisect_left(self.first, record) for record in (file["first_record"], file["last_record"] + 1))
        if "rows" in file:
            return self.parts[at : at + 1]
        return [one for one in self.parts[at:end] if one["last_record"] <= file["last_record"]]


def _versions(decodes: Sequence[DecodeCompleted]) -> dict[str, list[DecodeCompleted]]:
    """The readable decodes of each raw file: without a bench file first, the current one last."""
    found: dict[str, list[DecodeCompleted]] = defaultdict(list)
    for decode in decodes:
        if decode.outcome != "quarantined":
            found[decode.raw].append(decode)
    return {raw: sorted(some, key=lambda decode: decode.bench is not None) for raw, some in found.items()}


def _parts(versions: list[DecodeCompleted], benches: Mapping[str, Bench], said: Override) -> list[_Part]:
    decode = versions[-1]
    bench = benches.get(decode.bench or "", Bench(sha256="", name=""))
    whole: dict[str, Any] = {
        "first_record": 0,
        "last_record": max(decode.balance.get("found", 0) - 1, 0),
        "start_ns": decode.start_ns or 0,
        "end_ns": decode.end_ns or 0,
    }
    rows = decode.parts if decode.parts and said.specimen is None else [whole]
    return [
        _Part(
            raw=decode.raw,
            first=row["first_record"],
            last=row["last_record"],
            whole=len(rows) == 1,
            specimen=said.specimen or row.get("specimen") or bench.specimen,
            batch=said.batch or row.get("batch") or bench.batch,
            absolute=decode.absolute and decode.start_ns is not None,  # of a log without a record no time is known
            start_ns=row["start_ns"],
            end_ns=row["end_ns"],
            rows=tuple(row.get("rows", ())),
        )
        for row in rows
    ]


def _join(
    whole: list[_Part], versions: Mapping[str, list[DecodeCompleted]], benches: Mapping[str, Bench]
) -> list[list[_Part]]:
    """Connected parts, none from before and after a change of the bench. Two that are one session under any bench file
    stay one: a new version never parts them. Checks of a table are joined with nothing: they lie years apart."""
    head = {part: part for part in whole}

    def root(part: _Part) -> _Part:
        while head[part] != part:
            part = head[part]
        return part

    lines: dict[tuple[str, str | None, int], list[_Part]] = defaultdict(list)
    for part in whole:
        if part.absolute and not part.rows:
            for sha in {decode.bench for decode in versions[part.raw] if decode.bench in benches}:
                changes = benches[str(sha)].changes_at(part.start_ns)
                lines[str(sha), part.specimen, len(changes)].append(part)
    for (sha, *_), line in lines.items():
        latest: _Part | None = None
        for part in sorted(line, key=lambda one: one.place):
            if latest and part.start_ns - latest.end_ns < benches[sha].join_gap_s * SECOND_NS:
                head[root(part)] = root(latest)
            latest = max(latest or part, part, key=lambda one: one.end_ns)
    sets: dict[_Part, list[_Part]] = defaultdict(list)
    for part in whole:
        sets[root(part)].append(part)
    return [sorted(members, key=lambda one: one.place) for members in sets.values()]


def _session(
    members: list[_Part],
    versions: Mapping[str, list[DecodeCompleted]],
    place: Mapping[str, int],
    benches: Mapping[str, Bench],
    names: Mapping[str, str],
    overrides: Mapping[str, Override],
) -> SessionRecorded:
    raws = list(dict.fromkeys(part.raw for part in members))
    sha, model = _version_of([decode for raw in raws for decode in versions[raw] if decode.bench in benches], place)
    bench = benches.get(sha or "", Bench(sha256="", name=""))
    rows = [(part.raw, *run) for part in members if not part.whole for run in part.runs]
    kind = next((said.kind for raw in raws if (said := overrides.get(raw)) and said.kind), None)
    return SessionRecorded(
        session=session_id(raws, members[0].specimen, rows),
        name=names[raws[0]].split(".")[0],
        kind=kind or bench.kind or "",
        kind_why=BY_FLAG if kind else BY_BENCH if bench.kind else "",
        specimen=members[0].specimen,
        batch=next((part.batch for part in members if part.batch), None),
        bench=sha,
        configuration=bench.configuration,
        attributes=dict(bench.attributes),
        absolute=members[0].absolute,
        start_ns=min(part.start_ns for part in members),
        end_ns=max(part.end_ns for part in members),
        files=[_file(part, versions[part.raw], (sha, model)) for part in members],
        model=model,
    )


_Version = tuple[str | None, str | None]  # SHA-256 of bench and motor file


def _version_of(decodes: Iterable[DecodeCompleted], place: Mapping[str, int]) -> _Version:
    """The version that most files were decoded under; of equals, the one given last. `place`: decode -> its order."""
    files: dict[_Version, set[str]] = defaultdict(set)
    last: dict[_Version, int] = {}
    for decode in decodes:
        version = decode.bench, decode.model
        files[version].add(decode.raw)
        last[version] = max(last.get(version, -1), place[decode.decode])
    return max(files, key=lambda version: (len(files[version]), last[version]), default=(None, None))


def _file(part: _Part, versions: list[DecodeCompleted], version: _Version) -> dict[str, Any]:
    decode = next((one for one in reversed(versions) if (one.bench, one.model) == version), versions[-1])
    file = {"raw": part.raw, "decode": decode.decode, "first_record": part.first, "last_record": part.last}
    return file | ({"rows": list(part.rows)} if part.rows else {})


def _with_known_kind(session: SessionRecorded, before: SessionRecorded | None) -> SessionRecorded:
    if session.kind or before is None or before.files != session.files or before.kind_why in (BY_FLAG, BY_BENCH):
        return session
    return replace(session, kind=before.kind, kind_why=before.kind_why)


class _Heirs:
    """Which of the sessions `now` takes the place of one that is no more."""

    def __init__(self, now: Sequence[SessionRecorded]) -> None:
        self._now = now
        self._holding: dict[str, list[tuple[int, int]]] = defaultdict(list)  # log -> first records and places in `now`
        for place, session in enumerate(now):
            for file in session.files:
                self._holding[file["raw"]] += [(first, place) for first, _ in runs(file)]
        self._places = {raw: {place for _, place in held} for raw, held in self._holding.items()}
        for held in self._holding.values():
            held.sort()

    def of(self, session: SessionRecorded) -> SessionRecorded | None:
        """The session that holds most of this one's files, of a table with many the one with its first row; the first
        of equals."""
        found = Counter(place for file in session.files for place in self._with(file))
        return self._now[max(found, key=lambda place: (found[place], -place))] if found else None

    def _with(self, file: Mapping[str, Any]) -> set[int]:
        """The sessions with records of a file: where several have some, the one whose run its first record falls
        into."""
        places = self._places.get(file["raw"], set())
        if len(places) < 2:
            return places
        held = self._holding[file["raw"]]
        at = bisect_right(held, (file["first_record"], len(self._now)))
        return {held[max(at - 1, 0)][1]}


def _why(old: SessionRecorded, new: SessionRecorded) -> str:
    if old.specimen != new.specimen:
        return f"specimen is now {new.specimen or 'not given'} (was {old.specimen or 'not given'})"
    joined, parted = ({file["raw"] for file in one.files} for one in (new, old))
    if joined > parted:
        return f"{len(joined - parted)} more file{'s' * (len(joined - parted) > 1)} of the same test came"
    return "its files were put together anew"
