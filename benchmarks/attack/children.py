"""Work in a child process of its own, that may be killed, refused memory, or let down by its disk."""

from __future__ import annotations

import json
import os
import pkgutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ingest.facts.ledger_place import SqliteFile
from made.places import ROOT
from replay.cli import main

KILLED = -signal.SIGKILL
CALLS = ("write", "fsync", "replace", "mkdir", "unlink", "rmdir")  # of `os`: each changes a disk


def import_all() -> None:
    """Import all of ours and what it stands on, so that no child has to. Nothing runs: a child inherits no threads."""
    for package in ("ingest", "twin", "analytics", "replay"):
        for module in pkgutil.walk_packages([str(ROOT / package)], f"{package}."):
            with suppress(ImportError):  # of an extra that is not installed
                import_module(module.name)


def started(work: Callable[[], object], said: Path | None = None) -> int:
    """A child that does `work` and ends with the number that it returns, else 0; `said` gets its output."""
    pid = os.fork()
    if pid:
        return pid
    code = 70
    try:
        if said is not None:
            handle = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            say_to(handle)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        done = work()
        code = done if isinstance(done, int) else 0
        sys.stdout.flush()
    except KeyboardInterrupt:  # before the command had begun
        code = 130
    except BaseException:  # noqa: BLE001 -- nothing may leave a child
        traceback.print_exc()
    os._exit(code)


def say_to(handle: int) -> None:
    """From here on this process says all to `handle`."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(handle, number)
        setattr(sys, name, os.fdopen(number, "w", buffering=1, closefd=False))


def ended(pid: int) -> int:
    """The exit code of a child, waited for; minus the signal that killed it."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def done(work: Callable[[], object]) -> int:
    """The exit code of `work` in a child."""
    return ended(started(work))


def result_of(work: Callable[[], Any], folder: Path) -> Any:
    """What `work` returns in a child, as JSON. Raises RuntimeError where it fails, with what it said."""
    answer, said = folder / "answer.json", folder / "said.txt"
    if ended(started(lambda: answer.write_text(json.dumps(work())) and 0, said)):
        raise RuntimeError(said.read_text(errors="replace")[-2000:])
    return json.loads(answer.read_text())


@dataclass(frozen=True)
class Verb:
    """A command of ours in a folder; its store is `store` there."""

    words: Sequence[str]
    folder: Path

    @property
    def said(self) -> Path:
        """Where its output is."""
        return self.folder / "said.txt"

    def run(self) -> int:
        """The command, in this process."""
        os.chdir(self.folder)
        os.environ["WHYHOT_STORE"] = "store"
        return main(list(self.words))

    def start(self, before: Callable[[], object] = lambda: None) -> int:
        """The command in a child, which does something `before`."""

        def both() -> int:
            before()
            return self.run()

        return started(both, self.said)

    def ended(self, before: Callable[[], object] = lambda: None) -> tuple[int, str]:
        """Exit code and output of the command in a child."""
        code = ended(self.start(before))
        return code, self.said.read_text(errors="replace")


def killed_within(pid: int, seconds: float, by: int = signal.SIGKILL) -> int:
    """The exit code of a child that gets a signal after some time, unless it has ended by then."""
    time.sleep(seconds)
    os.kill(pid, by)
    return ended(pid)


def at_change(number: int, act: Callable[[str], object], on: bool = False) -> None:
    """In this process: `act` before the change of a disk of this number (from 0), with `on` before each later one too.

    Changes are calls of `os` and whatever the ledger's database does in one transaction.
    """
    left = [number]

    def watched(name: str, true: Callable[..., Any]) -> Callable[..., Any]:
        def step(*args: Any, **named: Any) -> Any:
            left[0] -= 1
            if left[0] == -1 or (on and left[0] < -1):
                act(name)
            return true(*args, **named)

        return step

    for name in CALLS:
        setattr(os, name, watched(name, getattr(os, name)))
    for name in ("insert", "disconnect"):
        setattr(SqliteFile, name, watched(name, getattr(SqliteFile, name)))


def die(_: str) -> None:
    """End this process as a power cut would."""
    os.kill(os.getpid(), signal.SIGKILL)
