"""Two logs of a small bench, and what `whyhot plan` says of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from replay.cli import main

LIMIT_DEGC = 70.0


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plan")
    can_bench.write_files(folder)
    motor = folder / "motor.toml"
    text = motor.read_text(encoding="utf-8")
    limited = text.replace('name = "winding"\n', f'name = "winding"\nlimit_degC = {LIMIT_DEGC}\n')
    assert limited != text
    motor.write_text(limited, encoding="utf-8")
    for name, kind, seed in (("1_point", "s1", 1), ("2_drive", "wltp", 2)):
        can_bench.write_log(folder / f"{name}.blf", 900, seed, can_bench.START + seed * 86_400, magnet_loss=90.0)
        words = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc"), "--kind", kind]
        assert main(["ingest", str(folder / f"{name}.blf"), *words, "--store", str(folder / "store")]) == 0
    return folder


@pytest.fixture(scope="session")
def answer(bench: Path) -> Mapping[str, Any]:
    words = ["--sessions", "1_point", "2_drive", "--hours", "2", "--out", str(bench / "days" / "day.csv")]
    assert main(["plan", *words, "--store", str(bench / "store"), "--json", str(bench / "plan.json")]) == 0
    found: dict[str, Any] = json.loads((bench / "plan.json").read_text(encoding="utf-8"))
    return found
