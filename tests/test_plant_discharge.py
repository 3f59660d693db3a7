"""The plant's voltage tests: when they discharge, and what is logged of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from plant import discharge, insulation_campaign, insulation_check, oven
from plant.timeline import Plan

PLAN = Plan(
    stators=2, cycles=4, forms=("none",), early_stops=0.0, dead=0.0, test_V=(1100.0, 700.0), test_h=(6.0,), test_shift=1
)


def test_a_voltage_discharges_where_it_is_above_the_inception_voltage() -> None:
    tests = [(1000.0, 2.0), (970.0, 3.0), (0.0, 4.0)]
    assert insulation_check.inception_V(0.0) == 980.0
    assert discharge.hours([0.0] * 4, tests, 0.0) == [2.0, 0.0, 0.0]


def test_what_discharges_wear_lowers_the_inception_voltage() -> None:
    tests = [(1000.0, 10.0), (970.0, 5.0)]
    assert discharge.hours([0.0] * 3, tests, 0.1) == [10.0, 0.0]
    assert discharge.hours([0.0] * 3, tests, 1.0) == [10.0, 5.0]


def test_the_voltage_is_on_for_its_hours_while_the_oven_is_hot() -> None:
    trace = oven.run(np.random.default_rng(0), [oven.Soak()])
    volts = discharge.volts(trace, 1000.0, 5.0)
    assert (volts > 0.0).sum() == pytest.approx(5.0 * 60, abs=1)
    assert trace.oven[volts > 0.0].min() > 220.0


def test_a_campaign_logs_its_tests_and_wears_by_them_alone_where_nothing_else_does() -> None:
    truth = insulation_campaign.run(5, replace(PLAN, discharge_rate=0.5))
    for stator, first in zip(truth.stators, (6.0, 0.0), strict=True):
        done = [check.discharge_h for check in stator.checks]
        assert done == [0.0, first, 6.0, 6.0 + first, 12.0]
        assert [check.insulation for check in stator.checks] == pytest.approx(np.exp(0.5 * np.array(done) / 100.0))
        logged = [float(np.median(log["U_test"][log["U_test"] > 0.0])) for log in stator.oven_logs]
        assert logged == pytest.approx([1100.0, 700.0] * 2 if first else [700.0, 1100.0] * 2, rel=0.005)


def test_without_voltage_tests_nothing_is_logged_of_them() -> None:
    plain = insulation_campaign.run(5, replace(PLAN, test_V=()))
    assert "U_test" not in [column.name for column in plain.stators[0].oven_logs[0].columns]
    assert {check.discharge_h for check in plain.stators[0].checks} == {0.0}
