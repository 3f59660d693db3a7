from __future__ import annotations

import numpy as np

from twin.features import Monomial, evaluate, is_known, monomial, monomials, scale
from twin.network import Boundary, Link, Network, Node, Source, Term

NETWORK = Network(
    name="two",
    nodes=(Node("a", 100.0, "copper"), Node("b", 200.0, "iron")),
    boundaries=(Boundary("coolant"),),
    links=(
        Link("a", "b", (Term(1.0), Term(2.0, {"speed": 0.8}))),
        Link("b", "coolant", (Term(5.0, {"flow_jacket": 0.8}),)),
    ),
    sources=(
        Source("a", (Term(9.0, {"current": 2, "speed": 2.0}), Term(3.0, {"speed": 2, "current": 2, "torque": 0}))),
    ),
    scale={"speed": 1000.0, "current": 100.0, "flow": 8.0},
)


def test_a_monomial_is_named_like_the_law_of_a_cause() -> None:
    assert monomial(Term(1.0, {"current": 2.0, "speed": 2.0})).name == "speed2_current2"
    assert monomial(Term(1.0, {"flow": 0.8})).name == "flow0.8"
    assert monomial(Term(1.0, {"speed": 1})).name == "speed"
    assert monomial(Term(1.0, {"speed": 0.0})).name == "constant"


def test_products_are_distinct_in_order_of_first_use_without_the_constant() -> None:
    assert [m.name for m in monomials(NETWORK)] == ["speed0.8", "flow_jacket0.8", "speed2_current2"]


def test_features_are_magnitudes() -> None:
    odd = Monomial((("speed", 1.0), ("current_d", 1.5)))
    u = {"speed": np.array([-0.5, 0.5]), "current_d": np.array([-0.25, 0.25])}
    np.testing.assert_array_equal(evaluate((odd,), u, 2), [[0.0625], [0.0625]])


def test_at_standstill_a_power_of_speed_is_zero() -> None:
    assert evaluate((Monomial((("speed", 0.8),)),), {"speed": np.zeros(1)}, 1) == 0.0


def test_components_of_the_current_share_its_scale_and_hours_count_as_hours() -> None:
    assert scale(NETWORK, "current_d") == scale(NETWORK, "current_q") == 100.0
    assert scale(NETWORK, "flow_jacket") == 8.0
    assert scale(NETWORK, "hours_above_180degC") == 1.0


def test_only_features_of_the_file_format_are_known() -> None:
    assert all(map(is_known, ["speed", "flux", "flow_jacket", "hours_above_180degC", "hours_above_162.5degC"]))
    assert not any(map(is_known, ["sped", "flow_", "hours_above_degC", "Speed", "hours_above_180"]))
