"""A script run as `python FILE` runs it, in a process that has imported already what most of ours import.

Imports of the same libraries, once a script, take longer than many a script itself.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from dataclasses import dataclass
from functools import cache
from multiprocessing.context import ForkServerContext
from pathlib import Path
from types import ModuleType

IMPORTED = ("replay.studies.diagnosis.diagnose", "scipy.sparse.linalg", "duckdb", "pyarrow.parquet")


@dataclass(frozen=True)
class Ran:
    """How a script ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


def ran(script: Path, *words: str, folder: Path) -> Ran:
    """Run a script with these words in a folder that is there, where its output is left as files too."""
    process = _context().Process(target=_run, args=(script, words, folder))
    process.start()
    process.join()
    assert process.exitcode is not None
    return Ran(process.exitcode, *(_printed(folder, name).read_text(encoding="utf-8") for name in ("stdout", "stderr")))


@cache
def _context() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*IMPORTED])
    return context


def _printed(folder: Path, name: str) -> Path:
    return folder / f"{name}.txt"


def _run(script: Path, words: tuple[str, ...], folder: Path) -> None:
    for number, name in ((1, "stdout"), (2, "stderr")):
        with _printed(folder, name).open("wb") as file:
            os.dup2(file.fileno(), number)
    os.chdir(folder)
    sys.argv = [str(script), *words]
    sys.path.insert(0, str(script.parent))
    main = ModuleType("__main__")
    main.__file__ = str(script)
    # Under the second name its own child processes send back what they make of its classes.
    sys.modules["__main__"] = sys.modules["__mp_main__"] = main
    exec(compile(script.read_bytes(), script, "exec"), main.__dict__)  # noqa: S102 -- our own script
