"""One motor of the calibration benchmark: a truth of another form, kept sessions, the whole way through files and
store."""

from __future__ import annotations

import math
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np

from made.places import ROOT

PATH = ROOT / "benchmarks" / "calibration.py"


def test_a_calibrated_model_is_better_on_sessions_that_it_did_not_learn_from(tmp_path: Path) -> None:
    spec = spec_from_file_location("calibration_benchmark", PATH)
    assert spec
    assert spec.loader
    benchmark = module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    before, after = benchmark.one_motor(100, tmp_path, math.inf)
    assert set(before) == set(after)
    assert len(before) == 12
    assert np.mean(list(after.values())) < 0.5 * np.mean(list(before.values())), (before, after)
    found = benchmark.summary([(before, after)])
    assert found["motors"] == 1
    assert found["nodes"]["magnet"]["largest_after_K"] < found["nodes"]["magnet"]["largest_before_K"]
