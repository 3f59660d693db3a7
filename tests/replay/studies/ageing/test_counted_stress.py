"""What a table of checks counts beside the dose is a stress of its own, by the name of its column."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay.cli import main

BENCH = """schema = "whyhot.bench/1"
specimen_column = "serial"
kind = "dc_check"

[time]
rate_hz = 1.0

[[channel]]
signal = "dose_h"
quantity = "dose"
unit = "h"

[[channel]]
signal = "R_th"
quantity = "thermal_resistance"
unit = "K/W"

[[channel]]
signal = "starts"
quantity = "counter"

[[channel]]
signal = "doors"
quantity = "counter"
role = "ignored"
"""
MOTORS, CHECKS = 20, 8


def _asked(folder: Path, per_start: float) -> list[dict[str, Any]]:
    """20 motors, each started at a pace of its own that changes on the way."""
    random = np.random.default_rng(8)
    lines = ["serial,dose_h,R_th,starts,doors"]
    for motor in range(MOTORS):
        dose = np.cumsum(random.uniform(5.0, 15.0, CHECKS))
        starts = np.cumsum(random.integers(0, 40, CHECKS))
        ln_r = np.log(0.02) + 0.0005 * dose + per_start * starts + 0.01 * random.standard_normal(CHECKS)
        rows = zip(dose, np.exp(ln_r), starts, starts, strict=True)
        lines += [f"M{motor:02d},{hours:.2f},{r:.6f},{count},{door}" for hours, r, count, door in rows]
    folder.mkdir()
    (folder / "checks.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "bench.toml").write_text(BENCH, encoding="utf-8")
    where = ["--store", str(folder / "store")]
    assert main(["ingest", str(folder / "checks.csv"), "--bench", str(folder / "bench.toml"), *where]) == 0
    assert main(["ageing", *where, "--json", str(folder / "out.json")]) == 0
    stress: list[dict[str, Any]] = json.loads((folder / "out.json").read_text(encoding="utf-8"))["stress"]
    return stress


@pytest.mark.parametrize("per_start", [0.001, 0.0])
def test_what_a_table_counts_is_weighed_beside_heat(tmp_path: Path, per_start: float) -> None:
    heat, starts = _asked(tmp_path / "fleet", per_start)
    assert (heat["name"], starts["name"], starts["unit"]) == ("heat", "starts", "count")
    assert starts["not_told_from"] == []
    assert abs(starts["percent"] - 100 * per_start) < 3 * starts["sd_percent"] < 0.05
    assert abs(heat["percent"] - 5.0) < 3 * heat["sd_percent"]
