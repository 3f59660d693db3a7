"""`whyhot replay --unknown`: what the filter is to find, as a run of its own whose open loop is the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from replay.cli import main


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unknown")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_hot.blf", 600, 1, magnet_loss=90.0)
    files = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main(["ingest", str(folder / "1_hot.blf"), *files, "--store", str(folder / "store")]) == 0
    return folder / "store"


def _answer(store: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["replay", "1_hot", *words, "--json", "--store", str(store)]) == 0
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def _run(store: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    (run,) = _answer(store, capsys, *words)["runs"]
    assert isinstance(run, dict)
    return run


def test_what_is_asked_for_is_found_in_a_run_of_its_own(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    usual = _run(store, capsys)
    asked = _run(store, capsys, "--unknown", "sensor.yoke.bias", "--unknown", "loss.magnet.scale")
    assert usual["run"] != asked["run"]
    assert usual["digest"] == asked["digest"], "the open loop knows of no filter"
    factor, error = asked["filtered"]["unknowns"]
    assert (factor["id"], factor["unit"]) == ("loss.magnet.scale", "1")
    assert factor["mean"] > 1.0, "the magnets lose three times what the motor file says"
    assert (error["id"], error["unit"]) == ("sensor.yoke.bias", "K")
    assert asked["filtered"]["heat"] != usual["filtered"]["heat"]


def test_without_it_a_run_is_what_it_was(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = _run(store, capsys)
    _run(store, capsys, "--unknown", "loss.magnet.scale")
    assert _run(store, capsys) == before
    assert "unknowns" not in before["filtered"]


def test_settings_and_terminal_say_it(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _answer(store, capsys, "--unknown", "loss.magnet.scale")
    assert answer["provenance"]["settings"]["unknown"] == ["loss.magnet.scale"]
    assert main(["replay", "1_hot", "--unknown", "loss.magnet.scale", "--store", str(store)]) == 0
    assert "Asked for 1_hot: loss.magnet.scale times " in " ".join(capsys.readouterr().out.split())


def test_what_no_filter_finds_is_refused_in_a_line(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", "1_hot", "--unknown", "clock.can2.offset", "--store", str(store)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("--unknown clock.can2.offset: no filter finds that: give loss.NODE.constant (a heat)")
