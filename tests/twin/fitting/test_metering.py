"""Meters of heat: what they read against the heats of a fine run, and every column against central differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import CASE, CHANNELS, FINE_S, ON_MOTOR, compiled, every_law, law, pulses, recorded, smooth, truth
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel, RecordedMeter
from twin.motor import sensor_laws
from twin.motor.features import evaluate, monomials
from twin.motor.network import Fluid, FluidCircuit, Link, Network, Node, Property, Term
from twin.motor.observables import Measurand, Thermometric, lagged_means
from twin.motor.sensor import Sensor
from twin.run.losses import heat_flows
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

NEAR = 1e-3
DURATION_S, STEP_S = 600.0, 2.0
METERS = ("P_el", "Q_cool", "Q_air", "R", "psi")
R = Thermometric(0.05, 0.00393, 20.0)
R_FOLLOWS = {"winding": 0.8, "yoke": 0.2}
PSI = Thermometric(0.08, -0.0011, 20.0)
EVERY: dict[str, tuple[actions.Action, float]] = {  # action and a size of its number
    **ON_MOTOR,
    "bias of a meter": (sensor_laws.Bias("P_el"), 20.0),
    "gain of a meter": (sensor_laws.Gain("P_el"), 0.01),
    "gain of a lagging meter": (sensor_laws.Gain("Q_cool"), 0.03),
    "gain of a resistance": (sensor_laws.Gain("R"), 0.01),
    "bias of a flux": (sensor_laws.Bias("psi"), 0.01),
}


def _meter(name: str, boundary: str | None, tau_s: float, given: Floats, samples: Floats) -> RecordedMeter:
    steps, what = len(given), Measurand("heat" if boundary else "power", "W", 0.01, boundary)
    sensor = Sensor(name, {name: 1.0}, bus="can1", noise=5.0, resolution=1.0, bias_sd=10.0, time_constant_s=tau_s)
    return RecordedMeter(sensor, np.zeros(steps), samples, np.full(steps, 0.5), what, given)


def _thermometric(
    name: str, law: Thermometric, weights: Mapping[str, float], tau_s: float, samples: Floats
) -> RecordedMeter:
    sensor = Sensor(name, weights, bus="can1", noise=1e-5, resolution=1e-6, time_constant_s=tau_s)
    what = Measurand("resistance", "ohm", 0.002, law=law)
    return RecordedMeter(sensor, np.zeros(len(samples)), samples, np.full(len(samples), 0.3), what)


def _with_meters(test: Test, seed: int) -> Test:
    steps = len(test.frame.features)
    rng = np.random.default_rng(seed)
    given = 3000.0 * np.sin(np.arange(steps) / 9.0)
    some = np.where(rng.random(steps) < 0.8, 4.0, 0.0)
    return replace(
        test,
        meters=(
            _meter("P_el", None, 0.0, given, np.full(steps, 4.0)),
            _meter("Q_cool", "coolant", 12.0, np.zeros(steps), some),
            _meter("Q_air", "ambient", 0.0, np.zeros(steps), np.full(steps, 1.0)),
            _thermometric("R", R, R_FOLLOWS, 0.0, some[::-1]),
            _thermometric("psi", PSI, {"magnet": 1.0}, 8.0, np.full(steps, 4.0)),
        ),
    )


@pytest.fixture(scope="module")
def tests() -> Sequence[Test]:
    initial = np.array([45.0, 42.0, 41.0, 35.0])
    more = (law(speed=2.0, current=2.0), law(current=2.0), law(speed=1.0))
    made = [recorded(every_law(), drive(DURATION_S), initial, more=more) for drive in (smooth, pulses)]
    return tuple(_with_meters(test, seed) for seed, test in enumerate(made))


def _others() -> list[Parameter]:
    chosen = ["scale of copper and AC loss", "exponent of a film", "tent", "heat in copper", "path to a boundary"]
    chosen += ["loss with temperature", "film with temperature", "capacity", "coolant bias", "mass that follows"]
    own = [Parameter(name, EVERY[name][0], abs(EVERY[name][1])) for name in chosen]
    return [*own, Parameter("meter", sensor_laws.Gain("P_el"), 0.01)]


def _shown(model: Model, beta: Floats) -> dict[tuple[int, str], Floats]:
    return {(one.session, one.channel): -one.y for one in model.residuals(beta) if one.channel in METERS}


@pytest.mark.parametrize("name", EVERY)
def test_a_column_of_a_meter_is_the_slope_of_its_residuals(name: str, tests: Sequence[Test]) -> None:
    action, size = EVERY[name]
    others = [one for one in _others() if one.name != name]
    model = Model(every_law(), tests, [*others, Parameter(name, action, abs(size))])
    beta = np.append(np.random.default_rng(7).uniform(-0.8, 0.8, len(others)) * model.sd[:-1], 0.9 * size)
    _assert_slopes(model, beta, len(beta) - 1, 1e-3 * abs(size), name)


def _assert_slopes(model: Model, beta: Floats, place: int, h: float, what: str) -> None:
    step = np.zeros_like(beta)
    step[place] = h
    up, down = _shown(model, beta + step), _shown(model, beta - step)
    moved = 0.0
    for part in model.linearise(beta):
        key = part.series.session, part.series.channel
        if key not in up:
            continue
        expected = (up[key] - down[key]) / (2 * h)
        column = part.columns[:, list(part.at).index(place)] if place in part.at else np.zeros_like(expected)
        largest = np.abs(expected).max()
        moved = max(moved, float(largest))
        assert np.abs(column - expected).max() <= NEAR * largest + 1e-5, f"{what} at {key}"
    assert moved > 0, f"{what} moves no meter"


@pytest.mark.parametrize(
    "name", ["scale of a link", "heat in inverse copper", "mass that follows", "two laws with temperature"]
)
def test_the_column_of_a_candidate_is_the_slope_where_it_enters(name: str, tests: Sequence[Test]) -> None:
    action, size = EVERY[name]
    others = [one for one in _others() if one.name != name]
    model = Model(every_law(), tests, others)
    beta = np.random.default_rng(9).uniform(-0.8, 0.8, len(others)) * model.sd
    candidate = Parameter(name, action, abs(size))
    parts = model.linearise(beta, [candidate])
    more = model.plus([candidate])
    h = 1e-3 * abs(size)
    up, down = (_shown(more, np.append(beta, way * h)) for way in (1.0, -1.0))
    for part in parts:
        key = part.series.session, part.series.channel
        if key in up:
            expected = (up[key] - down[key]) / (2 * h)
            assert np.abs(part.extra[:, 0] - expected).max() <= NEAR * np.abs(expected).max() + 1e-6, key


def _cooled() -> Network:
    """The motor of every law in a jacket of two nodes, with a case that radiates."""
    plain = every_law()
    links = [link for link in plain.links if {link.a, link.b} not in ({"yoke", "coolant"}, {"ambient", "case"})]
    fluid = Fluid(Property((20.0,), (1050.0,)), Property((20.0, 80.0), (3300.0, 3600.0)))
    return replace(
        plain,
        name="every-law-in-a-jacket",
        nodes=(*plain.nodes, Node("jacket", 300.0, "fluid"), Node("outlet", 200.0, "fluid")),
        links=(
            *links,
            Link("ambient", "case", (Term(2.0), Term(2.0, law="radiation"))),
            Link("yoke", "jacket", (Term(15.0), Term(10.0, {"flow": 0.8}))),
            Link("case", "outlet", (Term(8.0),)),
        ),
        circuits=(FluidCircuit("jacket", "coolant", ("jacket", "outlet"), fluid),),
        scale={**plain.scale, "flow": 0.2},
    )


COOLED: dict[str, tuple[actions.Action, float]] = {
    "scale of copper and AC loss": (actions.Scale((9, 10)), 0.2),
    "scale of what radiates": (actions.Scale((5,)), 0.3),
    "gain of the flow": (actions.InputGain("flow"), 0.05),
    "bias of the inlet": (actions.BoundaryBias(0), 1.0),
    "capacity of the fluid": (actions.Capacity((4,)), 0.2),
    "mass that follows": (actions.Attached((5,), 60.0), 200.0),
    "start of the fluid": (actions.Start(4), 3.0),
}


@pytest.mark.parametrize("name", COOLED)
def test_the_heat_that_a_circuit_carries_has_columns_too(name: str) -> None:
    initial = np.array([75.0, 52.0, 51.0, 45.0, 42.0, 42.0])
    tests = [_with_meters(recorded(_cooled(), pulses(DURATION_S), initial), 3)]
    others = [Parameter(other, *COOLED[other]) for other in COOLED if other != name]
    action, size = COOLED[name]
    model = Model(_cooled(), tests, [*others, Parameter(name, action, size)])
    beta = np.append(np.random.default_rng(11).uniform(-0.6, 0.8, len(others)) * model.sd[:-1], 0.7 * size)
    _assert_slopes(model, beta, len(beta) - 1, 1e-3 * size, name)


def test_a_free_heat_is_counted_as_a_loss_and_leaves_through_the_boundaries(tests: Sequence[Test]) -> None:
    model = Model(every_law(), tests[:1], [])
    tent = Parameter("free heat", actions.HeatTent(CASE, 300.0, 120.0), 20.0, test=0)
    columns = {part.series.channel: part for part in model.linearise(np.zeros(0), [tent])}
    row = {meter.name: meter.row for meter in tests[0].meters}
    electrical = columns["P_el"]
    hat = np.maximum(0.0, 1 - np.abs(electrical.series.t_s - 300.0) / 120.0)
    through_copper = np.abs(row["P_el"] * electrical.extra[:, 0] - hat).max()
    assert through_copper < 0.05  # all losses but those that go with temperature stay as they are
    taken = sum(row[name] * columns[name].extra[:, 0].sum() for name in ("Q_cool", "Q_air"))
    assert 0.2 * hat.sum() < taken < hat.sum()


def test_meters_leave_the_columns_of_thermometers_as_they_are(tests: Sequence[Test]) -> None:
    others = _others()[:-1]
    plain = tuple(replace(test, meters=()) for test in tests)
    beta = np.random.default_rng(5).uniform(-0.8, 0.8, len(others)) * [one.sd for one in others]
    with_meters = [p for p in Model(every_law(), tests, others).linearise(beta) if p.series.channel in CHANNELS]
    for part, alone in zip(with_meters, Model(every_law(), plain, others).linearise(beta), strict=True):
        np.testing.assert_array_equal(part.columns, alone.columns)
        np.testing.assert_array_equal(part.series.y, alone.series.y)


def test_a_meter_reads_what_a_fine_run_makes_and_its_boundaries_take() -> None:
    initial = np.array([45.0, 42.0, 41.0, 35.0])
    network, drive = every_law(), smooth(DURATION_S)
    test = _with_meters(recorded(network, drive, initial), 1)
    edges = truth(network, drive, initial)
    around = np.tile(test.frame.boundaries[0], (len(edges) - 1, 1))
    flows = heat_flows(
        compiled(network).network, Frame(FINE_S, evaluate(monomials(network), drive, len(around)), around), edges
    )
    expected = {"P_el": flows.made, "Q_cool": flows.boundaries[0], "Q_air": flows.boundaries[1]}
    for series in Model(network, [test], []).residuals(np.zeros(0)):
        if series.channel in expected:
            meter = next(one for one in test.meters if one.name == series.channel)
            means = expected[series.channel].reshape(-1, round(STEP_S / FINE_S)).mean(axis=1) + meter.given
            fine = meter.blocks(STEP_S).of_steps(lagged_means(means, meter.sensor.time_constant_s, STEP_S))
            np.testing.assert_allclose(-series.y * meter.row, fine, atol=0.005 * np.abs(fine).max())


def test_a_resistance_reads_what_a_thermometer_of_its_place_stands_for() -> None:
    initial = np.array([45.0, 42.0, 41.0, 35.0])
    test = _with_meters(recorded(every_law(), smooth(DURATION_S), initial), 1)
    known = {c.name: c for c in test.channels}
    resistance = test.meters[3]
    mixed_place = replace(known["W_1"].sensor, name="mixed", weights=R_FOLLOWS, time_constant_s=0.0)
    alike = RecordedChannel(mixed_place, known["W_1"].measured, resistance.samples, resistance.place)
    test = replace(test, channels=(*test.channels, alike))
    series = {s.channel: s for s in Model(every_law(), [test], []).residuals(np.zeros(0))}
    mixed = alike.blocks(STEP_S).measured(alike.measured) - series["mixed"].y
    np.testing.assert_allclose(-series["R"].y * R.per_K, R.reading(mixed), rtol=1e-12)


def test_a_clock_of_the_channels_alone_delays_no_meter(tests: Sequence[Test]) -> None:
    late = actions.Late(tuple(CHANNELS), False)
    assert not tests[0].is_common(late)
    model = Model(every_law(), tests, [Parameter("clock", late, 1.0)])
    still, moved = _shown(model, np.zeros(1)), _shown(model, np.array([0.9]))
    for key, reading in still.items():
        np.testing.assert_allclose(moved[key], reading, rtol=1e-12)


def test_a_lag_keeps_what_is_constant_and_follows_a_step_by_its_exponential() -> None:
    np.testing.assert_allclose(lagged_means(np.full(20, 7.0), 5.0, 1.0), 7.0)
    step = np.concatenate([np.zeros(5), np.ones(40)])
    t = np.arange(41) * 1.0
    edges = 1 - np.exp(-t / 8.0)
    expected = 1 - 8.0 * (np.exp(-t[:-1] / 8.0) - np.exp(-t[1:] / 8.0))
    np.testing.assert_allclose(lagged_means(step, 8.0, 1.0)[5:], expected, atol=1e-12)
    assert edges[-1] > 0.99
