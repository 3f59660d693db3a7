"""The electric side: currents, voltage and flux of a d/q machine at a torque and speed, with field weakening.

Amplitude-invariant values (peak of a phase). Least current that makes the torque within the voltage, as a table over
speed and torque at two magnet temperatures; between them everything is linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PSI_Wb = 0.0440  # of the magnets at 100 degC
LD_H = 0.083e-3
VOLTAGE_V = 182.0  # amplitude of a phase at 330 V of the link
COLD, HOT = 20.0, 140.0  # magnet temperatures of the two tables


@dataclass(frozen=True)
class Machine:
    """The d/q machine and its inverter; `current_A`, `top_rpm` and `torque_Nm` are the scales of its motor file.
    `leakage_H`: part of both inductances whose flux crosses slots and ends instead of the air gap. `table_Nm`: where
    the table of currents ends."""

    pole_pairs: int = 4
    psi_Wb: float = PSI_Wb
    psi_slope: float = -0.0011  # 1/K, NdFeB
    ld_H: float = LD_H
    lq_H: float = 0.185e-3
    lq_falls: float = 0.22  # the q axis loses 22 % of its inductance at full current
    leakage_H: float = 0.0
    voltage_V: float = VOLTAGE_V
    current_A: float = 450.0  # rms
    top_rpm: float = 16_000.0
    torque_Nm: float = 220.0
    table_Nm: float = 250.0
    resistance_ohm: float = 0.0115  # warm: of the voltages alone; losses have their own

    @property
    def peak_A(self) -> float:
        """Largest amplitude of a phase's current [A]."""
        return self.current_A * sqrt(2.0)

    @property
    def top_Hz(self) -> float:
        """Electric frequency at the top speed [Hz]."""
        return self.top_rpm / 60.0 * self.pole_pairs

    @property
    def speeds(self) -> Floats:
        """Speeds of the tables (52,) [rpm]."""
        return np.linspace(0.0, self.top_rpm * 1.02, 52)

    @property
    def torques(self) -> Floats:
        """Torques of the tables (51,) [Nm]."""
        return np.linspace(0.0, self.table_Nm, 51)

    def psi(self, magnet_degC: Floats) -> Floats:
        """Flux linkage of the magnets [Wb] at their temperature."""
        return self.psi_Wb * (1 + self.psi_slope * (magnet_degC - 100.0))


MACHINE = Machine()


@dataclass(frozen=True)
class Point:
    """At each sample: d and q current [A peak], d and q voltage [V peak], flux linkage [Wb] of a phase and what of it
    crosses the air gap, torque that was possible [Nm]."""

    i_d: Floats
    i_q: Floats
    u_d: Floats
    u_q: Floats
    flux: Floats
    gap_flux: Floats
    torque: Floats

    @property
    def current(self) -> Floats:
        """Current of a phase [A rms]."""
        return np.hypot(self.i_d, self.i_q) / sqrt(2.0)


def _lq(i_q: Floats, machine: Machine = MACHINE) -> Floats:
    return machine.lq_H * (1.0 - machine.lq_falls * np.minimum(np.abs(i_q) / machine.peak_A, 1.0) ** 2)


@cache
def _table(machine: Machine, magnet_degC: float) -> tuple[Floats, Floats]:
    """i_d (speeds, torques) of least current, and the torque (speeds,) that voltage and current allow."""
    speeds, torques, psi = machine.speeds, machine.torques, machine.psi(np.asarray(magnet_degC))
    i_d = np.linspace(-machine.peak_A, 0.0, 240)
    i_q = _needed(machine, torques[:, None], i_d[None, :], psi)
    flux = np.hypot(psi + machine.ld_H * i_d[None, :], _lq(i_q, machine) * i_q)
    size = np.hypot(i_d[None, :], i_q)
    best = np.empty((speeds.size, torques.size))
    largest = np.empty(speeds.size)
    for k, omega in enumerate(speeds * np.pi / 30 * machine.pole_pairs):
        possible = (flux * omega <= machine.voltage_V) & (size <= machine.peak_A)
        place = np.where(possible, size, np.inf).argmin(axis=1)
        there = possible.any(axis=1)
        last = int(np.flatnonzero(there)[-1])
        place[last + 1 :] = place[last]
        best[k], largest[k] = i_d[place], torques[last]
    return best, largest


def _needed(machine: Machine, torque: Floats, i_d: Floats, psi: Floats) -> Floats:
    """q current [A peak] for a torque; the q inductance falls with it."""
    i_q = np.zeros(np.broadcast_shapes(torque.shape, i_d.shape))
    for _ in range(30):
        i_q = torque / (1.5 * machine.pole_pairs * (psi + (machine.ld_H - _lq(i_q, machine)) * i_d))
    return i_q


def largest_torque(speed_rpm: float, magnet_degC: float = 100.0, machine: Machine = MACHINE) -> float:
    """Torque [Nm] that current and voltage allow."""
    share = (magnet_degC - COLD) / (HOT - COLD)
    cold, hot = (float(np.interp(abs(speed_rpm), machine.speeds, _table(machine, t)[1])) for t in (COLD, HOT))
    return (1 - share) * cold + share * hot


def operate(speed_rpm: Floats, torque_Nm: Floats, magnet_degC: Floats, machine: Machine = MACHINE) -> Point:
    """The point of each sample (N,); torque beyond what is possible is cut."""
    n, share = np.abs(speed_rpm), np.clip((magnet_degC - COLD) / (HOT - COLD), -0.5, 1.5)
    (cold, cold_top), (hot, hot_top) = _table(machine, COLD), _table(machine, HOT)
    top = (1 - share) * np.interp(n, machine.speeds, cold_top) + share * np.interp(n, machine.speeds, hot_top)
    torque = np.clip(torque_Nm, -top, top)
    asked = np.abs(torque)
    i_d = (1 - share) * _between(machine, cold, n, asked) + share * _between(machine, hot, n, asked)
    psi = machine.psi(magnet_degC)
    i_q = _needed(machine, torque, i_d, psi)
    omega = speed_rpm * np.pi / 30 * machine.pole_pairs
    flux_d, flux_q = psi + machine.ld_H * i_d, _lq(i_q, machine) * i_q
    return Point(
        i_d,
        i_q,
        machine.resistance_ohm * i_d - omega * flux_q,
        machine.resistance_ohm * i_q + omega * flux_d,
        np.hypot(flux_d, flux_q),
        np.hypot(flux_d - machine.leakage_H * i_d, flux_q - machine.leakage_H * i_q),
        torque,
    )


def _between(machine: Machine, table: Floats, speed: Floats, torque: Floats) -> Floats:
    """A table's value at speed and torque, bilinear."""
    speeds, torques = machine.speeds, machine.torques
    x, y = speed / (speeds[1] - speeds[0]), torque / (torques[1] - torques[0])
    i, j = (np.clip(v.astype(np.int64), 0, size - 2) for v, size in ((x, speeds.size), (y, torques.size)))
    u, w = x - i, y - j
    corners = (1 - u) * (1 - w) * table[i, j] + u * (1 - w) * table[i + 1, j]
    result: Floats = corners + (1 - u) * w * table[i, j + 1] + u * w * table[i + 1, j + 1]
    return result
