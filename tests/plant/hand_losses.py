"""Losses by hand: a measured no-load loss, 0.5 % stray loss and shares of both as in textbooks, windage after Vrancik,
bearings after Palmgren, AC copper after Dowell."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from plant import losses, machine
from plant.form import Form
from plant.geometry import RHO_COPPER_20
from plant.losses import HEATS, HOT100, MU0, LossLaws
from plant.reduction import Term

STRAY, NO_LOAD_SPEED = 0.005, 0.5  # of the largest power; of the top speed
IRON_SHARES = {"yoke": 0.50, "teeth": 0.40, "rotor_surface": 0.08, "rotor_core": 0.02}
STRAY_SHARES = {"teeth": 0.5, "rotor_surface": 0.3, "magnet": 0.2}
GREASE_mm2_per_s, BEARING_mm = 10.0, 60.0


def copper(form: Form) -> dict[str, tuple[Term, ...]]:
    """DC by lengths of copper; AC in the slots by the first term of Dowell's series, (5 m^2 - 1) xi^4 / 45."""
    g, scale = form.geometry, form.machine
    watts_per_m = g.slots * (g.turns / g.paths) ** 2 * RHO_COPPER_20 / g.bar_area * scale.current_A**2
    skin = sqrt(RHO_COPPER_20 * HOT100 / (pi * scale.top_Hz * MU0))
    xi = g.conductor_height / skin * sqrt(g.copper_breadth / g.slot_width)
    deep = g.layers * g.conductors_high
    rises = HOT100**2 * (5 * deep**2 - 1) / 45 * xi**4
    result: dict[str, tuple[Term, ...]] = {}
    result["terminal_rack"] = (Term(3 * form.losses.terminal_ohm * scale.current_A**2, (("current", 2.0),), 1),)
    for side in "ab":
        slot = watts_per_m * g.layers * g.stack / 2
        alternating = Term(slot * rises / HOT100, (("current", 2.0), ("speed", 2.0)), -1)
        result[f"winding_{side}"] = (Term(slot, (("current", 2.0),), 1), alternating)
        for part in ("inner", "outer"):
            head = watts_per_m * g.layers / 2 * (g.near_length + g.crown(side))
            result[f"endwinding_{side}_{part}"] = (Term(head, (("current", 2.0),), 1),)
    return result


def other_losses(form: Form) -> dict[str, tuple[Term, ...]]:
    g, scale = form.geometry, form.machine
    idle = no_load_loss(form) / NO_LOAD_SPEED**1.5
    stray = STRAY * largest_power(form)
    result = {node: [Term(share * idle, (("speed", 1.5),))] for node, share in IRON_SHARES.items()}
    result["magnet"] = [Term(0.05 * idle, (("speed", 2.0),))]
    for node, share in STRAY_SHARES.items():
        result[node].append(Term(share * stray, (("speed", 1.5), ("current", 2.0))))
    omega = scale.top_rpm * pi / 30
    windage = pi * 0.0025 * 1.06 * g.rotor_radius**4 * omega**3 * g.stack
    result["rotor_surface"].append(Term(windage, (("speed", 3.0),)))
    moment = 1e-10 * (GREASE_mm2_per_s * scale.top_rpm) ** (2 / 3) * (BEARING_mm * g.size) ** 3
    for side in "ab":
        result[f"bearing_{side}"] = [Term(moment * omega, (("speed", 1.67),))]
    return {node: tuple(terms) for node, terms in result.items()}


def no_load_loss(form: Form) -> float:
    """Iron loss [W] that the motor is measured to have without load, at half its top speed."""
    speed = np.array([NO_LOAD_SPEED * form.machine.top_rpm])
    point = machine.operate(speed, np.zeros(1), np.full(1, 100.0), form.machine)
    heats = losses.heats(LossLaws(form.losses), point, speed, np.zeros(1))
    iron = [HEATS.index(group) for group in ("tips", "teeth", "yoke", "surface", "core")]
    return float(heats[0, iron].sum())


def largest_power(form: Form) -> float:
    """Largest shaft power [W] of the motor."""
    speeds = form.machine.speeds
    return max(machine.largest_torque(float(n), machine=form.machine) * float(n) * pi / 30 for n in speeds)
