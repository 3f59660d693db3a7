"""The paper's form, temperatures and heat flows under constraints, agrees with the reduced form and closes its
balances."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.integrator import frame, motor, s2
from made.laws import law_frame, with_laws
from made.paper_form import Constraints, constraints, simulate_with_flows
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.errors import DivergedError, FrameError
from twin.motor.network import Link, Network, TemperatureFactor, Term
from twin.run.initial import conductances
from twin.run.simulate import Frame, simulate, source_heat

Floats = np.ndarray[Any, Any]


def held(inputs: Frame, steps: int, parts: int = 1, first: int = 0) -> Frame:
    """Some steps of a frame, each cut into parts with the same inputs."""
    some = slice(first, first + steps)
    return Frame(
        inputs.step_s / parts,
        np.repeat(inputs.features[some], parts, axis=0),
        np.repeat(inputs.boundaries[some], parts, axis=0),
    )


def reduced(network: Network, inputs: Frame, initial: Floats, parts: int) -> Floats:
    """The network's own kernel in steps so small that its error does not count, at the edges of `inputs`."""
    fine = held(inputs, len(inputs.features), parts)
    edges: Floats = simulate(compile_indexed(network, load=load), fine, initial)[::parts]
    return edges


def test_the_reference_motor_runs_as_in_its_reduced_form() -> None:
    """Inputs that jump cost a multistep method an order: the error halves with the step."""
    network = motor("reference_motor")
    inputs = frame(network, s2(), 0.5)
    inputs, initial = held(inputs, 150, first=110), np.full(len(network.nodes), 65.0)
    truth = reduced(network, inputs, initial, 32)
    errors = []
    for parts in (1, 2, 4):
        found = simulate_with_flows(network, held(inputs, 150, parts), initial).temperatures[::parts]
        errors.append(np.abs(found - truth).max())
    assert errors[0] < 1.1, "K, in a pulse of full current at 0.5 s"
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.2)


def test_it_is_of_second_order_where_inputs_do_not_jump() -> None:
    network = motor("reference_motor")
    inputs = held(frame(network, s2(), 0.5), 1, first=125)
    inputs = Frame(0.5, np.repeat(inputs.features, 120, 0), np.repeat(inputs.boundaries, 120, 0))
    initial = np.full(len(network.nodes), 65.0)
    truth = reduced(network, inputs, initial, 64)
    errors = []
    for parts in (2, 4, 8):
        found = simulate_with_flows(network, held(inputs, 120, parts), initial).temperatures[::parts]
        errors.append(np.abs(found - truth)[20:].max())
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.5)
    assert errors[1] / errors[2] == pytest.approx(4.0, abs=0.5)
    assert errors[2] < 2e-3


@pytest.mark.parametrize("laws", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_any_law_agrees_with_a_tight_solution_of_its_own_flows(
    seed: int, laws: bool, make_network: Any, make_frame: Any
) -> None:
    """C dT/dt = heat into the capacitors, all laws as they are and not linearised, by another method of another
    library. `laws`: with circuits, radiation and free convection."""
    network: Network = with_laws(make_network(seed), seed) if laws else make_network(seed)
    one: Frame = law_frame(network, seed, 1, 0.5) if laws else make_frame(network, seed, steps=1)
    inputs = Frame(0.25, np.repeat(one.features, 160, 0), np.repeat(one.boundaries, 160, 0))
    initial = np.linspace(35.0, 60.0, len(network.nodes))
    form = constraints(network)
    amounts, around = form.laws.amounts(inputs.features)[0], inputs.boundaries[0]

    def rate(_: float, temperatures: Floats) -> Floats:
        return np.asarray(form.at(temperatures, amounts, around)[-len(initial) :] / form.capacities)

    truth = solve_ivp(rate, (0, 40.0), initial, "DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    found = simulate_with_flows(network, inputs, initial).temperatures[-1]
    assert np.abs(found - truth).max() < 0.02
    kernel = simulate(compile_indexed(network, load=load), held(inputs, 160, 4), initial)[-1]
    assert np.abs(kernel - truth).max() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_constraints_and_capacitor_equations_close_to_rounding(seed: int, make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(seed)
    inputs: Frame = make_frame(network, seed)
    course = simulate_with_flows(network, inputs, np.full(len(network.nodes), 40.0))
    into = np.zeros_like(course.stored)
    nodes = [node.name for node in network.nodes]
    for flow, watts in zip(course.of, course.flows.T, strict=True):
        into[:, nodes.index(flow.node)] += watts
        if flow.other in nodes:
            into[:, nodes.index(flow.other)] -= watts
    scale = np.abs(course.flows).max()
    assert np.abs(into - course.stored).max() < 1e-12 * scale, "Kirchhoff"
    rate = (3 * course.temperatures[2:] - 4 * course.temperatures[1:-1] + course.temperatures[:-2]) / (
        2 * inputs.step_s
    )
    capacities = np.array([node.capacity for node in network.nodes])
    assert np.abs(capacities * rate - course.stored[2:]).max() < 1e-9 * scale, "Gamma"


def test_heat_flows_are_those_of_the_motor_file(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(5, linear=True)
    inputs: Frame = make_frame(network, 5)
    course = simulate_with_flows(network, inputs, np.full(len(network.nodes), 40.0))
    names = network.names
    for k in (0, 7, 39):
        between = conductances(network, inputs.features[k])
        at = np.append(course.temperatures[k + 1], inputs.boundaries[k])
        still = np.stack([course.temperatures[k + 1]] * 2)
        sources = source_heat(network, Frame(0.5, inputs.features[k : k + 1], inputs.boundaries[k : k + 1]), still)[0]
        made = {source.node: watts for source, watts in zip(network.sources, sources, strict=True)}
        for flow, watts in zip(course.of, course.flows[k + 1], strict=True):
            if flow.other is None:
                assert watts == pytest.approx(made[flow.node], rel=1e-9)
            else:
                a, b = names.index(flow.node), names.index(flow.other)
                assert watts == pytest.approx(between[a, b] * (at[b] - at[a]), rel=1e-9, abs=1e-9)


def test_derivatives_are_those_of_the_equations(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(2)
    inputs: Frame = make_frame(network, 2, steps=1)
    form = constraints(network)
    amounts, around = form.laws.amounts(inputs.features)[0], inputs.boundaries[0]
    q = form.at(np.linspace(40.0, 90.0, len(network.nodes)), amounts, around)
    exact = form.derivatives(q, amounts, 3.0).toarray()

    def equations(form: Constraints, q: Floats) -> Floats:
        return np.concatenate([form.phi(q, amounts, around), form.gamma(q, 3.0 * q)])

    for j in range(form.size):
        step = 1e-4 * np.eye(form.size)[j]
        difference = (equations(form, q + step) - equations(form, q - step)) / 2e-4
        assert np.abs(exact[:, j] - difference).max() < 1e-5 * np.abs(exact).max(), j


def test_a_start_fulfils_the_constraints(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(3)
    inputs: Frame = make_frame(network, 3, steps=1)
    form = constraints(network)
    amounts, around = form.laws.amounts(inputs.features)[0], inputs.boundaries[0]
    q = form.at(np.linspace(40.0, 90.0, len(network.nodes)), amounts, around)
    assert np.abs(form.phi(q, amounts, around)).max() < 1e-12 * np.abs(q).max()


def test_what_cannot_be_run_is_refused(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(1)
    inputs: Frame = make_frame(network, 1)
    with pytest.raises(FrameError, match="initial of shape"):
        simulate_with_flows(network, inputs, np.zeros(3))
    runaway = Link("ambient", "n0", (Term(1e6, temperature=TemperatureFactor("n0", -1.0, 29.0)),))
    still = Frame(inputs.step_s, inputs.features, np.full_like(inputs.boundaries, 30.0))
    with pytest.raises(DivergedError, match="no temperatures at 0 s"):  # heat (T - 30)^2 MW has no balance
        simulate_with_flows(replace(network, links=(*network.links, runaway)), still, np.full(len(network.nodes), 40.0))
