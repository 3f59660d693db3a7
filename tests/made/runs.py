"""Runs as the engine gives them, made from a known error, for the tests of report, plots and layers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from replay.engine.results.residuals import channel_errors, largest_by_node, mean_by_node
from replay.engine.results.run import HeatCourse, Observed, Run
from replay.engine.results.summary import Summary, read
from twin.run.losses import HeatBalance, HeatPart, StoredHeat

STEP_NS = 1_000_000_000
UTC_NS = 1_760_000_000_000_000_000  # 2025-10-09 08:53:20
NODES = {"winding": "copper", "stator": "iron", "rotor_surface": "rotor"}


def made_summary(**stored: Any) -> Summary:
    """A summary of these entries of its JSON, and of nothing else that a run need not have."""
    return read(
        {
            "session": "5e55",
            "session_name": "1_s1",
            "kind": "s1",
            "model": "9ac1f00d",
            "motor": "m",
            "level": "testing",
            "digest": "4f0c",
            "duration_s": 60.0,
            "step_s": 0.5,
            "note": None,
            "mae_K": {},
            "max_K": {},
            "bias_K": {},
            "channels": [],
            "network_heat_W": 1.0,
            "electrical_minus_mechanical_W": None,
            **stored,
        }
    )


def made_run(
    name: str = "1_s1", steps: int = 2400, absolute: bool = True, masked: tuple[int, int] = (0, 0), **more: Any
) -> Run:
    """Measured = model + 6 K at the rotor surface above 3,000 rpm, - 0.2 K elsewhere; `masked`: steps of the rotor not
    used."""
    start = UTC_NS if absolute else 0
    t_ns = start + np.arange(steps + 1) * STEP_NS
    speed = np.where(np.arange(steps) < steps // 2, 1500.0, 3500.0)
    inputs = {"speed_rpm": speed, "current_A": np.full(steps, 120.0), "coolant_degC": np.full(steps, 60.0)}
    temperatures = 60 + 20 * (1 - np.exp(-np.arange(steps + 1) / 600))[:, None] * np.array([1.0, 0.7, 1.4])
    observed = []
    for j, node in enumerate(NODES):
        modelled = (temperatures[1:, j] + temperatures[:-1, j]) / 2
        error = np.where(speed > 3000, 6.0, -0.2) if node == "rotor_surface" else np.full(steps, -0.2)
        used = np.ones(steps, dtype=bool)
        if node == "rotor_surface":
            used[slice(*masked)] = False
        observed.append(_observed(f"T_{j + 1}", node, t_ns, modelled + error, modelled, used))
    return _run(name, start, t_ns, temperatures, inputs, tuple(observed), absolute, more)


def _observed(channel: str, node: str, t_ns: Any, measured: Any, modelled: Any, used: Any) -> Observed:
    record = np.arange(measured.size)
    return Observed(
        channel=channel,
        node=node,
        t_ns=t_ns[:-1] + STEP_NS // 2,
        measured=measured,
        modelled=modelled,
        sd_K=0.1,
        bias_sd_K=0.5,
        used=used,
        first_record=record,
        last_record=record + 1,
        raw=np.zeros(measured.size, dtype=np.int64),
    )


def _run(
    name: str,
    start: int,
    t_ns: Any,
    temperatures: Any,
    inputs: Any,
    observed: tuple[Observed, ...],
    absolute: bool,
    more: Any,
) -> Run:
    places = {"speed_rpm": inputs["speed_rpm"], "current_A": inputs["current_A"]}
    channels = [c for o in observed if (c := channel_errors(o, places, start))]
    identity = {
        "session": f"5e55{name}",
        "session_name": name,
        "kind": "s1",
        "model": "9ac1f00d" * 8,
        "motor": "reference-150kW",
        "level": "testing",
        "digest": "4f0cbeef" * 8,
        **more,
    }
    summary = Summary(
        **identity,
        duration_s=float((t_ns[-1] - start) / 1e9),
        step_s=1.0,
        note=None,
        mae_K=mean_by_node(channels, lambda one: one.mae_K),
        max_K=largest_by_node(channels),
        bias_K=mean_by_node(channels, lambda one: one.bias_K),
        channels=channels,
        network_heat_W=400.0,
        electrical_minus_mechanical_W=1000.0,
    )
    return Run(
        run="a5b6c7d8e9f00112",
        **identity,
        nodes=tuple(NODES),
        regions=NODES,
        limits_degC={},
        t_ns=t_ns,
        absolute=absolute,
        temperatures=temperatures,
        inputs=inputs,
        losses_W=np.full(t_ns.size - 1, 400.0),
        observed=observed,
        summary=summary,
    )


def heated(run: Run, kinds_W: Mapping[str, float], taken_W: Mapping[str, float]) -> Run:
    """The run with an account of its heat: means by kind and boundary [W]; the rest is stored in the copper."""
    duration_s, steps = run.summary.duration_s, run.t_ns.size - 1

    def parts(of_W: Mapping[str, float]) -> dict[str, HeatPart]:
        return {name: HeatPart(mean_W=watts, energy_J=watts * duration_s) for name, watts in of_W.items()}

    made_W = sum(kinds_W.values())
    stored_J = (made_W - sum(taken_W.values())) * duration_s
    balance = HeatBalance(
        mean_W=made_W,
        energy_J=made_W * duration_s,
        kinds=parts(kinds_W),
        regions=parts({"copper": made_W}),
        nodes=parts({"winding": made_W}),
        boundaries=parts(taken_W),
        stored={"copper": StoredHeat(energy_J=stored_J)},
        left_J=0.0,
    )
    course = HeatCourse(*({name: np.full(steps, watts) for name, watts in of.items()} for of in (kinds_W, taken_W)))
    return replace(run, heat=course, summary=replace(run.summary, losses=balance))
