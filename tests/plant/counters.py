"""Counters that vehicles deliver at visits to the workshop: hours of operation in bins of temperature, and starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant.deterioration import acceleration
from plant.fleet import FIRST_DAY, sums_by_motor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Counters:
    """Read at visits to the workshop: sums since the motor was made. `hours` (N, bins): of operation with the hot
    spot in each bin between `edges_degC` (bins + 1,); `true_equivalent_h` (N,): hours at 180 degC by the hidden
    activation energy."""

    motor: NDArray[np.int32]
    day: Floats
    starts: Ints
    hours: Floats
    edges_degC: Floats
    true_equivalent_h: Floats
    activation_eV: float


def counters(seed: int, motors: int = 2000, readouts: tuple[int, int] = (1, 8), activation_eV: float = 1.0) -> Counters:
    """Vehicles with drivers of their own: mostly 60 to 120 degC, some often close to 180 degC. A readout is missed
    now and then."""
    random = np.random.default_rng([seed, 53])
    counts = random.integers(readouts[0], readouts[1] + 1, motors)
    motor = np.repeat(np.arange(motors, dtype=np.int32), counts)
    edges = np.arange(-40.0, 241.0, 20.0)
    usual, spread = random.normal(85.0, 12.0, motors), random.uniform(18.0, 32.0, motors)
    days = random.gamma(4.0, 60.0, len(motor))
    driven = days * random.gamma(6.0, 0.25, motors)[motor]
    fine = np.arange(-40.0, 240.0, 2.0) + 1.0
    shape = np.exp(-0.5 * ((fine - usual[:, None]) / spread[:, None]) ** 2)
    shape /= shape.sum(axis=1, keepdims=True)
    in_bins = shape.reshape(motors, -1, 10).sum(axis=2)
    a_year = random.gamma(200.0, 1.0 / 200.0, len(motor))  # no two stretches are driven alike
    hours = driven[:, None] * in_bins[motor] * a_year[:, None]
    worth = driven * a_year * (shape @ acceleration(fine, activation_eV, 180.0))[motor]
    starts = random.poisson(3.2 * days)

    def since_made(values: Floats) -> Floats:
        return sums_by_motor(values, counts)

    kept = random.random(len(motor)) >= 0.05
    return Counters(
        motor[kept],
        since_made(days)[kept],
        since_made(starts.astype(np.float64)).astype(np.int64)[kept],
        np.column_stack([since_made(column) for column in hours.T])[kept],
        edges,
        since_made(worth)[kept],
        activation_eV,
    )


def write_counters(path: Path, read: Counters, batches: Sequence[str]) -> Path:
    """One row for each readout: serial, batch of the motor (`batches` by its place), date, starts, and a column of
    hours for each bin."""
    bins = [f"h_{low:.0f}_{high:.0f}" for low, high in zip(read.edges_degC[:-1], read.edges_degC[1:], strict=True)]
    lines = [",".join(["serial", "batch", "date", "starts", *bins])]
    for motor, day, starts, hours in zip(read.motor, read.day, read.starts, read.hours, strict=True):
        when = f"{FIRST_DAY + timedelta(days=float(day)):%Y-%m-%d %H:%M}"
        lines.append(
            f"M{motor + 1:04d},{batches[motor]},{when},{starts}," + ",".join(f"{value:.2f}" for value in hours)
        )
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path
