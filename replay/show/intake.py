"""What `whyhot ingest` says: what came in, what became of every record, and what to look at."""

from __future__ import annotations

from typing import Any

from ingest.events import DecodeCompleted
from ingest.intake import Intake, Taken


def intake_json(intake: Intake) -> dict[str, Any]:
    """The answer "whyhot.ingest/1": files with their balance, sessions touched, flags."""
    return {
        "schema": "whyhot.ingest/1",
        "files": [_file(taken) for taken in intake.files],
        "sessions": [{"session": s.session, "name": s.name, "kind": s.kind} for s in intake.sessions],
        "flags": [{"session": name, "flag": flag.flag, "says": flag.says} for name, flag in intake.flags],
    }


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
    """A few lines a file, width 100, and the next command."""
    lines = [line for taken in intake.files if taken.decode for line in _lines(intake, taken, taken.decode)]
    lines += [f"  {name}: {flag.says}" for name, flag in intake.flags]
    if intake.sessions:
        lines.append(f"next: whyhot show {intake.sessions[0].name}")
    return "\n".join(lines)


def _lines(intake: Intake, taken: Taken, decode: DecodeCompleted) -> list[str]:
    balance = decode.balance
    state = "already in the store, nothing new" if taken.known else f"sealed {taken.raw[:12]}"
    mine = [s for s in intake.sessions if any(f["raw"] == taken.raw for f in s.files)]
    where = "".join(f"   session {s.name} ({s.kind}: {s.kind_why})" for s in mine[:1])
    more = f" and {len(mine) - 1} more sessions" if len(mine) > 1 else ""
    return [
        f"{taken.name}   {_size(taken.size)}   {balance['found']:,} {taken.holds}   {state}",
        *([f" {where}{more}"] if mine else []),
        (
            f"  decoded {balance['decoded']:,} · unknown id {balance['unknown_id']:,} · wrong length {balance['wrong_length']:,}"
            f" · rejected {balance['rejected']:,} = {balance['found']:,} in the file: the balance holds"
        ),
    ]


def _size(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{max(size / 1e3, 0.1):.1f} kB"
