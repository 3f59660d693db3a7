"""Power, heat, resistance and flux beside a replay: each against the model in its own unit, and learnt from in a
calibration."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.facts import facts
from ingest.facts.store import Store
from made import meters as made_meters
from made.meters import BENCH, DERATING, METERS
from replay.cli import main
from replay.engine.results.sealed import load_run


def _json(folder: Path, capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*words, "--json", "--store", str(folder / "store")]) == code
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def _ingested(folder: Path, bench: str = BENCH + METERS, magnet_loss: float = 30.0) -> Path:
    made_meters.write(folder, bench, magnet_loss)
    words = [
        "ingest",
        str(folder / "1_run.csv"),
        "--bench",
        str(folder / "bench.toml"),
        "--store",
        str(folder / "store"),
    ]
    assert main(words) == 0
    return folder


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _ingested(tmp_path_factory.mktemp("meters"), BENCH + METERS + DERATING)


@pytest.fixture
def run(bench: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    (found,) = _json(bench, capsys, "replay")["runs"]
    return dict(found)


def test_every_meter_is_compared_in_its_own_unit(run: dict[str, Any]) -> None:
    meters = {one["channel"]: one for one in run["meters"]}
    assert {name: (one["quantity"], one["unit"], one["place"]) for name, one in meters.items()} == {
        "P_el": ("power", "W", "motor"),
        "Q_cool": ("heat", "W", "coolant"),
        "R": ("resistance", "ohm", "winding"),
        "psi": ("flux", "Wb", "magnet"),
    }
    assert meters["P_el"]["mae"] < 4.0  # W: 2 W of noise, of hundreds of losses and kilowatts at the shaft
    assert meters["Q_cool"]["mae"] < 3.0
    assert meters["R"]["mae"] < 4e-5 and meters["R"]["mean"] == pytest.approx(0.055, rel=0.1)
    assert meters["psi"]["mae"] < 4e-5
    assert all(one["mae"] <= one["floor"] for name, one in meters.items() if name != "P_el")
    assert set(run["mae_K"]) == {"winding", "yoke", "magnet"}


def test_a_sealed_run_gives_the_meters_and_their_records_back(bench: Path, run: dict[str, Any]) -> None:
    with Store.open(bench / "store") as store:
        known = facts.at(store.ledger)
        loaded = load_run(store, known, known.runs[run["run"]])
    power = next(one for one in loaded.meters if one.channel == "P_el")
    signals = made_meters.signals()
    np.testing.assert_allclose(power.measured, 1e3 * signals["P_el"][: power.measured.size], rtol=1e-5)
    np.testing.assert_array_equal(power.first_record, np.arange(power.measured.size))
    assert float(np.abs(power.residual).mean()) == pytest.approx(run_meter(run, "P_el")["mae"])
    assert loaded.heat is not None and set(loaded.heat.boundaries) == {"coolant"}


def run_meter(run: dict[str, Any], channel: str) -> dict[str, Any]:
    return next(dict(one) for one in run["meters"] if one["channel"] == channel)


def test_a_motor_that_loses_more_shows_in_the_power(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (found,) = _json(_ingested(tmp_path, magnet_loss=130.0), capsys, "replay")["runs"]
    share = (made_meters.signals()["n"] / 6000.0) ** 2
    assert run_meter(found, "P_el")["bias"] == pytest.approx(100.0 * share.mean(), abs=5.0)


def test_a_reference_that_is_left_out_comes_from_the_first_sample(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = METERS.replace("reference = 50.0\n", "").replace("reference = 0.08\n", "")
    folder = _ingested(tmp_path, BENCH + text)
    (found,) = _json(folder, capsys, "replay")["runs"]
    assert run_meter(found, "R")["mae"] < 5e-5
    assert run_meter(found, "psi")["mae"] < 5e-5
    errors = {entry["channel"]: entry for entry in _json(folder, capsys, "calibrate", "--on", "1_run")["errors"]}
    per_K = made_meters.FLUX20 * abs(made_meters.FLUX_SLOPE)
    assert errors["psi"]["bias_sd"] > 0.3 * per_K  # as uncertain as the temperature that it began with
    assert errors["psi"]["after"] < 5e-5


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            'signal = "M"\nquantity = "torque"\nunit = "Nm"\n',
            'signal = "M"\nrole = "ignored"\n',
            "no channels of this session give torque",
        ),
        (
            'node = "coolant"\nrole = "observed"',
            'node = "winding"\nrole = "observed"',
            'the heat that "winding" takes, and that is no boundary',
        ),
    ],
)
def test_a_meter_without_what_it_is_compared_with_is_refused_in_a_line(
    old: str, new: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = BENCH + METERS
    assert whole.count(old) == 1
    answer = _json(_ingested(tmp_path, whole.replace(old, new)), capsys, "replay", code=2)
    assert says in answer["error"] and "\n" not in answer["error"]


def test_the_account_of_heat_closes_and_the_efficiencies_agree(run: dict[str, Any]) -> None:
    losses = run["losses"]
    made = losses["energy_J"]
    assert abs(losses["left_J"]) < 1e-9 * made
    assert set(losses["kinds"]) == {"copper_dc", "iron", "magnet"}
    gone = losses["boundaries"]["coolant"]["energy_J"] + sum(one["energy_J"] for one in losses["stored"].values())
    assert gone == pytest.approx(made, rel=1e-9)
    assert losses["nodes"]["winding"]["mean_W"] == pytest.approx(losses["kinds"]["copper_dc"]["energy_J"] / 900.0)
    assert run["efficiency"]["measured"] == pytest.approx(run["efficiency"]["modelled"], abs=0.005)


def test_hot_spots_and_limits_are_those_of_the_temperatures(bench: Path, run: dict[str, Any]) -> None:
    truth = made_meters.signals()["T_winding"]
    winding = run["hot_spots"]["winding"]
    assert winding["node"] == "winding" and winding["limit_degC"] == 60.0
    assert winding["max_degC"] == pytest.approx(truth.max(), abs=0.5)
    assert winding["at_s"] == pytest.approx(float(np.argmax(truth)), abs=15.0)
    assert run["hot_spots"]["magnet"]["margin_K"] is None
    assert list(run["limits"]) == ["winding"]
    assert run["limits"]["winding"]["above_s"] == pytest.approx(float((truth > 60.0).sum()), abs=10.0)


def test_a_derating_is_shown_beside_the_run(run: dict[str, Any]) -> None:
    (found,) = run["derating"]
    truth = made_meters.signals()["T_winding"]
    assert (found["channel"], found["protects"]) == ("T_winding", "winding")
    assert found["seconds"] == pytest.approx(float((truth > 50.0).sum()), abs=15.0)
    assert found["seconds_hot"] == pytest.approx(found["seconds"], abs=15.0)
    assert found["lowest"] == pytest.approx((80.0 - truth.max()) / 30.0, abs=0.02)
    assert found["margin_K"] == pytest.approx(60.0 - found["hottest_free_degC"])


def test_a_derating_may_watch_the_coolant_and_is_late_then(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rule = DERATING.replace("T_winding", "T_coolant")
    (found,) = _json(_ingested(tmp_path, BENCH + rule), capsys, "replay")["runs"]
    (entry,) = found["derating"]
    assert (entry["protects"], entry["seconds"]) == ("winding", 0.0)
    assert entry["late_s"] == entry["seconds_hot"] > 100.0


def test_a_calibration_learns_from_meters_and_says_what_they_read_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _ingested(tmp_path, magnet_loss=90.0)
    answer = _json(folder, capsys, "calibrate", "--on", "1_run")
    rows = {entry["channel"]: entry for entry in answer["errors"]}
    assert rows["P_el"]["unit"] == "W" and rows["P_el"]["after"] < 0.5 * rows["P_el"]["before"]
    assert (rows["R"]["place"], rows["R"]["unit"]) == ("winding", "ohm")
    assert rows["psi"]["after"] < 0.5 * rows["psi"]["before"]
    assert rows["Q_cool"]["place"] == "coolant" and abs(rows["Q_cool"]["gain"]) < 0.05
    magnet = next(p for p in answer["parameters"] if p["name"] == "loss.magnet.speed2")
    assert magnet["value"] == pytest.approx(90.0, rel=0.1)


def test_the_terminal_says_which_meters_are_off_and_the_report_heat_and_derating(
    bench: Path, run: dict[str, Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["replay", "--store", str(bench / "store")]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "hottest by model, 95 %: winding" in text
    assert re.search(r" P_el [\d.]+ W of [\d,]+ W \(within its floor\); ", text)
    page = tmp_path / "report.html"
    assert main(["report", "1_run", "--store", str(bench / "store"), "--out", str(page)]) == 0
    html = page.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    heat = ("W of heat on average (copper DC", "into coolant", "stored; efficiency")
    for said in (*heat, "Other meters", "Derating by T_winding (50 to 80 °C): less for", "limit 60 °C"):
        assert said in html
