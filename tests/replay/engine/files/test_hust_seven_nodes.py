"""The shipped file of seven nodes: all thermocouples of a recording find their node, and no number of it is absurd."""

from __future__ import annotations

import json
from pathlib import Path

from made.places import EXAMPLES
from replay.cli import main

NODES = {"yoke", "teeth", "winding", "end_winding", "rotor", "bearing", "end_cap"}


def test_half_an_hour_of_the_bench_is_predicted_by_estimates_alone(tmp_path: Path) -> None:
    log, bench = EXAMPLES / "hust_motor" / "id_1.csv.gz", EXAMPLES / "hust_seven_nodes" / "bench.toml"
    store, answer = str(tmp_path / "store"), tmp_path / "answer.json"
    assert main(["ingest", str(log), "--bench", str(bench), "--store", store]) == 0
    assert main(["replay", "id_1", "--store", store, "--json", str(answer)]) == 0
    (run,) = json.loads(answer.read_text(encoding="utf-8"))["runs"]
    assert run["mae_K"].keys() == NODES
    assert all(0.0 < error < 2.0 for error in run["mae_K"].values()), "winding and teeth rise by 15 K"
