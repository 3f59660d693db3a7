"""Sessions: which files are one test. A pure function of facts, so that any order of arrival gives the same sessions.

Files of one bench file and specimen with absolute time, that overlap or follow each other within `join_gap_s`, are one
session; a file without absolute time is one by itself, and so is a file without a bench file: nothing says then what it
belongs to. A table with `specimen_column` holds one session for each run of rows of one specimen. A file that holds
nothing readable belongs to no session.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench
from ingest.facts.events import DecodeCompleted, SessionRecorded, SessionRegrouped
from ingest.facts.standing import RowsOfLog

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


def parts(
    record: NDArray[np.int64],
    t_ns: NDArray[np.int64],
    specimens: Sequence[str | None],
    batches: Sequence[str | None],
) -> list[dict[str, Any]]:
    """The runs of rows of one specimen and batch in a table: the `parts` of its `DecodeCompleted`.

    `record`, `t_ns` [ns] (N,) in the order of the file; `specimens`, `batches`: N texts, None without such a column.
    """
    labels = list(zip(specimens, batches, strict=True))
    starts = [i for i in range(len(labels)) if i == 0 or labels[i] != labels[i - 1]]
    return [
        {
            "first_record": int(record[a]),
            "last_record": int(record[b - 1]),
            "start_ns": int(t_ns[a:b].min()),
            "end_ns": int(t_ns[a:b].max()),
            "specimen": labels[a][0],
            "batch": labels[a][1],
        }
        for a, b in zip(starts, [*starts[1:], len(labels)], strict=True)
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
    whole = [one for one in every if not any(rows.hold(one.raw, one.first, one.last) for rows in gone)]
    sets = _join(whole, versions, benches)
    sessions = [_session(members, versions, place, benches, names, overrides) for members in sets]
    return sorted(sessions, key=order)


def regroup(old: Sequence[SessionRecorded], new: Sequence[SessionRecorded]) -> list[SessionRecorded | SessionRegrouped]:
    """The events that turn the sessions `old` into `new`: what is new or changed, then where each vanished id went.

    A session whose files and decodes are as before keeps the kind that was recognised in them.
    """
    before = {session.session: session for session in old}
    now = [_with_known_kind(session, before.get(session.session)) for session in new]
    events: list[SessionRecorded | SessionRegrouped] = [
        session for session in now if before.get(session.session) != session
    ]
    ids = {session.session for session in now}
    for session in old:
        if session.session not in ids and (heir := _heir(session, now)):
            events.append(SessionRegrouped(session=session.session, into=heir.session, why=_why(session, heir)))
    return events


def overrides_of(
    sessions: Iterable[SessionRecorded], benches: Mapping[str, Bench], decodes: Mapping[str, DecodeCompleted]
) -> dict[str, Override]:
    """What was said on the command line for these sessions' files: what differs from their bench file, and from the
    columns of the file that it names. Of a file that was in several, the last tells."""
    found: dict[str, Override] = {}
    for session in sessions:
        bench = benches.get(session.bench or "", Bench(sha256="", name=""))
        for file in session.files:
            rows = [row for row in _rows_of(decodes.get(file["decode"])) if _holds(file, row)]
            specimens = {row["specimen"] for row in rows} if bench.specimen_column else {bench.specimen}
            batches = {row["batch"] for row in rows} if bench.batch_column else {bench.batch}
            found[file["raw"]] = Override(
                specimen=None if specimens == {session.specimen} else session.specimen,
                batch=None if batches == {session.batch} else session.batch,
                kind=session.kind if session.kind_why == BY_FLAG else None,
            )
    return {raw: said for raw, said in found.items() if said != Override()}


def _rows_of(decode: DecodeCompleted | None) -> list[dict[str, Any]]:
    return decode.parts if decode else []


def _holds(file: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    return bool(file["first_record"] <= row["first_record"] and row["last_record"] <= file["last_record"])


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
            absolute=decode.absolute,
            start_ns=row["start_ns"],
            end_ns=row["end_ns"],
        )
        for row in rows
    ]


def _join(
    whole: list[_Part], versions: Mapping[str, list[DecodeCompleted]], benches: Mapping[str, Bench]
) -> list[list[_Part]]:
    """Connected parts, none from before and after a change of the bench. Two that are one session under any bench file
    stay one: a new version never parts them."""
    head = {part: part for part in whole}

    def root(part: _Part) -> _Part:
        while head[part] != part:
            part = head[part]
        return part

    lines: dict[tuple[str, str | None, int], list[_Part]] = defaultdict(list)
    for part in whole:
        if part.absolute:
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
    kind = next((said.kind for raw in raws if (said := overrides.get(raw)) and said.kind), None)
    return SessionRecorded(
        session=session_id(raws, members[0].specimen, [(p.raw, p.first, p.last) for p in members if not p.whole]),
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
    return {"raw": part.raw, "decode": decode.decode, "first_record": part.first, "last_record": part.last}


def _with_known_kind(session: SessionRecorded, before: SessionRecorded | None) -> SessionRecorded:
    if session.kind or before is None or before.files != session.files or before.kind_why in (BY_FLAG, BY_BENCH):
        return session
    return replace(session, kind=before.kind, kind_why=before.kind_why)


def _heir(session: SessionRecorded, now: Sequence[SessionRecorded]) -> SessionRecorded | None:
    """The session that holds most of this one's files; the first of equals."""
    raws = {file["raw"] for file in session.files}
    shared = [(sum(file["raw"] in raws for file in one.files), one) for one in now]
    most, heir = max(shared, key=lambda pair: pair[0], default=(0, None))
    return heir if most else None


def _why(old: SessionRecorded, new: SessionRecorded) -> str:
    if old.specimen != new.specimen:
        return f"specimen is now {new.specimen or 'not given'} (was {old.specimen or 'not given'})"
    joined, parted = ({file["raw"] for file in one.files} for one in (new, old))
    if joined > parted:
        return f"{len(joined - parted)} more file{'s' * (len(joined - parted) > 1)} of the same test came"
    return "its files were put together anew"
