"""Property tests: the same examples on every machine, and no deadline on a shared one. Which tests come first, how wide
what they print is, and what is never collected as garbage."""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")

# Two workers share the processors: threads that wait for each other over small matrices take what the other one needs.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.pop("COLUMNS", None)  # printed text is as wide as it says: here 100, whoever runs the tests

HERE = Path(__file__).parent
# The one has numba compile what most others call; those beside it meanwhile need nothing compiled.
FIRST = ("test_benchmarks.py", "ingest")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """After `FIRST` come the other files beside this one, which run the whole program: a long one that came last would
    run alone."""
    items.sort(key=_turn)


def _turn(item: pytest.Item) -> int:
    place, *inner = item.path.relative_to(HERE).parts
    return FIRST.index(place) if place in FIRST else len(FIRST) + bool(inner)


def pytest_collection_finish() -> None:
    """What was collected stays to the end: Python need not look through it again and again, a sixth of all its time."""
    gc.freeze()


def pytest_sessionfinish() -> None:
    """At the end it goes, so that libraries find none of their objects left."""
    gc.unfreeze()
