"""A motor of two lumps under plateaus of speed and torque, run again and again: what repeats, and what does not."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ingest.catalogue.channels import ChannelData
from made.channels import channel

SECONDS = 3000
START = datetime(2025, 10, 6, 18, tzinfo=UTC).timestamp()
BENCH = """\
schema = "whyhot.bench/1"
specimen = "M-07"
kind = "drive"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "M"
quantity = "torque"
unit = "Nm"
[[channel]]
signal = "T_winding"
quantity = "temperature"
unit = "degC"
node = "winding"
sensor = "TC-1"
[[channel]]
signal = "T_yoke"
quantity = "temperature"
unit = "degC"
node = "yoke"
[[channel]]
signal = "T_coolant"
quantity = "temperature"
unit = "degC"
node = "coolant"
"""


def run(
    seed: int = 1,
    coolant: float = 60.0,
    start: float = 60.0,
    rest_s: int = 0,
    load: float = 1.0,
    film: float = 1.0,
    winding_K: float = 0.0,
    noise_seed: int = 0,
) -> list[ChannelData]:
    """Speed, torque, coolant, winding and yoke at 1 Hz: at rest for `rest_s`, then the plateaus of `seed`.

    `start`: of both lumps [degC]; `load`, `film`: factors of torque and of the film to the coolant; `winding_K`: what
    its sensor reads too much.
    """
    random = np.random.default_rng(seed)
    speed = np.repeat(np.round(random.uniform(500, 6000, 12), -2), SECONDS // 12)
    torque = np.repeat(np.round(random.uniform(5, 40, 12)), SECONDS // 12)
    speed, torque = np.r_[np.zeros(rest_s), speed], np.r_[np.zeros(rest_s), torque]
    winding, yoke = np.empty(len(speed)), np.empty(len(speed))
    w = y = start
    for k, (n, m) in enumerate(zip(speed, load * torque, strict=True)):
        winding[k], yoke[k] = w, y
        w, y = (
            w + (700.0 * (m / 40.0) ** 2 - 12.0 * (w - y)) / 900.0,
            y + (120.0 * (n / 6000.0) ** 1.5 + 12.0 * (w - y) - film * 25.0 * (y - coolant)) / 3500.0,
        )
    noise = np.random.default_rng(noise_seed).normal(0.0, 0.1, (5, len(speed)))
    read = {"T_winding": winding + winding_K + noise[0], "T_yoke": yoke + noise[1]}
    temperatures = [
        channel(name, "temperature", np.round(value, 2), role="observed", node=name.removeprefix("T_"))
        for name, value in (read | {"T_coolant": coolant + noise[2]}).items()
    ]
    return [
        channel("n", "speed", speed + 20.0 * noise[3]),
        channel("M", "torque", load * torque + noise[4]),
        *temperatures,
    ]


def write_table(path: Path, day: int, **more: float) -> None:
    """A run of the test as a table at 1 Hz, begun at 18:00 of a day."""
    channels = run(noise_seed=day, **more)  # type: ignore[arg-type]
    rows = [",".join(["time", *(one.spec.name for one in channels)])]
    for k, values in enumerate(zip(*(one.value for one in channels), strict=True)):
        stamp = datetime.fromtimestamp(START + 86_400 * day + k, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        rows.append(",".join([stamp, *(f"{value:.2f}" for value in values)]))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
