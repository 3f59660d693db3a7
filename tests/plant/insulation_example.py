"""The shipped ageing example: `PYTHONPATH=tests python -m plant.insulation_example FOLDER` writes it.

Two stators through ten oven cycles, one whose insulation cures first and gets worse then and one that nothing happens
to, and a table of checks of thirty motors with a batch that ages faster than the others.
"""

from __future__ import annotations

import gzip
import sys
from pathlib import Path

from plant import fleet, insulation_campaign
from plant.bare_stator import Rig
from plant.timeline import Plan

SEED = 7
PLAN = Plan(
    stators=2,
    cycles=10,
    forms=("dip_then_rise", "none"),
    early_stops=0.0,
    dead=0.0,
    electrical=False,
    cycles_a_log=10,
    period_s=60.0,
    rig=Rig(step_s=10.0),
)


def write(folder: Path) -> insulation_campaign.Campaign:
    """`S01`, `S02` with their logs and `fleet` with its table, each log gzipped, and the bench files; returns what is
    hidden."""
    written = insulation_campaign.write(folder, SEED, PLAN)
    fleet.write_checks(folder / "fleet", SEED, motors=30, checks=(4, 12), batches=3, bad_batches=1)
    for log in sorted(folder.rglob("*.csv")):
        log.with_name(f"{log.name}.gz").write_bytes(gzip.compress(log.read_bytes(), mtime=0))
        log.unlink()
    return written.truth


if __name__ == "__main__":
    write(Path(sys.argv[1]))
