"""The next bench day as a CSV for the bench automation: one row a second, a column a set value."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from replay.engine.frame.frame import column_name
from replay.studies.planning.plan import Planned
from replay.written import written
from twin.fitting.model import Floats
from twin.motor.features import is_flow, scale
from twin.motor.network import LOADS
from twin.motor.outputs import BLOCK_S
from twin.motor.sensor_laws import AMBIENT
from twin.planning.courses import rest

ROW_S = 1.0


def write_plan(found: Planned, target: Path) -> None:
    """Time [s], what is set, and which `step` of the day it is (0 in a rest). From block to block all goes straight, in
    10 s. A folder that is not there is made."""
    table = {name: [f"{value:.7g}" for value in values] for name, values in set_values(found).items()}
    with written(target) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))


def set_values(found: Planned) -> dict[str, Floats]:
    """Column -> a value a second, as a log of the bench calls it."""
    course, network = found.day.course, found.network
    test = found.bench.test(course)
    blocks = {column_name("speed", "speed"): course.speed * network.scale["speed"]}
    load = found.bench.load
    blocks[f"{load}_{LOADS[load]}"] = course.load * network.scale[load]
    for j, boundary in enumerate(network.boundaries):
        if boundary.name != AMBIENT:
            blocks[f"{boundary.name}_degC"] = test.frame.boundaries[:, j]
    for name in filter(is_flow, test.inputs):
        blocks[column_name(name, "flow")] = test.inputs[name] * scale(network, name)
    seconds = np.arange(0.0, len(course.speed) * BLOCK_S, ROW_S)
    middles = (np.arange(len(course.speed)) + 0.5) * BLOCK_S
    at_seconds = {name: np.interp(seconds, middles, values) for name, values in blocks.items()}
    at_block = np.minimum((seconds / BLOCK_S).astype(np.intp), len(course.speed) - 1)
    return {"time_s": seconds, **at_seconds, "step": _steps(found)[at_block]}


def _steps(found: Planned) -> Floats:
    """Which step of the day each block belongs to (B,), 0 in a rest."""
    length = len(rest(found.day.rest_min).speed)
    steps = ((number, len(step.proposed.speed)) for number, step in enumerate(found.day.steps, 1))
    return np.concatenate([np.repeat([number, 0.0], [own, length]) for number, own in steps])
