"""Compiled kernels kept between starts: each source text is a module named by its hash, which numba caches beside it.

A 21-node kernel takes seconds to compile and a fraction of a second to load again. Nothing depends on the cache: where
its folder cannot be written, the kernel is compiled in memory. What numba keeps are pickles and machine code, which run
as they are loaded: so they are loaded only from a folder that nobody else may write, and only as they were written,
which `<kernel>.sums` tells; what differs is compiled again.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import cast

import numba

from twin.compiled.integrators import DEFAULT, Tableau
from twin.compiled.kernel import Compiled, compile_network, load_in_memory
from twin.motor.network import Network

_log = logging.getLogger(__name__)


def load_kernel(network: Network, method: Tableau = DEFAULT) -> Compiled:
    """The compiled network, from the cache where it was compiled before. Raises `NetworkError` as `compile_network`."""
    return compile_network(network, method, load)


def folder() -> Path:
    """Where kernels are kept: `WHYHOT_CACHE`, else `whyhot` under `XDG_CACHE_HOME` or `~/.cache`."""
    own = os.environ.get("WHYHOT_CACHE")
    if own:
        return Path(own) / "kernels"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "whyhot" / "kernels"


@cache
def load(source: str) -> Callable[..., None]:
    """The compiled `run` of a kernel's source text."""
    # Whatever a folder that is full, read-only or damaged makes Python or numba raise, the text itself is whole.
    with suppress(Exception):
        place = folder()
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if why := _unsafe(place):
            _warn(f"{place}: {why}: kernels are compiled anew at every start. Name another folder with WHYHOT_CACHE.")
        else:
            return _imported(_written(place, source.replace("cache=CACHE", "cache=True")))
    return load_in_memory(source)


def _unsafe(place: Path) -> str | None:
    """Why what lies in a folder may come from somebody else; None where it cannot."""
    if os.name == "nt":  # rights are not in the mode there; the default folder is the user's own
        return None
    for one in (place, place / "__pycache__"):
        if not one.exists():
            continue
        if one.stat().st_uid != os.geteuid():
            return "belongs to another user"
        if one.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return "others may write in it"
    return None


@cache
def _warn(line: str) -> None:
    _log.warning(line)


def _written(place: Path, source: str) -> Path:
    """The module file of a text. Processes that write it at once each put down the same whole file."""
    path = place / f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:32]}.py"
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        _put(path, source)
    return path


def _put(path: Path, text: str) -> None:
    """Write a file as a whole, or not at all."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _imported(path: Path) -> Callable[..., None]:
    """`run` of a kernel's module; what numba keeps of it is as it was written, or is written anew."""
    if not _is_as_noted(path):
        for kept in _kept(path):
            kept.unlink(missing_ok=True)
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[path.stem] = module  # numba finds a cached function's module by name
    settings = vars(numba.config)
    elsewhere, settings["CACHE_DIR"] = settings["CACHE_DIR"], ""  # beside the module, not where NUMBA_CACHE_DIR says
    try:
        exec(compile(path.read_text(encoding="utf-8"), path, "exec"), module.__dict__)  # noqa: S102 -- our own text
    except BaseException:
        del sys.modules[path.stem]
        raise
    finally:
        settings["CACHE_DIR"] = elsewhere
    _note(path)
    for one in vars(module).values():
        if kept_by := getattr(one, "_cache", None):  # numba's, of a function that it compiles at its first call
            kept_by.save_overload = _noting(path, kept_by.save_overload)
    return cast(Callable[..., None], module.run)


def _noting(path: Path, save: Callable[..., None]) -> Callable[..., None]:
    """Keep a compiled function as `save` does, and note what is kept then."""

    def saved(*which: object) -> None:
        save(*which)
        with suppress(OSError):  # then it is compiled again at the next start
            _note(path)

    return saved


def _note(path: Path) -> None:
    """Write down what numba keeps of a module now."""
    if not _is_as_noted(path):
        _put(path.with_suffix(".sums"), _sums(path))


def _is_as_noted(path: Path) -> bool:
    known = path.with_suffix(".sums")
    return known.is_file() and known.read_text(encoding="utf-8") == _sums(path)


def _kept(path: Path) -> list[Path]:
    """The files in which numba keeps the functions of a module."""
    return sorted((path.parent / "__pycache__").glob(f"{path.stem}.*"))


def _sums(path: Path) -> str:
    """Name and SHA-256 of each of them."""
    return json.dumps({kept.name: hashlib.sha256(kept.read_bytes()).hexdigest() for kept in _kept(path)})
