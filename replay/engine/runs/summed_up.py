"""A run in numbers: its summary, from what was simulated, observed and filtered."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ingest.bench.bench_file import read_bench
from ingest.bench.derating import DeratingRule
from ingest.catalogue.power import balance
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.results.filtered import Estimated, filter_summary
from replay.engine.results.heat_account import efficiency_of
from replay.engine.results.hot_spot_bands import with_bands
from replay.engine.results.hot_spots import deratings, hot_spots, limits, watched
from replay.engine.results.residuals import errors_of_channels, errors_of_meters, largest_by_node, mean_by_node
from replay.engine.results.summary import IntegratorDistance, Summary
from replay.engine.runs.open_loop_run import OpenLoop
from twin.compiled.integrators import DEFAULT
from twin.run.losses import account


def summary_of(store: Store, facts: Facts, made: OpenLoop, digest: str, filtered: Estimated | None) -> Summary:
    """The summary of a run; `filtered`: None where no filter was run."""
    session, network, frame, temperatures = made.session, made.network, made.frame, made.temperatures
    channels = errors_of_channels(frame, made.observed, made.recorded)
    power = balance(made.recorded)
    rules = _deratings(store, facts, session)
    shown = watched(rules, made.recorded, frame.t_ns[:-1])
    spots = hot_spots(network, temperatures, frame.step_s)
    return Summary(
        session=session.session,
        session_name=session.name,
        kind=session.kind,
        model=made.model,
        motor=network.name,
        level=made.level,
        digest=digest,
        integrator=_distance(made),
        ageing=list(made.specimen.ageing),
        hours=dict(made.specimen.hours),
        duration_s=float((frame.t_ns[-1] - frame.t_ns[0]) / 1e9),
        step_s=frame.step_s,
        note=frame.note,
        mae_K=mean_by_node(channels, lambda one: one.mae_K),
        max_K=largest_by_node(channels),
        bias_K=mean_by_node(channels, lambda one: one.bias_K),
        channels=channels,
        meters=errors_of_meters(frame, made.meters),
        network_heat_W=float(made.flows.made.mean()),
        electrical_minus_mechanical_W=power.mean_loss_W if power else None,
        losses=account(network, made.inputs, temperatures, made.flows),
        efficiency=efficiency_of(frame, made.flows),
        limits=limits(network, temperatures, frame.step_s),
        hot_spots=with_bands(
            *(store, facts, session, made.model, network, frame, made.start), made.specimen.ageing, spots
        ),
        derating=deratings(rules, shown, network, temperatures, frame.step_s),
        filtered=None if filtered is None else filter_summary(filtered, frame, made.nodes),
    )


def _distance(made: OpenLoop) -> IntegratorDistance | None:
    """Where a run is furthest from the default integrator's; None of a run by that."""
    if made.integrator == DEFAULT.name:
        return None
    difference = made.temperatures - made.reference
    edge, node = (int(i) for i in np.unravel_index(int(np.abs(difference).argmax()), difference.shape))
    return IntegratorDistance(
        name=made.integrator,
        error_K=float(abs(difference[edge, node])),
        node=made.nodes[node],
        at_s=edge * made.frame.step_s,
        against=DEFAULT.name,
    )


def _deratings(store: Store, facts: Facts, session: SessionRecorded) -> Sequence[DeratingRule]:
    if session.bench is None:
        return ()
    sha256 = facts.current(session.bench)
    return read_bench(store.archive.read(sha256), handle(sha256)).deratings
