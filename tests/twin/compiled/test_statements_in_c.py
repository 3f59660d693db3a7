from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.integrator import frame, initial_of, motor, s2
from benchmarks.twin import in_c
from replay.engine.results.kernel_cache import load_kernel
from twin.run.simulate import Frame, simulate


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no compiler for C here")
@pytest.mark.parametrize("name", ["reference_motor", "hust_motor"])
def test_the_generated_statements_give_the_same_bits_in_c(name: str, tmp_path: Path) -> None:
    network = motor(name)
    compiled, whole, start = load_kernel(network), frame(network, s2(), 0.5), initial_of(network)
    inputs = Frame(0.5, whole.features[:400].copy(), whole.boundaries[:400].copy())
    ours = simulate(compiled, inputs, start)
    theirs = np.empty_like(ours)
    theirs[0] = start
    run = in_c(network, tmp_path, "-O1")
    assert run is not None
    run(compiled, inputs, theirs)
    np.testing.assert_array_equal(theirs, ours)
