"""Children that read logs, kept from one test to the next: to start one takes longer than it takes to read most logs of
the tests. What a child does that was used before is tested where each test has children of its own
(ingest/log/test_reading.py)."""

from __future__ import annotations

import os
import threading
from pathlib import Path

from ingest.log import reading

Place = tuple[int, Path, dict[str, str]]

Child = reading._Child  # as the product has it
_waiting: list[_Kept] = []
_looking = threading.Lock()


class _Kept(Child):
    """A child that waits for the next reader, unless it did not answer as it should."""

    def __init__(self) -> None:
        super().__init__()
        self.place, self.is_well = _place(), True

    def ask(self, request: bytes, seconds: float) -> bytes:
        self.is_well = False  # until it has answered
        line = super().ask(request, seconds)
        self.is_well = line.endswith(b"\n") and b'"no_memory"' not in line
        return line

    def end(self) -> None:
        if self.is_well and self.process.poll() is None:
            _waiting.append(self)
        else:
            super().end()


def keep() -> None:
    """From now on children are kept."""
    reading._Child = _taken  # type: ignore[assignment, misc]


def end() -> None:
    """End those that wait."""
    while _waiting:
        Child.end(_waiting.pop())


def _taken() -> Child:
    """One that waits and was started by this process, in this folder and environment; else a new one."""
    place = _place()
    with _looking:
        found = next((child for child in _waiting if child.place == place and child.process.poll() is None), None)
        if found is None:
            return _Kept()
        _waiting.remove(found)
        return found


def _place() -> Place:
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
    return os.getpid(), Path.cwd(), environment
