"""What a store survives: the same harm as in years of use, in minutes, and what came of each try.

    python benchmarks/torture.py [--hours H] [--only T1,T7] [--seed N] [--quick] [--json FILE]

`tried` of each attack is how often it was done, `failed` how often it did not end as it must; the exit code is 1 where
any failed. The full table takes about HOURS h on two cores; `--hours` takes so much of it (more than that: more tries),
and the answer says how much of each attack that is. `--quick` is the part that the tests run. Attacks draw from the
seed, and a failure names what was drawn. What a store must stand is in `benchmarks/attack`, a file a kind of harm.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.attack import (
    again,
    elsewhere,
    faults,
    flips,
    kills,
    leaks,
    logs,
    names,
    planted,
    sequences,
    strangers,
    tampering,
    together,
    unsynced,
)
from benchmarks.attack.children import import_all, result_of
from benchmarks.attack.outcome import Arena, Attack, Outcome
from benchmarks.attack.subjects import make_bench

HOURS = 3.5  # of the full table
SHM = Path("/dev/shm")  # where a sync costs nothing; what is killed here is a process, never the machine
MEMORY = SHM if os.access(SHM, os.W_OK) else None
MODULES = (
    *(kills, unsynced, faults, flips, tampering, together, logs, again, strangers, leaks, planted),
    *(sequences, names, elsewhere),
)
ATTACKS = sorted((one for module in MODULES for one in module.ATTACKS), key=lambda one: int(one.id[1:]))
SHOWN = 5  # failures of an attack


def main() -> None:
    """Print the table."""
    line = asked.parser(__doc__, seed=(1, 1))
    line.add_argument("--hours", metavar="H", type=float, default=0.05, help="about how long; %(default)s")
    line.add_argument("--only", metavar="T1,T7", help="only these attacks")
    chosen = line.parse_args()
    only = chosen.only.split(",") if chosen.only else [attack.id for attack in ATTACKS]
    import_all()
    share = 0.0 if chosen.quick else chosen.hours / HOURS
    print(f"{'':4} {'attack':40} {'tried':>7} {'failed':>7} {'of full':>8} {'s':>6}")
    with tempfile.TemporaryDirectory(prefix="torture", dir=MEMORY) as place:
        bench = Path(place).resolve() / "bench"
        make_bench(bench)
        answer = [_row(attack, share, bench, chosen.seed) for attack in ATTACKS if attack.id in only]
    failed = sum(len(row["failed"]) for row in answer)
    print(f"tried {sum(row['tried'] for row in answer):,}, failed {failed:,}")
    asked.keep({"hours": chosen.hours, "seed": chosen.seed, "attacks": answer}, chosen.json)
    sys.exit(1 if failed else 0)


def _row(attack: Attack, share: float, bench: Path, seed: int) -> dict[str, Any]:
    """One attack, in a process of its own."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="torture", dir=MEMORY) as place:
        folder = Path(place).resolve()
        arena = Arena(folder / "work", bench, attack.tries(share), f"{attack.id}, seed {seed}")
        arena.folder.mkdir()
        try:
            outcome = Outcome(**result_of(lambda: asdict(attack.run(arena)), folder))
        except RuntimeError as error:
            outcome = Outcome(0, [str(error)])
    seconds = time.monotonic() - began
    whole = outcome.whole or attack.whole
    percent = 100.0 * outcome.tried / whole
    print(f"{attack.id:4} {attack.name:40} {outcome.tried:7,} {len(outcome.failed):7,} {percent:6.3g} % {seconds:6.1f}")
    _say(outcome.failed)
    what = {"id": attack.id, "name": attack.name, "must": attack.must}
    return {**what, **asdict(outcome), "whole": whole, "seconds": round(seconds, 1)}


def _say(failed: Sequence[str]) -> None:
    for one in failed[:SHOWN]:
        print(f"       {one}")
    if len(failed) > SHOWN:
        print(f"       and {len(failed) - SHOWN:,} more: --json has all")


if __name__ == "__main__":
    main()
