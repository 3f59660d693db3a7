"""What a motor bears at a speed against the algebra of one with a single node, and the inputs at an operating point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.compiled.kernel import compile_network
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.run.envelope import Motor, border, temperatures
from twin.run.operating_map import OperatingMap

Floats = NDArray[np.float64]

COOLANT_DEGC, LIMIT_DEGC = 60.0, 180.0
G, C, P = 5.0, 400.0, 1000.0  # W/K, J/K, W at full current
SD = 0.1


def _network(copper: bool = False) -> Network:
    return Network(
        name="lump",
        nodes=(Node("winding", C, "copper"),),
        boundaries=(Boundary("coolant"),),
        links=(Link("winding", "coolant", (Term(G),)),),
        sources=(Source("winding", (Term(P, {"current": 2.0}, copper=copper),)),),
        scale={"current": 100.0},
    )


def _motor(copper: bool = False, covariance: Floats | None = None) -> Motor:
    return Motor(
        compile_network(_network(copper)),
        np.array([LIMIT_DEGC]),
        np.array([COOLANT_DEGC]),
        np.zeros((3, 3)) if covariance is None else covariance,
    )


START = np.array([COOLANT_DEGC])


def _drive(load: float) -> Floats:
    return np.array([load**2])


def test_for_ever_it_bears_what_leaves_at_the_limit() -> None:
    found = border(_motor(), _drive, START, math.inf, 2.0)
    assert found.load == pytest.approx(math.sqrt(G * (LIMIT_DEGC - COOLANT_DEGC) / P), rel=2e-3)
    assert (found.node, found.headroom_K) == ("winding", 0.0)


@pytest.mark.parametrize("seconds", [10.0, 30.0, 60.0])
def test_for_some_seconds_it_bears_more(seconds: float) -> None:
    found = border(_motor(), _drive, START, seconds, 5.0)
    reached = 1 - math.exp(-seconds * G / C)
    assert found.load == pytest.approx(math.sqrt(G * (LIMIT_DEGC - COOLANT_DEGC) / (P * reached)), rel=2e-3)


def test_copper_that_heats_itself_runs_away_and_is_not_borne() -> None:
    """Steady where G rise = P x^2 (1 + alpha (T - 20)): beyond G = P x^2 alpha there is no steady state."""
    alpha = 0.00393
    motor = _motor(copper=True)
    assert np.isinf(temperatures(motor, _drive(1.2), START, math.inf)).all()
    expected = math.sqrt(G * (LIMIT_DEGC - COOLANT_DEGC) / (P * (1 + alpha * (LIMIT_DEGC - 20.0))))
    assert border(motor, _drive, START, math.inf, 2.0).load == pytest.approx(expected, rel=2e-3)


def test_the_band_is_what_is_not_known_of_conductance_and_loss() -> None:
    """x ~ sqrt(G / P): a tenth of either moves it by a twentieth, both independent."""
    found = border(_motor(covariance=np.diag([SD**2, SD**2, 0.0])), _drive, START, math.inf, 2.0)
    expected = 1.96 * found.load * math.hypot(SD, SD) / 2
    assert found.high - found.load == pytest.approx(expected, rel=0.03)
    assert found.load - found.low == pytest.approx(expected, rel=0.03)


def test_a_capacity_matters_for_seconds_only() -> None:
    motor = _motor(covariance=np.diag([0.0, 0.0, SD**2]))
    steady, short = border(motor, _drive, START, math.inf, 2.0), border(motor, _drive, START, 30.0, 5.0)
    assert steady.high == pytest.approx(steady.load, rel=1e-3)
    assert short.high > 1.02 * short.load


def test_where_the_most_recorded_load_is_borne_the_headroom_is_said() -> None:
    found = border(_motor(), _drive, START, math.inf, 0.5)
    assert found.load == 0.5
    assert found.node is None
    assert found.headroom_K == pytest.approx(LIMIT_DEGC - COOLANT_DEGC - P * 0.25 / G, abs=0.01)
    unsure = border(_motor(covariance=np.diag([SD**2, 36 * SD**2, 0.0])), _drive, START, math.inf, 0.75)
    assert unsure.node is None
    assert unsure.low < unsure.load == unsure.high


def test_what_is_over_its_limit_at_rest_bears_nothing() -> None:
    assert border(_motor(), _drive, np.array([250.0]), 10.0, 2.0).load == 0.0


def test_inputs_at_a_point_are_those_of_the_steps_around_it() -> None:
    rng = np.random.default_rng(1)
    speed, load = rng.uniform(0, 12000, 4000), rng.uniform(0, 200, 4000)
    found = OperatingMap(speed, load, {"current": 2.5 * load, "flux": 1 - speed / 24000})
    at = found.inputs(6000.0, 100.0)
    assert at["current"] == pytest.approx(250.0, rel=0.01)
    assert at["flux"] == pytest.approx(0.75, rel=0.01)


def test_the_most_load_is_the_largest_recorded_near_a_speed() -> None:
    speed = np.tile(np.linspace(0, 12000, 61), 20)
    load = np.repeat(np.linspace(0, 1, 20), 61) * np.interp(speed, [0, 6000, 12000], [200.0, 200.0, 50.0])
    found = OperatingMap(speed, load, {"current": load})
    assert found.most_load(3000.0) == pytest.approx(200.0)
    assert found.most_load(12000.0) < 80.0
    most = found.most_load(9000.0)
    assert found.inputs(9000.0, most)["current"] == pytest.approx(most, rel=0.05)


def test_a_step_with_an_unknown_input_says_nothing() -> None:
    speed, load = np.array([0.0, 1.0, 1.0]), np.array([0.0, 1.0, 9.0])
    assert OperatingMap(speed, load, {"current": np.array([0.0, 1.0, np.nan])}).top_load == 1.0
