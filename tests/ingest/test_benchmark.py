"""The benchmark of the way from BLF to Parquet runs, and its ways agree."""

from __future__ import annotations

import json
import subprocess
import sys

from made.places import ROOT

SCRIPT = ROOT / "benchmarks" / "ingest.py"


def test_all_ways_from_blf_to_parquet_give_the_same_values() -> None:
    sizes = ["--frames", "500", "--files", "2", "--sessions", "50", "--rounds", "1"]
    command = [sys.executable, str(SCRIPT), *sizes, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["values_equal"] is True
    assert result["frames"] == 500
    assert {"whyhot", "python-can + cantools"} <= set(result["times_whyhot"])
    assert {name: one["count"] for name, one in result["many"].items()} == {
        "many small files": 2,
        "small files one by one": 2,
        "many sessions": 50,
    }
