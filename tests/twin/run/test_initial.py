from __future__ import annotations

import numpy as np
import pytest

from twin.motor.network import Boundary, Link, Network, Node, Term
from twin.run.initial import conductances, steady_interpolation, time_constants

CHAIN = Network(
    name="chain",
    nodes=tuple(Node(name, 100.0, "other") for name in ("a", "b", "c", "d", "rotor")),
    boundaries=(Boundary("coolant"),),
    links=(
        Link("coolant", "a", (Term(2.0),)),
        Link("a", "b", (Term(2.0),)),
        Link("b", "c", (Term(1.0),)),
        Link("c", "d", (Term(1.0),)),
        Link("d", "rotor", (Term(3.0, {"speed": 0.8}),)),
    ),
    sources=(),
    scale={"speed": 1000.0},
)
COOLANT = np.array([20.0])


def test_measured_nodes_start_as_measured_and_others_between() -> None:
    T, _ = steady_interpolation(CHAIN, np.array([1.0]), COOLANT, {"c": (60.0, 0.5)})
    # 0.5 + 0.5 + 1 K/W from coolant to c
    np.testing.assert_allclose(T, [30.0, 40.0, 60.0, 60.0, 60.0])


def test_a_mixture_that_was_measured_starts_as_measured() -> None:
    weights = {"c": {"c": 0.75, "b": 0.25}}
    T, sd = steady_interpolation(CHAIN, np.array([1.0]), COOLANT, {"c": (60.0, 0.5)}, weights)
    # b half way between coolant and c: 0.75 c + 0.25 (c + 20) / 2 = 60
    np.testing.assert_allclose(T, [20 + (T[2] - 20) / 4, (T[2] + 20) / 2, 57.5 / 0.875, T[2], T[2]])
    assert sd[2] == 0.5


def test_the_prior_grows_with_the_distance_from_what_is_known() -> None:
    _, sd = steady_interpolation(CHAIN, np.array([1.0]), COOLANT, {})
    np.testing.assert_array_equal(sd, [2.0, 3.0, 4.0, 4.0, 4.0])
    _, sd = steady_interpolation(CHAIN, np.array([1.0]), COOLANT, {"a": (30.0, 0.1), "c": (60.0, 0.8)})
    np.testing.assert_array_equal(sd, [0.3, 2.0, 0.8, 2.0, 3.0])


def test_a_part_that_nothing_joins_at_standstill_starts_at_the_mean_of_what_is_known() -> None:
    T, sd = steady_interpolation(CHAIN, np.array([0.0]), COOLANT, {"c": (60.0, 0.5)})
    assert T[4] == pytest.approx(40.0)
    assert sd[4] == 3.0


def test_every_node_measured_needs_no_interpolation() -> None:
    measured = {node.name: (25.0 + i, 0.5) for i, node in enumerate(CHAIN.nodes)}
    T, sd = steady_interpolation(CHAIN, np.array([1.0]), COOLANT, measured)
    np.testing.assert_array_equal(T, [25, 26, 27, 28, 29])
    np.testing.assert_array_equal(sd, 0.5)


def test_time_constants_are_capacity_over_conductance() -> None:
    assert conductances(CHAIN, np.array([0.5]))[3, 4] == 1.5
    found = time_constants(CHAIN, np.array([0.0]))
    assert found["a"] == 25.0
    assert found["rotor"] == np.inf
