"""Property tests: the same examples on every machine, and no deadline on a shared one. Which tests come first, how wide
what they print is, what is never collected as garbage, and that no test asks another machine for anything."""

import gc
import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")

# Two workers share the processors: threads that wait for each other over small matrices take what the other one needs.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.pop("COLUMNS", None)  # printed text is as wide as it says: here 100, whoever runs the tests

HERE = Path(__file__).parent
THIS_MACHINE = ("localhost", "127.0.0.1", "::1", "0.0.0.0", "", None)
# The one has numba compile what most others call; those beside it meanwhile need nothing compiled.
FIRST = ("test_benchmarks.py", "ingest")


def _near(true: Callable[..., Any], place: Callable[..., Any]) -> Callable[..., Any]:
    """`true`, but for another machine at the `place` that its arguments say."""

    def call(*args: Any, **named: Any) -> Any:
        if (asked := place(*args, **named)) not in THIS_MACHINE:
            raise RuntimeError(f"a test asks the network for {asked}")
        return true(*args, **named)

    return call


def _of_address(_: socket.socket, address: Any) -> str:
    return str(address[0]) if isinstance(address, tuple) else ""  # else the path of a socket in a folder


for _name in ("connect", "connect_ex"):
    setattr(socket.socket, _name, _near(getattr(socket.socket, _name), _of_address))
socket.getaddrinfo = _near(socket.getaddrinfo, lambda host, *_, **__: host)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """After `FIRST` come the other files beside this one, which run the whole program: a long one that came last would
    run alone."""
    items.sort(key=_turn)


def _turn(item: pytest.Item) -> int:
    place, *inner = item.path.relative_to(HERE).parts
    return FIRST.index(place) if place in FIRST else len(FIRST) + bool(inner)


def pytest_collection_finish() -> None:
    """What was collected stays to the end: Python need not look through it again and again, a sixth of all its time."""
    from made import readers  # numpy with it, which must not come before what is set above

    gc.freeze()
    readers.keep()


def pytest_sessionfinish() -> None:
    """At the end it goes, so that libraries find none of their objects left."""
    if readers := sys.modules.get("made.readers"):
        readers.end()
    gc.unfreeze()
