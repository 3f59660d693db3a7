"""Runs: a session replayed, sealed and cited; the same key gives the same digest, or `ReplayDiverged` says where
not."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ingest.bench.bench_file import read_bench
from ingest.bench.derating import DeratingRule
from ingest.catalogue.channels import load
from ingest.catalogue.power import balance
from ingest.facts.events import ReplayCompleted, ReplayDiverged, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.bench_versions import with_bench_of
from replay.engine.files.configurations import network_of
from replay.engine.frame.frame_of import session_frame
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
from replay.engine.results.compared import metered_of, observed_of
from replay.engine.results.filtered import filter_session, filter_summary, mean_losses
from replay.engine.results.heat_account import efficiency_of, heat_balance, heat_course
from replay.engine.results.hot_spot_bands import with_bands
from replay.engine.results.hot_spots import deratings, hot_spots, limits, watched
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import initial_temperatures
from replay.engine.results.residuals import errors_of_channels, errors_of_meters, largest_by_node, mean_by_node
from replay.engine.results.run import Compared
from replay.engine.results.summary import IntegratorDistance, Summary, document
from replay.engine.runs.identity import digest_of, environment, replay_key, run_id
from replay.engine.runs.sources import code_of
from replay.engine.specimen.aged import of_specimen
from replay.errors import ReplayDataError
from twin.compiled.integrators import DEFAULT, INTEGRATORS, Tableau
from twin.errors import TwinError
from twin.motor.network import Network
from twin.run.losses import account, heat_flows
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

MELTED_DEGC = 2000.0  # no motor is hotter, or colder below: the model or an input is wrong by orders of magnitude


@dataclass(frozen=True)
class Completed:
    """The fact of a run; `known` where the ledger has it already."""

    event: ReplayCompleted | ReplayDiverged
    known: bool


def replay(
    store: Store,
    facts: Facts,
    session: SessionRecorded,
    model: str,
    level: str,
    integrator: str,
    work: Path,
    unknown: Sequence[str] = (),
) -> Completed:
    """Open-loop replay of one session with a model (SHA-256 of a motor file in the archive), and the filter beside it.

    Leaves frame, temperatures, heat, residuals, meters and the filter's estimate as files in `work`, named by their
    SHA-256, for the one writer to seal. The digest is that of the open loop: the filter follows from the same frame,
    and changes nothing in it. `integrator`: one of `twin.compiled.integrators.INTEGRATORS`; of another than the default
    the summary says how far off it is, and the heat account is the default's. `unknown`: ids of causes that the filter
    is to find (`replay.engine.results.asked_unknowns`). Raises ReplayDataError where the session lacks an input or the
    model runs away.
    """
    specimen = of_specimen(store, facts, session, network_of(store, facts, session, model))
    network = specimen.network
    facts = with_bench_of(facts, model)
    recorded = load(store, facts, session)
    frame = session_frame(session, recorded, network, specimen.hours)
    initial, initial_sd = initial_temperatures(network, frame, level)
    inputs = Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries)
    reference = _simulated(network, inputs, initial, session, DEFAULT)
    method = INTEGRATORS[integrator]
    temperatures = reference if method is DEFAULT else _simulated(network, inputs, initial, session, method)
    flows = heat_flows(network, inputs, reference)
    nodes = tuple(node.name for node in network.nodes)
    observed = tuple(observed_of(o, frame, temperatures, nodes) for o in frame.observations)
    begins = dict(zip(nodes, initial.tolist(), strict=True))
    meters = tuple(metered_of(m, frame, network, temperatures, flows, begins) for m in frame.meters)
    compared: tuple[Compared, ...] = (*observed, *meters)
    digest = digest_of([*temperatures.T, *(o.modelled for o in compared), *(o.residual for o in compared)])
    tables = {
        "frame": frame_table(frame),
        "temperatures": temperature_table(frame, temperatures, nodes, flows.made),
        "residuals": residual_table(frame, observed),
        "heat": heat_table(frame, heat_course(network, flows)),
    }
    if meters:
        tables["meters"] = meter_table(frame, meters)
    artefacts = {name: _written(to_parquet(table), work) for name, table in tables.items()}
    mean_W = mean_losses(network, inputs, temperatures)
    asked = asked_unknowns(network, unknown, mean_W, frame.observations)
    filtered = filter_session(network, frame, mean_W, level, asked)
    if filtered is not None:
        artefacts["filtered"] = _written(to_parquet(filtered_table(frame, filtered, nodes)), work)
    rules = _deratings(store, facts, session)
    spots = hot_spots(network, temperatures, frame.step_s)
    key = replay_key(
        facts,
        session,
        model,
        level,
        initial,
        artefacts["frame"],
        integrator,
        to_json(list(specimen.ageing)),
        unknown,
        code=code_of(__name__),
    )
    channels = errors_of_channels(frame, observed)
    power = balance(recorded)
    summary = Summary(
        session=session.session,
        session_name=session.name,
        kind=session.kind,
        model=model,
        motor=network.name,
        level=level,
        digest=digest,
        integrator=None if method is DEFAULT else _distance(integrator, temperatures - reference, nodes, frame.step_s),
        ageing=list(specimen.ageing),
        hours=dict(specimen.hours),
        duration_s=float((frame.t_ns[-1] - frame.t_ns[0]) / 1e9),
        step_s=frame.step_s,
        note=frame.note,
        mae_K=mean_by_node(channels, lambda one: one.mae_K),
        max_K=largest_by_node(channels),
        bias_K=mean_by_node(channels, lambda one: one.bias_K),
        channels=channels,
        meters=errors_of_meters(frame, meters),
        network_heat_W=float(flows.made.mean()),
        electrical_minus_mechanical_W=power.mean_loss_W if power else None,
        losses=heat_balance(account(network, inputs, temperatures, flows)),
        efficiency=efficiency_of(frame, flows),
        limits=limits(network, temperatures, frame.step_s),
        hot_spots=with_bands(
            *(store, facts, session, model, network, frame, (initial, initial_sd)), specimen.ageing, spots
        ),
        derating=deratings(rules, watched(rules, recorded, frame.t_ns[:-1]), network, temperatures, frame.step_s),
        filtered=None if filtered is None else filter_summary(filtered, frame, nodes),
    )
    event = ReplayCompleted(
        run=run_id(key),
        session=session.session,
        model=model,
        motor=network.name,
        level=level,
        bench=facts.current(session.bench) if session.bench else None,
        key=key,
        digest=digest,
        environment=environment(),
        artefacts=artefacts,
        summary=document(summary),
    )
    return _against_the_ledger(store, facts, event, tables["temperatures"])


def _distance(integrator: str, difference: Floats, nodes: Sequence[str], step_s: float) -> IntegratorDistance:
    """Where a run is furthest from the default's."""
    edge, node = (int(i) for i in np.unravel_index(int(np.abs(difference).argmax()), difference.shape))
    return IntegratorDistance(
        name=integrator,
        error_K=float(abs(difference[edge, node])),
        node=nodes[node],
        at_s=edge * step_s,
        against=DEFAULT.name,
    )


def _simulated(network: Network, inputs: Frame, initial: Floats, session: SessionRecorded, method: Tableau) -> Floats:
    try:
        temperatures = simulate(load_kernel(network, method), inputs, initial)
    except TwinError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
    hot = np.argwhere(np.abs(temperatures) > MELTED_DEGC)
    if hot.size:
        step, node = (int(i) for i in hot[0])
        raise ReplayDataError(
            f'session {session.name}: node "{network.nodes[node].name}" of the model is beyond {MELTED_DEGC:,.0f} '
            f"degC at {step * inputs.step_s:,.0f} s: check its losses and links in the motor file, and the units of "
            "the inputs."
        )
    return temperatures


def _deratings(store: Store, facts: Facts, session: SessionRecorded) -> Sequence[DeratingRule]:
    if session.bench is None:
        return ()
    sha256 = facts.current(session.bench)
    return read_bench(store.archive.read(sha256), sha256[:12]).deratings


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
    """Where two tables of temperatures first differ: the time [s] from the start, and the column. None, None where they
    do not."""
    t_ns = now["t_ns"].to_numpy()
    pairs = {name: (before[name].to_numpy(), now[name].to_numpy()) for name in now.column_names}
    differing = {
        name: int(np.argmax(a != b)) for name, (a, b) in pairs.items() if not np.array_equal(a, b, equal_nan=True)
    }
    if not differing:
        return None, None
    column = min(differing, key=lambda name: differing[name])
    return float(t_ns[differing[column]] - t_ns[0]) / 1e9, column


def _written(data: bytes, work: Path) -> str:
    sha256 = hashlib.sha256(data).hexdigest()
    (work / sha256).write_bytes(data)
    return sha256
