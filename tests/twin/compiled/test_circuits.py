"""Circuits, radiation and free convection: every way to run a network gives what their definition says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.laws import GLYCOL, OIL, law_frame, tight_laws, with_laws
from made.paper_form import simulate_with_flows
from twin.compiled.heat import heat, heat_capacity
from twin.compiled.integrators import BDF2
from twin.compiled.kernel import compile_indexed, compile_network
from twin.compiled.laid_out import laid_out
from twin.compiled.structure import described, structure
from twin.filters import inputs as filter_inputs
from twin.filters.ekf import filter_unknowns
from twin.filters.unknowns import UnknownHeat
from twin.motor import features
from twin.motor.heat_laws import LINKS, NUMBER
from twin.motor.network import Boundary, FluidCircuit, Link, Network, Node, Source, Term
from twin.run.initial import conductances, steady_interpolation, time_constants
from twin.run.simulate import Frame, simulate
from twin.run.sparse_march import run

Floats = NDArray[np.float64]
Load = Callable[[str], Callable[..., None]]
Make = Callable[..., Network]


def _start(network: Network) -> Floats:
    return np.linspace(35.0, 90.0, len(network.nodes))


def _march(network: Network, inputs: Frame, initial: Floats) -> Floats:
    _, values, program, _, _ = laid_out(network)
    nodes = [node.name for node in network.nodes]
    return run(program, False, values, inputs.step_s, inputs.features, inputs.boundaries, initial, nodes).edges


@pytest.mark.parametrize("seed", range(6))
def test_both_kernels_agree(seed: int, make_network: Make, plain: Load) -> None:
    network = with_laws(make_network(seed, n=3 + seed), seed)
    inputs = law_frame(network, seed, 40, 0.5)
    straight = simulate(compile_network(network, load=plain), inputs, _start(network))
    general = simulate(compile_indexed(network), inputs, _start(network))
    np.testing.assert_allclose(straight, general, rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_filter_without_readings_is_the_open_loop(seed: int, make_network: Make) -> None:
    network = with_laws(make_network(seed, n=4), seed)
    inputs = law_frame(network, seed, 40, 0.5)
    start = filter_inputs.FilterStart(_start(network), np.ones(len(network.nodes)))
    filtered = filter_unknowns(network, inputs, start, [UnknownHeat(network.nodes[0].name, 1.0, 1.0)], [])
    run_alone = simulate(compile_indexed(network), inputs, _start(network))
    np.testing.assert_allclose(filtered.temperatures, run_alone, rtol=0, atol=1e-10)


def test_the_form_of_the_paper_gives_the_same(make_network: Make) -> None:
    """Newton-Raphson against one linearisation a step: equal but for what that leaves out."""
    network = with_laws(make_network(2, n=4), 2)
    inputs = law_frame(network, 2, 100, 0.5)
    course = simulate_with_flows(network, inputs, _start(network))
    found = simulate(compile_indexed(network, BDF2), inputs, _start(network))
    np.testing.assert_allclose(course.temperatures, found, rtol=0, atol=3e-3)
    assert np.ptp(found, axis=0).min() > 0.1


@pytest.mark.parametrize("seed", [1, 2])
def test_halving_the_step_divides_the_error_of_every_run_by_four(seed: int, make_network: Make, plain: Load) -> None:
    network = with_laws(make_network(seed, n=4), seed)
    coarse = law_frame(network, seed, 6, 8.0)
    truth = tight_laws(network, coarse, _start(network))
    compiled = compile_network(network, load=plain)
    runs: tuple[Callable[[Frame], Floats], ...] = (
        lambda frame: simulate(compiled, frame, _start(network)),
        lambda frame: _march(network, frame, _start(network)),
    )

    def error(way: Callable[[Frame], Floats], parts: int) -> float:
        fine = Frame(
            8.0 / parts, np.repeat(coarse.features, parts, axis=0), np.repeat(coarse.boundaries, parts, axis=0)
        )
        return float(np.abs(way(fine)[::parts] - truth).max())

    for way in runs:
        assert error(way, 64) < 0.01
        assert np.log2(error(way, 32) / error(way, 64)) == pytest.approx(2, abs=0.3)


def _drop(law: str, a: float, b: float) -> tuple[float, float, float]:
    """What drives the heat of a link of 1 W/K, and its slopes with both temperatures."""
    value, by_a, by_b, _ = heat(NUMBER[law], 1.0, a, b, a, 0.0, 20.0, 0.0, 20.0, 1.0, 0.0)
    return value, by_a, by_b


@pytest.mark.parametrize("law", LINKS)
@pytest.mark.parametrize(("a", "b"), [(20.0, 150.0), (90.0, 30.0), (40.0, 40.0), (50.0, 50.05)])
def test_the_slopes_of_a_drop_are_those_of_its_value(law: str, a: float, b: float) -> None:
    _, by_a, by_b = _drop(law, a, b)
    h = 1e-4
    assert by_a == pytest.approx((_drop(law, a + h, b)[0] - _drop(law, a - h, b)[0]) / (2 * h), rel=1e-5, abs=1e-7)
    assert by_b == pytest.approx((_drop(law, a, b + h)[0] - _drop(law, a, b - h)[0]) / (2 * h), rel=1e-5, abs=1e-7)


def test_a_bent_law_is_the_plain_one_where_its_coefficient_is_said_to_hold() -> None:
    assert _drop("radiation", 19.99, 20.01)[0] == pytest.approx(0.02, rel=1e-6)
    assert _drop("free_convection", 30.0, 40.0)[0] == pytest.approx(10.0, rel=1e-12)
    assert _drop("free_convection", 30.0, 110.0)[0] == pytest.approx(80 * 8**0.25, rel=1e-4)
    sigma, eps_area = 5.670374e-8, 0.3
    watts = sigma * eps_area * ((150 + 273.15) ** 4 - (25 + 273.15) ** 4)
    assert 4 * sigma * eps_area * 293.15**3 * _drop("radiation", 25.0, 150.0)[0] == pytest.approx(watts, rel=1e-12)


def test_a_number_that_no_law_has_gives_no_heat_that_could_be_believed() -> None:
    assert np.isnan(heat(len(NUMBER), 1.0, 20.0, 30.0, 20.0, 0.0, 20.0, 0.0, 20.0, 1.0, 0.0)).all()


@pytest.mark.parametrize("at", [-10.0, 0.0, 15.0, 30.0, 45.0, 60.0, 99.0])
def test_the_heat_capacity_of_a_fluid_is_linear_between_its_knots_and_constant_beyond(at: float) -> None:
    knots, values = np.array([0.0, 30.0, 60.0]), np.array([1.0, 0.7, 0.9])
    rises = np.append(values[0], np.diff(values) / np.diff(knots))
    relative, growth = heat_capacity(at, knots, rises, 3)
    assert relative == pytest.approx(np.interp(at, knots, values), abs=1e-15)
    before = (np.interp(at, knots, values) - np.interp(at - 1e-6, knots, values)) / 1e-6
    assert growth == pytest.approx(before, abs=1e-9)  # at a knot that of the line that ends there


# --- A channel: 300 W into fluid that runs through two nodes ---------------------------------------------------------


PER_K_W = 850.0 * 2000.0 * 4.0 / 60_000  # what 4 l/min of the oil carries


def _channel() -> Network:
    return Network(
        "channel",
        (Node("wall", 500.0, "housing"), Node("near", 100.0, "fluid"), Node("far", 80.0, "fluid")),
        (Boundary("coolant"),),
        (Link("wall", "near", (Term(20.0),)), Link("wall", "far", (Term(20.0),))),
        (Source("wall", (Term(300.0),)),),
        scale={"flow": 4.0},
        circuits=(FluidCircuit("jacket", "coolant", ("near", "far"), OIL),),
    )


def _run(flow: float, steps: int, plain: Load) -> Floats:
    inputs = Frame(0.5, np.full((steps, 1), flow), np.full((steps, 1), 30.0))
    return simulate(compile_network(_channel(), load=plain), inputs, np.full(3, 30.0))


def test_the_last_node_comes_out_as_hot_as_the_heat_and_the_flow_say(plain: Load) -> None:
    assert _run(1.0, 2000, plain)[-1, 2] - 30.0 == pytest.approx(300.0 / PER_K_W, rel=1e-6)
    assert _run(0.5, 4000, plain)[-1, 2] - 30.0 == pytest.approx(600.0 / PER_K_W, rel=1e-6)


def test_fluid_that_stands_keeps_the_heat(plain: Load) -> None:
    rise = (_run(0.0, 200, plain)[-1] - 30.0) @ [500.0, 100.0, 80.0]
    assert rise == pytest.approx(300.0 * 100.0, rel=1e-9)


def test_a_stream_carries_only_downstream() -> None:
    found = conductances(_channel(), np.ones(1))
    wall, near, far, coolant = range(4)
    assert found[near, coolant] == found[far, near] == pytest.approx(PER_K_W)
    assert found[near, far] == found[coolant, near] == found[wall, coolant] == 0.0
    assert time_constants(_channel(), np.ones(1))["far"] == pytest.approx(80.0 / (20.0 + PER_K_W))


def test_what_is_downstream_of_a_measured_node_starts_with_it() -> None:
    at, sd = steady_interpolation(_channel(), np.ones(1), np.array([30.0]), {"near": (42.0, 0.5)})
    np.testing.assert_allclose(at, 42.0)
    assert sd.tolist() == [2.0, 0.5, 2.0]
    at, _ = steady_interpolation(_channel(), np.zeros(1), np.array([30.0]), {})
    np.testing.assert_allclose(at, 30.0)


def test_streams_stand_behind_all_terms_and_are_none_of_them(make_network: Make) -> None:
    network = with_laws(make_network(1, n=4), 1)
    terms = [term.coefficient for term in features.terms(network)]
    found = described(network)[1].coefficients
    assert found[: len(terms)].tolist() == terms
    volume = GLYCOL.density.at(20.0) * GLYCOL.heat_capacity.at(20.0)
    np.testing.assert_allclose(found[len(terms) :], [volume * 0.05 / 60_000] * 3 + [850 * 2000 * 0.05 / 60_000] * 3)
    assert {"flow", "flow_oil"} <= {m.name for m in features.monomials(network)}


def test_only_a_matrix_that_is_symmetric_is_taken_for_one() -> None:
    plain = replace(_channel(), circuits=(), links=(*_channel().links, Link("wall", "coolant", (Term(1.0),))))
    assert structure(plain).symmetric
    assert not structure(_channel()).symmetric
    inlet = replace(_channel(), circuits=(FluidCircuit("jacket", "coolant", ("near",), OIL),))
    assert structure(inlet).symmetric
    for law in ("radiation", "free_convection"):
        bent = Link("wall", "near", (Term(1.0, law=law),))
        assert not structure(replace(plain, links=(bent, *plain.links[1:]))).symmetric
