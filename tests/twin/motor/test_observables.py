"""Resistance and flux as thermometers, and what derating makes of a run."""

from __future__ import annotations

import numpy as np
import pytest

from twin.motor.network import Copper
from twin.motor.observables import Thermometric, copper_slope
from twin.run.derating import Derating, derated

WINDING = Thermometric(0.05, 0.00393, 20.0)


def test_a_resistance_stands_for_one_temperature_and_back() -> None:
    degC = np.array([20.0, 85.0, 180.0])
    np.testing.assert_allclose(WINDING.reading(degC), 0.05 * (1 + 0.00393 * (degC - 20.0)))
    np.testing.assert_allclose(WINDING.temperature(WINDING.reading(degC)), degC)
    assert WINDING.per_K == pytest.approx(0.05 * 0.00393)


def test_a_reference_is_taken_through_a_reading() -> None:
    found = WINDING.through(0.07, 95.0)
    assert found.reading(np.array([95.0]))[0] == pytest.approx(0.07)
    assert found.slope_per_K == WINDING.slope_per_K


def test_the_slope_of_copper_is_that_of_one_line_wherever_its_reference_is() -> None:
    copper = Copper(0.00393, 20.0)
    warm = Thermometric(0.05 * (1 + 0.00393 * 40.0), copper_slope(copper, 60.0), 60.0)
    degC = np.array([0.0, 60.0, 150.0])
    np.testing.assert_allclose(warm.reading(degC), WINDING.reading(degC))


def test_current_falls_in_a_straight_line_between_two_temperatures() -> None:
    rule = Derating(140.0, 160.0)
    np.testing.assert_allclose(rule.factor(np.array([20.0, 140.0, 145.0, 160.0, 200.0])), [1.0, 1.0, 0.75, 0.0, 0.0])


def test_a_sensor_that_lags_is_late_and_leaves_the_hot_spot_alone_with_full_current() -> None:
    hot = np.array([120.0, 150.0, 155.0, 150.0])
    seen = np.array([np.nan, 130.0, 145.0, 150.0])
    found = derated(Derating(140.0, 160.0), seen, hot, 0.5)
    assert found is not None
    assert (found.seconds, found.seconds_hot, found.late_s) == (1.0, 1.5, 0.5)
    assert (found.lowest, found.lowest_hot) == (0.5, 0.25)
    assert found.mean == pytest.approx((1.0 + 0.75 + 0.5) / 3)
    assert found.hottest_free_degC == 150.0


def test_a_rule_says_nothing_where_its_sensor_showed_nothing_and_no_margin_where_it_always_acts() -> None:
    assert derated(Derating(1.0, 2.0), np.array([np.nan]), np.array([5.0]), 0.5) is None
    always = derated(Derating(1.0, 2.0), np.array([3.0]), np.array([5.0]), 0.5)
    assert always is not None and always.hottest_free_degC is None
