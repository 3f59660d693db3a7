from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.integrator import COOLANT_DEGC, frame, motor, s2
from twin.compiled import kernel
from twin.compiled.integrators import DEFAULT
from twin.compiled.kernel import compile_indexed, compile_network, generate, statements
from twin.motor.network import Network
from twin.run.simulate import Frame, simulate

Load = Callable[[str], Callable[..., None]]


@pytest.mark.parametrize("seed", range(12))
def test_both_forms_of_the_kernel_agree_on_random_networks(
    seed: int, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(seed, n=3 + seed, linear=seed % 3 == 0)
    inputs = make_frame(network, seed)
    start = np.linspace(20, 60, len(network.nodes))
    straight = simulate(compile_network(network, load=plain), inputs, start)
    general = simulate(compile_indexed(network, load=plain), inputs, start)
    np.testing.assert_allclose(straight, general, rtol=0, atol=1e-10)


def test_both_forms_agree_on_the_reference_motor(plain: Load) -> None:
    network = motor("reference_motor")
    inputs = frame(network, s2(), 2.0)
    start = np.full(len(network.nodes), COOLANT_DEGC)
    straight, general = compile_network(network, load=plain), compile_indexed(network)
    assert (straight.form, general.form) == ("straight-line", "indexed")
    np.testing.assert_allclose(simulate(straight, inputs, start), simulate(general, inputs, start), rtol=0, atol=1e-10)


def test_compiling_changes_nothing_and_a_run_repeats_to_the_bit(plain: Load) -> None:
    network = motor("hust_motor")
    inputs = frame(network, s2(), DEFAULT.step_s)
    start = np.full(len(network.nodes), COOLANT_DEGC)
    compiled = compile_network(network)
    first = simulate(compiled, inputs, start)
    np.testing.assert_array_equal(first, simulate(compiled, inputs, start))
    np.testing.assert_allclose(first, simulate(compile_network(network, load=plain), inputs, start), rtol=0, atol=1e-10)


def test_a_big_network_runs_as_the_index_program(make_network: Callable[..., Network], plain: Load) -> None:
    network = make_network(1, n=60)
    assert statements(generate(network)) > kernel.STATEMENTS
    assert compile_network(network, load=plain).form == "indexed"


def test_the_text_depends_on_topology_and_not_on_values(make_network: Callable[..., Network]) -> None:
    network = make_network(3)
    text = generate(network)
    other = replace(network, nodes=tuple(replace(node, capacity=2 * node.capacity) for node in network.nodes))
    assert generate(other) == text
    assert generate(replace(network, sources=network.sources[1:])) != text
