"""Hours at one temperature as hours at another, under one stated rule."""

from __future__ import annotations

import numpy as np
import pytest

from analytics.insulation.dose.arrhenius import (
    LIFE_H,
    RULES,
    Activation,
    Doubling,
    Rule,
    equivalent_hours,
)


@pytest.mark.parametrize(
    ("rule", "hours"),
    [(Activation(0.9), 2963.0), (Activation(1.1), 4930.0), (Doubling(), 9600.0)],
    ids=lambda x: str(x),
)
def test_300_h_at_230_degC_are_worth_what_the_rule_says_at_180_degC(rule: Rule, hours: float) -> None:
    assert equivalent_hours([230.0], [300.0], 180.0, rule) == pytest.approx(hours, abs=0.5)


def test_an_hour_is_worth_an_hour_at_its_own_temperature() -> None:
    for rule in RULES:
        assert rule.acceleration(200.0, 200.0) == pytest.approx(1.0)


def test_the_rule_of_10_K_is_near_1_23_eV_at_180_degC_and_1_51_eV_at_230_degC() -> None:
    for at, eV in ((180.0, 1.23), (230.0, 1.51)):
        slopes = [float(np.log(rule.acceleration(at + 0.01, at))) for rule in (Doubling(), Activation(eV))]
        assert slopes[0] == pytest.approx(slopes[1], rel=0.005)


def test_only_what_is_hotter_than_the_threshold_counts() -> None:
    temperatures, hours = [170.0, 180.0, 190.0], [5.0, 7.0, 11.0]
    assert equivalent_hours(temperatures, hours, 180.0, Doubling()) == pytest.approx(22.0)
    assert equivalent_hours(temperatures, hours, 180.0, Doubling(), -np.inf) == pytest.approx(22.0 + 7.0 + 2.5)


def test_300_h_at_230_degC_use_15_to_48_percent_of_a_class_H_life() -> None:
    used = [equivalent_hours([230.0], [300.0], 180.0, rule) / LIFE_H for rule in RULES]
    assert (min(used), max(used)) == pytest.approx((0.148, 0.480), abs=0.001)
