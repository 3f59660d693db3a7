"""Facts as rows of the tables in schema `base` that `sql/tables.sql` declares."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ingest.bench.resolving import region_by_name
from ingest.errors import UnknownSessionError
from ingest.facts.cited import cited
from ingest.facts.events import InspectionRecorded, RawFileSealed, ReplayCompleted, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.facts.standing import runs

if TYPE_CHECKING:
    from ingest.facts.store import Store

Rows = Iterable[dict[str, Any]]  # of tables that grow with the sessions one after the other, never all at once
BALANCE = ("found", "decoded", "unknown_id", "wrong_length", "rejected")


def rows(store: Store, facts: Facts, recorded: Sequence[Recorded]) -> dict[str, Rows]:
    """The rows of every base table but `built_from`, by table. `recorded`: the events that `facts` follow from.

    What was forgotten since then has no samples any more."""
    gone, again = store.forgotten, cited(recorded)
    used = {file["decode"] for session in facts.sessions for file in session.files}
    return {
        "events": map(_event, recorded),
        "files": _files(facts, recorded),
        "decodes": _decodes(facts),
        "benches": [{"bench": bench.sha256, "name": bench.name} for bench in facts.benches.values()],
        "sessions": _sessions(facts),
        "session_files": (
            {
                "session": session.session,
                "raw": file["raw"],
                "decode": file["decode"],
                "first_record": first,
                "last_record": last,
            }
            for session in facts.sessions
            for file in session.files
            for first, last in runs(file)
        ),
        "groups": _groups(store, facts, used - gone.decodes.keys()),
        "channels": _channels(facts, used),
        "runs": _runs(facts, recorded),
        "artefacts": [
            {
                "run": run,
                "kind": kind,
                "file": str(store.archive.path(sha256).absolute()),
                "sha256": sha256,
                "again": again[sha256].mend,
            }
            for run, kind, sha256 in _artefacts(facts)
            if sha256 not in gone.files
        ],
        "inspections": _inspections(facts, recorded),
    }


def _event(one: Recorded) -> dict[str, Any]:
    names = ("position", "stream", "version", "happened", "recorded", "code", "caused_by", "digest")
    return {name: getattr(one, name) for name in names} | {"topic": one.event.TOPIC, "payload": _json(vars(one.event))}


def _files(facts: Facts, recorded: Iterable[Recorded]) -> Rows:
    sealed = {one.event.sha256: one.recorded for one in recorded if isinstance(one.event, RawFileSealed)}
    return [
        {
            "raw": file.sha256,
            "name": file.name,
            "size": file.size,
            "format": file.format,
            "recorded": sealed.get(file.sha256),
            "place": place,
        }
        for place, file in enumerate(facts.files.values())
    ]


def _decodes(facts: Facts) -> Rows:
    names = ("decode", "raw", "bench", "decoder", "outcome", "why", "absolute", "start_ns", "end_ns")
    return [
        {name: getattr(decode, name) for name in names}
        | {name: decode.balance.get(name, 0) for name in BALANCE}
        | {"place": place}
        for place, decode in enumerate(facts.decodes.values())
    ]


def _sessions(facts: Facts) -> Rows:
    names = ("session", "name", "kind", "kind_why", "specimen", "batch", "bench", "configuration", "absolute")
    return (
        {name: getattr(session, name) for name in (*names, "start_ns", "end_ns")}
        | {"attributes": _json(session.attributes), "place": place, **_model(facts, session)}
        for place, session in enumerate(facts.sessions)
    )


def _model(facts: Facts, session: SessionRecorded) -> dict[str, str | None]:
    """The motor file that lay beside the session's bench file when its files came, and its motor."""
    known = facts.models.get(session.model or "") or facts.benches.get(session.bench or "")
    return {"motor": known.motor if known else None, "model": known.model if known else None}


def _groups(store: Store, facts: Facts, used: Iterable[str]) -> Rows:
    return [
        {
            "decode": decode,
            "group_name": group["name"],
            "file": str((store.decoded(decode) / group["file"]).absolute()),
            "sha256": facts.decodes[decode].products.get(group["file"]),
            "doubled": group["name"] in facts.decodes[decode].settings.get("clock", {}).get("doubled", ()),
        }
        for decode in sorted(used)
        for group in facts.decodes[decode].groups
    ]


def _channels(facts: Facts, used: Iterable[str]) -> Rows:
    return [
        {
            "decode": decode,
            "place": place,
            "channel": channel["name"],
            "group_name": channel["group"],
            "column_name": channel["column"],
            **{key: channel.get(key) for key in ("quantity", "unit", "node", "role", "derived")},
            "region": _region(channel),
        }
        for decode in sorted(used)
        for place, channel in enumerate(facts.decodes[decode].channels)
    ]


def _region(channel: Mapping[str, Any]) -> str | None:
    """The region of a channel's node, as the decode says; by the node's name where an older decode does not say it."""
    node: str | None = channel.get("node")
    found: str | None = channel.get("region", region_by_name(node) if node else None)
    return found


def _runs(facts: Facts, recorded: Iterable[Recorded]) -> Rows:
    when = {one.event.run: one.recorded for one in recorded if isinstance(one.event, ReplayCompleted)}
    names = ("run", "session", "motor", "model", "level", "bench", "digest")
    models: dict[str | None, str] = {one.session: facts.current(one.model) for one in facts.sessions if one.model}
    return [
        {name: getattr(run, name) for name in names}
        | {name: _json(getattr(run, name)) for name in ("key", "environment", "summary")}
        | {"session_now": (now := _session_now(facts, run.session)), "recorded": when.get(run.run), "place": place}
        | {"current_model": run.model == models.get(now)}
        for place, run in enumerate(facts.runs.values())
    ]


def _artefacts(facts: Facts) -> Iterator[tuple[str, str, str]]:
    """(id, kind, SHA-256) of the Parquet files of every run, and of the latest assessment of ageing."""
    for run in facts.runs.values():
        yield from ((run.run, kind, sha256) for kind, sha256 in run.artefacts.items())
    for latest in list(facts.assessments.values())[-1:]:
        yield from ((latest.assessment, f"ageing_{kind}", sha256) for kind, sha256 in latest.artefacts.items())


def _inspections(facts: Facts, recorded: Iterable[Recorded]) -> Rows:
    when = {one.event.inspection: one.recorded for one in recorded if isinstance(one.event, InspectionRecorded)}
    return [
        {**vars(one), "recorded": when.get(one.inspection), "place": place}
        for place, one in enumerate(facts.inspections.values())
    ]


def _session_now(facts: Facts, session: str) -> str | None:
    try:
        return facts.session(session).session
    except UnknownSessionError:
        return None


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
