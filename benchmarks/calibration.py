"""Does calibration help on sessions that it did not learn from? Healthy motors of `tests/plant`, a truth of another
form.

    python benchmarks/calibration.py [--seeds N] [--first SEED] [--quick] [--json FILE]

For each seed: two S1, one S2 and two WLTC sessions are written as BLF with motor, bench and DBC files, ingested,
replayed with the file's model, calibrated on S1, S2 and WLTC, and replayed again on the kept S1 and WLTC. Mean absolute
errors [K] on the kept sessions by node, before and after: median over seeds, largest, and the share of (seed, session,
node) that got better.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path.append(str(HERE.parent / "tests"))

import numpy as np

from benchmarks import asked
from benchmarks.shared import stored
from ingest.facts import facts
from ingest.facts.store import Store
from plant import Plant, drives, points, sessions, write_campaign
from replay.engine.runs.campaign import replay_sessions
from replay.studies.characterise.calibrate import calibrate_sessions

LEARNT, KEPT = ("1_s1", "2_s2", "3_wltp"), ("4_s1", "5_wltp")
QUICK_S = 180.0  # of each session
Errors = dict[tuple[str, str], float]  # (session, node) -> mean absolute error [K]


def one_motor(seed: int, folder: Path, longest_s: float) -> tuple[Errors, Errors]:
    """Errors on the kept sessions before and after calibration of the healthy motor of a seed, of drives that end after
    `longest_s`."""
    plant = Plant(seed)
    tests = [points.s1(plant, 6000.0, 30.0, 0), points.s2(plant, 8000.0, 20.0, 1), drives.wltp(1)]
    tests += [points.s1(plant, 9000.0, 30.0, 3), drives.wltp(1)]
    logs = write_campaign(
        folder, plant, sessions(plant, [t.first(longest_s) for t in tests], layout="six"), layout="six"
    )
    with stored(folder, logs) as store:
        known = facts.at(store.ledger)
        before = _errors(store, None)
        result = calibrate_sessions(store, known, [known.session(name) for name in LEARNT], None, "testing")
        return before, _errors(store, result.event.model)


def _errors(store: Store, model: str | None) -> Errors:
    known = facts.at(store.ledger)
    outcomes = replay_sessions(store, [known.session(name) for name in KEPT], model, "testing")
    return {
        (outcome.session.name, node): mae
        for outcome in outcomes
        if outcome.run
        for node, mae in outcome.run.summary["mae_K"].items()
    }


def summary(pairs: list[tuple[Errors, Errors]]) -> dict[str, Any]:
    """Median and largest kept error by node, before and after, and the share that got better."""
    nodes: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    for before, after in pairs:
        for (session, node), error in before.items():
            nodes[node].append((error, after[session, node]))
    every = np.array([pair for of_node in nodes.values() for pair in of_node])
    return {
        "motors": len(pairs),
        "better": float((every[:, 1] < every[:, 0]).mean()),
        "nodes": {
            node: {
                "median_before_K": float(np.median([b for b, _ in some])),
                "median_after_K": float(np.median([a for _, a in some])),
                "largest_before_K": max(b for b, _ in some),
                "largest_after_K": max(a for _, a in some),
            }
            for node, some in nodes.items()
        },
    }


def main() -> None:
    """Run and print."""
    args = asked.parser(__doc__, seeds=(5, 1), first=(100, 100)).parse_args()
    pairs = []
    for seed in range(args.first, args.first + args.seeds):
        with tempfile.TemporaryDirectory() as folder:
            pairs.append(one_motor(seed, Path(folder), QUICK_S if args.quick else math.inf))
    found = {"seeds": [args.first, args.first + args.seeds - 1], **summary(pairs)}
    asked.keep(found, args.json)
    print(
        f"{found['motors']} healthy motors, kept S1 and WLTC: {found['better']:.0%} of errors smaller after calibration"
    )
    print(f"{'mean error [K]':<22}{'median before':>14}{'after':>8}{'largest before':>17}{'after':>8}")
    for node, row in found["nodes"].items():
        print(
            f"{node:<22}{row['median_before_K']:>14.2f}{row['median_after_K']:>8.2f}"
            f"{row['largest_before_K']:>17.2f}{row['largest_after_K']:>8.2f}"
        )


if __name__ == "__main__":
    main()
