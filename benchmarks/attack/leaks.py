"""One process that takes in log after log: what it holds open, and how much memory it keeps."""

from __future__ import annotations

import resource
import shutil
from pathlib import Path

from benchmarks.attack import subjects
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.models import for_intake

FRESH = 25  # ingests of a store, then a new one: what is measured is the program, not the store
GROWTH = 1.05  # of memory, from the fifth part on


def ingests(arena: Arena) -> Outcome:
    """T23."""
    outcome = Outcome()
    subjects.write_bench(arena.folder)
    setup = prepare([arena.folder / "3_s2.csv"], arena.folder / "bench.toml", [], for_intake)
    log, store, first = arena.folder / "log.csv", arena.folder / "store", (0, 0)
    for number in range(arena.tries):
        subjects.write_table(log, 5, number)
        if number % FRESH == 0:
            shutil.rmtree(store, ignore_errors=True)
        with Store.open(store, create=True) as opened:
            done = take_in(opened, [log], setup, Override())
        outcome.count(*done.refusals)
        if number == arena.tries // 5:
            first = _held()
    now = _held()
    outcome.failed += [f"{now[0]} open files, {first[0]} before"] * (now[0] > first[0])
    outcome.failed += [f"{now[1] / 1e6:.1f} MB, {first[1] / 1e6:.1f} before"] * (now[1] > GROWTH * first[1])
    outcome.note = f"{now[0]} open files, {now[1] / 1e6:.0f} MB; after a fifth {first[0]} and {first[1] / 1e6:.0f} MB"
    return outcome


def _held() -> tuple[int, int]:
    """Open files, bytes of memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return len(list(Path("/proc/self/fd").iterdir())), pages * resource.getpagesize()


ATTACKS = (
    Attack("T23", "ingests in one process", "open files constant, memory grows by less than 5 %", 1000, 5, ingests),
)
