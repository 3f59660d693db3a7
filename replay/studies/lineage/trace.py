"""Where a number came from: a point of a run, a number of a report, a row of SQL, or any fact by its name."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from ingest.errors import UnknownSessionError
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.facts.lineage import Chains, FactLink, distinct
from ingest.facts.named import find, find_log, retractable
from ingest.facts.store import Store
from ingest.intake.located import Located, locate
from ingest.texts.names import handle, is_called
from ingest.texts.times import clock
from replay.engine.results.artefacts import read_parquet
from replay.errors import ReplayDataError

SHOWN = 20  # points of a run
POINT = re.compile(r"(?P<run>[0-9a-f]{4,16})(?:@(?P<time>[0-9.:]+))?(?:/(?P<channel>.+))?", re.IGNORECASE)
OF_SESSION = re.compile(r"(?P<session>.+)@(?P<time>[0-9.:]+)(?:/(?P<channel>.+))?|(?P<mean>[^/]+)/(?P<its>.+)")
RECORDS = re.compile(r"(?P<log>.+?):(?P<first>[0-9,]+)(?:-(?P<last>[0-9,]+))?")


@dataclass(frozen=True)
class TracedPoint:
    """What a run says of a channel: at one step, or (`steps` > 1) in the mean over all that were used. `measured` and
    `modelled` [degC], `residual_K`: the mean absolute one of several; `file`, `first`, `last`: its records."""

    channel: str
    node: str
    t_s: float
    steps: int
    measured: float
    modelled: float
    residual_K: float
    used: bool
    file: str
    first: int
    last: int


@dataclass(frozen=True)
class TracedRecord:
    """A record of a log. `absolute`: its stamp is UTC."""

    file: str
    name: str
    absolute: bool
    found: Located


@dataclass(frozen=True)
class Lineage:
    """What was asked for, the facts behind it from the answer down to the bytes, and the records themselves: of a range
    the first and the last."""

    points: Sequence[TracedPoint]
    links: Sequence[FactLink]
    records: Sequence[TracedRecord]


def trace(store: Store, recorded: Sequence[Recorded], facts: Facts, text: str) -> Lineage:
    """The lineage of `text`: the name or id of a fact, RUN@TIME/CHANNEL (RUN may be a session: its last replay), or
    LOG:RECORD. Raises ReplayDataError, CorrectionError, DamageError."""
    chains = Chains(recorded, facts)
    at = POINT.fullmatch(text)
    runs = [run for run in facts.runs if at and run.startswith(at["run"].lower())]
    if at and len(runs) == 1:
        return _of_run(store, facts, chains, runs[0], at["time"], at["channel"])
    if (of := OF_SESSION.fullmatch(text)) and (session := _session(facts, of["session"] or of["mean"])):
        return _of_run(store, facts, chains, _last_run(facts, session), of["time"], of["channel"] or of["its"])
    if (rows := RECORDS.fullmatch(text)) and (raw := _log(facts, rows["log"])):
        first = int(rows["first"].replace(",", ""))
        return _of_records(store, facts, chains, raw, first, int((rows["last"] or rows["first"]).replace(",", "")))
    return Lineage((), distinct(_chain(facts, chains, text)), ())


def trace_row(store: Store, recorded: Sequence[Recorded], facts: Facts, row: Mapping[str, Any]) -> Lineage:
    """The lineage of a row of SQL, by the columns that it has: `run` with `t_s` and `channel`; `file_id` with `record`,
    or `first_record` and `last_record`; else any id, or of an event its stream's. Raises as `trace`, ReplayDataError
    where it has none of these."""
    chains, has = Chains(recorded, facts), {name for name, value in row.items() if value is not None}
    if {"run", "t_s", "channel"} <= has:
        return _of_run(store, facts, chains, row["run"], str(row["t_s"]), row["channel"])
    if "file_id" in has and {"record", "first_record"} & has:
        first = row.get("record", row.get("first_record"))
        return _of_records(store, facts, chains, row["file_id"], first, row.get("last_record", first))
    for column in ("run", "assessment", "inspection", "session", "file_id", "model"):
        if column in has:
            return trace(store, recorded, facts, row[column])
    if "stream" in has:  # of an event: `run-<id>`
        return trace(store, recorded, facts, row["stream"].partition("-")[2])
    raise ReplayDataError(
        "the row has no column that says where it came from: select run (with t_s and channel), session, file_id (with "
        "record), assessment, inspection, model or stream too."
    )


def _chain(facts: Facts, chains: Chains, text: str) -> Iterable[FactLink]:
    """The links of any fact by its name, id, or the beginning of its id."""
    of: tuple[tuple[Iterable[str], Callable[[str], list[FactLink]]], ...] = (
        ([one.calibration for one in facts.calibrations.values()], chains.of_calibration),
        (facts.assessments, chains.of_ageing),
        (facts.models, chains.of_model),
        (facts.benches, chains.of_bench),
    )
    for ids, chain in of:
        found = [one for one in ids if is_called(one, text)]
        if len(found) == 1:
            return chain(found[0])
    motors = [one.model for one in facts.models.values() if text in (one.motor, one.file)]
    if motors:
        return chains.of_model(motors[-1])
    benches = [sha256 for sha256, one in facts.benches.items() if one.name == text]
    if benches and all(one.name != text for one in retractable(facts)):
        return chains.of_bench(benches[-1])
    named = find(facts, text)
    match named.kind:
        case "session":
            return chains.of_session(named.key)
        case "log":
            return chains.of_log(_file(facts, named.key))
        case "diagnosis":
            return chains.of_diagnosis(named.key)
    return chains.of_inspection(named.key)


def _session(facts: Facts, text: str) -> SessionRecorded | None:
    """The session of this name, id or beginning of it, None where there is none. Raises UnknownSessionError for
    several of one name."""
    try:
        return facts.session(text)
    except UnknownSessionError:
        if any(one.name == text for one in facts.sessions):
            raise
        return None


def _last_run(facts: Facts, session: SessionRecorded) -> str:
    """Raises ReplayDataError where it has not been replayed."""
    if runs := facts.runs_of(session):
        return runs[-1].run
    again = f"`whyhot replay {shlex.quote(session.name)}`"
    raise ReplayDataError(f"session {session.name}: has no replay to take a point of: {again} first.")


def _log(facts: Facts, text: str) -> str | None:
    """SHA-256 of the log of this name, or beginning of its SHA-256. Raises CorrectionError for several of one name."""
    named = [raw for raw, one in facts.files.items() if one.name == text]
    if len(named) > 1:
        return find_log(facts, text).key
    found = named or [raw for raw in facts.files if is_called(raw, text)]
    return found[0] if len(found) == 1 else None


def _file(facts: Facts, raw: str) -> dict[str, Any]:
    """The log as its session holds it; where it has several or none, the whole of it as it was decoded last."""
    held = [file for session in facts.sessions for file in session.files if file["raw"] == raw]
    if len(held) == 1:
        return held[0]
    decodes = [facts.decodes[file["decode"]] for file in held] or facts.decodes_of(raw)
    if not decodes:
        raise ReplayDataError(f"log {handle(raw)}: is not in this store, or was taken back.")
    last = max(decodes[-1].balance.get("found", 0) - 1, 0)
    return {"raw": raw, "decode": decodes[-1].decode, "first_record": 0, "last_record": last}


def _of_records(store: Store, facts: Facts, chains: Chains, raw: str, first: int, last: int) -> Lineage:
    records = _records(store, facts, [(raw, first), (raw, last)])
    if not records:
        name, found = facts.files[raw].name, facts.decodes[_file(facts, raw)["decode"]].balance.get("found", 0)
        raise ReplayDataError(f"{name}: has no record {first:,}: it holds {found:,}, counted from 0.")
    return Lineage((), distinct(chains.of_log(_file(facts, raw))), records)


def _records(store: Store, facts: Facts, wanted: Iterable[tuple[str, int]]) -> list[TracedRecord]:
    """(log, record) each found in its sealed bytes."""
    of: dict[str, list[int]] = {}
    for raw, record in dict.fromkeys(wanted):
        of.setdefault(raw, []).append(record)
    found = []
    for raw, records in of.items():
        decode = facts.decodes[_file(facts, raw)["decode"]]
        located = locate(store, facts, decode, records)
        found += [TracedRecord(raw, facts.files[raw].name, decode.absolute, one) for one in located]
    return found


def _of_run(store: Store, facts: Facts, chains: Chains, run: str, time: str | None, channel: str | None) -> Lineage:
    links = distinct(chains.of_run(run))
    if time is None and channel is None:
        return Lineage((), links, ())
    table = read_parquet(store.archive.read(facts.runs[run].artefacts["residuals"]))
    channels = np.array(table["channel"].to_pylist(), object)
    nodes = np.array(table["node"].to_pylist(), object)
    names = list(dict.fromkeys(channels.tolist()))
    if channel is not None:
        names = [name for name in names if channel in (name, nodes[np.argmax(channels == name)])]
        if not names:
            there = ", ".join(dict.fromkeys(channels.tolist()))
            raise ReplayDataError(f"replay {run}: has no channel {channel}: it has {there}.")
    at = [np.flatnonzero(channels == name) for name in names[:SHOWN]]
    if time is not None and not _within(table, _seconds(time)):
        ends = clock(float(table["t_s"].to_numpy().max()))
        raise ReplayDataError(f"replay {run}: has no point at {time}: it ends at {ends}.")
    points = [_mean(table, rows) if time is None else _nearest(table, rows, _seconds(time)) for rows in at]
    wanted = [(point.file, record) for point in points for record in (point.first, point.last)]
    return Lineage(points, links, _records(store, facts, wanted))


def _within(table: pa.Table, t_s: float) -> bool:
    """Whether a run reaches to this time, within its longest step."""
    times = np.unique(table["t_s"].to_numpy())
    return bool(t_s <= times[-1] + max(np.diff(times), default=1.0))


def _nearest(table: pa.Table, rows: np.ndarray[Any, Any], t_s: float) -> TracedPoint:
    """The step of a channel whose mean time is nearest."""
    times = table["t_s"].to_numpy()[rows]
    row = table.slice(int(rows[int(np.argmin(np.abs(times - t_s)))]), 1).to_pylist()[0]
    return TracedPoint(
        **{name: row[name] for name in ("channel", "node", "t_s", "used", "residual_K")},
        steps=1,
        measured=row["measured_degC"],
        modelled=row["modelled_degC"],
        file=row["file_id"],
        first=row["first_record"],
        last=row["last_record"],
    )


def _mean(table: pa.Table, rows: np.ndarray[Any, Any]) -> TracedPoint:
    """A channel over all steps that were used: what a report gives as its mean error."""
    own = table.take(pa.array(rows))
    used = np.flatnonzero(own["used"].to_numpy())
    if not used.size:
        raise ReplayDataError(f"channel {own['channel'][0]}: no step of it was used.")
    own = own.take(pa.array(used))
    first, last = (own.slice(i, 1).to_pylist()[0] for i in (0, own.num_rows - 1))
    return TracedPoint(
        channel=first["channel"],
        node=first["node"],
        t_s=first["t_s"],
        steps=own.num_rows,
        measured=float(own["measured_degC"].to_numpy().mean()),
        modelled=float(own["modelled_degC"].to_numpy().mean()),
        residual_K=float(np.abs(own["residual_K"].to_numpy()).mean()),
        used=True,
        file=first["file_id"],
        first=first["first_record"],
        last=last["last_record"] if last["file_id"] == first["file_id"] else first["last_record"],
    )


def _seconds(text: str) -> float:
    """3600, 3600.5, 60:00 or 1:00:00."""
    try:
        return sum(float(part) * 60.0**i for i, part in enumerate(reversed(text.split(":"))))
    except ValueError:
        raise ReplayDataError(f"@{text}: is no time: give seconds, or hours as 1:02:03.") from None
