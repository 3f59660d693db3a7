"""An ageing campaign of the plant's stator in a store: DC checks, oven cycles between them, and what really
happened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant import Effect, Plant, drives, record, write_campaign
from plant.drives import COURSES, Drive
from plant.plant import Truth
from replay.cli import main

CYCLES = 2
CHECKS = 2  # before the first cycle and after each: their spread is the repeatability
CHECK_HZ, OVEN_HZ = 2.0, 0.05  # of the log: neither changes fast
LIMIT_degC = 180.0
COPPER = ("endwinding_a_inner", "endwinding_b_inner")
IRON = ("teeth", "yoke")


@dataclass(frozen=True)
class Campaign:
    """What truly happened, in the order of the checks and of the cycles: means of whole nodes, without noise."""

    dose_h: list[float]
    resistance_K_per_W: list[float]
    hours: list[float]

    @property
    def slope_percent_per_100h(self) -> float:
        """Slope of 100 ln R over the dose, per 100 h."""
        return float(np.polyfit(self.dose_h, np.log(self.resistance_K_per_W), 1)[0] * 1e4)


def ageing_campaign(folder: Path, store: Path, specimen: str, seed: int, share_per_100h: float = 0.0) -> Campaign:
    """Run the campaign, write it to `folder` as BLF with motor, bench and DBC file, and ingest it into `store`.
    `share_per_100h`: how the conductance from winding to teeth changes with the dose, negative for insulation that
    gets worse."""
    hidden = [Effect("ageing.winding-teeth.hours_above_180degC", share_per_100h)] if share_per_100h else []
    plant = Plant(seed, *hidden)
    check, oven = _slowly(drives.dc_check(), CHECK_HZ, 2.0), _slowly(drives.oven(), OVEN_HZ, 20.0)
    true, recordings = Campaign([], [], []), []
    for number, drive in enumerate([check] * CHECKS + ([oven] + [check] * CHECKS) * CYCLES):
        truth = plant.run(drive, number, sum(true.hours))
        recordings.append(record(plant, truth))
        if drive is oven:
            true.hours.append(_hours_above(plant, truth))
        else:
            true.dose_h.append(sum(true.hours))
            true.resistance_K_per_W.append(_resistance(plant, truth))
    logs = write_campaign(folder, plant, recordings)
    words = [*map(str, logs), "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main(["ingest", *words, "--specimen", specimen, "--store", str(store)]) == 0
    return true


def _slowly(drive: Drive, rate_hz: float, step_s: float) -> Drive:
    """The drive recorded and solved less often."""
    courses = {name: getattr(drive, name)[:: round(drive.rate_hz / rate_hz)] for name in COURSES}
    return replace(drive.with_courses(courses), rate_hz=rate_hz, step_s=step_s)


def _hours_above(plant: Plant, truth: Truth) -> float:
    """Hours of the hotter end winding above 180 degC."""
    hottest = max((_mean(plant, truth, (node,)) for node in COPPER), key=lambda course: float(course.max()))
    return float((hottest[:-1] > LIMIT_degC).sum() * truth.drive.step_s / 3600.0)


def _resistance(plant: Plant, truth: Truth) -> float:
    """Resistance [K/W] over the last 10 min."""
    rise = _mean(plant, truth, COPPER) - _mean(plant, truth, IRON)
    last = round(600.0 / truth.drive.step_s)
    return float(rise[-last:].mean() / truth.heat[-last:].mean())


def _mean(plant: Plant, truth: Truth, nodes: tuple[str, ...]) -> NDArray[np.float64]:
    courses = [truth.temperatures[:, plant.mesh.of_node(node)].mean(axis=1) for node in nodes]
    return np.asarray(np.mean(courses, axis=0), dtype=np.float64)
