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

POLE_PAIRS = 4
PSI_Wb = 0.0440  # of the magnets at 100 degC
PSI_SLOPE = -0.0011  # 1/K, NdFeB
LD_H, LQ_H, LQ_FALLS = 0.083e-3, 0.185e-3, 0.22  # the q axis loses 22 % of its inductance at full current
VOLTAGE_V = 182.0  # amplitude of a phase at 330 V of the link
CURRENT_A = 450.0 * sqrt(2.0)
TOP_RPM = 16_000.0
COLD, HOT = 20.0, 140.0  # magnet temperatures of the two tables
SPEEDS = np.linspace(0.0, TOP_RPM * 1.02, 52)
TORQUES = np.linspace(0.0, 250.0, 51)


@dataclass(frozen=True)
class Point:
    """At each sample: d and q current [A peak], d and q voltage [V peak], flux linkage [Wb], torque that was possible
    [Nm]."""

    i_d: Floats
    i_q: Floats
    u_d: Floats
    u_q: Floats
    flux: Floats
    torque: Floats

    @property
    def current(self) -> Floats:
        """Current of a phase [A rms]."""
        return np.hypot(self.i_d, self.i_q) / sqrt(2.0)


def _lq(i_q: Floats) -> Floats:
    return LQ_H * (1.0 - LQ_FALLS * np.minimum(np.abs(i_q) / CURRENT_A, 1.0) ** 2)


@cache
def _table(magnet_degC: float) -> tuple[Floats, Floats]:
    """i_d (speeds, torques) of least current, and the torque (speeds,) that voltage and current allow."""
    psi = PSI_Wb * (1 + PSI_SLOPE * (magnet_degC - 100.0))
    i_d = np.linspace(-CURRENT_A, 0.0, 240)
    i_q = _needed(TORQUES[:, None], i_d[None, :], psi)
    flux = np.hypot(psi + LD_H * i_d[None, :], _lq(i_q) * i_q)
    size = np.hypot(i_d[None, :], i_q)
    best = np.empty((SPEEDS.size, TORQUES.size))
    largest = np.empty(SPEEDS.size)
    for k, omega in enumerate(SPEEDS * np.pi / 30 * POLE_PAIRS):
        possible = (flux * omega <= VOLTAGE_V) & (size <= CURRENT_A)
        place = np.where(possible, size, np.inf).argmin(axis=1)
        there = possible.any(axis=1)
        last = int(np.flatnonzero(there)[-1])
        place[last + 1 :] = place[last]
        best[k], largest[k] = i_d[place], TORQUES[last]
    return best, largest


def _needed(torque: Floats, i_d: Floats, psi: float) -> Floats:
    """q current [A peak] for a torque; the q inductance falls with it."""
    i_q = np.zeros(np.broadcast_shapes(torque.shape, i_d.shape))
    for _ in range(30):
        i_q = torque / (1.5 * POLE_PAIRS * (psi + (LD_H - _lq(i_q)) * i_d))
    return i_q


def largest_torque(speed_rpm: float, magnet_degC: float = 100.0) -> float:
    """Torque [Nm] that current and voltage allow."""
    share = (magnet_degC - COLD) / (HOT - COLD)
    cold, hot = (float(np.interp(abs(speed_rpm), SPEEDS, _table(t)[1])) for t in (COLD, HOT))
    return (1 - share) * cold + share * hot


def operate(speed_rpm: Floats, torque_Nm: Floats, magnet_degC: Floats) -> Point:
    """The point of each sample (N,); torque beyond what is possible is cut."""
    n, share = np.abs(speed_rpm), np.clip((magnet_degC - COLD) / (HOT - COLD), -0.5, 1.5)
    (cold, cold_top), (hot, hot_top) = _table(COLD), _table(HOT)
    top = (1 - share) * np.interp(n, SPEEDS, cold_top) + share * np.interp(n, SPEEDS, hot_top)
    torque = np.clip(torque_Nm, -top, top)
    i_d = (1 - share) * _between(cold, n, np.abs(torque)) + share * _between(hot, n, np.abs(torque))
    psi = PSI_Wb * (1 + PSI_SLOPE * (magnet_degC - 100.0))
    i_q = np.zeros_like(i_d)
    for _ in range(30):
        i_q = torque / (1.5 * POLE_PAIRS * (psi + (LD_H - _lq(i_q)) * i_d))
    omega = speed_rpm * np.pi / 30 * POLE_PAIRS
    flux_d, flux_q = psi + LD_H * i_d, _lq(i_q) * i_q
    resistance = 0.0115  # ohm, warm: of the voltages alone; losses have their own
    return Point(
        i_d,
        i_q,
        resistance * i_d - omega * flux_q,
        resistance * i_q + omega * flux_d,
        np.hypot(flux_d, flux_q),
        torque,
    )


def _between(table: Floats, speed: Floats, torque: Floats) -> Floats:
    """A table's value at speed and torque, bilinear."""
    x, y = speed / (SPEEDS[1] - SPEEDS[0]), torque / (TORQUES[1] - TORQUES[0])
    i, j = (np.clip(v.astype(np.int64), 0, size - 2) for v, size in ((x, SPEEDS.size), (y, TORQUES.size)))
    u, w = x - i, y - j
    corners = (1 - u) * (1 - w) * table[i, j] + u * (1 - w) * table[i + 1, j]
    result: Floats = corners + (1 - u) * w * table[i, j + 1] + u * w * table[i + 1, j + 1]
    return result
