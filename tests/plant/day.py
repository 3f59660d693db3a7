"""A bench day as a file of set values, as `whyhot plan --out` writes it, run as a drive."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant import machine as electric
from plant.drives import RATE_HZ, Drive, FLOW_lpm, INLET_degC, drive
from plant.machine import MACHINE, Machine

Floats = NDArray[np.float64]

MAGNET_degC = 90.0  # at which an operator's map of torque over current was made


def read(path: Path, machine: Machine = MACHINE, name: str = "day") -> Drive:
    """The drive of a CSV with a row a second: `time_s`, `speed_rpm`, `torque_Nm` or `current_A` (rms; at standstill
    direct current), and where they are there `flow_lpm` and `coolant_degC`. Raises ValueError where it sets no load."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    names = table.dtype.names or ()
    if not {"time_s", "speed_rpm"} <= set(names) or not {"torque_Nm", "current_A"} & set(names):
        raise ValueError(f"{path}: needs time_s, speed_rpm and torque_Nm or current_A; it has {', '.join(names)}")
    t = np.arange(round((table["time_s"][-1] + 1.0) * RATE_HZ)) / RATE_HZ
    set_values = {column: np.interp(t, table["time_s"], table[column]) for column in names}
    speed, current = set_values["speed_rpm"], set_values.get("current_A", 0.0 * t)
    asked = set_values.get("torque_Nm")
    found = drive(name, "drive", speed, torque(speed, current, machine) if asked is None else asked)
    return replace(
        found,
        flow_lpm=set_values.get("flow_lpm", np.full(t.size, FLOW_lpm)),
        inlet_degC=found.inlet_degC - INLET_degC + set_values.get("coolant_degC", INLET_degC),
        direct_A=np.where(speed == 0.0, sqrt(2.0) * current, 0.0),
    )


def torque(speed_rpm: Floats, current_A: Floats, machine: Machine = MACHINE) -> Floats:
    """The torque (N,) [Nm] of currents [A rms] at speeds; none at standstill, none where weakening alone takes as
    much."""
    speeds, torques, currents = _map(machine)
    at = np.clip(np.searchsorted(speeds, speed_rpm, side="right") - 1, 0, len(speeds) - 2)
    share = (speed_rpm - speeds[at]) / (speeds[at + 1] - speeds[at])
    below, above = (np.zeros_like(current_A) for _ in range(2))
    for place in np.unique(at):
        here = at == place
        below[here] = np.interp(current_A[here], currents[place], torques)
        above[here] = np.interp(current_A[here], currents[place + 1], torques)
    found: Floats = np.where(speed_rpm > 0.0, (1.0 - share) * below + share * above, 0.0)
    return found


@cache
def _map(machine: Machine) -> tuple[Floats, Floats, Floats]:
    """Speeds (S,), torques (T,) and the current (S, T) [A rms] of each pair, rising with the torque."""
    speeds, torques = machine.speeds, machine.torques
    each = [
        electric.operate(np.full(torques.size, n), torques, np.full(torques.size, MAGNET_degC), machine).current
        for n in speeds
    ]
    return speeds, torques, np.maximum.accumulate(np.array(each), axis=1)
