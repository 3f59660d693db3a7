"""A free loss map: a heat that is there while a motor brakes, which no law can say, is found and told as that."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from made import motor as made
from twin.calibration.learned import network_of
from twin.diagnosis.free_heats import as_fitted, as_parameters, describe, free_heats, knots_of
from twin.diagnosis.free_maps import LOADS, SPEEDS, Knots
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.unknown import Response, free_heat
from twin.differences.everyday import everyday, mean_loss_W
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Floats, Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor.features import evaluate, monomial
from twin.motor.network import Map, Network, Term

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
QUIET = ChannelNoise(ar_sd=0.1, ar_tau_s=60.0, ou_sd=0.2, ou_tau_s=600.0)
HIDDEN_W = 150.0  # at full current, while it brakes
SECONDS = 3600.0
BRAKING = np.repeat(np.random.default_rng(8).random(200) < 0.4, round(20 / made.FINE_S))  # for 20 s or not


def _hiding(network: Network) -> Network:
    """Magnets that are heated by "voltage", which stands for the current of a motor that brakes."""
    sources = [
        replace(s, terms=(*s.terms, Term(HIDDEN_W, {"voltage": 1.0}))) if s.node == "magnet" else s
        for s in network.sources
    ]
    scale = {**network.scale, "voltage": 1.0}
    return replace(network, name="hot-while-it-brakes", sources=tuple(sources), scale=scale)


def _test(hidden: bool) -> Test:
    network, drive = made.every_law(), made.pulses(SECONDS, seed=5)
    brakes = BRAKING[: len(drive["current"])]
    with_brakes = {**drive, "voltage": np.where(brakes, drive["current"], 0.0)}
    test = made.recorded(network, with_brakes, INITIAL, true=_hiding(network) if hidden else network, seed=4)
    load = np.where(brakes, -drive["current"], drive["current"])
    return replace(test, load=load.reshape(len(test.inputs["current"]), -1).mean(axis=1))


@cache
def _fitted(hidden: bool = True) -> Fit:
    network, tests = made.every_law(), [_test(hidden)]
    model = Model(network, tests, everyday(network, tests), dict.fromkeys(made.CHANNELS, QUIET))
    return fit(model, np.zeros(len(model.parameters)))


def _true_course(test: Test) -> Floats:
    return HIDDEN_W * np.where(test.load < 0.0, -test.load, 0.0)


def test_a_heat_while_it_brakes_is_found_as_a_map_and_not_in_time() -> None:
    found = free_heats(_fitted(), maps=True)
    best = found[0]
    assert (best.node, best.is_map) == ("magnet", True)
    in_time = max(heat.log_bayes_factor for heat in found if not heat.is_map)
    assert best.log_bayes_factor > in_time + 20
    test = _fitted().model.tests[0]
    knots = Knots.of([test])
    assert knots is not None
    assert np.corrcoef(knots.course(best.watts, test), _true_course(test))[0, 1] > 0.8


def test_it_is_told_that_it_goes_with_braking_and_when() -> None:
    fitted = _fitted()
    unknown = describe(fitted, free_heats(fitted, maps=True)[0])
    assert unknown.goes_with == ("braking",)
    low, high = unknown.watts
    assert 0.0 < low < high < HIDDEN_W
    told = unknown.map
    assert told is not None and told.load == "current"
    assert told.seconds.sum() == pytest.approx(SECONDS)
    often = told.seconds > 60
    braking, driving = often & (np.array(told.loads) < 0), often & (np.array(told.loads) > 0)
    assert told.watts[braking].mean() > told.watts[driving].mean() + 20.0


def test_a_healthy_motor_has_no_map() -> None:
    assert max(heat.log_bayes_factor for heat in free_heats(_fitted(False), maps=True)) < 3


def test_there_is_no_map_where_nobody_knows_the_load() -> None:
    tests = [_fitted().model.tests[0], replace(_fitted().model.tests[0], load=np.empty(0))]
    assert Knots.of(tests) is None
    assert not any(heat.is_map for heat in free_heats(_fitted()))


def test_a_map_holds_every_step_and_its_heights_add_up_to_it() -> None:
    test = _fitted().model.tests[0]
    knots = Knots.of([test])
    assert knots is not None
    assert (len(knots.speeds), len(knots.loads)) == (SPEEDS, LOADS)
    np.testing.assert_allclose(knots.course(np.ones(SPEEDS * LOADS), test), 1.0)


def test_a_map_that_is_added_up_test_by_test_is_that_of_all_rows_at_once() -> None:
    """Against one linearisation of two tests with the map's own parameters."""
    one = _fitted()
    tests = [*one.model.tests, replace(one.model.tests[0], load=np.abs(one.model.tests[0].load))]
    fitted = fit(Model(one.model.network, tests, one.model.parameters, one.model.noise), one.beta, linearisations=1)
    heat = next(heat for heat in free_heats(fitted, maps=True) if heat.is_map)
    wanted = as_parameters(fitted, heat)
    assert {parameter.test for parameter in wanted} == {None}, "it is the same in every test"
    projector, whole, e0 = stacked(fitted, fitted.model.linearise(fitted.beta, wanted))
    response = Response(slice(None), np.eye(len(wanted)), whole)
    total_W = mean_loss_W(fitted.model.network, tests)
    expected = free_heat(heat.node, [response], e0, projector, total_W)
    assert heat.log_bayes_factor == pytest.approx(expected.log_bayes_factor, rel=1e-4)
    watts = knots_of(fitted.model).alike @ expected.watts
    np.testing.assert_allclose(heat.watts, watts, rtol=1e-2, atol=0.05)


@pytest.mark.parametrize(
    ("by", "told"),
    [
        (lambda speed, load: np.where(load < 0, 1.0, 0.0), ("braking",)),
        (lambda speed, load: np.exp(-0.5 * ((speed - 0.5) / 0.1) ** 2) + 0 * load, ("speed",)),
        (lambda speed, load: np.abs(load) + 0 * speed, ("current",)),
    ],
)
def test_what_a_map_goes_with(by: object, told: tuple[str, ...]) -> None:
    test = _fitted().model.tests[0]
    knots = Knots.of([test])
    assert knots is not None and callable(by)
    speed, load = np.meshgrid(knots.speeds, knots.loads, indexing="ij")
    assert knots.followed(knots.course(by(speed, load).ravel(), test), [test]) == told


def test_a_motor_that_hardly_brakes_has_a_map_from_no_load_on() -> None:
    test = _fitted().model.tests[0]
    hardest = float(np.abs(test.load).max())
    rolling = replace(test, load=np.maximum(test.load, -0.05 * hardest))
    braking, driving = (Knots.of([one]) for one in (test, rolling))
    assert braking is not None and driving is not None
    assert (braking.loads[0], driving.loads[0]) == (-hardest, 0.0)
    node = _fitted().model.network.names.index("magnet")
    assert [knots.parts(node, knots.alike)[0].sayable for knots in (braking, driving)] == [False, True]


def test_a_map_is_learnt_and_written_as_a_term() -> None:
    """Of a motor that does not brake the file says the map over the current: a replay with it has the same heat."""
    one = _fitted().model
    tests = [replace(one.tests[0], load=np.abs(one.tests[0].load))]
    found = fit(Model(one.network, tests, (), one.noise), np.zeros(0))
    heat = next(heat for heat in free_heats(found, maps=True) if heat.is_map)
    parts = as_parameters(found, heat)
    learnt = fit(found.model.plus(parts), np.zeros(len(parts)))
    assert learnt.log_evidence > found.log_evidence
    told, knots = as_fitted(learnt, heat), knots_of(learnt.model)
    said = network_of(learnt, ())
    (term,) = (t for source in said.sources for t in source.terms if isinstance(t.shape, Map))
    assert isinstance(term.shape, Map) and (term.coefficient, term.shape.over) == (1.0, "current")
    assert next(source.node for source in said.sources if term in source.terms) == heat.node
    np.testing.assert_allclose(np.ravel(term.shape.values), told.watts)
    test = tests[0]
    u = {"speed": test.inputs["speed"], "current": test.inputs["current"]}
    written = evaluate((monomial(term),), u, len(test.load))[:, 0]
    np.testing.assert_allclose(written, knots.course(told.watts, test), atol=1e-9)
