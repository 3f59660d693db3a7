"""The servo of `can_bench` with its winding potted: a mass beside the winding that its motor file does not know of.

Steps of 1 s by the classical Runge-Kutta method, inputs held: its fastest time constant is 50 s.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from made.can_bench import ALPHA, Floats

POTTING_J_PER_K, FOLLOWS_S = 200.0, 300.0


def truth(speed: Floats, current: Floats, coolant: Floats, magnet_loss: float) -> Floats:
    """Temperatures (N, 3) of winding, yoke and magnet [degC], one a second, from 25 degC: speed [rpm], current [A rms]
    and coolant [degC] (N,) each held for a second; `magnet_loss` [W] at full speed."""
    s, c = speed / 6000.0, current / 20.0
    gap, iron, magnet = 1.0 + 2.0 * s**0.8, 90.0 * s**1.5, magnet_loss * s**2
    temperatures = np.full((len(speed), 4), 25.0)

    def rate(k: int, t: Floats) -> Floats:
        copper = 240.0 * c[k] ** 2 * (1 + ALPHA * (t[0] - 20.0))
        to_potting = POTTING_J_PER_K / FOLLOWS_S * (t[0] - t[3])
        return np.array(
            [
                (copper + 12.0 * (t[1] - t[0]) - to_potting) / 900.0,
                (iron[k] + 12.0 * (t[0] - t[1]) + 25.0 * (coolant[k] - t[1]) + gap[k] * (t[2] - t[1])) / 3500.0,
                (magnet[k] + gap[k] * (t[1] - t[2])) / 1200.0,
                to_potting / POTTING_J_PER_K,
            ]
        )

    for k, t in enumerate(temperatures[:-1]):
        first = rate(k, t)
        second = rate(k, t + first / 2)
        third = rate(k, t + second / 2)
        temperatures[k + 1] = t + (first + 2 * second + 2 * third + rate(k, t + third)) / 6
    return temperatures[:, :3]


def set_values(day: Path) -> tuple[Floats, Floats, Floats]:
    """Speed [rpm], current [A rms] and coolant [degC] (N,), one a second, of a day that `whyhot plan --out` wrote."""
    table = np.genfromtxt(day, delimiter=",", names=True)
    return table["speed_rpm"], table["current_A"], table["coolant_degC"]
