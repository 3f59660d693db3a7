"""`whyhot envelope` on logs of a bench whose truth is known: what its winding bears, and how its sessions ended."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from made.browser import label_faults
from replay.cli import main
from replay.show.verbs.envelope import load_says
from replay.studies.characterise.envelope import DURATIONS_S
from twin.run.envelope import Border

LIMIT = "limit_degC = "


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("envelope")
    can_bench.write_files(folder)
    motor = folder / "motor.toml"
    text = motor.read_text(encoding="utf-8")
    assert 'name = "winding"\n' in text
    motor.write_text(text.replace('name = "winding"\n', f'name = "winding"\n{LIMIT}45.0\n'), encoding="utf-8")
    for name, kind, seed in (("1_point", "s1", 1), ("2_drive", "wltp", 2)):
        can_bench.write_log(folder / f"{name}.blf", 900, seed, can_bench.START + seed * 86_400, magnet_loss=90.0)
        words = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc"), "--kind", kind]
        assert main(["ingest", str(folder / f"{name}.blf"), *words, "--store", str(folder / "store")]) == 0
    return folder


@pytest.fixture(scope="module")
def answer(bench: Path) -> Mapping[str, Any]:
    words = ["--on", "1_point", "2_drive", "--out", str(bench / "curve.svg"), "--store", str(bench / "store")]
    assert main(["envelope", *words, "--json", str(bench / "answer.json")]) == 0
    found: dict[str, Any] = json.loads((bench / "answer.json").read_text(encoding="utf-8"))
    return found


def test_a_curve_for_ever_and_for_seconds(answer: Mapping[str, Any]) -> None:
    assert answer["schema"] == "whyhot.envelope/1"
    seconds = [curve["seconds"] for curve in answer["curves"]]
    assert seconds == [None, *DURATIONS_S[1:]]
    for curve in answer["curves"]:
        assert len(curve["points"]) >= 5
        for point in curve["points"]:
            low, high = point["ci95"]
            assert 0 <= low <= point["load"] <= high


def test_less_is_borne_the_longer_it_lasts(answer: Mapping[str, Any]) -> None:
    of_time = [[point["load"] for point in curve["points"]] for curve in answer["curves"]]
    for longer, shorter in pairwise(of_time):
        assert all(a <= b + 1e-6 for a, b in zip(longer, shorter, strict=True))
    assert sum(of_time[0]) < sum(of_time[-1])


def test_only_what_has_a_limit_limits(answer: Mapping[str, Any]) -> None:
    nodes = {point["node"] for curve in answer["curves"] for point in curve["points"]}
    assert nodes <= {"winding", None}
    assert "winding" in nodes
    for curve in answer["curves"]:
        for point in curve["points"]:
            assert (point["node"] is None) == (point["headroom_K"] > 0)


def test_a_model_that_was_fitted_to_nothing_has_the_bands_of_its_file(
    bench: Path, answer: Mapping[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    assert answer["bands"] == "motor file"
    store = ["--store", str(bench / "store")]
    capsys.readouterr()
    assert main(["calibrate", "--on", "1_point", "--json", *store]) == 0
    model = json.loads(capsys.readouterr().out)["model"]
    assert main(["envelope", "--on", "1_point", "2_drive", "--model", model, "--json", *store]) == 0
    fitted = json.loads(capsys.readouterr().out)
    assert fitted["bands"] == "sessions"

    def width(found: Mapping[str, Any]) -> float:
        return float(sum(p["ci95"][1] - p["ci95"][0] for p in found["curves"][0]["points"]))

    assert width(fitted) < 0.5 * width(answer)


def test_how_a_session_ended_is_said(answer: Mapping[str, Any]) -> None:
    (one,) = answer["ended"]  # the drive cycle is no point
    assert (one["name"], one["kind"]) == ("1_point", "s1")
    hot = one["hottest_degC"] >= 42.0
    assert one["reason"] == "temperature" if hot else one["reason"] in ("time", "current limit")
    assert one["pulse"] is None
    assert one["current_A"] > 0
    assert one["node"] == "winding"


def test_the_picture_is_there_twice(bench: Path, answer: Mapping[str, Any]) -> None:
    assert answer
    assert (bench / "curve.svg").read_text(encoding="utf-8").count("<svg") == 1
    assert label_faults(bench / "curve.svg") == []
    assert (bench / "curve.png").stat().st_size > 10_000


def test_a_motor_without_limits_is_refused(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (bench / "motor.toml").read_text(encoding="utf-8").splitlines(keepends=True)
    bare = tmp_path / "bare.toml"
    bare.write_text("".join(line for line in lines if not line.startswith(LIMIT)), encoding="utf-8")
    words = ["--on", "1_point", "--model", str(bare), "--store", str(bench / "store")]
    assert main(["envelope", *words]) == 2
    assert "has a limit: say limit_degC = 180.0" in capsys.readouterr().err


def test_a_load_beyond_what_was_recorded_is_said_in_words() -> None:
    unlimited = Border(17.2, 17.0, 17.4, None, 3.0)
    assert load_says(unlimited) == "at least 17"
    assert load_says(replace(unlimited, load=0.0)) == "no load", "none was recorded, so nothing is held"
    assert load_says(replace(unlimited, node="winding", low=15.1)) == "17 (15 to 17)"
