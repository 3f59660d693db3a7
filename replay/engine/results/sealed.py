"""A sealed run read back: what reports and viewers show is what was sealed, never a second computation."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ingest.facts.events import ReplayCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.results.artefacts import filtered_of, heat_of, read_parquet
from replay.engine.results.run import Filtered, Metered, Observed, Run
from replay.engine.results.summary import ChannelErrors, MeterErrors, Summary, read


def load_run(store: Store, facts: Facts, event: ReplayCompleted) -> Run:
    """The run of an event, arrays from its artefacts. Raises DamageError where these are not what was sealed."""
    session = facts.session(event.session)
    network = network_of(store, facts, session, event.model)
    frame, temperatures, residuals = (
        read_parquet(store.archive.read(event.artefacts[name])) for name in ("frame", "temperatures", "residuals")
    )
    nodes, summary = tuple(node.name for node in network.nodes), read(event.summary)
    raw_files = tuple(json.loads(frame.schema.metadata[b"files"]))
    return Run(
        run=event.run,
        session=event.session,
        session_name=session.name,
        kind=session.kind,
        model=event.model,
        motor=event.motor,
        level=event.level,
        digest=event.digest,
        nodes=nodes,
        regions={node.name: node.region for node in network.nodes},
        limits_degC={node.name: node.limit_degC for node in network.nodes if node.limit_degC is not None},
        t_ns=temperatures["t_ns"].to_numpy(),
        absolute=session.absolute,
        temperatures=np.stack([temperatures[f"{node}_degC"].to_numpy() for node in nodes], axis=1),
        inputs={c.removeprefix("input:"): frame[c].to_numpy() for c in frame.column_names if c.startswith("input:")},
        losses_W=temperatures["network_heat_W"].to_numpy()[:-1],
        observed=tuple(_observed(residuals, one, raw_files) for one in summary.channels),
        summary=summary,
        filtered=_filtered(store, event, summary, nodes),
        meters=_meters(store, event, summary, raw_files),
        heat=heat_of(read_parquet(store.archive.read(event.artefacts["heat"]))) if "heat" in event.artefacts else None,
    )


def _filtered(store: Store, event: ReplayCompleted, summary: Summary, nodes: tuple[str, ...]) -> Filtered | None:
    """None for a run that was sealed without a filter."""
    if summary.filtered is None:
        return None
    return filtered_of(read_parquet(store.archive.read(event.artefacts["filtered"])), summary.filtered, nodes)


def _meters(store: Store, event: ReplayCompleted, summary: Summary, raw_files: tuple[str, ...]) -> tuple[Metered, ...]:
    if "meters" not in event.artefacts:
        return ()
    table = read_parquet(store.archive.read(event.artefacts["meters"]))
    return tuple(_metered(table, one, raw_files) for one in summary.meters)


def _metered(table: pa.Table, one: MeterErrors, raw_files: tuple[str, ...]) -> Metered:
    steps = _steps(table, one.channel, raw_files)
    said = {key: getattr(one, key) for key in ("quantity", "unit", "place", "bias_sd", "gain_sd")}
    return Metered(**steps, **said, sd=one.white)


def _observed(table: pa.Table, one: ChannelErrors, raw_files: tuple[str, ...]) -> Observed:
    steps = _steps(table, one.channel, raw_files, "_degC")
    return Observed(**steps, node=one.node, sd_K=one.white_K, bias_sd_K=one.bias_sd_K)


def _steps(table: pa.Table, channel: str, raw_files: tuple[str, ...], unit: str = "") -> dict[str, Any]:
    """What all observed channels have, of a table of residuals or meters. `unit`: at the end of two of its columns."""
    rows = table.filter(pc.equal(table["channel"], channel))
    raw = pc.fill_null(pc.index_in(rows["file_id"], pa.array(raw_files)), -1)
    found = {name: rows[name].to_numpy() for name in ("t_ns", "used", "first_record", "last_record")}
    shown = {name: rows[name + unit].to_numpy() for name in ("measured", "modelled")}
    return {"channel": channel, "raw": raw.to_numpy(), **found, **shown}
