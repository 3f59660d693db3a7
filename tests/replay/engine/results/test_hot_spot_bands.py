"""How sure a replay is of its hottest winding and magnet: before and after a calibration, on a bench whose truth is
known."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.facts import facts
from ingest.facts.store import Store
from ingest.facts.store_check import check
from made import can_bench
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.engine.results.hot_spot_bands import MOST_NODES, known_covariance
from replay.engine.results.summary import read
from replay.show.reports.report import heat_says

SPOTS = ("winding", "magnet")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bands")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_learn.blf", seconds=900, seed=1, magnet_loss=90.0)
    can_bench.write_log(folder / "2_kept.blf", 500, 2, can_bench.START + 86_400, magnet_loss=90.0)
    logs = [str(folder / name) for name in ("1_learn.blf", "2_kept.blf")]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    return folder


@pytest.fixture(scope="module")
def model(bench: Path) -> str:
    words = ["--json", str(bench / "answer.json"), "--store", str(bench / "store")]
    assert main(["calibrate", "--on", "1_learn", *words]) == 0
    found: str = json.loads((bench / "answer.json").read_text(encoding="utf-8"))["model"]
    return found


def _spots(bench: Path, *words: str) -> dict[str, Any]:
    target = bench / "run.json"
    assert main(["replay", "2_kept", *words, "--json", str(target), "--store", str(bench / "store")]) == 0
    (run,) = json.loads(target.read_text(encoding="utf-8"))["runs"]
    found: dict[str, Any] = run["hot_spots"]
    return found


def test_a_file_that_was_fitted_to_nothing_is_as_sure_as_its_sd(bench: Path) -> None:
    spots = _spots(bench)
    true = can_bench.truth(*can_bench.drive(500, 2), 30.0, 90.0).max(axis=0)
    for spot in SPOTS:
        low, high = spots[spot]["ci95_degC"]
        assert spots[spot]["band_from"] == "motor file"
        assert low == pytest.approx(spots[spot]["max_degC"] - 1.96 * spots[spot]["sd_K"])
        assert high == pytest.approx(spots[spot]["max_degC"] + 1.96 * spots[spot]["sd_K"])
        assert spots[spot]["sd_K"] > 0.5
    low, high = spots["winding"]["ci95_degC"]  # the magnets lose three times what the file says, 2.2 of its sd
    assert low < true[0] < high


def test_a_calibration_makes_the_band_narrower_and_the_truth_stays_in_it(bench: Path, model: str) -> None:
    before, after = _spots(bench), _spots(bench, "--model", model)
    true = can_bench.truth(*can_bench.drive(500, 2), 30.0, 90.0).max(axis=0)
    for spot, hottest in zip(SPOTS, (true[0], true[2]), strict=True):
        low, high = after[spot]["ci95_degC"]
        assert after[spot]["band_from"] == "calibration"
        assert after[spot]["sd_K"] < 0.7 * before[spot]["sd_K"]
        assert low < hottest < high


def test_what_a_calibration_left_unknown_goes_together(bench: Path, model: str) -> None:
    """Conductances and losses that grow together: single sds would make the band too wide."""
    with Store.open(bench / "store") as store:
        known = facts.at(store.ledger)
        motor = read_motor(store.archive.read(model), known.models[model].file)
        covariance, source = known_covariance(store, known, model, motor, None)
        event = known.calibrations[model]
        found = check(store, read=True)
        assert found.damages == []
        assert not [line for line in found.hints if "no event cites" in line]
    assert source == "calibration"
    assert covariance.diagonal() == pytest.approx([p["sd"] ** 2 for p in event.parameters])
    sd = covariance.diagonal() ** 0.5
    assert abs(covariance / sd / sd[:, None] - np.eye(len(sd))).max() > 0.5


def test_the_terminal_says_the_band_and_the_report_what_it_holds(
    bench: Path, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, holds in (
        ([], "95 %, by the sd of the motor file: calibrate it for a narrower one"),
        (["--model", model], "95 %, by what its calibration left unknown of the model, not by errors of its form"),
    ):
        capsys.readouterr()
        assert main(["replay", "2_kept", *words, "--store", str(bench / "store")]) == 0
        said = " ".join(capsys.readouterr().out.split())
        low, high = _spots(bench, *words)["winding"]["ci95_degC"]
        assert re.search(rf"hottest by model, 95 %: winding \d+ °C \({low:.0f} to {high:.0f}\)", said)
        (run,) = json.loads((bench / "run.json").read_text(encoding="utf-8"))["runs"]
        assert holds in " ".join(heat_says(read(run)))


def test_a_network_of_hundreds_of_nodes_says_that_it_has_no_band_and_no_filter_and_why(
    bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sliced = bench / "sliced.toml"
    cut = ["--into", str(MOST_NODES), "--stack-mm", "60", "--nodes", "winding", "-o", str(sliced)]
    assert main(["motor", "slice", str(bench / "motor.toml"), *cut]) == 0
    why = f"the network has {MOST_NODES + 2} nodes, more than {MOST_NODES}"
    for one in _spots(bench, "--model", str(sliced)).values():
        assert (one["sd_K"], one["ci95_degC"], one["band_from"]) == (None, None, None)
        assert one["why_no_band"] == why
    answer = json.loads((bench / "run.json").read_text(encoding="utf-8"))
    assert answer["runs"][0]["filtered"] is None
    assert answer["notes"] == [f"2_kept: no band and no filter: {why}"]
    capsys.readouterr()
    assert main(["replay", "2_kept", "--model", str(sliced), "--store", str(bench / "store")]) == 0
    assert "\n  no band and no filter: the network has 102 nodes" in capsys.readouterr().out


def test_a_run_with_band_and_filter_has_nothing_to_note(bench: Path) -> None:
    assert not any("why_no_band" in one for one in _spots(bench).values())
    assert json.loads((bench / "run.json").read_text(encoding="utf-8"))["notes"] == []
