"""A command that is killed right before one of its changes: in a process of its own, as nothing runs behind that."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable
from typing import Any

from made.places import ROOT

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests")))}  # of such a process


def dies_at(call: int, work: Callable[[], object], changes: Iterable[tuple[Any, Iterable[str]]]) -> None:
    """Do `work`, killed right before the call that comes after `call` others. `changes`: what is counted, modules or
    classes with the names of their functions, as `(os, ("fsync", "replace"))`."""
    left = [call]

    def counted(true: Callable[..., Any]) -> Callable[..., Any]:
        def step(*args: Any, **named: Any) -> Any:
            left[0] -= 1
            if left[0] < 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return true(*args, **named)

        return step

    for owner, names in changes:
        for name in names:
            setattr(owner, name, counted(getattr(owner, name)))
    work()


def started(work: Callable[[], object]) -> int:
    """The number of a child process that does `work` and ends."""
    pid = os.fork()
    if pid == 0:
        work()
        os._exit(0)
    return pid


def ended(pid: int) -> int:
    """How a child process ended: 0, or minus the number of the signal that killed it."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
