"""Derivatives block by block, against a run by the definitions of the laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import fsolve

from made.laws import law_frame, rate, with_laws
from twin.calibration.calibrate import freedom
from twin.errors import DivergedError, FrameError
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.features import streams
from twin.motor.network import Link, Network, Property, Source, Term
from twin.motor.sensor import Sensor
from twin.run import block_columns, sparse_march
from twin.run.block_columns import Thermometer, of_every_node, of_motor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Make = Callable[..., Network]
Case = tuple[Network, Frame, Floats]

STEPS, STEP_S, BLOCK_S = 8, 5.0, 10.0


@pytest.fixture(scope="module", params=[0, 3])
def case(request: pytest.FixtureRequest, make_network: Make) -> Case:
    """A network with every law, and a term that is a candidate: its coefficient is 0."""
    network = with_laws(make_network(request.param, n=3), request.param)
    network = replace(network, sources=(*network.sources, Source("jacket_1", (Term(0.0, {"speed": 1.0}),))))
    return network, law_frame(network, request.param, STEPS, STEP_S), np.linspace(35, 90, len(network.nodes))


def _columns(network: Network, frame: Frame, initial: Floats, wanted: list[int] | None = None) -> Floats:
    """(B, n, P) of every node."""
    every = of_every_node(network, frame)
    return np.concatenate(list(block_columns.block_columns(network, frame, initial, every, wanted)))


def _run(network: Network, frame: Frame, initial: Floats) -> Floats:
    """Means of blocks (B, n) by the implicit midpoint rule."""
    start, means = initial, []
    for phi, around in zip(frame.features, frame.boundaries, strict=True):
        slope, before = rate(network, phi, around), start

        def left(z: Floats, slope: Callable[[float, Floats], Floats] = slope, before: Floats = before) -> Floats:
            found: Floats = z - before - frame.step_s / 2 * slope(0.0, z)
            return found

        means.append(fsolve(left, start, xtol=1e-12))
        start = 2 * means[-1] - start
    found: Floats = np.array(means).reshape(-1, round(BLOCK_S / frame.step_s), len(initial)).mean(axis=1)
    return found


def _moved(network: Network, place: int, change: float) -> Network:
    """One coefficient, or behind them one capacity, by so much more."""
    number = iter(range(place + 1))

    def more(terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(
            replace(t, coefficient=t.coefficient + (change if next(number, -1) == place else 0.0)) for t in terms
        )

    links = tuple(replace(link, terms=more(link.terms)) for link in network.links)
    sources = tuple(replace(source, terms=more(source.terms)) for source in network.sources)
    nodes = tuple(
        replace(n, capacity=n.capacity + (change if next(number, -1) == place else 0.0)) for n in network.nodes
    )
    return replace(network, links=links, sources=sources, nodes=nodes)


def _agree(column: Floats, up: Floats, down: Floats, step: float) -> None:
    expected = (up - down) / (2 * step)
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(column, expected, rtol=1e-4, atol=1e-5 * float(np.abs(expected).max()))


def test_columns_are_the_derivatives_of_a_run_by_every_coefficient_and_capacity(case: Case) -> None:
    network, frame, initial = case
    places, values = of_motor(network)
    found = _columns(network, frame, initial, places)
    assert found.shape == (STEPS // 2, len(network.nodes), len(places))
    for p, value in enumerate(values):
        step = 1e-4 * max(abs(value), 0.1)
        up, down = (_run(_moved(network, p, sign * step), frame, initial) for sign in (1, -1))
        _agree(found[:, :, p], up, down, step)


def test_columns_are_the_derivatives_of_a_run_by_every_start(case: Case) -> None:
    network, frame, initial = case
    n = len(initial)
    found = _columns(network, frame, initial)[:, :, -n:]
    for i, unit in enumerate(1e-3 * np.eye(n)):
        _agree(found[:, :, i], _run(network, frame, initial + unit), _run(network, frame, initial - unit), 1e-3)


def test_columns_of_streams_add_up_to_that_of_denser_fluids(case: Case) -> None:
    network, frame, initial = case
    first = len(of_motor(network)[0]) - len(initial)
    carried = np.array([term.coefficient for term in streams(network)])
    found = _columns(network, frame, initial)[:, :, first : first + len(carried)] @ carried

    def denser(factor: float) -> Network:
        def of(density: Property) -> Property:
            return replace(density, value=tuple(factor * value for value in density.value))

        fluids = (replace(c, fluid=replace(c.fluid, density=of(c.fluid.density))) for c in network.circuits)
        return replace(network, circuits=tuple(fluids))

    up, down = (_run(denser(1 + sign * 1e-4), frame, initial) for sign in (1, -1))
    _agree(found, up, down, 1e-4)


@pytest.mark.parametrize("strip", [8, 16])
def test_columns_are_the_same_in_many_strips_and_in_any_order(
    case: Case, strip: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    network, frame, initial = case
    every = _columns(network, frame, initial)
    wanted = np.random.default_rng(0).permutation(every.shape[2])[:-3].tolist()
    monkeypatch.setattr(sparse_march, "STRIP", strip)
    np.testing.assert_allclose(_columns(network, frame, initial, wanted), every[:, :, wanted], rtol=1e-12)


def test_what_is_held_at_a_time_does_not_matter(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    network, frame, initial = case
    at_once = _columns(network, frame, initial)
    monkeypatch.setattr(block_columns, "HELD", 1)
    np.testing.assert_allclose(
        _columns(network, frame, initial), at_once, rtol=1e-6, atol=1e-9 * float(np.abs(at_once).max())
    )


def test_a_network_of_many_nodes_has_the_columns_of_its_calibration(
    make_network: Make, make_frame: Callable[..., Frame]
) -> None:
    """Thermometers with lags that see several nodes, stamps anywhere in their steps."""
    network = make_network(4, n=120)
    frame, rng = make_frame(network, 4, steps=37, step_s=2.0), np.random.default_rng(4)
    names, initial = [node.name for node in network.nodes], np.full(120, 40.0)
    cut = replace(frame, features=frame.features[:35], boundaries=frame.boundaries[:35])
    sensors = (
        Sensor(f"{i}", {names[i]: 0.25, names[i + 50]: 0.75}, noise=0.1, time_constant_s=tau)
        for i, tau in enumerate([0.0, 3.0, 40.0])
    )
    channels = tuple(RecordedChannel(own, np.zeros(35), np.ones(35), rng.random(35)) for own in sensors)
    test = Test("", "", cut, {}, {}, initial, np.ones(120), channels)
    parameters = freedom(network, [test])
    parts = Model(network, [test], parameters).linearise(np.zeros(len(parameters)))
    expected = np.stack([part.columns for part in parts], axis=1)
    places, values = of_motor(network)
    read = [Thermometer(own.sensor.over(names), own.sensor.time_constant_s, own.blocks(2.0)) for own in channels]
    wanted = [*places, *(places[-1] + 1 + i for i in range(120))]
    found = np.concatenate(list(block_columns.block_columns(network, cut, initial, read, wanted)))
    found[:, :, : len(values)] *= values
    assert found.shape == expected.shape == (7, 3, len(values) + 120)
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_steps_behind_the_last_whole_block_do_not_count(case: Case) -> None:
    network, frame, initial = case
    odd = Frame(STEP_S, frame.features[:-1], frame.boundaries[:-1])
    np.testing.assert_array_equal(_columns(network, odd, initial), _columns(network, frame, initial)[:-1])


def test_a_frame_that_does_not_fit_is_refused(case: Case) -> None:
    network, frame, initial = case
    with pytest.raises(FrameError, match="initial of shape"):
        _columns(network, frame, initial[1:])


def test_a_run_that_leaves_the_finite_numbers_is_refused(make_network: Make) -> None:
    network = make_network(0, n=3)
    runaway = replace(network, links=(Link("n0", "coolant", (Term(1e-3),)),), sources=(Source("n0", (Term(1e9),)),))
    with pytest.raises(DivergedError, match='node "n0" runs away'):
        _columns(runaway, Frame(1.0, np.zeros((20, 0)), np.full((20, 2), 40.0)), np.full(3, 40.0))
