"""What `whyhot ingest` says: what came in, what became of every record, and what to look at."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from ingest.catalogue.quality import seconds
from ingest.facts.events import DecodeCompleted, QualityFlagged, SessionRecorded
from ingest.intake.intake import Intake, Taken
from ingest.texts.names import handle
from replay.show.words.words import counted, joined, size

REPEATED = ("held", "stuck", "saturated")  # flags of a channel that gives one value again and again
Home = tuple[str, str | None]  # of a channel: its file, its bus
Member = tuple[QualityFlagged, Home]


def intake_json(intake: Intake) -> dict[str, Any]:
    """The answer "whyhot.ingest/1": files with their balance, sessions touched, flags."""
    return {
        "schema": "whyhot.ingest/1",
        "files": [_file(taken) for taken in intake.files],
        "sessions": [session_json(session) for session in intake.sessions],
        "flags": [{"session": name, "flag": flag.flag, "says": flag.says} for name, flag in intake.flags],
    }


def session_json(session: SessionRecorded) -> dict[str, str]:
    """A session as answers name it."""
    return {"session": session.session, "name": session.name, "kind": session.kind}


def _file(taken: Taken) -> dict[str, Any]:
    decode = taken.decode
    return {
        "name": taken.name,
        "bytes": taken.size,
        "sha256": taken.raw or None,
        "outcome": decode.outcome if decode else "refused",
        "known": taken.known,
        "why": taken.refusal or (decode.why if decode else None),
        "balance": decode.balance if decode else None,
        "unknown_ids": decode.unknown_ids if decode else {},
        "rejections": decode.rejections if decode else [],
    }


def intake_text(intake: Intake) -> str:
    """A few lines a file, and the next command."""
    lines = [line for taken in intake.files if taken.decode for line in _lines(intake, taken, taken.decode)]
    lines += [*_version_lines(intake), *_flag_lines(intake)]
    if intake.sessions:
        first, names = intake.sessions[0], [session.name for session in intake.sessions]
        called = first.name if names.count(first.name) == 1 else first.session
        lines.append(f"next: whyhot show {shlex.quote(called)}")
    return "\n".join(lines)


def _lines(intake: Intake, taken: Taken, decode: DecodeCompleted) -> list[str]:
    balance = decode.balance
    state = f"sealed {handle(taken.raw)}"
    if taken.known:
        state = f"already in the store, {'its session anew' if taken.anew else 'nothing new'}"
    if decode.outcome == "quarantined":
        return [f"{taken.name}   {size(taken.size)}   quarantined   {state}"]
    mine = [s for s in intake.sessions if any(f["raw"] == taken.raw for f in s.files)]
    where = "".join(f"   session {s.name} ({s.kind}: {s.kind_why})" for s in mine[:1])
    more = f" and {counted(len(mine) - 1, 'more session')}" if len(mine) > 1 else ""
    of = "read" if decode.outcome == "salvaged" else "in the file"
    return [
        f"{taken.name}   {size(taken.size)}   {balance['found']:,} {taken.holds}   {state}",
        *([f" {where}{more}"] if mine else []),
        (
            f"  decoded {balance['decoded']:,} · unknown id {balance['unknown_id']:,} · wrong length "
            f"{balance['wrong_length']:,} · rejected {balance['rejected']:,} = {balance['found']:,} {of}: the balance "
            "holds"
        ),
    ]


def _version_lines(intake: Intake) -> list[str]:
    """A line for each session that stays with the bench and motor file that most of its files came with."""
    given = {taken.raw: (taken.decode.bench, taken.decode.model) for taken in intake.files if taken.decode}
    return [
        f"  {session.name}: most of its files came with another bench or motor file, which it keeps: to change that, "
        "ingest all of them with this one"
        for session in intake.sessions
        for version in [(session.bench, session.model)]
        if session.bench
        and any(given.get(file["raw"], version) not in (version, (None, None)) for file in session.files)
    ]


def _flag_lines(intake: Intake) -> list[str]:
    """A line a flag; one line together are gaps of several channels that cover the same stretches of one file, and what
    a channel repeats in several sessions."""
    homes = _homes(intake)
    entries: list[tuple[str, list[Member]]] = []
    for session, flag in intake.flags:
        home = homes.get((session, flag.detail.get("channel", "")), ("", None))
        beside = (members for name, members in entries if name == session and _same_silence(members, flag, home))
        if (members := next(beside, None)) is not None:
            members.append((flag, home))
        else:
            entries.append((session, [(flag, home)]))
    repeated = _repeated(entries)
    lines = []
    for session, members in entries:
        flag = members[0][0]
        first, *further = repeated.get(_repeats(flag), [session])
        if session != first:
            continue
        says = _silence(members) if len(members) > 1 else flag.says
        alike = f"; the like in {joined(further)}" if further else ""
        lines.append(f"  {says if says.startswith(f'{session}: ') else f'{session}: {says}'}{alike}")
    return lines


def _repeats(flag: QualityFlagged) -> tuple[str, str]:
    return flag.flag, flag.detail.get("channel", "")


def _repeated(entries: Sequence[tuple[str, Sequence[Member]]]) -> Mapping[tuple[str, str], list[str]]:
    """How and which channel repeats a value -> the sessions in which it does."""
    found: dict[tuple[str, str], list[str]] = {}
    for session, members in entries:
        if members[0][0].flag in REPEATED:
            found.setdefault(_repeats(members[0][0]), []).append(session)
    return found


def _homes(intake: Intake) -> Mapping[tuple[str, str], Home]:
    """(session, channel) -> where the channel comes from, for the files of this intake."""
    found = {taken.raw: (taken.name, taken.decode) for taken in intake.files if taken.decode}
    return {
        (session.name, channel["name"]): (name, (channel["signal"] or {}).get("bus"))
        for session in intake.sessions
        for name, decode in (found[file["raw"]] for file in session.files if file["raw"] in found)
        for channel in decode.channels
    }


def _same_silence(members: Sequence[Member], flag: QualityFlagged, home: Home) -> bool:
    """Whether `flag` is a gap in the file of `members`, as often, and each time while all of them are silent."""
    if flag.flag != "gap" or home[0] == "":
        return False
    return all(
        other.flag == "gap" and file == home[0] and _overlap(other.detail["spans"], flag.detail["spans"])
        for other, (file, _) in members
    )


def _overlap(some: Sequence[Mapping[str, int]], others: Sequence[Mapping[str, int]]) -> bool:
    return len(some) == len(others) and all(
        max(a["start_ns"], b["start_ns"]) < min(a["end_ns"], b["end_ns"]) for a, b in zip(some, others, strict=True)
    )


def _silence(members: Sequence[Member]) -> str:
    """ "gaps: 16 channels of can2 silent for 3.0 s, 1 time"; the time is that in which all of them are."""
    same = zip(*(flag.detail["spans"] for flag, _ in members), strict=True)
    shared_s = [(min(s["end_ns"] for s in spans) - max(s["start_ns"] for s in spans)) / 1e9 for spans in same]
    buses = {bus for _, (_, bus) in members if bus}
    where = buses.pop() if len(buses) == 1 else members[0][1][0]
    longest, times = seconds(max(shared_s)), len(shared_s)
    often = f"up to {longest}, {times} times" if times > 1 else f"{longest}, 1 time"
    return f"gaps: {len(members)} channels of {where} silent for {often}"
