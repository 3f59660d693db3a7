"""Which notebooks there are, opened in marimo or written for Jupyter. Raises NotebookError."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from ingest.errors import not_installed
from ingest.texts.nearest import hint
from replay.errors import NotebookError
from replay.shipped import shipped


def notebooks() -> Mapping[str, Path]:
    """Name -> file."""
    return {path.stem: path for path in sorted(shipped("notebooks").glob("*.py"))}


def says(path: Path) -> str:
    """What a notebook shows: the first line of its file."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.splitlines()[0]


def notebook(name: str) -> Path:
    known = notebooks()
    if name not in known:
        raise NotebookError(f"{name}: there is no such notebook.{hint(name, known)} whyhot notebook lists all")
    return known[name]


def run(path: Path, store: Path) -> None:
    """Show a notebook in the browser, and return when marimo is ended. It listens on this machine only, and its file
    cannot be changed from there."""
    with suppress(KeyboardInterrupt):
        _marimo("run", path, "--", "--store", store)


def write(path: Path, target: Path) -> None:
    """A notebook as a file of one's own: .ipynb for Jupyter, .py to change in marimo; never over one that is there."""
    if target.suffix == ".html":
        raise NotebookError(
            f"{target}: a page made by marimo loads its program from the network and stays empty without it. Write "
            f"{target.with_suffix('.ipynb')} and let `jupyter nbconvert --execute --to html` make the page of it"
        )
    if target.suffix not in (".ipynb", ".py"):
        raise NotebookError(f"{target}: a notebook is written as .ipynb for Jupyter or as .py for marimo; name it so")
    if target.exists():
        raise NotebookError(f"{target}: there is a file of this name; give another, or move it away")
    if target.suffix == ".py":
        shutil.copyfile(path, target)
    else:
        _marimo("export", "ipynb", "--output", target, path)


def _marimo(*words: str | Path) -> None:
    """marimo as a program, as which alone it is documented."""
    lacking = [package for package in ("marimo", "nbformat", "vl_convert") if find_spec(package) is None]
    if lacking:
        raise NotebookError(not_installed(lacking[0]))
    command: Sequence[str] = [sys.executable, "-m", "marimo", *map(str, words)]
    export = words[0] == "export"
    done = subprocess.run(command, capture_output=export, text=True, check=False)
    if done.returncode:
        why = (done.stderr or "").strip().splitlines()[-1:] or ["see what it said above"]
        raise NotebookError(f"marimo stopped ({done.returncode}): {why[0]}")
