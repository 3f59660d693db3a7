"""Compiled kernels kept between starts: each source text is a module named by its hash, which numba caches beside it.

A 21-node kernel takes seconds to compile and a fraction of a second to load again. Nothing depends on the cache: where
its folder cannot be written or holds damage, the kernel is compiled in memory.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import cast

from twin.compiled.integrators import DEFAULT, Tableau
from twin.compiled.kernel import Compiled, compile_network, load_in_memory
from twin.motor.network import Network


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
        return _imported(_written(source.replace("cache=CACHE", "cache=True")))
    return load_in_memory(source)


def _written(source: str) -> Path:
    """The module file of a text. Processes that write it at once each put down the same whole file."""
    name = f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:32]}"
    path = folder() / f"{name}.py"
    if path.is_file() and path.read_text(encoding="utf-8") == source:
        return path
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=name, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        Path(temporary).replace(path)
    finally:
        Path(temporary).unlink(missing_ok=True)
    return path


def _imported(path: Path) -> Callable[..., None]:
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} cannot be imported")
    module = module_from_spec(spec)
    sys.modules[path.stem] = module  # numba finds a cached function's module by name
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[path.stem]
        raise
    return cast(Callable[..., None], module.run)
