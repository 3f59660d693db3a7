"""A run of which the report of a replay draws every picture that it knows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ingest.bench.derating import DeratingRule
from made.runs import heated, made_run
from made.seen import filtered
from replay.engine.results.run import Metered, Run
from replay.engine.results.summary import DeratingCourse, FilterSummary, MeterErrors
from twin.run.derating import Derating, derated

LONG = "endwinding_b_outer_turn_3_of_phase_v"
CHANNELS = 6
KINDS = {"copper_dc": 600.0, "copper_ac": 150.0, "iron": 200.0, "magnet": 4.0, "mechanical": 4.0, "other": 1.0}
TAKEN = {"coolant": 900.0, LONG: 1.0, "ambient": 1.0, "plate": -50.0}
FILTER = FilterSummary(
    node="rotor_surface",
    measured=["T_1", "T_2"],
    mae_K={"T_3": 0.4},
    heat_bias_W=5.0,
    heat_walk_W_per_sqrt_s=0.4,
    nis=1.0,
)
POWER = MeterErrors(
    channel="P_electric",
    quantity="power",
    place="motor",
    unit="W",
    mae=90.0,
    max=95.0,
    bias=90.0,
    mean=12_090.0,
    white=5.0,
    bias_sd=20.0,
    gain_sd=0.001,
    floor=24.0,
    samples=2400,
    masked=0,
    max_at_s=60.0,
    where={},
)


def with_all_pictures() -> Run:
    """Its winding is called LONG; its channels are more than lines tell apart."""
    run = many(CHANNELS)
    nodes = (LONG, *run.nodes[1:])
    observed = tuple(replace(o, node=LONG if o.node == "winding" else o.node) for o in run.observed)
    channels = [replace(c, node=LONG if c.node == "winding" else c.node) for c in run.summary.channels]
    regions = {LONG: "copper", **{node: run.regions[node] for node in nodes[1:]}}
    said: dict[str, Any] = {"meters": [POWER], "derating": [_derating(run)], "filtered": FILTER}
    summary = replace(run.summary, channels=channels, **said)
    whole = replace(run, nodes=nodes, regions=regions, observed=observed, meters=(_power(run),), summary=summary)
    return heated(replace(whole, filtered=filtered()), KINDS, TAKEN)


def many(count: int) -> Run:
    """As `made_run`, with its channels again under other names up to so many."""
    run = made_run(masked=(0, 600))
    observed, errors = list(run.observed), list(run.summary.channels)
    for i in range(len(errors), count):
        observed.append(replace(run.observed[i % 3], channel=f"T_{i + 1}"))
        errors.append(replace(errors[i % 3], channel=f"T_{i + 1}"))
    return replace(run, observed=tuple(observed), summary=replace(run.summary, channels=errors))


def _power(run: Run) -> Metered:
    """90 W above the model."""
    one = run.observed[0]
    modelled = np.where(run.inputs["speed_rpm"] > 3000, 16_000.0, 8_000.0)
    return Metered(
        channel=POWER.channel,
        quantity=POWER.quantity,
        place=POWER.place,
        unit=POWER.unit,
        sd=POWER.white,
        bias_sd=POWER.bias_sd,
        gain_sd=POWER.gain_sd,
        t_ns=one.t_ns,
        measured=modelled + POWER.mae,
        modelled=modelled,
        used=one.used,
        first_record=one.first_record,
        last_record=one.last_record,
        raw=one.raw,
    )


def _derating(run: Run) -> DeratingCourse:
    """The stator's thermometer protects the winding."""
    rule = DeratingRule("T_2", 70.0, 90.0)
    found = derated(Derating(70.0, 90.0), run.observed[1].measured, run.temperatures[1:, 0], 1.0)
    assert found is not None, "it takes current back"
    return DeratingCourse(**vars(rule), protects="winding", **vars(found), margin_K=None)
