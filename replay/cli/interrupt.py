"""Ctrl-C stops a command wherever it comes."""

from __future__ import annotations

import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager

SOON_S = 0.05
DUCKDB = "Query interrupted"  # what DuckDB raises when Ctrl-C comes while it computes


@contextmanager
def stopping() -> Iterator[None]:
    """Where Python can only print an interrupt and go on (while LLVM loads compiled code), it comes once more."""
    before = sys.unraisablehook

    def again(what: sys.UnraisableHookArgs) -> None:
        if what.exc_type is KeyboardInterrupt:
            timer = threading.Timer(SOON_S, interrupt_main)
            timer.daemon = True
            timer.start()
        else:
            before(what)

    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = before
