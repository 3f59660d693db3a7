"""Work in a child process of its own, that may be killed, refused memory, or let down by its disk."""

from __future__ import annotations

import builtins
import io
import json
import os
import pkgutil
import random
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, tzinfo
from importlib import import_module
from pathlib import Path
from typing import Any

from ingest.facts.ledger_place import SqliteFile
from ingest.texts import units
from made.places import ROOT
from replay.cli import main

KILLED = -signal.SIGKILL
WRONG_S = 10 * 365.25 * 86_400
CHANGES = (  # of a disk: calls of `os`, and what the ledger's database does in one transaction
    *((os, name) for name in ("write", "fsync", "replace", "mkdir", "unlink", "rmdir")),
    *((SqliteFile, name) for name in ("insert", "disconnect")),
)


def import_all() -> None:
    """Import all of ours and what it stands on, and read the table of units, so that no child has to. Nothing else
    runs: a child inherits no threads."""
    for package in ("ingest", "twin", "analytics", "replay"):
        for module in pkgutil.walk_packages([str(ROOT / package)], f"{package}."):
            with suppress(ImportError):  # of an extra that is not installed
                import_module(module.name)
    units.factor("rpm", "rad/s")


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


Act = Callable[[str], Callable[..., Any] | None]  # name of a call -> what is called in its place


def _counted(number: int, act: Act, on: bool) -> Act:
    """`act` before the call of this number (from 0), with `on` before each later one too."""
    left = [number]

    def step(name: str) -> Callable[..., Any] | None:
        left[0] -= 1
        return act(name) if left[0] == -1 or (on and left[0] < -1) else None

    return step


def _watched(name: str, true: Callable[..., Any], step: Act) -> Callable[..., Any]:
    def call(*args: Any, **named: Any) -> Any:
        return (step(name) or true)(*args, **named)

    return call


def at_change(number: int, act: Act, on: bool = False) -> None:
    """In this process: `act` before the change of a disk of this number (from 0), with `on` before each later one."""
    step = _counted(number, act, on)
    for owner, name in CHANGES:
        setattr(owner, name, _watched(name, getattr(owner, name), step))


def at_read(number: int, act: Act, on: bool = False) -> None:
    """The same before a file is opened, to be read or written, and before something is read of it."""
    step, true = _counted(number, act, on), io.open

    class Watched(io.FileIO):
        def readinto(self, *into: Any) -> int | None:
            step("read")
            return super().readinto(*into)

        def readall(self) -> bytes:
            step("read")
            return super().readall()

    def opened(file: Any, mode: str = "r", buffering: int = -1, *text: Any, **named: Any) -> Any:
        step("open")
        if set(mode) - set("rbt") or buffering == 0:
            return true(file, mode, buffering, *text, **named)
        ends = {key: named.pop(key) for key in ("closefd", "opener") if key in named}
        data = io.BufferedReader(Watched(file, **ends))
        return data if "b" in mode else io.TextIOWrapper(data, *text, **named)

    vars(io)["open"] = vars(builtins)["open"] = opened
    vars(os)["open"] = _watched("open", os.open, step)


def at_wrong_times(chance: random.Random) -> None:
    """In this process: the clock of the day is wrong by up to `WRONG_S`, and by something else at each look at it."""
    true = time.time

    def now_s() -> float:
        return true() + chance.uniform(-WRONG_S, WRONG_S)

    class Wrong(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Wrong:
            return cls.fromtimestamp(now_s(), tz)

    vars(time)["time"] = now_s
    for module in [*sys.modules.values()]:
        if vars(module).get("datetime") is datetime:
            vars(module)["datetime"] = Wrong


def die(_: str) -> None:
    """End this process as a power cut would."""
    os.kill(os.getpid(), signal.SIGKILL)
