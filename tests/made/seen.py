"""A session as the viewer shows it, under three models made of one run, for the tests of its layers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ingest.facts.events import SessionRecorded
from made.channels import channel
from made.runs import NODES, STEP_NS, UTC_NS, made_run
from replay.engine.results.run import Filtered, Run
from replay.show.viewer.seen import SessionSeen
from twin.motor.network import Boundary, Link, Network, Node, Term

STEPS = 2400
PUBLISHED, RECALIBRATED, EXTENDED = "9ac1f00d", "4eca11b4", "e47e4ded"


def seen_session(absolute: bool = True) -> SessionRecorded:
    start = UTC_NS if absolute else 0
    return SessionRecorded(
        session="5e551_s1",
        name="1_s1",
        kind="s1",
        kind_why="said in the bench file",
        specimen=None,
        batch=None,
        bench=None,
        configuration=None,
        attributes={},
        absolute=absolute,
        start_ns=start,
        end_ns=start + STEPS * STEP_NS,
        files=[],
    )


def seen_channels(start_s: float = UTC_NS / 1e9) -> list[Any]:
    t_s = start_s + np.arange(STEPS)
    node: dict[str, Any] = {"role": "observed", "node": "winding", "region": "copper"}
    return [
        channel("T_1", "temperature", np.linspace(60, 80, STEPS), t_s=t_s, **node),
        channel("coolant / in", "temperature", np.full(STEPS, 60.0), t_s=t_s, node="coolant"),
        channel("speed", "speed", np.full(STEPS, 1500.0), t_s=t_s),
        channel("mode", "state", np.repeat([0.0, 1.0], STEPS // 2), t_s=t_s),
        channel("bearing", "temperature", np.full(STEPS, 40.0), t_s=t_s, role="ignored"),
        channel("never", "torque", np.array([])),
    ]


def network() -> Network:
    """Of the nodes of `made_run`."""
    conducts = (Term(coefficient=2.0),)
    return Network(
        name="m",
        nodes=tuple(Node(name=name, capacity=900.0, region=region) for name, region in NODES.items()),
        boundaries=(Boundary("coolant"),),
        links=(Link("winding", "stator", conducts), Link("stator", "coolant", conducts)),
        sources=(),
        scale={"speed": 4000.0},
    )


def three_models() -> dict[str, Run]:
    """Of which the last two correct a reading by 1.7 K, as a learnt bias does."""
    others = {
        role: made_run(model=model * 8) for role, model in (("recalibrated", RECALIBRATED), ("extended", EXTENDED))
    }
    corrected = {
        role: replace(run, observed=tuple(replace(o, measured=o.measured - 1.7) for o in run.observed))
        for role, run in others.items()
    }
    return {"published": replace(made_run(masked=(100, 400)), filtered=filtered()), **corrected}


def filtered() -> Filtered:
    run, heat = made_run(), np.linspace(20.0, 40.0, STEPS)
    return Filtered(
        node="rotor_surface",
        measured=("T_1", "T_2"),
        temperatures=run.temperatures + 1.0,
        heat_W=heat,
        heat_sd_W=np.full(STEPS, 3.0),
        nominal_W=heat - 5.0,
        heat_walk_W=0.4,
        nis=1.0,
    )


def seen(absolute: bool = True) -> SessionSeen:
    """A session under three models, with the answer of a diagnosis."""
    runs = three_models() if absolute else {"published": made_run(absolute=False)}
    start = UTC_NS / 1e9 if absolute else 0.0
    return SessionSeen(
        seen_session(absolute), seen_channels(start), runs, network(), "**The cause.**" if absolute else ""
    )
