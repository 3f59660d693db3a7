from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from twin.compiled.kernel import Compiled, compile_network
from twin.errors import DivergedError, FrameError
from twin.motor.network import Boundary, Link, Network, Node, Source, TemperatureFactor, Term
from twin.run.simulate import Frame, simulate, source_heat

Load = Callable[[str], Callable[..., None]]

BAR = Network(
    name="bar",
    nodes=(Node("winding", 100.0, "copper"), Node("yoke", 300.0, "iron")),
    boundaries=(Boundary("coolant"),),
    links=(Link("winding", "yoke", (Term(4.0),)), Link("yoke", "coolant", (Term(2.0), Term(6.0, {"speed": 1.0})))),
    sources=(
        Source("winding", (Term(80.0, {"current": 2.0}, copper=True), Term(30.0, {"current": 2.0}, resistance=-1))),
        Source("yoke", (Term(50.0, {"speed": 1.0}, temperature=TemperatureFactor("winding", -0.002, 20.0)),)),
    ),
    scale={"speed": 1000.0, "current": 100.0},
)


@pytest.fixture(scope="module")
def bar(plain: Load) -> Compiled:
    return compile_network(BAR, load=plain)


def _frame(steps: int, speed: float = 0.5, current: float = 1.0, step_s: float = 1.0) -> Frame:
    return Frame(step_s, np.tile([speed, current**2], (steps, 1)), np.full((steps, 1), 30.0))


def test_without_losses_everything_comes_to_the_coolant(bar: Compiled) -> None:
    T = simulate(bar, _frame(4000, speed=0.0, current=0.0), np.array([90.0, 60.0]))
    np.testing.assert_allclose(T[-1], 30.0, atol=1e-6)
    np.testing.assert_array_equal(T[0], [90.0, 60.0])


def test_at_steady_state_the_losses_leave_through_the_coolant(bar: Compiled) -> None:
    inputs = _frame(4000)
    T = simulate(bar, inputs, np.array([30.0, 30.0]))
    to_coolant = (2.0 + 6.0 * 0.5) * (T[-1, 1] - 30.0)
    assert source_heat(BAR, inputs, T)[-1].sum() == pytest.approx(to_coolant, rel=1e-9)


def test_the_heat_of_each_source_follows_its_factors(bar: Compiled) -> None:
    inputs = _frame(1)
    heat = source_heat(BAR, inputs, np.array([[110.0, 50.0], [130.0, 50.0]]))  # mean of the winding: 120
    x = 1 + 0.00393 * 100.0
    np.testing.assert_allclose(heat, [[80 * x + 30 / x, 50 * 0.5 * (1 - 0.002 * 100.0)]])


def test_a_run_is_the_chain_of_its_parts(bar: Compiled) -> None:
    start = np.array([30.0, 40.0])
    whole, first = simulate(bar, _frame(60), start), simulate(bar, _frame(25), start)
    np.testing.assert_array_equal(simulate(bar, _frame(35), first[-1]), whole[25:])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"features": np.zeros((5, 3))}, 'features of shape (5, 3) do not fit network "bar": give (5, 2)'),
        ({"boundaries": np.zeros((4, 1))}, "boundaries of shape (4, 1) do not fit"),
        ({"boundaries": np.array([[1.0], [2.0], [np.nan], [1.0], [1.0]])}, "boundaries are not finite first at (2, 0)"),
        ({"step_s": 0.0}, "step_s 0 is not above 0"),
    ],
)
def test_a_frame_that_does_not_fit_is_refused(bar: Compiled, change: dict[str, object], says: str) -> None:
    with pytest.raises(FrameError) as caught:
        simulate(bar, replace(_frame(5), **change), np.array([30.0, 30.0]))  # type: ignore[arg-type]
    assert says in str(caught.value)


def test_initial_temperatures_of_another_motor_are_refused(bar: Compiled) -> None:
    with pytest.raises(FrameError, match=r"initial of shape \(3,\) do not fit"):
        simulate(bar, _frame(5), np.zeros(3))


def test_a_thermal_runaway_is_named_by_node_and_time(plain: Load) -> None:
    hot = Source("winding", (Term(5000.0, {"current": 2.0}, copper=True),))
    runaway = compile_network(replace(BAR, sources=(hot,)), load=plain)
    with (
        np.errstate(all="ignore"),
        pytest.raises(DivergedError, match=r'node "winding" leaves the finite numbers at \d+ s'),
    ):
        simulate(runaway, Frame(1.0, np.tile([0.5, 9.0], (5000, 1)), np.full((5000, 1), 30.0)), np.array([30.0, 30.0]))
