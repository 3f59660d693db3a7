"""A motor of two lumps under plateaus of speed and torque, run again and again: what repeats, and what does not."""

from __future__ import annotations

import numpy as np

from ingest.catalogue.channels import ChannelData
from made.channels import channel

SECONDS = 3000


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
