"""What several benchmarks do: measure many motors at once, take a campaign's logs into a store of their own, and say
how sure a rate is."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from scipy.stats import binomtest

from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from ingest.units.each import Workers
from replay.engine.files.models import for_intake

T = TypeVar("T")


def of_each(measure: Callable[[int], T], seeds: Sequence[int]) -> Iterator[T]:
    """What is measured of the motor of each seed, in order: in a process for each core, of a single one in this."""
    if len(seeds) == 1:
        yield measure(seeds[0])
        return
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(measure, seeds)


@contextmanager
def stored(
    folder: Path, logs: Sequence[Path], at: Path | None = None, workers: Workers | None = None
) -> Iterator[Store]:
    """A new store that holds these logs, in `folder` or `at`; bench file and database, where there is one, lie in
    `folder`, as `plant.write_campaign` leaves them; `workers`: where logs are read and decoded."""
    setup = prepare(logs, folder / "bench.toml", [*folder.glob("bench.dbc")], for_intake)
    with Store.open((at or folder) / "store", create=True) as store:
        take_in(store, logs, setup, Override(), workers=workers)
        yield store


def clopper_pearson(found: int, of: int, confidence: float = 0.95) -> tuple[float, float]:
    """Bounds of a rate, `found` in `of` trials (Biometrika 26 (1934) 404, DOI 10.1093/biomet/26.4.404)."""
    low, high = binomtest(found, of).proportion_ci(confidence, method="exact")
    return float(low), float(high)
