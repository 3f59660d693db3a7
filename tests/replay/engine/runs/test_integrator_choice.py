"""`whyhot replay --integrator bdf2`: the paper's method, as a run of its own that says how far off it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from replay.cli import main


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("integrator")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_drive.blf", 300, 1)
    words = [
        "--bench",
        str(folder / "bench.toml"),
        "--dbc",
        str(folder / "bench.dbc"),
        "--store",
        str(folder / "store"),
    ]
    assert main(["ingest", str(folder / "1_drive.blf"), *words]) == 0
    return folder / "store"


def _run(store: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["replay", "1_drive", *words, "--json", "--store", str(store)]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert isinstance(run, dict)
    return run


def test_it_is_another_run_and_says_its_distance(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    usual, paper = _run(store, capsys), _run(store, capsys, "--integrator", "bdf2")
    assert usual["run"] != paper["run"]
    assert usual["digest"] != paper["digest"]
    assert "integrator" not in usual
    said = paper["integrator"]
    assert (said["name"], said["against"]) == ("bdf2", "sdirk2")
    assert 1e-4 < said["error_K"] < 1.0
    assert said["node"] in ("winding", "yoke", "magnet")
    assert abs(usual["mae_K"]["winding"] - paper["mae_K"]["winding"]) < said["error_K"]
    assert _run(store, capsys)["digest"] == usual["digest"]


def test_the_text_says_it_too(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", "1_drive", "--integrator", "bdf2", "--store", str(store)]) == 0
    assert "Integrator        1_drive bdf2: up to 0." in capsys.readouterr().out
