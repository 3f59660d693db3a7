"""Candidates as parameters: what each acts on, and the size that its prior gives it on these tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import CHANNELS, SINGLE, every_law, pulses, recorded
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import mean_conductances, mean_loss_W
from twin.differences.proposals import Proposals, scales
from twin.fitting import actions
from twin.fitting.model import Model, Test
from twin.motor import sensor_laws
from twin.motor.paths import terms_at
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
WINDING, YOKE, MAGNET, CASE, COOLANT, AMBIENT = range(6)
BUSES = {"W_1": "can1", "Y_1": "can2", "R_1": "can2"}
CANDIDATES = {
    str(c.cause): c
    for c in generate(
        every_law(),
        [Sensor(name, weights, BUSES[name]) for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, "can3") for name in (*SINGLE, "coolant", "ambient")],
    )
    if not c.discrete
}


@pytest.fixture(scope="module")
def tests() -> list[Test]:
    more = added_monomials(list(CANDIDATES.values()))
    return [recorded(every_law(), pulses(400.0, seed=i), INITIAL, more=more, buses=BUSES) for i in range(2)]


@pytest.fixture(scope="module")
def proposals(tests: list[Test]) -> Proposals:
    return Proposals(Model(every_law(), tests, []), np.zeros(0))


def _rms(tests: list[Test], feature: str) -> float:
    return float(np.sqrt(np.mean(np.concatenate([t.features[feature] for t in tests]) ** 2)))


@pytest.mark.parametrize("candidate", CANDIDATES.values(), ids=list(CANDIDATES))
def test_every_candidate_is_a_parameter_whose_column_is_a_number(candidate: Candidate, proposals: Proposals) -> None:
    parameter = proposals.parameter(candidate)
    assert parameter.name == str(candidate.cause)
    assert np.isfinite(parameter.sd)
    assert parameter.sd > 0
    assert parameter.test is None
    extra = np.concatenate([part.extra for part in proposals.model.linearise(np.zeros(0), [parameter])])
    assert np.isfinite(extra).all()


def test_an_added_heat_is_measured_in_watts_of_root_mean_square(proposals: Proposals, tests: list[Test]) -> None:
    found = proposals.parameter(CANDIDATES["loss.magnet.speed2_current2"])
    assert found.action == actions.Added((actions.Place(MAGNET),), "speed2_current2", _rms(tests, "speed2_current2"))
    assert found.sd == pytest.approx(0.05 * mean_loss_W(every_law(), tests))


def test_no_more_heat_is_taken_away_than_there_is(proposals: Proposals, tests: list[Test]) -> None:
    """At its bound, what is added makes the mean of the law 0."""
    found = proposals.parameter(CANDIDATES["loss.magnet.speed2_current2"])
    own = np.concatenate([proposals.model.course(s, np.zeros(0))[2][:, 12] for s in range(len(tests))])
    feature = np.concatenate([t.features["speed2_current2"] for t in tests])
    added = found.low * feature / _rms(tests, "speed2_current2")
    assert own.mean() > 0
    assert added.mean() == pytest.approx(-own.mean())
    assert found.high == np.inf


def test_a_heat_in_copper_goes_with_copper(proposals: Proposals) -> None:
    action = proposals.parameter(CANDIDATES["loss.winding.current2"]).action
    assert isinstance(action, actions.Added)
    assert action.own == 1


def test_a_missing_path_may_only_carry_heat_downhill(proposals: Proposals) -> None:
    found = proposals.parameter(CANDIDATES["conductance.magnet-coolant.constant"])
    assert found.action == actions.Added((actions.Place(MAGNET, COOLANT),), "constant", 1.0)
    assert (found.low, found.high) == (0.0, np.inf)


def test_a_scale_multiplies_the_terms_of_its_place_whichever_way_it_is_written(proposals: Proposals) -> None:
    assert proposals.parameter(CANDIDATES["loss.winding.scale"]).action == actions.Scale((8, 9))
    assert terms_at(every_law(), ("case", "ambient")) == terms_at(every_law(), ("ambient", "case")) == (6, 7)
    assert terms_at(every_law(), ("magnet",)) == (12,)
    assert terms_at(every_law(), ("winding", "magnet")) == ()


def test_a_slope_with_temperature_has_a_prior_of_heat_not_of_slope(proposals: Proposals, tests: list[Test]) -> None:
    """At one sd, the heat that it brings has the root mean square of the sd of a heat at one place."""
    found = proposals.parameter(CANDIDATES["loss.yoke.temperature"])
    assert isinstance(found.action, actions.Tilt)
    (reference,) = found.action.references
    runs = [proposals.model.course(s, np.zeros(0)) for s in range(len(tests))]
    means = np.concatenate([m[:, YOKE] for _, m, _ in runs])
    own = np.concatenate([values[:, [10, 11]].sum(axis=1) for _, _, values in runs])
    assert reference == pytest.approx(means.mean())
    brought = found.sd * own * (means - reference)
    assert np.sqrt(np.mean(brought**2)) == pytest.approx(0.05 * mean_loss_W(every_law(), tests))


def test_a_clock_is_of_all_channels_of_its_bus_or_of_all_against_the_inputs(proposals: Proposals) -> None:
    assert proposals.parameter(CANDIDATES["clock.can2.offset"]).action == actions.Late(("Y_1", "R_1"), False)
    of_inputs = actions.Late(("W_1", "Y_1", "R_1"), True, -1.0)
    assert proposals.parameter(CANDIDATES["clock.can3.drift"]).action == of_inputs


def test_what_was_off_in_one_session_moves_that_one_alone(proposals: Proposals) -> None:
    always = CANDIDATES["boundary.coolant.bias"]
    in_one = proposals.parameter(replace(always, test=1))
    parts = proposals.model.linearise(np.zeros(0), [proposals.parameter(always), in_one])
    for part in parts:
        expected = part.extra[:, 0] if part.series.session == 1 else np.zeros(len(part.extra))
        np.testing.assert_array_equal(part.extra[:, 1], expected)


def test_a_channel_that_no_test_has_is_no_part_of_a_clock(proposals: Proposals) -> None:
    clock = replace(CANDIDATES["clock.can2.offset"], action=actions.Late(("R_1", "X_1", "Y_1"), False))
    assert proposals.parameter(clock).action == actions.Late(("Y_1", "R_1"), False)


def test_inputs_and_boundaries_read_too_much(proposals: Proposals) -> None:
    assert proposals.parameter(CANDIDATES["boundary.ambient.bias"]).action == actions.BoundaryBias(1)
    assert proposals.parameter(CANDIDATES["input.current.gain"]).action == actions.InputGain("current")
    assert proposals.parameter(CANDIDATES["input.speed.bias"]).action == actions.InputBias("speed", 10000.0)


def test_a_lag_is_never_negative(proposals: Proposals) -> None:
    found = proposals.parameter(CANDIDATES["sensor.winding.lag"])
    assert found.action == sensor_laws.Lag("W_1")
    assert found.low == 0.0


def test_a_stem_pulls_towards_ambient(proposals: Proposals) -> None:
    assert proposals.parameter(CANDIDATES["sensor.yoke.stem"]).action == sensor_laws.Stem("Y_1")


def test_the_scales_are_those_of_the_file_on_these_tests(tests: list[Test]) -> None:
    found = scales(every_law(), tests)
    assert found.total_loss_W == pytest.approx(mean_loss_W(every_law(), tests))
    own = mean_conductances(every_law(), tests)
    assert found.conductance_W_per_K == {f"{a}-{b}": g for (a, b), g in own.items()}
