"""A replay's hot spots, by open loop and by the smoother, against motors whose truth is known.

    python benchmarks/hot_spots.py [--seeds N] [--first SEED] [--quick] [--json FILE]

Each motor of `tests/plant` has ten thermocouples and a motor file that is not calibrated to it, and goes through an S1
point and a WLTC, with and without a hidden magnet loss. Printed is how far the hottest winding and the hottest magnet
are off the truth (the hottest node, the mean of its cells), and how often the 95 % band holds it.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np

from benchmarks import asked
from benchmarks.shared import stored
from ingest.facts import facts
from plant import Effect, Plant, Recording, drives, sessions, write_campaign
from replay.engine.runs.campaign import replay_sessions

HIDDEN_W = 400.0  # of the magnets at 16,000 rpm
QUICK_S = 300.0  # of each session
WHO = ("open loop", "smoother")


@dataclass(frozen=True)
class Case:
    """A hot spot of one session: how far off it is [K], its band's half width [K], None without one, and whether that
    holds the truth."""

    spot: str
    who: str
    off_K: float
    half_K: float | None
    held: bool


def cases(seed: int, effects: tuple[Effect, ...], longest_s: float) -> Iterator[Case]:
    """The hot spots of one motor, in drives that end after `longest_s`."""
    plant = Plant(seed, *effects)
    s1 = drives.join("s1", "s1", [drives.hold(2000.0, 60.0, 5), drives.hold(9000.0, 60.0, 15)])
    recordings = sessions(plant, [drive.first(longest_s) for drive in (s1, drives.wltp(1))], layout="ten")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = write_campaign(folder, plant, recordings, layout="ten")
        with stored(folder, logs) as store:
            outcomes = replay_sessions(store, facts.at(store.ledger).sessions, None, "testing")
    for recording, outcome in zip(recordings, outcomes, strict=True):
        assert outcome.run, outcome.refusal
        summary = outcome.run.summary
        for who, spots in zip(WHO, (summary["hot_spots"], summary["filtered"]["hot_spots"]), strict=True):
            yield from (_case(plant, recording, spot, who, one) for spot, one in spots.items())


def _case(plant: Plant, recording: Recording, spot: str, who: str, one: Mapping[str, Any]) -> Case:
    nodes = {cell.node for cell in plant.mesh.cells if cell.node.startswith(("winding", "endwinding", "magnet"))}
    true = max(_hottest(plant, recording, node) for node in nodes if ("magnet" in node) == (spot == "magnet"))
    low, high = one["ci95_degC"] or (np.nan, np.nan)
    half = None if one["ci95_degC"] is None else (high - low) / 2
    return Case(spot, who, abs(one["max_degC"] - true), half, low < true < high)


def _hottest(plant: Plant, recording: Recording, node: str) -> float:
    cells = plant.mesh.of_node(node)
    means = np.average(recording.truth.temperatures[:, cells], axis=1, weights=plant.mesh.capacity[cells])
    return float(means.max())


def main() -> None:
    args = asked.parser(__doc__, seeds=(6, 1), first=(300, 300)).parse_args()
    hidden = Effect("loss.magnet.speed2", HIDDEN_W)
    found = [
        case
        for seed in range(args.first, args.first + args.seeds)
        for effects in ((), (hidden,))
        for case in cases(seed, effects, QUICK_S if args.quick else math.inf)
    ]
    print(f"{'':<20} {'off':>16} {'band, +-':>16} {'held':>10}")
    for spot, who in [(spot, who) for spot in ("winding", "magnet") for who in WHO]:
        mine = [case for case in found if (case.spot, case.who) == (spot, who)]
        off, half = [case.off_K for case in mine], [case.half_K for case in mine if case.half_K is not None]
        held = f"{sum(case.held for case in mine)} of {len(half)}"
        print(f"{f'{spot}, {who}':<20} {_range(off):>16} {_range(half) if half else 'none':>16} {held:>10}")
    asked.keep([asdict(case) for case in found], args.json)


def _range(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f} K"


if __name__ == "__main__":
    main()
