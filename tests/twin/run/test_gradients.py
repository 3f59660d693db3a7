from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.laws import law_frame, with_laws
from twin.compiled.integrators import BDF2
from twin.compiled.kernel import Compiled, compile_indexed, compile_network
from twin.errors import FrameError
from twin.motor.network import Network
from twin.run.gradients import gradient
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
Load = Callable[[str], Callable[..., None]]
Make = Callable[..., Network]

STEPS = 24


@pytest.fixture(scope="module", params=range(4))
def case(request: pytest.FixtureRequest, make_network: Make, plain: Load) -> tuple[Compiled, Frame, Floats, Floats]:
    """A network with every law, inputs, a start, and weights of a number."""
    seed = request.param
    network = with_laws(make_network(seed, n=3 + seed), seed)
    n, rng = len(network.nodes), np.random.default_rng(seed)
    weights = rng.normal(size=(STEPS + 1, n)) * (rng.random((STEPS + 1, n)) < 0.2)
    return compile_network(network, load=plain), law_frame(network, seed, STEPS, 2.0), np.linspace(35, 90, n), weights


def _derivative(number: Callable[[float], float], at: float) -> float:
    """By four points, so that what is left out is of the fourth order."""
    step = 2e-5 * at  # so short that no knot of a table is passed
    two = number(at + 2 * step) - number(at - 2 * step)
    return (8 * (number(at + step) - number(at - step)) - two) / (12 * step)


def test_a_gradient_is_the_derivative_of_the_run_by_every_parameter(
    case: tuple[Compiled, Frame, Floats, Floats],
) -> None:
    compiled, inputs, start, weights = case
    values = compiled.parameters
    found = gradient(compiled, inputs, simulate(compiled, inputs, start), weights)

    def by(which: str, place: int) -> float:
        def number(value: float) -> float:
            arrays = {"coefficients": values.coefficients, "capacities": values.capacities, "initial": start}
            moved = arrays[which].copy()
            moved[place] = value
            own = values if which == "initial" else replace(values, **{which: moved})
            begins = moved if which == "initial" else start
            return float((weights * simulate(replace(compiled, parameters=own), inputs, begins)).sum())

        return _derivative(number, float((start if which == "initial" else getattr(values, which))[place]))

    for which, gradients in (
        ("coefficients", found.coefficients),
        ("capacities", found.capacities),
        ("initial", found.initial),
    ):
        expected = np.array([by(which, place) for place in range(len(gradients))])
        scale = np.abs(expected).max()
        assert scale > 0
        np.testing.assert_allclose(gradients, expected, rtol=1e-6, atol=1e-8 * scale)


def test_what_follows_the_last_weight_is_not_looked_at(case: tuple[Compiled, Frame, Floats, Floats]) -> None:
    compiled, inputs, start, weights = case
    early = np.concatenate([weights[:13], np.zeros_like(weights[13:])])
    temperatures = simulate(compiled, inputs, start)
    found = gradient(compiled, inputs, temperatures, early)
    temperatures[13:] = np.nan
    again = gradient(compiled, inputs, temperatures, early)
    assert found.coefficients.any()
    np.testing.assert_array_equal(again.coefficients, found.coefficients)
    np.testing.assert_array_equal(again.initial, found.initial)


def test_without_weights_there_is_no_gradient(case: tuple[Compiled, Frame, Floats, Floats]) -> None:
    compiled, inputs, start, weights = case
    found = gradient(compiled, inputs, simulate(compiled, inputs, start), 0 * weights)
    assert not found.coefficients.any()
    assert not found.initial.any()


@pytest.mark.parametrize("form", ["indexed", "bdf2"])
def test_a_network_of_the_index_form_or_another_method_has_no_gradient(
    form: str, make_network: Make, plain: Load
) -> None:
    network = make_network(0, n=3)
    compiled = compile_indexed(network, load=plain) if form == "indexed" else compile_network(network, BDF2, plain)
    with pytest.raises(FrameError, match="3 nodes has no kernel for gradients"):
        gradient(compiled, law_frame(network, 0, 3, 1.0), np.zeros((4, 3)), np.zeros((4, 3)))
