"""What follows from a motor alone is worked out once: session after session is filtered with the one object that the
motor was read into."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from twin.motor.network import Network

Found = TypeVar("Found")


def once_a_network(function: Callable[[Network], Found]) -> Callable[[Network], Found]:
    """The function, called once for each network and remembered as long as that lives. What it returns is
    shared: nobody changes it."""
    known: dict[int, Found] = {}

    @wraps(function)
    def of(network: Network) -> Found:
        key = id(network)
        if key not in known:
            known[key] = function(network)
            weakref.finalize(network, known.pop, key, None)
        return known[key]

    return of
