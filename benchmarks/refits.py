"""What of a diagnosis further workers could take: the refits of a round, which do not depend on each other.

    python benchmarks/refits.py [--seconds N] [--quick] [--json FILE]

The shipped campaign with a hidden effect is diagnosed as `whyhot diagnose` does it (with `--seconds`, two sessions of a
small bench of that length instead). Measured is processor time: of the whole, and of the refits with what sessions left
out say of them. They run on two threads already, so four workers could at most halve the clock's time of that part.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.shared import stored
from ingest.facts import facts
from made import can_bench
from replay.shipped import example
from replay.studies.diagnosis.diagnose import diagnose
from twin.diagnosis import naming
from twin.diagnosis.rounds import with_refits

THREADS, WORKERS = 2, 4


def main() -> None:
    args = asked.parser(__doc__, seconds=(0, 600)).parse_args()
    with TemporaryDirectory() as place:
        folder = _small_bench(Path(place), args.seconds) if args.seconds else example("hidden_effect")
        numbers = measured(folder, Path(place))
    for name, value in numbers.items():
        print(f"{name:20} {value:.3g}")
    asked.keep(numbers, args.json)


def _small_bench(folder: Path, seconds: int) -> Path:
    """Two sessions of a motor whose magnet loses ten times what its file says."""
    can_bench.write_files(folder)
    for k in range(2):
        log = folder / f"{k}.blf"
        can_bench.write_log(log, seconds, seed=1 + k, start=can_bench.START + k * 86_400, magnet_loss=300.0)
    return folder


def measured(folder: Path, place: Path) -> dict[str, float]:
    """Processor time [s] of a diagnosis from all sessions but the last two of five, how many refits it made in how many
    rounds, and what further workers could take off the clock."""
    with stored(folder, sorted(folder.glob("*.blf")), place) as store:
        known = facts.at(store.ledger)
        learnt, kept = known.sessions[:3], known.sessions[3:]
        with _watched() as (spent_s, refits):
            begun = time.process_time()
            diagnose(store, known, learnt, kept, None, "testing")
            busy_s = time.process_time() - begun
    share = sum(spent_s) / busy_s
    on_threads = 1.0 - share + share / THREADS
    return {
        "diagnosis_busy_s": busy_s,
        "rounds": len(refits),
        "refits": sum(refits),
        "refits_share": share,
        "four_workers_save": (share / THREADS - share / WORKERS) / on_threads,
    }


@contextmanager
def _watched() -> Iterator[tuple[list[float], list[int]]]:
    """Processor time [s] of each round's refits, and their number."""
    spent_s, refits = list[float](), list[int]()

    def watched(*args: Any, **more: Any) -> Any:
        begun = time.process_time()
        found = with_refits(*args, **more)
        spent_s.append(time.process_time() - begun)
        refits.append(len(found.refits))
        return found

    with patch.object(naming, "with_refits", watched):
        yield spent_s, refits


if __name__ == "__main__":
    main()
