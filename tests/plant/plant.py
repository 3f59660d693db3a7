"""The motor on its bench: a specimen of a seed, with or without hidden effects, run through drives.

plant = Plant(7, Effect("loss.magnet.speed2_current2", 150.0))
truth = plant.run(drives.wltp(1))
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from plant import everyday as daily
from plant import losses, solver
from plant import machine as electric
from plant.drives import Drive, drive
from plant.effects import Effect, law
from plant.films import FLOW0, films
from plant.forms import JACKETED, Form
from plant.geometry import ALPHA_COPPER
from plant.machine import MACHINE, Machine, Point
from plant.mesh import BOILS, GAPES, Joint, Mesh

Floats = NDArray[np.float64]

LITRE_PER_MIN = 1e-3 / 60.0


@dataclass(frozen=True)
class Truth:
    """What really happened in a session: `t_s` (N + 1,), `temperatures` (N + 1, n) of the cells [degC], the electric
    `point` at the drive's samples (M,), `heat`, `to_coolant`, `to_ambient` (N,) W."""

    drive: Drive
    t_s: Floats
    temperatures: Floats
    point: Point
    heat: Floats
    to_coolant: Floats
    to_ambient: Floats
    number: int

    def at(self, cells: NDArray[np.intp], weights: Floats) -> Floats:
        """Weighted mean of cells (N + 1,) [degC]."""
        mean: Floats = self.temperatures[:, cells] @ (weights / weights.sum())
        return mean


class Plant:
    """A specimen and the `effects` that it hides; `roughness` 0 is the motor as designed, 1 an everyday specimen;
    `axial` slices; `form`: what motor it is.

    The draws of a seed do not depend on the effects, so that a plant with and without one differs by it alone.
    """

    def __init__(
        self,
        seed: int,
        *effects: Effect,
        roughness: float = 1.0,
        axial: int = 6,
        form: Form = JACKETED,
    ) -> None:
        self.seed = seed
        self.effects = effects
        self.roughness = roughness
        self.form, self.geometry = form, form.geometry
        designed = form.build(self.geometry, axial)
        self.everyday = daily.draw(seed, designed, form, roughness) if roughness else daily.designed(form)
        self.mesh = self._as_built(designed)

    def random(self, *key: int) -> np.random.Generator:
        """A stream of random numbers of its own for each purpose."""
        return np.random.default_rng([self.seed, *key])

    # ---- the specimen ----------------------------------------------------------------------------------------------

    def _as_built(self, mesh: Mesh) -> Mesh:
        """The mesh with everyday paths and those of effects."""
        for a, b, conductance in self.everyday.paths:
            mesh.join(a, b, 1.0 / conductance, "everyday")
        for effect in self.effects:
            _add(mesh, effect)
        return mesh

    @cached_property
    def capacity(self) -> Floats:
        """Heat capacity of each cell (n,) [J/K], as this specimen has it."""
        factor = np.array([self.everyday.capacities.get(cell.node, 1.0) for cell in self.mesh.cells])
        for effect in self.effects:
            if effect.kind == "capacity" and effect.law == "scale":
                factor[self._cells(effect)] *= effect.size
        result: Floats = self.mesh.capacity * factor
        return result

    def system(self, number: int = 0, dose_h: float = 0.0) -> solver.System:
        """The arrays of session `number`, `dose_h` hours above 180 degC after it was new."""
        scale = np.array([self.everyday.groups.get(joint.group, 1.0) for joint in self.mesh.joints])
        for effect in self.effects:
            scale[self._joints(effect)] *= self._factor(effect, number, dose_h)
        slope = np.array([losses.SLOPES.get(cell.node, 0.0) for cell in self.mesh.cells])
        dc = losses.direct(self.mesh, self.form.losses.terminal_ohm) * self.everyday.dc
        for effect in self.effects:
            if effect.kind == "loss" and effect.law == "temperature":
                slope[self._cells(effect)] += effect.size
            if effect.kind == "loss" and effect.law == "scale":
                dc[self._cells(effect)] *= effect.size
        return solver.system(self.mesh, self.capacity, scale, dc, slope, ALPHA_COPPER)

    def _factor(self, effect: Effect, number: int, dose_h: float) -> float:
        if effect.kind == "ageing":
            return max(1.0 + effect.size * dose_h / 100.0, 0.1)
        if effect.law == "session":
            return float(np.exp(effect.size * self.random(4, number).standard_normal()))
        return effect.size

    def _joints(self, effect: Effect) -> NDArray[np.intp]:
        """Joints that a factor on the links of `effect` changes: between its nodes, and through an interface."""
        scaled = effect.kind == "ageing" or (effect.kind == "conductance" and effect.law in ("scale", "session"))
        if not scaled:
            return np.empty(0, np.intp)
        return np.unique(np.concatenate([between(self.mesh, a, b) for a, b in effect.links]))

    def _cells(self, effect: Effect) -> NDArray[np.intp]:
        return np.concatenate([self.mesh.of_node(node) for node in effect.nodes])

    # ---- running ---------------------------------------------------------------------------------------------------

    def run(
        self,
        drive: Drive,
        number: int = 0,
        dose_h: float = 0.0,
        start: Floats | None = None,
        step_s: float | None = None,
    ) -> Truth:
        """The session `number`: from `start` (n,), else from a warm start of the seed's own."""
        step = step_s or drive.step_s
        system = self.system(number, dose_h)
        first = self.warm(number, drive) if start is None else start
        hot = np.full(drive.samples, first[self.mesh.of_node("magnet")].mean())
        if drive.torque_Nm.any():  # currents depend on the magnets' temperature, which depends on the currents
            coarse = self._march(system, drive, operate(drive, hot, self.form.machine), first, 4 * step, number)
            magnets = coarse.temperatures[:, self.mesh.of_node("magnet")].mean(axis=1)
            hot = np.interp(np.arange(drive.samples) / drive.rate_hz, np.arange(len(magnets)) * 4 * step, magnets)
        point = operate(drive, hot, self.form.machine)
        solution = self._march(system, drive, point, first, step, number)
        t = np.arange(len(solution.temperatures), dtype=np.float64) * step
        return Truth(
            drive, t, solution.temperatures, point, solution.heat, solution.to_coolant, solution.to_ambient, number
        )

    def _march(
        self, system: solver.System, drive: Drive, point: Point, start: Floats, step_s: float, number: int
    ) -> solver.Solution:
        return solver.march(system, self.loads(system, drive, point, step_s, number), start, step_s)

    def loads(self, system: solver.System, drive: Drive, point: Point, step_s: float, number: int = 0) -> solver.Loads:
        """What drives the cells, averaged over each step (never the square of a mean)."""
        size = max(round(step_s * drive.rate_hz), 1)
        steps = drive.samples // size

        def mean(values: Floats) -> Floats:
            result: Floats = values[: steps * size].reshape(steps, size, *values.shape[1:]).mean(axis=1)
            return result

        speed, current2 = drive.speed_rpm, point.current**2
        laws = self.everyday.losses
        shares, ac_shares = self._shares
        heat = mean(losses.heats(laws, point, speed, drive.inverter)) @ shares
        ac = mean(losses.alternating(laws, self.mesh, current2, speed)) @ ac_shares
        for effect in self.effects:
            if effect.kind == "loss" and effect.law == "scale":
                heat[:, self._cells(effect)] *= effect.size
                ac[:, self._cells(effect)] *= effect.size
            heat += self._extra(effect, drive, point, mean, number)
        flow = mean(drive.flow_lpm) * LITRE_PER_MIN * self.form.coolant.density * self.form.coolant.heat_capacity
        outside = np.stack([mean(drive.inlet_degC), mean(drive.ambient_degC)], axis=1)
        return solver.Loads(self._films(system, drive, point, mean, number), flow, outside, mean(current2), ac, heat)

    @cached_property
    def _shares(self) -> tuple[Floats, Floats]:
        """How the losses' groups, and the AC loss of each layer, spread over the cells."""
        return losses.shares(self.mesh), losses.alternating_shares(self.mesh)

    def _films(self, system: solver.System, drive: Drive, point: Point, mean, number: int) -> Floats:  # type: ignore[no-untyped-def]
        courses = films(self.everyday.films, self.geometry, drive.speed_rpm, drive.flow_lpm)
        features = _features(drive, point, self.form.machine)
        for effect in self.effects:
            if effect.is_missing_path:
                courses[effect.cause] = law(effect.law, features)
            if effect.cause == "unknown.spray":
                courses["unknown.spray"] = _switching(self.random(5, number), drive, 250.0, 200.0)
            if effect.cause == "unknown.vapour":
                warm = lfilter([1.0], [1.0, -np.exp(-1 / (900.0 * drive.rate_hz))], features["current"] ** 2)
                share = np.clip(warm / (900.0 * drive.rate_hz) / 0.05 - 1.0, 0.0, 1.0)
                courses["jacket"] = courses["jacket"] * (1.0 + (effect.size - 1.0) * share)
        return np.stack([mean(courses[name]) for name in system.films], axis=1)

    def _extra(self, effect: Effect, drive: Drive, point: Point, mean, number: int) -> Floats:  # type: ignore[no-untyped-def]
        """Heat (N, n) [W] that an effect adds; the same at each node of a group, over its cells by capacity."""
        course = _added(effect, drive, point, self.form.machine, self.random(6, number))
        heat = np.zeros((1, len(self.mesh.cells)))
        if course is None:
            return heat
        for node in effect.nodes if effect.kind == "loss" else (effect.node,):
            cells = self.mesh.of_node(node)
            heat[0, cells] = effect.size * self.mesh.capacity[cells] / self.mesh.capacity[cells].sum()
        result: Floats = mean(course)[:, None] * heat
        return result

    # ---- where a session begins ------------------------------------------------------------------------------------

    def rest(self, like: Drive) -> Floats:
        """Temperatures (n,) of a motor that has stood for ever in the surroundings at the beginning of `like`."""
        return self._balance(like, 0.0, 0.0)

    def steady(self, like: Drive, speed_rpm: float, torque_Nm: float) -> Floats:
        """Temperatures (n,) after a point held for ever in the surroundings of `like`. Raises ArithmeticError if
        none."""
        return self._balance(like, speed_rpm, torque_Nm)

    def _balance(self, like: Drive, speed_rpm: float, torque_Nm: float) -> Floats:
        row = replace(_row(like, 10), speed_rpm=np.full(10, speed_rpm), torque_Nm=np.full(10, torque_Nm))
        system = self.system()
        point = operate(row, np.full(10, 90.0), self.form.machine)
        return solver.steady(system, self.loads(system, row, point, 10 / row.rate_hz))

    def warm(self, number: int, like: Drive) -> Floats:
        """A motor that ran before: some load, then 5 to 40 minutes of standing with the coolant on. Cold before an
        oven."""
        if not like.flow_lpm[0]:
            return np.full(len(self.mesh.cells), float(like.ambient_degC[0]))
        random = self.random(3, number)
        machine = self.form.machine
        speed = random.uniform(1500.0, 7000.0) * (machine.top_rpm / MACHINE.top_rpm)
        torque = random.uniform(10.0, 60.0) * (machine.torque_Nm / MACHINE.torque_Nm)
        healthy = self if not self.effects else self._without_effects()
        hot = healthy.steady(like, float(speed), float(torque))
        steps = int(random.integers(30, 240))
        still = replace(_row(like, steps), rate_hz=0.1, inverter=np.zeros(steps), speed_rpm=np.zeros(steps))
        cooled = healthy.run(replace(still, torque_Nm=np.zeros(steps)), start=hot, step_s=10.0).temperatures[-1]
        return np.concatenate([cooled, np.full(len(self.mesh.cells) - len(cooled), cooled.mean())])

    def _without_effects(self) -> Plant:
        return Plant(self.seed, roughness=self.roughness, axial=self.mesh.axial, form=self.form)


def _row(like: Drive, samples: int) -> Drive:
    """The first surroundings of `like`, `samples` times."""
    ones = np.ones(samples)
    base = drive("rest", "other", 0 * ones, 0 * ones, rate_hz=like.rate_hz)
    return replace(
        base,
        flow_lpm=like.flow_lpm[0] * ones,
        inlet_degC=like.inlet_degC[0] * ones,
        ambient_degC=like.ambient_degC[0] * ones,
    )


def operate(drive: Drive, magnet_degC: Floats, machine: Machine = MACHINE) -> Point:
    """The electric point of each sample: from torque, or from a direct current; none where the inverter is off."""
    point = electric.operate(drive.speed_rpm, drive.torque_Nm * drive.inverter, magnet_degC, machine)
    on = drive.inverter
    return replace(
        point,
        i_d=np.where(drive.direct_A > 0, drive.direct_A, point.i_d * on),
        i_q=point.i_q * on,
        u_d=point.u_d * on,
        u_q=point.u_q * on,
        flux=np.where(on > 0, point.flux, machine.psi_Wb),
        gap_flux=np.where(on > 0, point.gap_flux, machine.psi_Wb),
    )


def between(mesh: Mesh, a: str, b: str) -> NDArray[np.intp]:
    """Joints of a link of the reduced network: from node to node (or boundary), and both halves through an
    interface."""
    node = {cell.name: cell.node for cell in mesh.cells}
    reach: dict[str, set[str]] = {}
    for joint in mesh.joints:
        for here, there in ((joint.a, joint.b), (joint.b, joint.a)):
            if node.get(here) == "":
                reach.setdefault(here, set()).add(node.get(there, there))
    across = {cell for cell, nodes in reach.items() if {a, b} <= nodes}
    ends = [(joint.a, joint.b) for joint in mesh.joints]
    wanted = {
        i
        for i, (x, y) in enumerate(ends)
        if {node.get(x, x), node.get(y, y)} == {a, b}
        or (x in across and node.get(y, y) in (a, b))
        or (y in across and node.get(x, x) in (a, b))
    }
    if b == "coolant":  # the film between the node's solid cells and its coolant stands for the link
        wet = {name for name in mesh.coolant if node[name] == a}
        wanted = {i for i, (x, y) in enumerate(ends) if (x in wet) != (y in wet) and node[x] == node.get(y) == a}
    return np.array(sorted(wanted), np.intp)


def _add(mesh: Mesh, effect: Effect) -> None:
    """Cells and joints that an effect brings."""
    names = {node: [cell.name for cell in mesh.cells if cell.node == node] for node in {c.node for c in mesh.cells}}
    if effect.is_missing_path:
        for a, b in effect.links:
            touching = [mesh.joints[i] for i in between(mesh, a, b).tolist()] if b != "coolant" else []
            here, there = (sorted({x for j in touching for x in (j.a, j.b) if x in names.get(n, ())}) for n in (a, b))
            here = here or names[a]
            ends = there or names.get(b, [mesh.coolant[0] if b == "coolant" else b])
            pairs = [(x, ends[i * len(ends) // len(here)]) for i, x in enumerate(here)]
            for x, y in pairs:
                mesh.join(x, y, 0.0, "effect", effect.cause, effect.size / len(pairs))
    if effect.kind == "capacity" and effect.law == "attached":
        for node in effect.nodes:
            extra = mesh.cell(f"mass_{node}", "", effect.size)
            for cell in names[node]:
                mesh.join(cell, extra, len(names[node]) / 10.0, "effect")
    hot = {"unknown.boiling": ("air_a_in", BOILS, 120.0, 40.0)}.get(effect.cause)
    if hot:
        for cell in names[effect.node]:
            share = effect.size / len(names[effect.node])
            mesh.joints.append(Joint(cell, "hub_a", 0.0, "effect", area=share, kind=hot[1], low=hot[2], high=hot[3]))
    if effect.cause == "unknown.spray":
        for cell in names[effect.node]:
            mesh.join(cell, mesh.coolant[-1], 0.0, "effect", effect.cause, effect.size / len(names[effect.node]))
    if effect.cause == "unknown.liner_gap":
        for i, joint in enumerate(mesh.joints):
            if joint.group == "liner" and joint.a.startswith(("bar", "wall")) and _slice(joint.a) < mesh.axial // 2:
                mesh.joints[i] = replace(joint, kind=GAPES, area=effect.size, low=95.0, high=120.0)


def _slice(cell: str) -> int:
    return int(cell.split(".")[1])


def _features(drive: Drive, point: Point, machine: Machine) -> dict[str, Floats]:
    return {
        "speed": drive.speed_rpm / machine.top_rpm,
        "current": point.current / machine.current_A,
        "torque": point.torque / machine.torque_Nm,
        "flow": drive.flow_lpm / FLOW0,
    }


def _added(effect: Effect, drive: Drive, point: Point, machine: Machine, random: np.random.Generator) -> Floats | None:
    """The course (M,) of the heat that an effect adds, for 1 W."""
    features = _features(drive, point, machine)
    if effect.kind == "loss" and effect.law not in ("scale", "temperature"):
        return law(effect.law, features)
    if effect.cause == "unknown.resonance":
        rpm = np.abs(drive.speed_rpm) / (machine.top_rpm / MACHINE.top_rpm)
        return np.exp(-0.5 * ((rpm - 9200.0) / 500.0) ** 2)
    if effect.cause == "unknown.contact":
        return features["current"] ** 2 * _switching(random, drive, 250.0, 200.0)
    if effect.cause == "unknown.demagnetised":
        return features["current"] * (point.torque < 0.0)
    return None


def _switching(random: np.random.Generator, drive: Drive, off_s: float, on_s: float) -> Floats:
    """0 and 1 in turn (M,), for times drawn from exponential distributions."""
    t, edges = 0.0, []
    while t < drive.seconds:
        for mean in (off_s, on_s):
            t += float(random.exponential(mean))
            edges.append(t)
    return (np.searchsorted(edges, np.arange(drive.samples) / drive.rate_hz, side="right") % 2).astype(np.float64)
