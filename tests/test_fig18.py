"""The redrawn Fig. 18: what its stators hide is found in R, and the picture shows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.fig18 import HEALTHY, LATE, TURN, Course, course, draw, findings
from plant import insulation_campaign
from plant.timeline import PAPER

SEED = 1


@pytest.fixture(scope="module")
def aged() -> Course:
    return course(insulation_campaign.run(SEED, PAPER).stators[0])


@pytest.fixture(scope="module")
def healthy() -> Course:
    return course(insulation_campaign.run(SEED, HEALTHY).stators[0])


def test_the_papers_course_is_seen_in_r_and_nothing_where_nothing_is_hidden(aged: Course, healthy: Course) -> None:
    assert (aged.by_resistance.name, healthy.by_resistance.name) == ("dip_then_rise", "none")
    assert aged.change(aged.true_ln_r, TURN) < 1.2 * aged.change(aged.ln_r, TURN) < -0.1, "less steep without iron"
    assert aged.change(aged.ln_r, LATE) > 0.05 > 2 * abs(healthy.change(healthy.ln_r, LATE))


def test_the_hottest_sensor_falls_where_nothing_is_hidden(healthy: Course) -> None:
    assert healthy.change(healthy.hottest_degC, LATE) < -2.0


def test_what_is_printed_counts_both_kinds_of_stator(aged: Course, healthy: Course) -> None:
    text = "\n".join(findings([aged], [healthy]))
    assert "dip, then rise named where it is hidden: 1 of 1" in text
    assert "something named where nothing is hidden: 0 of 1" in text
    assert "nan" not in text


def test_the_figure_is_drawn_from_an_answer(aged: Course, healthy: Course, tmp_path: Path) -> None:
    checks = [
        {"dose_h": dose, "resistance_K_per_W": float(np.exp(ln_r)), "sd": 0.0, "hottest_degC": degC}
        for dose, ln_r, degC in zip(aged.dose_h, aged.ln_r, aged.hottest_degC, strict=True)
    ]
    stator = {
        "checks": checks, "repeatability_percent": 2.0, "form": "dip_then_rise", "form_probability": 0.99,
        "change_at_dose_h": 100.0,
    }  # fmt: skip
    draw({"specimens": [stator], "threshold_degC": 180.0}, aged, healthy, tmp_path / "fig18.svg")
    drawn = (tmp_path / "fig18.svg").read_text(encoding="utf-8")
    assert "R over the dose: dip then rise, probability 99.0 %" in drawn
    assert "hours above 180 °C" in drawn
    assert (tmp_path / "fig18.png").stat().st_size > 10_000
