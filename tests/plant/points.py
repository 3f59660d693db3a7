"""Bench points found by search on the motor itself: what an operator does who watches the hot spot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from plant.drives import RATE_HZ, Drive, drive, flat, hold, join, pulse, ramp
from plant.machine import MACHINE, largest_torque
from plant.plant import Plant

Floats = NDArray[np.float64]

LIMIT_degC = 180.0
PULSES = ((10.0, 215.0, 60.0), (30.0, 165.0, 120.0), (60.0, 130.0, 150.0))  # length [s], Nm, rest after it [s]
SEARCH_STEP_s = 5.0


def hot_spot(plant: Plant, temperatures: Floats) -> Floats:
    """The hottest copper cell (N + 1,) [degC]."""
    nodes = ("winding_a", "winding_b", *(f"endwinding_{s}_{p}" for s in "ab" for p in ("inner", "outer")))
    cells = np.concatenate([plant.mesh.of_node(node) for node in nodes])
    hottest: Floats = temperatures[:, cells].max(axis=1)
    return hottest


def s1(
    plant: Plant,
    speed_rpm: float,
    minutes: float = 30.0,
    number: int = 0,
    limit_degC: float = LIMIT_degC,
    name: str = "s1",
) -> Drive:
    """Speed held with the torque at which the hot spot ends at the limit; the largest possible where it does not
    reach it."""
    first = plant.warm(number, hold(speed_rpm, 0.0, minutes))

    def above(torque: float) -> float:
        truth = plant.run(hold(speed_rpm, torque, minutes), number, start=first, step_s=SEARCH_STEP_s)
        return float(hot_spot(plant, truth.temperatures).max()) - limit_degC

    top = 0.97 * largest_torque(speed_rpm, machine=plant.form.machine)
    torque = top if above(top) < 0.0 else float(brentq(above, 1.0, top, xtol=0.1))
    return hold(speed_rpm, round(torque, 1), minutes, name)


def s2(
    plant: Plant,
    speed_rpm: float,
    minutes: float = 60.0,
    number: int = 0,
    pulses: Sequence[tuple[float, float, float]] = PULSES,
    name: str = "s2",
) -> Drive:
    """Pulses in turn, each ended after its length or when the hot spot reaches 180 degC; rests between. Their torques
    are those of the jacketed motor: another's are larger as its torque is."""
    parts = [drive(name, "s2", ramp(0.0, speed_rpm, 10.0), flat(0.0, 10.0))]
    state = plant.run(parts[0], number, start=plant.warm(number, parts[0])).temperatures[-1]
    top = 0.97 * largest_torque(speed_rpm, machine=plant.form.machine)
    while sum(part.seconds for part in parts) < 60.0 * minutes:
        length, torque, rest = pulses[(len(parts) - 1) % len(pulses)]
        torque = torque * plant.form.machine.torque_Nm / MACHINE.torque_Nm
        part = _ended(plant, pulse(speed_rpm, min(torque, top), length, rest), length, rest, state, number)
        state = plant.run(part, number, start=state).temperatures[-1]
        parts.append(part)
    return join(name, "s2", parts)


def _ended(plant: Plant, part: Drive, length: float, rest: float, state: Floats, number: int) -> Drive:
    """The pulse, cut where the hot spot reaches the limit: to whole seconds, at least 5."""
    truth = plant.run(part.first(length), number, start=state)
    over = np.flatnonzero(hot_spot(plant, truth.temperatures) >= LIMIT_degC)
    if not over.size:
        return part
    seconds = max(float(np.floor(truth.t_s[over[0]])), 5.0)
    level = float(part.torque_Nm[: round(length * RATE_HZ)].max())
    return pulse(float(part.speed_rpm[0]), level, seconds, rest)
