"""Every column of a model against central differences of its residuals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.integrator import AMBIENT_DEGC, COOLANT_DEGC, motor, wltp_like
from made.motor import CASE, CHANNELS, MAGNET, ON_MOTOR, every_law, law, pulses, recorded, smooth
from twin.differences.everyday import everyday
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor import sensor_laws
from twin.motor.features import Monomial, evaluate, monomials
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

NEAR = 1e-3  # of a column's largest entry
DURATION_S = 600.0

EVERY: dict[str, tuple[actions.Action, float]] = {  # action and a size of its number
    **ON_MOTOR,
    "bias": (sensor_laws.Bias("W_1"), 1.0),
    "gain": (sensor_laws.Gain("Y_1"), 0.02),
    "gain of a prompt sensor": (sensor_laws.Gain("W_1"), 0.02),
    "lag of a lagging sensor": (sensor_laws.Lag("R_1"), 2.0),
    "lag of a prompt sensor": (sensor_laws.Lag("W_1"), 3.0),
    "drift": (sensor_laws.Drift("Y_1"), 2.0),
    "stem": (sensor_laws.Stem("Y_1"), 0.03),
    "reading that follows speed": (sensor_laws.OfSpeed("R_1"), 0.3),
    "reading that follows current": (sensor_laws.OfCurrent("W_1"), 1.0),
    "clock of all channels": (actions.Late(tuple(CHANNELS), False), 0.8),
    "clock of the inputs": (actions.Late(tuple(CHANNELS), False, -1.0), 0.8),
    "clock of one channel": (actions.Late(("Y_1",), False), 0.9),
    "clock of one channel, early": (actions.Late(("Y_1",), False), -0.9),
    "clock of all others": (actions.Late(("Y_1",), False, -1.0), 0.9),
    "clock far off": (actions.Late(("R_1",), False), 7.5),
    "clock that runs wrong": (actions.Late(("R_1", "Y_1"), True), 900.0),
    "free heat": (actions.HeatTent(CASE, 300.0, 120.0), 20.0),
    "free map": (
        actions.HeatMap(CASE, (0.0, 0.5, 1.0), (-1.0, 0.0, 1.0), "torque", tuple(np.linspace(-1.0, 1.0, 9))),
        20.0,
    ),
}
MORE = (law(speed=2.0, current=2.0), law(current=2.0), law(speed=1.0))


@pytest.fixture(scope="module")
def tests() -> Sequence[Test]:
    """Two tests: one smooth, one in pulses with samples that are not there, its start measured by its sensors."""
    initial = np.array([45.0, 42.0, 41.0, 35.0])
    steps = round(DURATION_S / 2)
    some = (np.random.default_rng(2).random(steps) < 0.7).astype(np.float64)
    some[100:120] = 0.0
    pulsed = recorded(
        every_law(), pulses(DURATION_S), initial, more=MORE, seed=2, samples={"Y_1": some, "R_1": some[::-1]}
    )
    begins = {"W_1": np.array([1.0, 0.0, 0.3, 0.1]), "Y_1": np.array([0.0, 0.8, 0.2, 0.4])}
    both = (recorded(every_law(), smooth(DURATION_S), initial, more=MORE, seed=1), replace(pulsed, begins=begins))
    return tuple(replace(test, load=test.inputs["current"]) for test in both)


def _modelled(model: Model, beta: Floats) -> Floats:
    return np.concatenate([-series.y for series in model.residuals(beta)])


def _differences(model: Model, beta: Floats, place: int, h: float) -> Floats:
    step = np.zeros_like(beta)
    step[place] = h
    found: Floats = (_modelled(model, beta + step) - _modelled(model, beta - step)) / (2 * h)
    return found


def _assert_near(column: Floats, expected: Floats, what: str) -> None:
    assert np.abs(expected).max() > 0, f"{what} moves nothing"
    error = np.abs(column - expected).max() / np.abs(expected).max()
    assert error < NEAR, f"{what}: {error:.2g} of the largest entry"


def _own_column(model: Model, beta: Floats, place: int) -> Floats:
    found = []
    for part in model.linearise(beta):
        column = np.zeros(len(part.series.y))
        if place in part.at:
            column = part.columns[:, list(part.at).index(place)]
        found.append(column)
    return np.concatenate(found)


def _others() -> list[Parameter]:
    """What else is not zero while a column is looked at: one of every kind of law, and of every way to read wrong."""
    chosen = (
        "scale of copper and AC loss",
        "exponent of a film",
        "tent",
        "gain of the current",
        "heat in copper",
        "path to a boundary",
        "loss with temperature",
        "capacity",
        "coolant bias",
        "gain",
        "lag of a lagging sensor",
        "stem",
    )
    return [Parameter(name, EVERY[name][0], abs(EVERY[name][1])) for name in chosen]


@pytest.mark.parametrize("name", EVERY)
def test_a_column_is_the_slope_of_the_residuals_at_a_random_vector(name: str, tests: Sequence[Test]) -> None:
    action, size = EVERY[name]
    others = _others()
    model = Model(every_law(), tests, [*others, Parameter(name, action, abs(size))])
    rng = np.random.default_rng(7)
    beta = np.append(rng.uniform(-0.8, 0.8, len(others)) * model.sd[:-1], 0.9 * size)
    column = _own_column(model, beta, len(beta) - 1)
    _assert_near(column, _differences(model, beta, len(beta) - 1, 1e-3 * abs(size)), name)


@pytest.mark.parametrize("late", [0.0, 0.9, -3.1])
def test_the_columns_of_all_others_follow_a_clock_that_is_off(late: float, tests: Sequence[Test]) -> None:
    others = _others()
    for channels in (("Y_1",), tuple(CHANNELS)):
        model = Model(every_law(), tests, [*others, Parameter("clock", actions.Late(channels, False), 1.0)])
        beta = np.append(np.random.default_rng(8).uniform(-0.8, 0.8, len(others)) * model.sd[:-1], late)
        for place, one in enumerate(others):
            column = _own_column(model, beta, place)
            _assert_near(column, _differences(model, beta, place, 1e-3 * one.sd), f"{one.name}, {channels}")


@pytest.mark.parametrize("name", EVERY)
def test_the_column_of_a_candidate_is_the_slope_where_it_enters(name: str, tests: Sequence[Test]) -> None:
    action, size = EVERY[name]
    others = _others()
    model = Model(every_law(), tests, others)
    beta = np.random.default_rng(9).uniform(-0.8, 0.8, len(others)) * model.sd
    candidate = Parameter(name, action, abs(size))
    column = np.concatenate([part.extra[:, 0] for part in model.linearise(beta, [candidate])])
    more = model.plus([candidate])
    h = 1e-3 * abs(size)
    one_sided = isinstance(action, sensor_laws.Lag) and name == "lag of a prompt sensor"
    at = [_modelled(more, np.append(beta, x)) for x in ((h, 0.0) if one_sided else (h, -h))]
    expected = (at[0] - at[1]) / (h if one_sided else 2 * h)
    _assert_near(column, expected, name)


def test_a_parameter_of_one_test_moves_no_other(tests: Sequence[Test]) -> None:
    model = Model(every_law(), tests, [Parameter("start", actions.Start(MAGNET), 1.0, test=1)])
    beta = np.array([0.4])
    parts = model.linearise(beta, [Parameter("coolant", actions.BoundaryBias(0), 1.0, test=0)])
    assert [part.at.size for part in parts] == [0, 0, 0, 1, 1, 1]
    assert [bool(part.extra.any()) for part in parts] == [True] * 3 + [False] * 3
    _assert_near(_own_column(model, beta, 0), _differences(model, beta, 0, 1e-3), "start of test 1")


OF_A_KIND = 3
STEPS = 250  # steps of the cycle


def _reference_test(seed: int) -> Test:
    """Part of a driving cycle as the reference motor's sensors see it; what they measured does not matter here."""
    network = motor("reference_motor")
    full = {**wltp_like(), "flow": np.ones(len(wltp_like()["speed"]))}
    u = {name: values[1000 + 400 * seed :][: 4 * STEPS].reshape(STEPS, 4).mean(axis=1) for name, values in full.items()}
    every = (*monomials(network), *(Monomial(((f, 1.0),)) for f in u), law(current=2.0))
    phi = evaluate(every, u, STEPS)
    where = {"rotor_surface": 2.0, "endwinding_a_inner": 0.0, "teeth": 5.0}
    channels = [
        RecordedChannel(
            Sensor(
                node,
                {node: 1.0},
                bus="can1" if tau_s else "can2",
                noise=0.1,
                resolution=0.1,
                bias_sd=0.3,
                time_constant_s=tau_s,
            ),
            measured=np.zeros(STEPS),
            samples=np.full(STEPS, 4.0),
            place=np.full(STEPS, 0.5),
        )
        for node, tau_s in where.items()
    ]
    return Test(
        name=f"cycle {seed}",
        kind="wltp",
        frame=Frame(2.0, phi[:, : len(monomials(network))], np.tile([COOLANT_DEGC, AMBIENT_DEGC], (STEPS, 1))),
        inputs=u,
        features={m.name: phi[:, j] for j, m in enumerate(every)},
        initial=np.linspace(COOLANT_DEGC, 75.0, len(network.nodes)),
        initial_sd=np.ones(len(network.nodes)),
        channels=tuple(channels),
    )


def test_the_columns_of_the_reference_motor_are_slopes_too() -> None:
    """A few of every kind of what a healthy motor may do, all else away from its prior mean."""
    tests = [_reference_test(seed) for seed in range(2)]
    parameters = everyday(motor("reference_motor"), tests)
    model = Model(motor("reference_motor"), tests, parameters)
    rng = np.random.default_rng(3)
    beta = rng.uniform(-0.4, 0.4, len(parameters)) * model.sd
    clocks = [isinstance(p.action, actions.Late) for p in parameters]
    beta[clocks] = 0.6  # s: near whole steps the slope is the mean of both sides
    parts = model.linearise(beta)
    seen: Counter[type] = Counter()
    for place in rng.permutation(len(parameters)):
        kind = type(parameters[place].action)
        seen[kind] += 1
        if seen[kind] > OF_A_KIND:
            continue
        full = [np.zeros(len(p.series.y)) for p in parts]
        for column, part in zip(full, parts, strict=True):
            if place in part.at:
                column += part.columns[:, list(part.at).index(place)]
        expected = _differences(model, beta, int(place), 3e-3 * parameters[place].sd)
        if np.abs(expected).max() * parameters[place].sd > 1e-6:
            _assert_near(np.concatenate(full), expected, parameters[place].name)
    assert len(seen) >= 10
