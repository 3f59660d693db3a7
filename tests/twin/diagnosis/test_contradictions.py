"""Tests that ran alike and were read differently are found, with where; what sensors may do is no contradiction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.motor import BIAS_SD, FINE_S, Drive, every_law, pulses, recorded
from twin.diagnosis.alike import WINDOW_S
from twin.diagnosis.contradictions import FAR, LEFT_K, contradictions
from twin.differences.everyday import laws, of_test
from twin.fitting.model import Model, Test

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
OFF_K = 8.0


def held(speed: float = 0.6, current: float = 0.5, seconds: float = 2400.0) -> Drive:
    """Ten minutes of something else, then constant."""
    ones = np.ones(round(seconds / FINE_S))
    before = np.arange(ones.size) * FINE_S < 600.0
    return {"speed": np.where(before, 0.2, speed), "current": np.where(before, 0.8, current), "flow": ones}


def model_of(*tests: Test) -> Model:
    """With coefficients, and what each test brings along."""
    own = [p for number, test in enumerate(tests) for p in of_test(every_law(), test, number)]
    return Model(every_law(), tests, [*laws(every_law()), *own])


def ran(drive: Drive, seed: int, off_K: float = 0.0) -> Test:
    """As recorded, with an offset of the yoke's sensor."""
    return recorded(every_law(), drive, INITIAL, seed=seed, off_K={"Y_1": off_K})


def test_two_alike_tests_that_were_read_differently_are_named_with_where_and_how_much() -> None:
    (one,) = contradictions(model_of(ran(held(), 1), ran(held(speed=0.3), 2), ran(held(), 3, OFF_K)))
    assert (one.channel, one.tests, one.at_s) == ("Y_1", (0, 2), (2400.0, 2400.0))
    assert one.differ_K == pytest.approx(-OFF_K, abs=0.5)
    assert np.sqrt(2) * BIAS_SD < one.sd_K < OFF_K / FAR
    assert one.inputs == pytest.approx({"speed": 0.6, "current": 0.5, "flow": 1.0})


@pytest.mark.parametrize(
    ("drive", "off_K"),
    [
        (held(), 2 * BIAS_SD),  # no more than sensors may be off
        (held(speed=0.66), OFF_K),  # at another speed: a law may have that wrong
        (held(seconds=600.0 + 800.0), OFF_K),  # constant for too short
    ],
)
def test_what_sensors_may_do_and_what_did_not_run_alike_is_no_contradiction(drive: Drive, off_K: float) -> None:
    assert contradictions(model_of(ran(held(), 1), ran(drive, 2, off_K))) == []


def test_a_part_of_the_current_that_is_nearly_none_need_not_be_constant() -> None:
    noise = np.random.default_rng(4)
    tests = []
    for seed, off_K in ((1, 0.0), (2, OFF_K)):
        test = ran(held(), seed, off_K)
        part = noise.normal(0.0, 0.002, len(test.frame.features))
        tests.append(replace(test, inputs={**test.inputs, "current_d": part}))
    assert [one.channel for one in contradictions(model_of(*tests))] == ["Y_1"]


def test_boundaries_of_other_temperatures_are_not_alike() -> None:
    warm = ran(held(), 2, OFF_K)
    frame = replace(warm.frame, boundaries=warm.frame.boundaries + 20.0)
    assert contradictions(model_of(ran(held(), 1), replace(warm, frame=frame))) == []


def test_a_reading_that_has_not_settled_says_nothing() -> None:
    test = ran(held(), 2, OFF_K)
    t_s = test.frame.step_s * np.arange(len(test.frame.features))
    drifts = 0.02 * np.clip(t_s - (2400.0 - WINDOW_S), 0.0, None)
    channels = tuple(replace(c, measured=c.measured + drifts * (c.name == "Y_1")) for c in test.channels)
    found = contradictions(model_of(ran(held(), 1), replace(test, channels=channels)))
    assert "Y_1" not in [one.channel for one in found]


def test_of_two_tests_each_moment_counts_and_the_worst_is_told() -> None:
    twice = {name: np.concatenate([u, u]) for name, u in held().items()}
    (one,) = contradictions(model_of(ran(twice, 1), ran(held(), 2, OFF_K)))
    assert one.at_s[0] in (2400.0, 4800.0) and one.at_s[1] == 2400.0
    assert abs(one.differ_K) > FAR * one.sd_K > FAR * LEFT_K


CYCLE = pulses(3600.0)


def stood(seconds: float, drive: Drive = CYCLE) -> Drive:
    """The cycle, after the motor stood for so long."""
    still = {name: np.full(round(seconds / FINE_S), u[0] if name == "flow" else 0.0) for name, u in drive.items()}
    return {name: np.concatenate([still[name], u]) for name, u in drive.items()}


def test_two_runs_of_one_cycle_that_were_read_differently_are_named_though_nothing_is_constant() -> None:
    (one,) = contradictions(model_of(ran(stood(60.0), 1), ran(stood(120.0), 2, OFF_K)))
    assert (one.channel, one.inputs) == ("Y_1", None)
    assert one.at_s == pytest.approx((3660.0, 3720.0))
    assert one.differ_K == pytest.approx(-OFF_K, abs=0.5)


def test_where_two_runs_of_a_cycle_part_the_comparison_ends() -> None:
    other = {name: np.where(np.arange(u.size) * FINE_S < 2000.0, u, 0.5) for name, u in CYCLE.items()}
    (one,) = contradictions(model_of(ran(CYCLE, 1), ran(other, 2, OFF_K)))
    assert one.at_s == (1840.0, 1840.0)  # six times five minutes since the first move


@pytest.mark.parametrize(
    ("drive", "off_K"),
    [
        (CYCLE, 2 * BIAS_SD),  # no more than sensors may be off
        (pulses(3600.0, seed=1), OFF_K),  # another cycle
        ({**CYCLE, "current": 1.1 * CYCLE["current"]}, OFF_K),  # with more current
        (stood(600.0), OFF_K),  # after another rest
        ({name: u[: round(800.0 / FINE_S)] for name, u in CYCLE.items()}, OFF_K),  # a past too short
        ({name: u[: round(200.0 / FINE_S)] for name, u in CYCLE.items()}, OFF_K),  # not five minutes long
    ],
)
def test_other_cycles_other_pasts_and_what_sensors_may_do_are_no_contradiction(drive: Drive, off_K: float) -> None:
    assert contradictions(model_of(ran(CYCLE, 1), ran(drive, 2, off_K))) == []
