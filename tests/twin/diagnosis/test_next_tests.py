"""The menu of next tests stays within what the recorded ones have shown, and runs in the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made import motor as made
from twin.diagnosis.next_tests import Proposed, as_test, load_of, menu
from twin.differences.everyday import everyday
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedMeter
from twin.motor.observables import Measurand, Thermometric
from twin.motor.sensor import Sensor
from twin.planning.observed import observing

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
NETWORK = made.every_law()


@pytest.fixture(scope="module")
def tests() -> list[Test]:
    more = [made.law(speed=3.0), made.law(current=2.0, speed=1.0)]
    return [
        made.recorded(NETWORK, made.smooth(600.0), INITIAL, more=more),
        made.recorded(NETWORK, made.pulses(600.0), INITIAL - 10.0, more=more),
    ]


def test_every_kind_of_test_is_on_the_menu_in_the_units_of_the_bench(tests: list[Test]) -> None:
    top = 10000 * max(float(t.inputs["speed"].max()) for t in tests)
    words = [p.words for p in menu(NETWORK, tests)]
    assert f"spin-down from {top:,.0f} rpm without current, 20 min" in words
    for start in ("S1 at", "S2 pulses", "spin-down", "DC at standstill", "flow halved"):
        assert any(w.startswith(start) for w in words), start
    assert len(words) == len(set(words))


def test_proposals_stay_within_the_recorded_range(tests: list[Test]) -> None:
    for proposed in menu(NETWORK, tests):
        assert 0 <= proposed.speed.min() <= proposed.speed.max() <= max(t.inputs["speed"].max() for t in tests)
        assert 0 <= proposed.load.min() <= proposed.load.max() <= max(t.inputs["current"].max() for t in tests)


def test_every_proposal_runs_in_the_model_with_every_product_of_features(tests: list[Test]) -> None:
    for proposed in menu(NETWORK, tests):
        test = as_test(NETWORK, tests, proposed)
        np.testing.assert_allclose(test.features["speed3"], proposed.speed**3)
        np.testing.assert_allclose(test.features["speed_current2"], proposed.speed * proposed.load**2)
        assert test.features.keys() == tests[0].features.keys()
        model = Model(NETWORK, [test], everyday(NETWORK, [test]))
        for series in model.residuals(np.zeros(len(model.parameters))):
            assert len(series.y) == len(proposed.speed) * 2 / 10
            assert np.isfinite(series.y).all()


def test_a_proposal_starts_where_the_coldest_test_did(tests: list[Test]) -> None:
    test = as_test(NETWORK, tests, menu(NETWORK, tests)[0])
    np.testing.assert_array_equal(test.initial, INITIAL - 10.0)


def test_a_spin_down_ends_at_rest_and_only_the_flow_step_moves_the_flow(tests: list[Test]) -> None:
    offered = menu(NETWORK, tests)
    down = next(p for p in offered if p.words.startswith("spin-down"))
    assert down.speed[0] > 0
    assert down.speed[-1] == 0
    assert down.load.max() == 0
    moving = [p.words for p in offered if np.ptp(p.flow) > 0]
    assert len(moving) == 1
    assert moving[0].startswith("flow halved")


def test_inputs_that_a_proposal_does_not_set_are_those_of_the_nearest_step() -> None:
    test = made.recorded(NETWORK, made.smooth(600.0), INITIAL)
    torque = 2.0 * test.inputs["current"]
    with_torque = replace(test, inputs={**test.inputs, "torque": torque})
    at = 150
    ones = np.ones(10)
    proposed = Proposed("", test.inputs["speed"][at] * ones, test.inputs["current"][at] * ones, ones)
    found = as_test(NETWORK, [with_torque], proposed)
    np.testing.assert_array_equal(found.inputs["torque"], torque[at])
    np.testing.assert_allclose(found.inputs["flow"], np.median(test.inputs["flow"]))


def test_without_a_speed_or_a_load_nothing_is_offered(tests: list[Test]) -> None:
    without = [replace(t, inputs={"flow": t.inputs["flow"]}) for t in tests]
    assert load_of(without) is None
    assert menu(NETWORK, without) == ()


def test_torque_stands_for_the_load_where_no_current_is_known(tests: list[Test]) -> None:
    turning = [replace(t, inputs={"speed": t.inputs["speed"], "torque": t.inputs["current"]}) for t in tests]
    network = replace(NETWORK, scale={**NETWORK.scale, "torque": 300.0})
    words = [p.words for p in menu(network, turning)]
    assert any("Nm" in w for w in words)
    assert not any("standstill" in w or "flow" in w for w in words)


def _metered() -> list[Test]:
    """At one speed with two loads and at rest: power is read throughout, a resistance at rest alone; a second test has
    no meter."""
    speed, current = np.repeat([0.5, 0.5, 0.0], 400), np.repeat([0.2, 0.8, 0.0], 400)
    drive = {"speed": speed, "current": current, "flow": np.full(1200, 0.8)}
    test = made.recorded(NETWORK, drive, INITIAL)
    steps = len(test.frame.features)
    middle, given = np.full(steps, 0.5), 2000.0 * test.inputs["speed"]
    power = Measurand("power", "W", gain_sd=0.01)
    heat = RecordedMeter(Sensor("P_el", {}), given + 150.0, np.full(steps, 4.0), middle, power, given)
    law = Measurand("resistance", "ohm", 0.001, law=Thermometric(1.0, 0.004, 20.0))
    at_rest = (test.inputs["speed"] == 0.0).astype(np.float64)
    resistance = RecordedMeter(Sensor("R", {"winding": 1.0}), np.ones(steps), at_rest, middle, law)
    return [made.recorded(NETWORK, drive, INITIAL), replace(test, meters=(heat, resistance))]


def test_meters_of_the_bench_are_read_in_proposals_where_they_were_read() -> None:
    recorded, tens = _metered(), np.ones(10)
    speed, load = np.repeat([0.25, 0.0], 10), np.repeat([0.8, 0.0], 10)
    test = as_test(NETWORK, recorded, Proposed("", speed, load, np.ones(20)))
    power, resistance = test.meters
    np.testing.assert_array_equal(power.samples, np.concatenate([tens, tens]))
    np.testing.assert_array_equal(resistance.samples, np.concatenate([0 * tens, tens]))
    np.testing.assert_allclose(np.broadcast_to(power.given, 20)[:10], 500.0)  # the torque there, at half its speed
    assert power.row == pytest.approx(recorded[1].meters[0].row)
    shown = {one.channel: len(one.y) for one in Model(NETWORK, [test], []).residuals(np.zeros(0))}
    assert (shown["P_el"], shown["R"]) == (2 * shown["R"], shown["R"])
    assert shown["R"] > 0


def test_what_a_bench_has_is_not_proposed_again() -> None:
    recorded = _metered()
    test = as_test(NETWORK, recorded, Proposed("", np.zeros(20), np.zeros(20), np.ones(20)))
    torque = {"torque": np.ones(20)}
    network = replace(NETWORK, scale={**NETWORK.scale, "torque": 300.0})
    without = replace(test, meters=(), inputs={**test.inputs, **torque})
    proposed = {m.what.quantity for m in observing(network, without, recorded).meters}
    assert {"power", "resistance", "heat"} <= proposed
    left = observing(network, replace(without, meters=test.meters), recorded)
    assert {m.what.quantity for m in left.meters} == proposed - {"power", "resistance"}
