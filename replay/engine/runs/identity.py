"""What a run is (its key), where it was made (environment), and what came out (digest)."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from twin.compiled.integrators import DEFAULT

Floats = NDArray[np.float64]


def replay_key(
    facts: Facts,
    session: SessionRecorded,
    model: str,
    level: str,
    initial: Floats,
    frame: str,
    integrator: str,
    ageing: Sequence[Mapping[str, Any]] = (),
    unknown: Sequence[str] = (),
    *,
    code: str,
) -> dict[str, Any]:
    """Everything that a run's digest may depend on, but for the environment. `initial` (n,) [degC]; `frame` SHA-256;
    `ageing`: what is left of the model's coefficients (`replay.engine.specimen.aged`); `unknown`: causes that the
    filter was asked to find; `code` hash of the sources that run it (`replay.engine.runs.sources`)."""
    decodes = [facts.decodes[file["decode"]] for file in session.files]
    return {
        "raw": sorted({d.raw for d in decodes}),
        "databases": sorted({sha for d in decodes for sha in d.databases}),
        "bench": facts.current(session.bench) if session.bench else None,
        "decoder": sorted({d.decoder for d in decodes}),
        "clocks": {},
        "model": model,
        "level": level,
        "initial": digest_of([initial]),
        "frame": frame,
        "settings": {"integrator": integrator, "step_s": DEFAULT.step_s},
        "code": code,
        **({"ageing": list(ageing)} if ageing else {}),
        **({"unknown": list(unknown)} if unknown else {}),
    }


def run_id(key: Mapping[str, Any]) -> str:
    """The first 16 hexadecimal digits of the key's SHA-256."""
    return hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:16]


def environment() -> dict[str, str]:
    """Interpreter, processor and numerical packages: same key and same environment must give the same digest."""
    from llvmlite import binding

    packages = {name: version(name) for name in ("numpy", "scipy", "numba", "llvmlite", "pyarrow")}
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpu": binding.get_host_cpu_name(),
        **packages,
    }


def digest_of(columns: Iterable[Floats]) -> str:
    """SHA-256 over little-endian float64 columns in the order given, NaN canonical, -0 as 0."""
    sha = hashlib.sha256()
    for column in columns:
        values = np.ascontiguousarray(column, dtype="<f8") + 0.0  # -0 + 0 is 0
        values[np.isnan(values)] = np.nan
        sha.update(values.tobytes())
    return sha.hexdigest()
