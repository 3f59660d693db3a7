"""The motor file: what an honest engineer makes of the design's mesh, 21 nodes as a user has them.

Nothing here knows a specimen: it reads the motor as designed, with the usual exponents. A conductance between two
nodes is what 1 W driven evenly into the one and out of the other meets in the cells of both (interfaces between them
included); its dependence on speed or flow is fitted as `constant + coefficient x feature^usual exponent`; then each
is scaled once so that it carries what the mesh carries at the rated point, as one does with a finite-element model
beside. Loss laws are fitted to the design's loss map with the field's usual exponents, weighted like a test campaign.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from plant import losses, machine, solver
from plant.drives import AMBIENT_degC, FLOW_lpm, INLET_degC, drive
from plant.films import films
from plant.forms import JACKETED, Form
from plant.geometry import NODES
from plant.losses import HEATS
from plant.mesh import CONDUCTS, RADIATES, Mesh
from plant.plant import LITRE_PER_MIN, Plant, between, operate

Floats = NDArray[np.float64]

SPEEDS = np.array([0.0, 1500.0, 3000.0, 5000.0, 7000.0, 9000.0, 12000.0, 16000.0]) / 16000.0  # of the top
FLOWS_lpm = np.array([4.0, 6.0, 8.0, 10.0, 12.0, 14.0])
USUAL = {"endwinding": 0.7, "air": 0.7, "end_plate": 0.8, "rotor_surface": 0.8, "bearing": 0.5, "shaft": 0.6}
FLOW_EXPONENT = 0.8
LEAST_W_per_K = 0.08  # links below are left out, as nobody would draw them
LEAST_K, LEAST_W, MOST = 4.0, 0.3, 2.5  # what a link's scaling at the rated point needs, and the largest factor
DC_SD = 0.05

Law = tuple[tuple[tuple[str, float], ...], ...]
LOSS_LAWS: Mapping[str, Law] = {
    "teeth": ((("speed", 1.6),), (("speed", 1.6), ("current", 1.0))),
    "yoke": ((("speed", 1.6),), (("speed", 1.6), ("current", 1.0))),
    "rotor_surface": ((("speed", 2.0),), (("speed", 1.5), ("current", 2.0))),
    "rotor_core": ((("speed", 1.5),),),
    "magnet": ((("speed", 2.0),), (("speed", 2.0), ("current", 2.0))),
    "bearing_a": ((("speed", 1.5),),),
    "bearing_b": ((("speed", 1.5),),),
}


@dataclass(frozen=True)
class Term:
    """`coefficient` [W or W/K] times features to powers; `copper` +1 times, -1 divided by 1 + alpha (T - 20)."""

    coefficient: float
    powers: tuple[tuple[str, float], ...] = ()
    copper: int = 0
    sd: float | None = None


@dataclass(frozen=True)
class Reduced:
    """The reduced network: `capacities` node -> J/K, `links` (a, b) -> terms, `sources` node -> terms."""

    capacities: Mapping[str, float]
    links: Mapping[tuple[str, str], tuple[Term, ...]]
    sources: Mapping[str, tuple[Term, ...]]


@cache
def reduce(form: Form = JACKETED) -> Reduced:
    """The reduction of the motor as designed."""
    plant = designed(form)
    return Reduced(capacities(plant.mesh), fitted_links(plant), {**copper_losses(plant), **_other_losses(plant)})


def capacities(mesh: Mesh) -> dict[str, float]:
    """Heat capacity [J/K] of each node; that of an interface goes to its neighbours in equal parts."""
    total = dict.fromkeys(NODES, 0.0)
    node = {cell.name: cell.node for cell in mesh.cells}
    for cell in mesh.cells:
        near = {node.get(j.b if j.a == cell.name else j.a, "") for j in mesh.joints if cell.name in (j.a, j.b)} - {""}
        for name in [cell.node] if cell.node else near:
            total[name] += cell.capacity / (1 if cell.node else len(near))
    return total


# ---- conductances --------------------------------------------------------------------------------------------------


def fitted_links(plant: Plant) -> dict[tuple[str, str], tuple[Term, ...]]:
    """Every pair that the mesh joins, node order of the motor file, boundaries last."""
    mesh, result = plant.mesh, {}
    for a, b in pairs(mesh):
        by_flow = "coolant" in (a, b)
        if by_flow:
            values = np.array([_conductance(plant, a, b, plant.form.rated[0], flow) for flow in FLOWS_lpm])
            terms = fitted_terms(values, FLOWS_lpm / 10.0, "flow", FLOW_EXPONENT)
        else:
            values = np.array(
                [_conductance(plant, a, b, speed, FLOW_lpm) for speed in SPEEDS * plant.form.machine.top_rpm]
            )
            terms = fitted_terms(values, SPEEDS, "speed", usual_exponent(a, b))
        if values.max() > LEAST_W_per_K:
            result[a, b] = terms
    return _at_rated_point(plant, result)


def _at_rated_point(
    plant: Plant, links: dict[tuple[str, str], tuple[Term, ...]]
) -> dict[tuple[str, str], tuple[Term, ...]]:
    """The links, each scaled (within MOST) to the mesh's flow between its nodes over the difference of their means."""
    (rpm, torque), top = plant.form.rated, plant.form.machine.top_rpm
    point = drive("rated", "s1", np.full(10, rpm), np.full(10, torque))
    loads = plant.loads(_system(plant), point, operate(point, np.full(10, 100.0), plant.form.machine), 1.0)
    temperatures = solver.steady(_system(plant), loads)
    outside = {"coolant": INLET_degC, "ambient": AMBIENT_degC}
    of_cell = dict(zip((cell.name for cell in plant.mesh.cells), temperatures.tolist(), strict=True)) | outside
    mean = {node: mean_of(plant.mesh, node, temperatures) for node in NODES} | outside
    joints = joint_conductances(plant, rpm, FLOW_lpm)
    features = {"speed": rpm / top, "flow": FLOW_lpm / 10.0}
    result = {}
    for (a, b), terms in links.items():
        now = sum(term.coefficient * float(np.prod([features[f] ** e for f, e in term.powers])) for term in terms)
        flow, across = heat_flow(plant, a, b, joints, of_cell, float(loads.stream[0])), mean[a] - mean[b]
        ratio = flow / across / now if abs(across) > LEAST_K and abs(flow) > LEAST_W else 1.0
        factor = float(np.clip(ratio, 1 / MOST, MOST))
        result[a, b] = tuple(replace(term, coefficient=term.coefficient * factor) for term in terms)
    return result


def mean_of(mesh: Mesh, node: str, temperatures: Floats) -> float:
    cells = mesh.of_node(node)
    return float(np.average(temperatures[cells], weights=mesh.capacity[cells]))


def heat_flow(plant: Plant, a: str, b: str, joints: Floats, of_cell: Mapping[str, float], stream: float) -> float:
    """Heat [W] from a to b in the mesh; through an interface the mean of what enters and what leaves."""
    if b == "coolant":
        return stream * sum(
            share * (of_cell[last] - of_cell[before or "coolant"]) for before, last, share in _runs(plant.mesh, a)
        )
    node = {cell.name: cell.node for cell in plant.mesh.cells}
    total = 0.0
    for i in between(plant.mesh, a, b).tolist():
        joint = plant.mesh.joints[i]
        ends = [node.get(name, name) for name in (joint.a, joint.b)]
        direction = 1.0 if a == ends[0] or b == ends[1] else -1.0
        half = 0.5 if "" in ends else 1.0
        total += half * direction * joints[i] * (of_cell[joint.a] - of_cell[joint.b])
    return total


def _runs(mesh: Mesh, node: str) -> list[tuple[str, str, float]]:
    """The cells before and at the end of each run of a node's coolant, "" for the inlet, and its share."""
    mine = {cell.name for cell in mesh.cells if cell.node == node}
    runs: dict[str, tuple[str, str, float]] = {}
    for station in mesh.stations:
        if station.cell in mine:
            before, _, share = runs.pop(station.before, (station.before, "", station.share))
            runs[station.cell] = (before, station.cell, share)
    return list(runs.values())


def usual_exponent(a: str, b: str) -> float:
    for start in ("end_plate", "endwinding", "air", "rotor_surface", "bearing", "shaft"):
        if any(name.startswith(start) for name in (a, b)):
            return USUAL[start]
    return 0.7


def pairs(mesh: Mesh) -> list[tuple[str, str]]:
    order = [*NODES, "coolant", "ambient"]
    node = {cell.name: cell.node for cell in mesh.cells} | {"coolant": "coolant", "ambient": "ambient"}
    found = {(node[name], "coolant") for name in mesh.coolant}
    near: dict[str, set[str]] = {}
    for joint in mesh.joints:
        x, y = node[joint.a], node[joint.b]
        if x and y and x != y:
            found.add((x, y))
        for cell, other in ((joint.a, y), (joint.b, x)):
            if not node[cell] and other:
                near.setdefault(cell, set()).add(other)
    found |= {(x, y) for nodes in near.values() for x in nodes for y in nodes if x != y}
    return sorted(
        {(x, y) if order.index(x) < order.index(y) else (y, x) for x, y in found},
        key=lambda p: (order.index(p[0]), order.index(p[1])),
    )


def _conductance(plant: Plant, a: str, b: str, speed_rpm: float, flow_lpm: float) -> float:
    """Conductance [W/K] between mean temperatures of two nodes, 1 W driven evenly through; to a boundary: with all of
    the node heated."""
    mesh = plant.mesh
    conductances = joint_conductances(plant, speed_rpm, flow_lpm)
    inside = {cell.name for cell in mesh.cells if cell.node in (a, b)}
    chosen = set(between(mesh, a, b).tolist()) if b != "coolant" else set()
    node = {cell.name: cell.node for cell in mesh.cells}
    if b == "coolant":  # metal and stations, the coolant marched along
        inside = {cell.name for cell in mesh.cells if cell.node == a}
    for i, joint in enumerate(mesh.joints):
        if joint.a in inside and joint.b in inside and node[joint.a] == node[joint.b]:
            chosen.add(i)
    cells = sorted({c for i in chosen for c in (mesh.joints[i].a, mesh.joints[i].b) if c in node} | inside)
    return _driven(plant, a, b, cells, sorted(chosen), conductances, flow_lpm)


def _driven(
    plant: Plant, a: str, b: str, cells: list[str], chosen: list[int], conductances: Floats, flow_lpm: float
) -> float:
    mesh, at = plant.mesh, {name: i for i, name in enumerate(cells)}
    matrix = np.zeros((len(cells), len(cells)))
    for i in chosen:
        joint, g = mesh.joints[i], conductances[i]
        for x, y in ((joint.a, joint.b), (joint.b, joint.a)):
            if x in at:
                matrix[at[x], at[x]] += g
                if y in at:
                    matrix[at[x], at[y]] -= g
    if b == "coolant":
        stream = flow_lpm * LITRE_PER_MIN * plant.form.coolant.density * plant.form.coolant.heat_capacity
        for station in mesh.stations:
            if station.cell in at:
                matrix[at[station.cell], at[station.cell]] += stream * station.share
            if station.cell in at and station.before in at:
                matrix[at[station.cell], at[station.before]] -= stream * station.share
    facing = _facing(mesh, a, b)
    weights = {node: _weights(mesh, node, cells, facing, b == "coolant") for node in (a, b) if node in NODES}
    drive = weights[a] - weights.get(b, 0.0)
    if b in NODES:
        matrix += np.ones_like(matrix) / len(cells)  # only differences matter
    t = np.linalg.solve(matrix + 1e-9 * np.eye(len(cells)), drive)
    return 1.0 / float(drive @ t)


def _facing(mesh: Mesh, a: str, b: str) -> set[str]:
    """Slices in which two nodes touch along the stack; empty where they touch at an end or outside of it: then all of
    both counts, as heat has to come along them."""
    node = {cell.name: cell.node for cell in mesh.cells}
    joints = [mesh.joints[i] for i in between(mesh, a, b)]
    ends = {name for joint in joints for name in (joint.a, joint.b) if node.get(name) in (a, b)}
    slices = {name.partition(".")[2] for name in ends} - {""}
    return slices if len(slices) > 1 else set()


def _weights(mesh: Mesh, node: str, cells: list[str], facing: set[str], dry: bool) -> Floats:
    """Shares of a node's capacity in the slices `facing`; for the link to the coolant those of its metal."""
    capacity = {
        c.name: c.capacity
        for c in mesh.cells
        if c.node == node
        and not (dry and c.name in mesh.coolant)
        and (not facing or c.name.partition(".")[2] in facing)
    }
    values = np.array([capacity.get(name, 0.0) for name in cells])
    result: Floats = values / values.sum()
    return result


@cache
def designed(form: Form) -> Plant:
    """The motor as designed."""
    return Plant(0, roughness=0.0, form=form)


@cache
def _system(plant: Plant) -> solver.System:
    return plant.system()


@cache
def joint_conductances(plant: Plant, speed_rpm: float, flow_lpm: float) -> Floats:
    """Conductance of each joint (J,) [W/K]; radiation and free convection about 80 degC against their surroundings."""
    laws, still = plant.everyday.films, np.ones(1)
    h = {
        name: float(values[0])
        for name, values in films(laws, plant.geometry, speed_rpm * still, flow_lpm * still).items()
    }
    result = []
    for joint in plant.mesh.joints:
        if joint.kind == RADIATES:
            result.append(solver.SIGMA * joint.area * 4 * (353.15 if joint.b != "ambient" else 318.0) ** 3)
        elif joint.kind != CONDUCTS:
            result.append(solver.FREE * joint.area * (INLET_degC - AMBIENT_degC) ** 0.25)
        else:
            film = 1.0 / (joint.area * h[joint.film]) if joint.film else 0.0
            result.append(1.0 / (joint.resistance + film))
    return np.array(result)


def fitted_terms(values: Floats, ratio: Floats, feature: str, exponent: float) -> tuple[Term, ...]:
    """Terms `constant + coefficient x ratio^exponent`, none of them negative; a constant alone where the values vary
    by less than 3 %."""
    if np.ptp(values) < 0.03 * values.mean():
        return (Term(float(values.mean())),)
    columns = np.stack([np.ones_like(ratio), ratio**exponent], axis=1) / values[:, None]
    constant, coefficient = nnls(columns, np.ones_like(ratio))[0]
    terms = (Term(float(constant)), Term(float(coefficient), ((feature, exponent),)))
    return tuple(term for term in terms if term.coefficient > 1e-3 * values.mean())


# ---- losses --------------------------------------------------------------------------------------------------------


def node_watts(plant: Plant, node: str, cells: Floats) -> Floats:
    total: Floats = cells[..., plant.mesh.of_node(node)].sum(axis=-1)
    return total


def copper_losses(plant: Plant) -> dict[str, tuple[Term, ...]]:
    """Copper losses: DC exactly; AC as speed squared, fitted to the bars' over a map."""
    speed, point = loss_map(plant.form)
    dc = losses.direct(plant.mesh, plant.form.losses.terminal_ohm) * plant.form.machine.current_A**2
    current2, features = point.current**2, _ratios(plant.form, speed, point)
    ac = losses.alternating(plant.everyday.losses, plant.mesh, current2, speed) @ losses.alternating_shares(plant.mesh)
    result = {}
    for node in NODES:
        direct = float(node_watts(plant, node, dc))
        if direct:
            terms = [Term(direct, (("current", 2.0),), 1, DC_SD)]
            law = ((("current", 2.0), ("speed", 2.0)),)
            if coefficient := _fitted(law, node_watts(plant, node, ac), features)[0]:
                terms.append(Term(coefficient, law[0], -1, 0.2))
            result[node] = tuple(terms)
    return result


def _other_losses(plant: Plant) -> dict[str, tuple[Term, ...]]:
    """Iron, magnets, bearings over the same map; ripple of the inverter and end windage are left out, the gap's drag is
    given to the rotor surface, as usual."""
    speed, point = loss_map(plant.form)
    cells = usual_losses(plant, speed, point)
    result = {}
    for node, law in LOSS_LAWS.items():
        coefficients = _fitted(law, node_watts(plant, node, cells), _ratios(plant.form, speed, point))
        terms = zip(coefficients, law, strict=True)
        result[node] = tuple(Term(c, powers) for c, powers in terms if c > 0.0)
    return result


def usual_losses(plant: Plant, speed_rpm: Floats, point: machine.Point) -> Floats:
    """Loss of each cell (M, n) [W] beside copper's, of the kinds that a motor file has."""
    heats = losses.heats(plant.everyday.losses, point, speed_rpm, np.ones_like(speed_rpm))
    for name in ("ripple", "end_drag", "contact"):
        heats[:, HEATS.index(name)] = 0.0
    shares = losses.shares(plant.mesh)
    shares[HEATS.index("gap_drag")] = shares[HEATS.index("surface")]
    cells: Floats = heats @ shares
    return cells


def loss_map(form: Form) -> tuple[Floats, machine.Point]:
    """Speed and point over a campaign's points: 24 speeds, torque shares that thin out towards the top."""
    speeds = np.linspace(600.0, 15_000.0, 24) * (form.machine.top_rpm / 16_000.0)
    shares = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 0.95])
    speed = np.repeat(speeds, shares.size)
    top = np.repeat([machine.largest_torque(float(n), machine=form.machine) for n in speeds], shares.size)
    torque = np.tile(shares, speeds.size) * top
    return speed, machine.operate(speed, torque, np.full(speed.size, 100.0), form.machine)


def _ratios(form: Form, speed_rpm: Floats, point: machine.Point) -> dict[str, Floats]:
    return {"speed": speed_rpm / form.machine.top_rpm, "current": point.current / form.machine.current_A}


def _fitted(law: Law, watts: Floats, features: Mapping[str, Floats]) -> tuple[float, ...]:
    """Coefficients, not negative, that fit `watts` with errors weighted between absolute and relative."""
    columns = [np.prod([features[name] ** power for name, power in powers], axis=0) for powers in law]
    weight = 1.0 / (np.abs(watts) + 0.2 * np.abs(watts).mean() + 1e-9)
    found = nnls(np.stack(columns, axis=1) * weight[:, None], watts * weight)[0]
    return tuple(float(c) for c in found)


def loss_errors(form: Form = JACKETED) -> dict[str, float]:
    """Node -> mean relative error of the fitted law over the map, weighted by loss."""
    plant = designed(form)
    speed, point = loss_map(form)
    heats = losses.heats(plant.everyday.losses, point, speed, np.ones_like(speed))
    cells = heats @ losses.shares(plant.mesh)
    features = _ratios(form, speed, point)
    errors = {}
    for node in LOSS_LAWS:
        true = node_watts(plant, node, cells)
        fitted = sum(
            term.coefficient * np.prod([features[name] ** power for name, power in term.powers], axis=0)
            for term in reduce(form).sources[node]
        )
        errors[node] = float(np.abs(fitted - true).sum() / true.sum())
    return errors
