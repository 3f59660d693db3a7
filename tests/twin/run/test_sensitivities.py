from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.laws import law_frame, with_laws
from twin.compiled.kernel import Compiled, compile_indexed, compile_network
from twin.errors import FrameError
from twin.motor.network import Network, Source, Term
from twin.run.sensitivities import columns, grams
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
Load = Callable[[str], Callable[..., None]]
Make = Callable[..., Network]
Case = tuple[Compiled, Frame, Floats]

STEPS, BLOCK = 20, 5


@pytest.fixture(scope="module", params=[0, 3])
def case(request: pytest.FixtureRequest, make_network: Make, plain: Load) -> Case:
    """A network with every law."""
    network = with_laws(make_network(request.param, n=3), request.param)
    inputs = law_frame(network, request.param, STEPS, 2.0)
    return compile_network(network, load=plain), inputs, np.linspace(35, 90, len(network.nodes))


def _means(compiled: Compiled, inputs: Frame, start: Floats) -> Floats:
    edges = simulate(compiled, inputs, start)
    found: Floats = (0.5 * (edges[1:] + edges[:-1])).reshape(-1, BLOCK, edges.shape[1]).mean(axis=1)
    return found


def test_columns_are_the_derivatives_of_the_run_by_every_parameter(case: Case) -> None:
    compiled, inputs, start = case
    values, n = compiled.parameters, len(start)
    found = columns(compiled, inputs, simulate(compiled, inputs, start), BLOCK)
    sizes = len(values.coefficients), n, n
    assert found.shape == (STEPS // BLOCK, n, sum(sizes))

    def moved(which: int, place: int, change: float) -> Floats:
        arrays = [values.coefficients.copy(), values.capacities.copy(), start.copy()]
        arrays[which][place] *= 1 + change
        own = replace(values, coefficients=arrays[0], capacities=arrays[1])
        return _means(replace(compiled, parameters=own), inputs, arrays[2])

    for which, size in enumerate(sizes):
        at = (values.coefficients, values.capacities, start)[which]
        for place in range(size):
            step = 2e-5  # so short that no knot of a table is passed
            near, far = (moved(which, place, h) - moved(which, place, -h) for h in (step, 2 * step))
            expected = (8 * near - far) / (12 * step * at[place])
            column = found[:, :, sum(sizes[:which]) + place]
            np.testing.assert_allclose(column, expected, rtol=1e-5, atol=2e-6 * float(np.abs(expected).max()))


def test_some_columns_are_those_of_all(case: Case) -> None:
    compiled, inputs, start = case
    temperatures = simulate(compiled, inputs, start)
    wanted = (4, 0, len(compiled.parameters.coefficients) + 1)
    every, some = (columns(compiled, inputs, temperatures, BLOCK, own) for own in (None, wanted))
    np.testing.assert_allclose(some, every[:, :, list(wanted)], rtol=1e-6)


def test_grams_are_the_sums_of_products_of_columns(case: Case) -> None:
    compiled, inputs, start = case
    temperatures = simulate(compiled, inputs, start)
    rows = columns(compiled, inputs, temperatures, BLOCK).astype(np.float64)
    expected = np.einsum("bip,biq->ipq", rows, rows)
    found = grams(compiled, inputs, temperatures, BLOCK)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * float(expected.max()))


def test_a_candidate_is_a_term_whose_coefficient_is_put_to_zero(case: Case, plain: Load) -> None:
    compiled, inputs, start = case
    network = compiled.network
    node = next(n.name for n in network.nodes if n.name not in {source.node for source in network.sources})

    more = compile_network(replace(network, sources=(*network.sources, Source(node, (Term(1.0),)))), load=plain)
    place = len(more.parameters.coefficients) - 1 - sum(len(circuit.nodes) for circuit in network.circuits)

    def with_heat(watts: float) -> Compiled:
        coefficients = more.parameters.coefficients.copy()
        coefficients[place] = watts
        return replace(more, parameters=replace(more.parameters, coefficients=coefficients))

    without = with_heat(0.0)
    np.testing.assert_array_equal(simulate(without, inputs, start), simulate(compiled, inputs, start))
    column = columns(without, inputs, simulate(without, inputs, start), BLOCK, [place])[:, :, 0]
    brought = (_means(with_heat(1e-3), inputs, start) - _means(with_heat(-1e-3), inputs, start)) / 2e-3
    assert np.abs(brought).max() > 0
    np.testing.assert_allclose(column, brought, rtol=1e-4, atol=1e-5 * float(np.abs(brought).max()))


def test_steps_behind_the_last_whole_block_do_not_count(case: Case) -> None:
    compiled, inputs, start = case
    temperatures = simulate(compiled, inputs, start)
    assert columns(compiled, inputs, temperatures, 8, [0]).shape == (2, len(start), 1)
    assert columns(compiled, inputs, temperatures, STEPS + 1, [0]).shape == (0, len(start), 1)


def test_a_network_of_the_index_form_has_no_columns(make_network: Make, plain: Load) -> None:
    network = make_network(0, n=3)
    with pytest.raises(FrameError, match="3 nodes has no kernel for columns"):
        columns(compile_indexed(network, load=plain), law_frame(network, 0, 4, 1.0), np.zeros((5, 3)), 2)


def test_compiled_columns_are_vector_instructions_and_agree_with_plain_numbers(make_network: Make, plain: Load) -> None:
    """Were the loop over the columns no longer made into vectors, nothing else would tell."""
    network = make_network(1, n=5)
    alone, compiled = compile_network(network, load=plain), compile_network(network)
    assert compiled.columns is not None
    places = tuple(range(len(compiled.parameters.coefficients) + 2 * 5))
    kernel = compiled.columns(places)
    (signature,) = kernel.signatures  # type: ignore[attr-defined]
    made = re.findall(r"= fmul contract (?:<(\d+) x )?float", kernel.inspect_llvm(signature))  # type: ignore[attr-defined]
    assert sum(int(width or 1) >= 4 for width in made) > 0.9 * len(made) > 50
    inputs, start = law_frame(network, 1, STEPS, 2.0), np.linspace(35.0, 90.0, 5)
    temperatures = simulate(alone, inputs, start)
    ours, theirs = (columns(one, inputs, temperatures, BLOCK) for one in (compiled, alone))
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-6 * float(np.abs(theirs).max()))
