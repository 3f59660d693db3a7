"""Bands and margins of `whyhot sensors` against motors whose truth is known.

    python benchmarks/sensors.py [--seeds N] [--first SEED] [--quick] [--json FILE]

Each motor of `tests/plant` has ten thermocouples, is calibrated on two S1 points and an S2, and `whyhot sensors` is
asked over these, a WLTC and another S2. Printed is the share of readings that the filter's own 95 % bands hold, and
that the widened ones hold in the sessions that they were not made from; then, of a WLTC with a trailer that neither
calibration nor margins have seen, the share of time that the hottest winding passes the margin above one thermocouple:
the hottest node (the mean of its cells, as the motor file has it), and the hottest cell of all.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.shared import of_each, stored
from ingest.facts import facts
from plant import Plant, Recording, drives, points, sessions, write_campaign
from replay.studies.characterise.calibrate import calibrate_sessions
from replay.studies.characterise.sensors import SETTLE_S, sensors_worth

Floats = NDArray[np.float64]

VEHICLE, RISK = "EW_A_outer", 0.05
QUICK_S = 420.0  # of each session
WINDINGS = ("winding_a", "winding_b", *(f"endwinding_{side}_{part}" for side in "ab" for part in ("inner", "outer")))


@dataclass(frozen=True)
class Row:
    """Of one motor: means over channels, the margin [K], and the shares of time in which it is passed."""

    seed: int
    filter_covered: float
    covered: float
    filter_band_K: float
    band_K: float
    margin_K: float
    node_passes: float
    cell_passes: float


def row_of(seed: int, longest_s: float) -> Row:
    """One motor, in drives that end after `longest_s`."""
    plant = Plant(seed)
    plan = [
        points.s1(plant, 6000.0, 20.0, 0),
        points.s1(plant, 10_000.0, 20.0, 1),
        points.s2(plant, 8000.0, 15.0, 2),
        drives.wltp(1),
        points.s2(plant, 12_000.0, 15.0, 4),
        drives.wltp(1, trailer=1.3, name="trailer"),
    ]
    recordings = sessions(plant, [drive.first(longest_s) for drive in plan], layout="ten")
    with threadpool_limits(1, user_api="blas"), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = write_campaign(folder, plant, recordings[:-1], layout="ten")
        with stored(folder, logs) as store:
            known = facts.at(store.ledger)
            calibrate_sessions(store, known, known.sessions[:3], None, "testing")
            known = facts.at(store.ledger)
            model = next(iter(known.calibrations))
            worth = sensors_worth(store, known, known.sessions, model, [VEHICLE], RISK, lambda _: None)
    assert worth.margin is not None
    margin, withheld = worth.margin.from_sensor_K, worth.withheld
    shown, node, cell = above_sensor(plant, recordings[-1])
    return Row(
        seed=seed,
        filter_covered=float(np.mean([one.filter_covered for one in withheld])),
        covered=float(np.mean([one.covered for one in withheld])),
        filter_band_K=float(np.mean([one.filter_band_K for one in withheld])),
        band_K=float(np.mean([one.band_K for one in withheld])),
        margin_K=margin,
        node_passes=float((node - shown > margin).mean()),
        cell_passes=float((cell - shown > margin).mean()),
    )


def above_sensor(plant: Plant, recording: Recording) -> tuple[Floats, Floats, Floats]:
    """What the vehicle's thermocouple shows, the hottest winding node and the hottest cell, at its samples after the
    start [degC]."""
    (block,) = (b for b in recording.blocks if VEHICLE in [signal for signal, _, _ in b.message.signals])
    place = [signal for signal, _, _ in block.message.signals].index(VEHICLE)
    at_s = (block.t_ns - block.t_ns[0]) / 1e9
    truth, mesh = recording.truth, plant.mesh
    nodes = [
        np.average(truth.temperatures[:, cells], axis=1, weights=mesh.capacity[cells])
        for cells in (mesh.of_node(node) for node in WINDINGS)
    ]
    cells = points.hot_spot(plant, truth.temperatures)
    after = at_s >= SETTLE_S
    node, cell = (np.interp(at_s[after], truth.t_s, course) for course in (np.max(nodes, axis=0), cells))
    return block.values[after, place], node, cell


def table(rows: Sequence[Row]) -> str:
    """Means over the motors, and the worst of them."""

    def shares(values: Sequence[float]) -> str:
        return f"{100 * np.mean(values):5.1f} % ({100 * min(values):.1f} to {100 * max(values):.1f})"

    lines = [f"{len(rows)} motors: mean (range by motor)"]
    lines += [f"95 % band, the filter's own    +-{np.mean([r.filter_band_K for r in rows]):.1f} K holds "]
    lines[-1] += shares([r.filter_covered for r in rows])
    lines += [f"95 % band, widened             +-{np.mean([r.band_K for r in rows]):.1f} K holds "]
    lines[-1] += shares([r.covered for r in rows])
    lines += [f"margin at {100 * RISK:g} %: {np.mean([r.margin_K for r in rows]):.1f} K, passed by the hottest"]
    lines += [f"  node {shares([r.node_passes for r in rows])}", f"  cell {shares([r.cell_passes for r in rows])}"]
    return "\n".join(lines)


def main() -> None:
    """Run and print."""
    args = asked.parser(__doc__, seeds=(5, 1), first=(200, 200)).parse_args()
    of_motor, rows = partial(row_of, longest_s=QUICK_S if args.quick else math.inf), []
    for row in of_each(of_motor, range(args.first, args.first + args.seeds)):
        print(f"motor {row.seed}: measured", file=sys.stderr, flush=True)
        rows.append(row)
    print(table(rows))
    asked.keep([asdict(row) for row in rows], args.json)


if __name__ == "__main__":
    main()
