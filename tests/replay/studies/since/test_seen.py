"""`whyhot seen`: every motor of the store, asked for the cause of a diagnosis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from made.fleet import Fleet
from replay.cli import main
from replay.show.reports.seen import since_says
from replay.studies.since.acting import Since

Capture = pytest.CaptureFixture[str]


def _asked(fleet: Fleet, folder: Path, *words: str, code: int = 0) -> dict[str, Any]:
    target = folder / "seen.json"
    assert main(["seen", *words, "--store", str(fleet.store), "--json", str(target)]) == code
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


def test_the_motors_with_the_cause_are_found_and_since_when(fleet: Fleet, tmp_path: Path, capsys: Capture) -> None:
    found = _asked(fleet, tmp_path, f"d-{fleet.diagnosis[:8]}")
    text = capsys.readouterr().out
    assert (found["schema"], found["cause"]) == ("whyhot.seen/1", "loss.magnet.scale")
    motors = {one["specimen"]: one for one in found["motors"]}
    acts = {one["name"]: one["probability"] for motor in motors.values() for one in motor["sessions"]}
    assert acts["a_1"] < 0.05
    assert min(acts["a_2"], acts["b_1"], acts["b_2"]) > 0.95
    assert max(acts["c_1"], acts["c_2"]) < 0.5
    assert motors["servo-01"]["since"][0]["says"][:2] == ["since a_2", "inverter = sw 4.2"]
    assert motors["servo-02"]["since"][0]["says"][0] == "in all sessions"
    assert [one["name"] for one in motors["servo-02"]["sessions"] if one["learnt_from"]] == ["b_1", "b_2"]
    assert motors["servo-02"]["amplitude"] == pytest.approx(2.3, abs=0.5)  # ln of 300 W over 30 W
    assert "acts in 2 of 3 motors" in text
    assert "In doubt 2 sessions to learn from and none kept cannot say" in " ".join(text.split())
    assert len(found["in_doubt"]) == 1
    assert since_says([Since(("in all sessions",), 0.998)], 1.0) == "in all sessions", "no other has a percent"
    assert (
        since_says([Since(("since a_2",), 0.9), Since(("since a_3",), 0.1)], 1.0) == "since a_2, 90 %; since a_3, 10 %"
    )
    assert text.rstrip().splitlines()[-1].startswith(f"next: whyhot show --store {fleet.store} ")


def test_what_is_too_short_is_named_and_the_rest_is_asked(fleet: Fleet, tmp_path: Path, capsys: Capture) -> None:
    words = (fleet.diagnosis, "--sessions", "b_1", "b_2", "c_1")
    found = _asked(fleet, tmp_path, *words, code=1)
    assert [one["specimen"] for one in found["motors"]] == ["servo-02"]
    assert "servo-03: not asked: c_1: 9 min together, too short" in found["not_asked"][0]
    assert found["not_asked"][0] in capsys.readouterr().err


def test_a_cause_that_was_not_named_is_refused_with_those_that_were(fleet: Fleet, capsys: Capture) -> None:
    words = [fleet.diagnosis, "--cause", "loss.yoke.scale", "--store", str(fleet.store)]
    assert main(["seen", *words]) == 2
    assert "names no loss.yoke.scale with a size: it has loss.magnet.scale" in capsys.readouterr().err
