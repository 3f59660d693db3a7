from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from random import Random

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from twin.compiled.kernel import compile_network
from twin.motor.features import Monomial, evaluate, is_known, monomial, monomials, product, scale
from twin.motor.network import Boundary, Link, Network, Node, Shape, Source, Term
from twin.run.simulate import Frame, simulate

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


FLAT = (0.0, 0.0, 0.0)
SHAPE = Shape((0.0, 0.25, 1.0), (0.2, -0.1, 0.3), (0.0, 0.4, -0.2))


def test_a_shape_multiplies_by_one_plus_its_deviations_at_the_knots_and_between() -> None:
    shaped = monomial(Term(1.0, {"speed": 2.0}, shape=SHAPE))
    plain = monomial(Term(1.0, {"speed": 2.0}))
    u = {"speed": np.array([0.0, 0.25, -0.625, 1.0, 0.625]), "current": np.array([0.5, 0.5, 0.5, -1.0, 0.0])}
    ratio = [1.2, 0.9 + 0.2, 1.1 + 0.05, 1.3 - 0.2, 1.1]
    square = evaluate((plain,), u, 5)[:, 0]
    np.testing.assert_allclose(evaluate((shaped,), u, 5)[:, 0], square * ratio, rtol=1e-15)
    constant = evaluate((Monomial((), SHAPE),), u, 5)[:, 0]
    np.testing.assert_allclose(constant, ratio, rtol=1e-15)


def test_a_shape_is_constant_beyond_its_ends() -> None:
    shape = Shape((0.25, 0.5), (0.1, 0.6), (0.0, 0.0))
    u = {"speed": np.array([0.0, 0.2, 0.25, 0.5, 0.7, 1.5])}
    np.testing.assert_allclose(evaluate((Monomial((), shape),), u, 6)[:, 0], [1.1, 1.1, 1.1, 1.6, 1.6, 1.6], rtol=1e-15)


@given(
    st.lists(st.floats(0.0, 2.0), min_size=2, max_size=7, unique=True),
    st.lists(st.floats(0.0, 2.5), min_size=1, max_size=20),
    st.randoms(use_true_random=False),
)
def test_a_shape_is_the_sum_of_tent_functions(knots: list[float], speeds: list[float], random: Random) -> None:
    knots = sorted({round(knot, 3) for knot in knots})
    assume(len(knots) > 1)
    factor = tuple(random.uniform(-0.5, 0.5) for _ in knots)
    u = {"speed": np.array(speeds)}
    tents = sum(f * np.interp(speeds, knots, np.eye(len(knots))[k]) for k, f in enumerate(factor))
    found = evaluate((Monomial((), Shape(tuple(knots), factor, (0.0,) * len(knots))),), u, len(speeds))[:, 0]
    np.testing.assert_allclose(found, 1 + tents, rtol=1e-12)


def test_a_shape_asks_for_speed_and_only_with_a_slope_for_current() -> None:
    assert Monomial((("torque", 1.0),), SHAPE).features == ("torque", "speed", "current")
    assert Monomial((("current", 1.0),), SHAPE).features == ("current", "speed")
    assert Monomial((), Shape((0.0, 1.0), (0.1, 0.0), (0.0, 0.0))).features == ("speed",)
    assert Monomial((("flow", 0.8),)).features == ("flow",)


def test_products_of_other_shapes_are_other_columns_with_other_names() -> None:
    other = Shape(SHAPE.speed, SHAPE.factor, (0.0, 0.4, -0.3))
    terms = [Term(1.0, {"speed": 1.6}, shape=shape) for shape in (None, SHAPE, other, SHAPE)]
    network = replace(NETWORK, links=(), sources=(Source("a", (*terms, Term(1.0, shape=SHAPE), Term(2.0))),))
    names = [m.name for m in monomials(network)]
    assert len(set(names)) == 4
    assert names[0] == "speed1.6"
    assert all(re.fullmatch(r"(speed1\.6|constant)\*shape[0-9a-f]{8}", name) for name in names[1:])
    assert {product(term).name for term in terms} == {"speed1.6"}


def test_equal_shapes_have_one_name_however_their_numbers_are_spelt() -> None:
    spelt = Shape((0, 0.25, 1), (0.2, -0.1, 0.3), (-0.0, 0.4, -0.2))
    assert monomial(Term(1.0, shape=spelt)).name == monomial(Term(1.0, shape=SHAPE)).name


def test_a_shape_that_changes_nothing_is_left_out() -> None:
    still = Shape((0.0, 0.5, 1.0), FLAT, FLAT)
    assert monomial(Term(1.0, {"current": 2.0}, shape=still)) == monomial(Term(1.0, {"current": 2.0}))


def test_a_shaped_loss_heats_as_its_coefficient_times_the_shape(plain: Callable[[str], Callable[..., None]]) -> None:
    steps, u = 50, {"speed": np.full(50, 0.25), "current": np.full(50, 0.5), "flow_jacket": np.ones(50)}
    shaped = (Term(40.0, shape=SHAPE), Term(10.0, {"speed": 1.0}, copper=True, shape=SHAPE))
    scaled = (Term(40.0 * 1.1), Term(10.0 * 1.1, {"speed": 1.0}, copper=True))
    runs = []
    for terms in (shaped, scaled):
        network = replace(NETWORK, sources=(Source("a", terms),))
        frame = Frame(1.0, evaluate(monomials(network), u, steps), np.full((steps, 1), 30.0))
        runs.append(simulate(compile_network(network, load=plain), frame, np.array([30.0, 30.0])))
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-12)
    assert runs[0][-1, 0] > 31.0
