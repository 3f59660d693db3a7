"""The shipped campaign with a hidden effect: `PYTHONPATH=tests python -m plant.hidden_effect FOLDER` writes it.

Air in the gap carries more heat from the rotor to the teeth than the motor file says, and the more the faster it turns.
"""

from __future__ import annotations

import sys
from pathlib import Path

from plant import drives, points
from plant.campaign import sessions, write_campaign
from plant.effects import Effect
from plant.plant import Plant

SEED = 81
EFFECT = Effect("conductance.rotor_surface-teeth.speed1.5", 20.0)
LEARN, KEEP = ("1_s1", "2_s2", "3_wltp"), ("4_s1", "5_wltp")


def write(folder: Path) -> list[Path]:
    """Two S1 points, S2 pulses and two WLTC as BLF, with motor, bench and DBC file; returns the logs."""
    plant = Plant(SEED, EFFECT)
    plan = [points.s1(plant, 6000.0, 20.0, 0), points.s2(plant, 7000.0, 20.0, 1), drives.wltp(1)]
    plan += [points.s1(plant, 12000.0, 20.0, 3), drives.wltp(1)]
    return write_campaign(folder, plant, sessions(plant, plan, layout="six"), layout="six")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
