"""A motor file from runs alone: temperatures of volumes and the heat between them, losses by two points of a law.

A conductance is the mean flow between two nodes over the difference of their mean temperatures, both over a quarter of
an hour from rest: at three speeds, or three flows, as constant + coefficient x feature^usual exponent. Where two nodes
are about as warm as each other the fitted file's value stands. A loss without load is a power of speed through two
points, what load adds another one of speed and current through three.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from plant import losses, machine
from plant.drives import AMBIENT_degC, FLOW_lpm, INLET_degC, drive
from plant.films import FLOW0
from plant.form import Form
from plant.geometry import NODES
from plant.plant import LITRE_PER_MIN, Plant
from plant.reduction import (
    FLOW_EXPONENT,
    LOSS_LAWS,
    LEAST_W_per_K,
    Reduced,
    Term,
    capacities,
    designed,
    fitted_terms,
    heat_flow,
    joint_conductances,
    mean_of,
    node_watts,
    pairs,
    reduce,
    usual_exponent,
    usual_losses,
)

Floats = NDArray[np.float64]

SPEEDS = ((0.1, 1.0), (0.375, 1.0), (0.8, 0.5))  # of the top; share of the rated torque there
FLOWS_lpm = (5.0, 10.0, 14.0)
SECONDS, STEP_s = 900.0, 5.0
LEAST_K = 1.5
LIGHT, HEAVY = 0.4, 0.9  # of the torque possible
SLOW, FAST = 0.3, 0.7  # of the top speed


@cache
def energy_weighted(form: Form) -> Reduced:
    """The network of the motor as designed."""
    plant = designed(form)
    return Reduced(capacities(plant.mesh), _links(plant), {**_copper(plant), **_other_losses(plant)})


# ---- conductances --------------------------------------------------------------------------------------------------


def _links(plant: Plant) -> dict[tuple[str, str], tuple[Term, ...]]:
    form = plant.form
    rpm = form.rated[0] / form.machine.top_rpm
    by_speed = [_flows(plant, speed, torque, FLOW_lpm) for speed, torque in SPEEDS]
    by_flow = [_flows(plant, rpm, 1.0, flow) for flow in FLOWS_lpm]
    usual, result = reduce(form).links, {}
    for pair in pairs(plant.mesh):
        wet = "coolant" in pair
        runs = [run[pair] for run in (by_flow if wet else by_speed)]
        values = np.array([flow / across if abs(across) > LEAST_K else -1.0 for flow, across in runs])
        if (values > 0.0).all():
            ratio = np.array(FLOWS_lpm) / FLOW0 if wet else np.array([speed for speed, _ in SPEEDS])
            feature, exponent = ("flow", FLOW_EXPONENT) if wet else ("speed", usual_exponent(*pair))
            if values.max() > LEAST_W_per_K:
                result[pair] = fitted_terms(values, ratio, feature, exponent)
        elif pair in usual:
            result[pair] = usual[pair]
    return result


def _flows(plant: Plant, speed: float, torque: float, flow_lpm: float) -> dict[tuple[str, str], tuple[float, float]]:
    """Each pair's heat flow [W] and difference of temperature [K], means over a run."""
    form, samples = plant.form, round(SECONDS / STEP_s)
    rpm, ones = speed * form.machine.top_rpm, np.ones(samples)
    held = drive("held", "s1", rpm * ones, torque * form.rated[1] * ones, flow_lpm, 1.0 / STEP_s)
    run = plant.run(held, start=plant.rest(held), step_s=STEP_s).temperatures.mean(axis=0)
    outside = {"coolant": INLET_degC, "ambient": AMBIENT_degC}
    of_cell = dict(zip((cell.name for cell in plant.mesh.cells), run.tolist(), strict=True)) | outside
    mean: Mapping[str, float] = {node: mean_of(plant.mesh, node, run) for node in NODES} | outside
    joints = joint_conductances(plant, rpm, flow_lpm)
    stream = flow_lpm * LITRE_PER_MIN * form.coolant.density * form.coolant.heat_capacity
    return {(a, b): (heat_flow(plant, a, b, joints, of_cell, stream), mean[a] - mean[b]) for a, b in pairs(plant.mesh)}


# ---- losses --------------------------------------------------------------------------------------------------------


def _points(plant: Plant) -> tuple[Floats, machine.Point]:
    """Slow and fast, each without load, with a light and with a heavy one: (6,)."""
    scale = plant.form.machine
    speed = np.repeat(np.array([SLOW, FAST]) * scale.top_rpm, 3)
    most = np.array([machine.largest_torque(float(n), machine=scale) for n in speed])
    return speed, machine.operate(speed, np.tile([0.0, LIGHT, HEAVY], 2) * most, np.full(6, 100.0), scale)


def _exponent(low: float, high: float, ratio: float) -> float:
    """The exponent of the straight line through two points of a double logarithmic plot, to a tenth; at least 0."""
    return max(round(float(np.log(high / low) / np.log(ratio)), 1), 0.0)


def _other_losses(plant: Plant) -> dict[str, tuple[Term, ...]]:
    speed, point = _points(plant)
    cells, ratios = usual_losses(plant, speed, point), point.current / plant.form.machine.current_A
    result = {}
    for node in LOSS_LAWS:
        watts = node_watts(plant, node, cells)
        idle = _exponent(watts[0], watts[3], FAST / SLOW)
        terms = [Term(float(watts[3] / FAST**idle), (("speed", idle),))]
        light, heavy, fast = watts[1] - watts[0], watts[2] - watts[0], watts[5] - watts[3]
        if min(light, heavy, fast) > 0.02 * watts[3]:
            with_current = _exponent(light, heavy, ratios[2] / ratios[1])
            slow_at_fast = heavy * (ratios[5] / ratios[2]) ** with_current
            with_speed = _exponent(slow_at_fast, fast, FAST / SLOW)
            size = fast / (FAST**with_speed * ratios[5] ** with_current)
            terms.append(Term(float(size), (("speed", with_speed), ("current", with_current))))
        result[node] = tuple(terms)
    return result


def _copper(plant: Plant) -> dict[str, tuple[Term, ...]]:
    """DC by the resistance of each node's copper, AC through the two speeds."""
    form = plant.form
    scale = form.machine
    dc = losses.direct(plant.mesh, form.losses.terminal_ohm) * scale.current_A**2
    speed = np.array([SLOW, FAST]) * scale.top_rpm
    full = np.full(2, scale.current_A**2)
    ac = losses.alternating(plant.everyday.losses, plant.mesh, full, speed) @ losses.alternating_shares(plant.mesh)
    result: dict[str, tuple[Term, ...]] = {}
    for node in NODES:
        direct, rises = float(node_watts(plant, node, dc)), node_watts(plant, node, ac)
        if direct:
            result[node] = (Term(direct, (("current", 2.0),), 1),)
        if direct and rises[1] > 0.0:
            exponent = _exponent(rises[0], rises[1], FAST / SLOW)
            powers = (("current", 2.0), ("speed", exponent))
            result[node] += (Term(float(rises[1] / FAST**exponent), powers, -1),)
    return result
