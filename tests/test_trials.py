"""The trials: what is hidden in whom, how large, what it does without noise, and the rates that come out."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials import (
    BINS,
    OFF_LIBRARY_EVERY,
    Case,
    Result,
    bounds,
    cases,
    difference,
    kept_as,
    read_results,
    scaled,
    summary,
    table,
    written,
)
from plant import Effect, Plant, drives
from plant.sensors import sensors
from twin.fitting.model import Test
from twin.run.simulate import Frame

HIDDEN = "loss.magnet.speed2"
SILENT = Result(case=Case(1, "six", HIDDEN, 4.0), size=60.0, d_true=4.0, named={}, unknown=-1.0, linear=2.0)


def _named(cause: str, log_bf: float = 20.0) -> Result:
    return replace(SILENT, named={cause: log_bf}, linear=log_bf)


def test_no_seed_is_used_twice_and_a_third_of_the_effects_is_off_the_library() -> None:
    found = cases(1000, 40, 60, "six")
    assert len({case.seed for case in found}) == len(found) == 100
    assert sum(case.cause.startswith("unknown.") for case in found) == 60 // OFF_LIBRARY_EVERY
    assert sum(not case.cause for case in found) == 40
    assert min(case.seed for case in found) == 1000


def test_every_row_of_the_catalogue_that_can_be_seen_is_drawn_and_every_strength_too() -> None:
    found = [case for case in cases(1000, 0, 120, "six") if not case.cause.startswith("unknown.")]
    causes = Counter(case.cause for case in found)
    assert len(causes) > 30
    assert max(causes.values()) - min(causes.values()) <= 1
    assert len({case.wanted for case in found}) == 5
    assert not any(word in cause for cause in causes for word in ("ageing", "session", "stuck", "hold"))


def test_a_size_grows_in_proportion_and_a_factor_by_its_logarithm() -> None:
    assert scaled(Effect(HIDDEN, 60.0), 3.0).size == 180.0
    assert scaled(Effect("conductance.yoke-jacket.scale", 0.6), 2.0).size == pytest.approx(0.36)
    assert scaled(Effect("loss.magnet.scale", 2.4), 6.0).size == 5.0
    assert scaled(Effect("unknown.vapour", 0.45), 4.0).size == 0.2


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [(0, 16, 0.0, 0.171), (16, 16, 0.829, 1.0), (5, 10, 0.222, 0.778)],  # Clopper and Pearson 1934, 5 % on either side
)
def test_bounds_are_those_of_clopper_and_pearson(k: int, n: int, low: float, high: float) -> None:
    assert bounds(k, n) == pytest.approx((low, high), abs=1e-3)


@pytest.mark.parametrize(
    ("result", "verdict"),
    [
        (SILENT, "silent"),
        (_named(HIDDEN), "first"),
        (replace(_named("loss.magnet.scale"), same=(HIDDEN,)), "class"),
        (_named("loss.magnet.scale"), "place"),
        (_named("loss.yoke.scale"), "wrong"),
        (
            replace(_named("conductance.teeth-winding.scale"), case=Case(1, "six", "conductance.winding-teeth.scale")),
            "first",
        ),
        (replace(SILENT, refused=(HIDDEN,)), "silent"),
        (replace(SILENT, is_unknown=True), "wrong"),
    ],
)
def test_an_answer_is_judged_against_what_was_hidden(result: Result, verdict: str) -> None:
    assert result.verdict == verdict


def test_off_the_library_unknown_is_right_and_a_name_is_wrong() -> None:
    outside = replace(SILENT, case=Case(1, "six", "unknown.spray", 4.0))
    assert replace(outside, is_unknown=True).verdict == "first"
    assert replace(outside, named={HIDDEN: 40.0}).verdict == "wrong"


def test_rates_are_counted_by_strength_and_healthy_motors_apart() -> None:
    healthy = replace(SILENT, case=Case(2, "six"), d_true=0.0)
    swap = replace(_named("sensor.teeth.swap_yoke"), case=Case(3, "six", "sensor.teeth.swap_yoke"), d_true=None)
    outside = replace(SILENT, case=Case(4, "six", "unknown.spray", 7.0), d_true=7.0, is_unknown=True)
    weak = replace(SILENT, d_true=2.9)
    strong = replace(_named(HIDDEN), d_true=10.0)
    alarm = replace(_named(HIDDEN), case=Case(5, "six"), d_true=0.0, improved=True)
    found = summary([healthy, alarm, swap, outside, weak, strong])
    assert found["healthy"]["named"]["count"] == found["healthy"]["improved"]["count"] == 1
    assert found["healthy"]["named"]["of"] == 2
    assert found["swaps"]["first"] == {"of": 1, "count": 1, "at_least": 0.05, "at_most": 1.0}
    assert found["off_library"]["5-10"]["first"]["count"] == 1
    assert found["effects"]["0-3"]["silent"]["count"] == found["effects"]["10-inf"]["first"]["count"] == 1
    assert len(found["effects"]) == len(BINS)
    assert found["wrong"]["of"] == 2
    assert "1/2 [2%, 98%]" in table(found)


def test_an_effect_moves_the_readings_and_none_moves_nothing() -> None:
    drive = drives.wltp(1).first(120.0)
    frame = Frame(1.0, np.zeros((120, 0)), np.zeros((120, 2)))
    test = Test("t", "wltp", frame, {}, {}, np.zeros(0), np.zeros(0), ())
    plant = Plant(7, Effect("loss.endwinding_a_inner.speed2_current2", 4000.0))
    without, with_it = Plant(7).run(drive), plant.run(drive)
    moved = difference(without, with_it, plant, "six", test)
    assert moved.keys() == {sensor.signal for sensor in sensors("six")}
    assert moved["EW_A_inner"].shape == (120,)
    assert moved["EW_A_inner"].max() > 10 * np.abs(moved["EW_B_inner"]).max() > 0
    assert not any(np.any(k) for k in difference(without, without, plant, "six", test).values())


def test_what_was_made_is_made_once(tmp_path: Path) -> None:
    made = []
    for _ in range(2):
        kept_as(tmp_path / "a" / "b.pickle", lambda: made.append(1))
    assert made == [1]


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    for result in (SILENT, _named(HIDDEN)):
        written(path, result)
    assert read_results(path) == [SILENT, _named(HIDDEN)]
