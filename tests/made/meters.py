"""A session of the small servo with meters beside its thermometers, as one table: their truth is written out by
hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from made import can_bench

SECONDS, COOLANT = 900, 30.0
R20, FLUX20, FLUX_SLOPE = 0.05, 0.08, -0.0011
TORQUE_PER_A = 0.8

MOTOR = can_bench.MOTOR.replace("capacity = 900.0", "capacity = 900.0\nlimit_degC = 60.0")

BENCH = """\
schema = "whyhot.bench/1"
motor = "motor.toml"
specimen = "servo-01"
[time]
column = "t"
unit = "s"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "M"
quantity = "torque"
unit = "Nm"
[[channel]]
signal = "I"
quantity = "current"
unit = "A"
[[channel]]
signal = "T_winding"
quantity = "temperature"
unit = "degC"
node = "winding"
[[channel]]
signal = "T_yoke"
quantity = "temperature"
unit = "degC"
node = "yoke"
[[channel]]
signal = "T_magnet"
quantity = "temperature"
unit = "degC"
node = "magnet"
[[channel]]
signal = "T_coolant"
quantity = "temperature"
unit = "degC"
node = "coolant"
"""
METERS = """\
[[channel]]
signal = "P_el"
quantity = "power"
unit = "kW"
role = "observed"
noise = 0.002
[[channel]]
signal = "Q_cool"
quantity = "heat"
unit = "W"
node = "coolant"
role = "observed"
noise = 1.0
bias_sd = 2.0
[[channel]]
signal = "R"
quantity = "resistance"
unit = "mOhm"
node = "winding"
role = "observed"
reference = 50.0
[[channel]]
signal = "psi"
quantity = "flux"
unit = "Wb"
node = "magnet"
role = "observed"
reference = 0.08
slope_per_K = -0.0011
"""
DERATING = """\
[[derating]]
channel = "T_winding"
begin_degC = 50.0
end_degC = 80.0
"""

Floats = NDArray[np.float64]


def signals(magnet_loss: float = 30.0, seed: int = 1) -> Mapping[str, Floats]:
    """What the table's columns hold, one row for each second."""
    speed, current = (np.repeat(values[::10], 10) for values in can_bench.drive(SECONDS, seed))
    temperatures = can_bench.truth(speed, current, COOLANT, magnet_loss)
    n, i = speed[::10], current[::10]
    winding, yoke = ((temperatures[:-1, k] + temperatures[1:, k]) / 2 for k in range(2))
    s, c = n / 6000.0, i / 20.0
    loss = 240.0 * c * c * (1 + can_bench.ALPHA * (winding - 20.0)) + 90.0 * s**1.5 + magnet_loss * s * s
    random = np.random.default_rng(seed)

    def noisy(truth: Floats, sd: float) -> Floats:
        return truth + random.normal(0.0, sd, truth.size)

    torque = TORQUE_PER_A * i
    return {
        "t": np.arange(SECONDS, dtype=np.float64),
        "n": n,
        "M": torque,
        "I": i,
        "T_winding": noisy(temperatures[:-1, 0], 0.05),
        "T_yoke": noisy(temperatures[:-1, 1], 0.05),
        "T_magnet": noisy(temperatures[:-1, 2], 0.05),
        "T_coolant": np.full(SECONDS, COOLANT) + 0.01 * (np.arange(SECONDS) % 7),
        "P_el": noisy(torque * n * 2 * np.pi / 60 + loss, 2.0) / 1e3,
        "Q_cool": noisy(25.0 * (yoke - COOLANT), 1.0),
        "R": noisy(R20 * (1 + can_bench.ALPHA * (temperatures[:-1, 0] - 20.0)), 1e-5) * 1e3,
        "psi": noisy(FLUX20 * (1 + FLUX_SLOPE * (temperatures[:-1, 2] - 20.0)), 1e-5),
    }


def write(folder: Path, bench: str = BENCH + METERS, magnet_loss: float = 30.0) -> None:
    """Write motor.toml, bench.toml and 1_run.csv."""
    columns = signals(magnet_loss)
    rows = [",".join(columns)]
    rows += [",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True)]
    files = {"motor.toml": MOTOR, "bench.toml": bench, "1_run.csv": "\n".join(rows) + "\n"}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
