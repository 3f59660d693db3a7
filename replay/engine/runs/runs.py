"""A session replayed, sealed and cited. The same key gives the same digest, or `ReplayDiverged` says where not."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from uuid import uuid4

import numpy as np
import pyarrow as pa

from ingest.catalogue.channels import load
from ingest.facts.events import ReplayCompleted, ReplayDiverged, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.benches import with_bench_of
from replay.engine.files.configurations import network_of
from replay.engine.results.artefacts import (
    filtered_table,
    frame_table,
    heat_table,
    meter_table,
    read_parquet,
    residual_table,
    temperature_table,
    to_parquet,
)
from replay.engine.results.as_json import to_json
from replay.engine.results.asked_unknowns import asked_unknowns
from replay.engine.results.filtered import filter_session, mean_losses
from replay.engine.results.heat_account import heat_course
from replay.engine.results.run import Compared
from replay.engine.results.summary import document
from replay.engine.runs.identity import digest_of, environment, replay_key, run_id
from replay.engine.runs.open_loop_run import OpenLoop, run_of
from replay.engine.runs.sources import code_of
from replay.engine.runs.summed_up import summary_of
from replay.engine.specimen.aged import of_specimen
from twin.filters.by_filterpy import Apart, apart


@dataclass(frozen=True)
class Completed:
    """The fact of a run; `known` where the ledger has it already; how far filterpy's filter is from its own (`apart`),
    where that was asked for and a filter ran."""

    event: ReplayCompleted | ReplayDiverged
    known: bool
    apart: Apart | None = None


def replay(
    store: Store,
    facts: Facts,
    session: SessionRecorded,
    model: str,
    level: str,
    integrator: str,
    work: Path,
    unknown: Sequence[str] = (),
    check_filter: bool = False,
) -> Completed:
    """Open-loop replay of one session with a model (SHA-256 of a motor file in the archive), and the filter beside it.

    Leaves frame, temperatures, heat, residuals, meters and the filter's estimate as files in `work`, named by their
    SHA-256, for the one writer to seal. The digest is that of the open loop, in which the filter changes nothing.
    `integrator`: one of `twin.compiled.integrators.INTEGRATORS`; of another than the default the summary says how far
    off it is, and the heat account is the default's. `unknown`: ids of causes that the filter is to find
    (`replay.engine.results.asked_unknowns`); `check_filter`: whether filterpy's filter runs beside ours. Raises
    ReplayDataError where the session lacks an input or the model runs away.
    """
    specimen = of_specimen(store, facts, session, network_of(store, facts, session, model))
    facts = with_bench_of(facts, model)
    made = run_of(session, model, level, integrator, specimen, load(store, facts, session))
    compared: tuple[Compared, ...] = (*made.observed, *made.meters)
    digest = digest_of([*made.temperatures.T, *(o.modelled for o in compared), *(o.residual for o in compared)])
    tables = _tables(made)
    mean_W = mean_losses(made.network, made.inputs, made.temperatures)
    asked = asked_unknowns(made.network, unknown, mean_W, made.frame.observations)
    filtered = filter_session(made.network, made.frame, mean_W, level, asked)
    if filtered is not None:
        tables["filtered"] = filtered_table(made.frame, filtered, made.nodes)
    artefacts = {name: _written(to_parquet(table), work) for name, table in tables.items()}
    ageing, code, frame = to_json(list(specimen.ageing)), code_of(__name__), artefacts["frame"]
    key = replay_key(facts, session, model, level, made.start[0], frame, integrator, ageing, unknown, code=code)
    event = ReplayCompleted(
        run=run_id(key),
        session=session.session,
        model=model,
        motor=made.network.name,
        level=level,
        bench=facts.current(session.bench) if session.bench else None,
        key=key,
        digest=digest,
        environment=environment(),
        artefacts=artefacts,
        summary=document(summary_of(store, facts, made, digest, filtered)),
    )
    found = _against_the_ledger(store, facts, event, tables["temperatures"])
    checked = apart(filtered.given, filtered.estimate) if check_filter and filtered is not None else None
    return replace(found, apart=checked)


def _tables(made: OpenLoop) -> dict[str, pa.Table]:
    """What a run leaves but for its filter: name of the artefact -> table."""
    tables = {
        "frame": frame_table(made.frame),
        "temperatures": temperature_table(made.frame, made.temperatures, made.nodes, made.flows.made),
        "residuals": residual_table(made.frame, made.observed),
        "heat": heat_table(made.frame, heat_course(made.network, made.flows)),
    }
    return {**tables, "meters": meter_table(made.frame, made.meters)} if made.meters else tables


def _against_the_ledger(store: Store, facts: Facts, event: ReplayCompleted, temperatures: pa.Table) -> Completed:
    before = facts.runs.get(event.run)
    if before is None or before.environment != event.environment:
        return Completed(event, known=False)
    if before.digest == event.digest:
        return Completed(event, known=True)
    t_s, column = _first_difference(read_parquet(store.archive.read(before.artefacts["temperatures"])), temperatures)
    diverged = ReplayDiverged(run=event.run, digest=event.digest, expected=before.digest, t_s=t_s, field=column)
    return Completed(diverged, known=False)


def _first_difference(before: pa.Table, now: pa.Table) -> tuple[float | None, str | None]:
    """Where two tables of temperatures first differ: time [s] from the start and column, None where they do not."""
    t_ns = now["t_ns"].to_numpy()
    pairs = ((name, before[name].to_numpy(), now[name].to_numpy()) for name in now.column_names)
    differing = {name: int(np.argmax(a != b)) for name, a, b in pairs if not np.array_equal(a, b, equal_nan=True)}
    if not differing:
        return None, None
    column = min(differing, key=lambda name: differing[name])
    return float(t_ns[differing[column]] - t_ns[0]) / 1e9, column


def _written(data: bytes, work: Path) -> str:
    sha256 = hashlib.sha256(data).hexdigest()
    made = work / f"{sha256}.{uuid4().hex}"
    made.write_bytes(data)
    made.replace(work / sha256)  # at once: two workers may make the same run, where one was given up too early
    return sha256
