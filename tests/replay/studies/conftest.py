"""A store of three motors on a small bench: one whose magnet loses more since its second session, one that always did,
and a healthy one; and the diagnosis of the second."""

from __future__ import annotations

import json

import pytest

from made import can_bench
from made.fleet import Fleet
from replay.cli import main

HEALTHY_W, ILL_W = 30.0, 300.0
# log: specimen, inverter software, loss of the magnet at top speed [W]
LOGS = {
    "a_1": ("servo-01", "sw 4.1", HEALTHY_W),
    "a_2": ("servo-01", "sw 4.2", ILL_W),
    "b_1": ("servo-02", "sw 4.2", ILL_W),
    "b_2": ("servo-02", "sw 4.2", ILL_W),
    "c_1": ("servo-03", "sw 4.1", HEALTHY_W),
    "c_2": ("servo-03", "sw 4.1", HEALTHY_W),
}
SECONDS = 600


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    folder = tmp_path_factory.mktemp("fleet")
    can_bench.write_files(folder)
    store = ["--store", str(folder / "store")]
    for number, (name, (specimen, software, magnet_W)) in enumerate(LOGS.items()):
        said = f'specimen = "{specimen}"\nattributes = {{inverter = "{software}"}}\n'
        bench = folder / f"{specimen}_{software[-1]}.toml"
        bench.write_text(can_bench.BENCH.replace('specimen = "servo-01"\n', said), encoding="utf-8")
        log, day = folder / f"{name}.blf", can_bench.START + number * 86_400
        can_bench.write_log(log, SECONDS, 1 + number % 2, day, magnet_loss=magnet_W)
        words = ["--bench", str(bench), "--dbc", str(folder / "bench.dbc"), "--kind", "wltp"]
        assert main(["ingest", str(log), *words, *store]) == 0
    assert main(["diagnose", "--on", "b_1", "b_2", *store, "--json", str(folder / "why.json")]) == 0
    why = json.loads((folder / "why.json").read_text(encoding="utf-8"))
    assert [one["id"] for one in why["causes"]] == ["loss.magnet.scale"]
    return Fleet(folder / "store", why["diagnosis"])
