"""Maps over speed and torque or current: bilinear, held at the edge, and weighed as part of a product of features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from twin.errors import BadValueError, FeatureError
from twin.motor import features
from twin.motor.check import check
from twin.motor.network import Boundary, Link, Map, Network, Node, Source, Term
from twin.run.simulate import Frame, source_heat

TABLE = Map(
    (0.0, 0.5, 1.0), (0.1, 0.4, 0.7, 1.0), ((0.0, 1.0, 4.0, 9.0), (5.0, 7.0, 9.0, 20.0), (30.0, 31.0, 40.0, 80.0))
)
NETWORK = Network(
    "mapped",
    (Node("iron", 100.0, "iron"),),
    (Boundary("coolant"),),
    (Link("iron", "coolant", (Term(2.0), Term(0.5, {"speed": 0.5}, shape=TABLE))),),
    (Source("iron", (Term(1.5, shape=TABLE), Term(3.0, {"current": 2.0}, shape=TABLE))),),
    scale={"speed": 8000.0, "torque": 50.0, "current": 20.0},
)


def test_a_map_is_bilinear_between_its_knots_and_takes_magnitudes() -> None:
    rng = np.random.default_rng(1)
    u = {"speed": rng.uniform(-1, 1, 200), "torque": rng.uniform(0.1, 1, 200) * rng.choice([-1, 1], 200)}
    expected = RegularGridInterpolator((TABLE.speed, TABLE.load), np.array(TABLE.values))(
        np.column_stack([np.abs(u["speed"]), np.abs(u["torque"])])
    )
    found = features.evaluate((features.Monomial((), TABLE),), u, 200)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_a_map_with_torques_below_0_tells_braking_from_driving() -> None:
    """Whichever way the motor turns: it brakes where its torque is against its speed."""
    both = Map((0.0, 1.0), (-1.0, 0.0, 1.0), ((0.0, 0.0, 0.0), (40.0, 0.0, 10.0)))
    u = {"speed": np.array([0.5, -0.5, 0.5, -0.5, 0.0]), "torque": np.array([0.5, -0.5, -0.5, 0.5, -0.5])}
    found = features.evaluate((features.Monomial((), both),), u, 5)[:, 0]
    assert found.tolist() == [2.5, 2.5, 10.0, 10.0, 0.0]
    assert features.beyond(both, {"speed": np.array([0.5, 0.5]), "torque": np.array([-1.1, 1.1])}).all()


def test_a_map_over_the_current_takes_its_magnitude() -> None:
    over = replace(TABLE, over="current")
    u = {"speed": np.array([0.5, -0.5]), "current": np.array([-0.4, 0.55]), "torque": np.array([9.0, 9.0])}
    found = features.evaluate((features.Monomial((), over),), u, 2)[:, 0]
    np.testing.assert_allclose(found, [7.0, 8.0])
    assert features.Monomial((), over).features == ("speed", "current")


def test_outside_a_map_its_edge_is_taken_and_can_be_said() -> None:
    u = {"speed": np.array([0.2, 1.2, 0.5, 0.5]), "torque": np.array([0.2, 0.4, 0.0, 1.5])}
    found = features.evaluate((features.Monomial((), TABLE),), u, 4)[:, 0]
    assert found[1:].tolist() == [31.0, 5.0, 20.0]
    assert features.beyond(TABLE, u).tolist() == [False, True, True, True]


def test_products_with_a_map_are_products_of_their_own() -> None:
    check(NETWORK)
    own = features.monomials(NETWORK)
    assert [m.features for m in own] == [("speed", "torque"), ("speed", "torque"), ("current", "speed", "torque")]
    assert own[0].name.startswith("speed0.5*map") and own[1].name.startswith("constant*map")
    assert len({m.name for m in own}) == 3
    other = replace(TABLE, values=(*TABLE.values[:2], (30.0, 31.0, 40.0, 80.5)))
    assert features.Monomial((), other).name != own[1].name
    assert features.product(NETWORK.sources[0].terms[0]).name == "constant"


def test_a_map_makes_the_heat_that_it_says() -> None:
    u = {"speed": np.array([0.25]), "torque": np.array([0.4]), "current": np.array([2.0])}
    frame = Frame(0.5, features.evaluate(features.monomials(NETWORK), u, 1), np.array([[30.0]]))
    heat = source_heat(NETWORK, frame, np.full((2, 1), 30.0))
    assert heat[0, 0] == pytest.approx((1.5 + 3.0 * 4.0) * (1.0 + 7.0) / 2)


REFUSED = {
    "one speed": (replace(TABLE, speed=(0.5,), values=(TABLE.values[0],)), BadValueError,
        "map has 1 speeds: give at least 2"),
    "falling": (replace(TABLE, load=(0.1, 0.4, 0.3, 1.0)), BadValueError, "its torques do not rise"),
    "braking current": (replace(TABLE, load=(-1.0, 0.4, 0.7, 1.0), over="current"), BadValueError,
        "its currents begin below 0: a current is a magnitude"),
    "turned back": (replace(TABLE, speed=(-0.5, 0.5, 1.0)), BadValueError, "its speeds begin below 0: a speed is a"),
    "rows": (replace(TABLE, values=TABLE.values[:2]), BadValueError, "map needs 3 rows of 4 values"),
    "columns": (replace(TABLE, values=((0.0, 1.0),) * 3), BadValueError, "map needs 3 rows of 4 values"),
    "cooling": (replace(TABLE, values=((-1.0,) * 4,) * 3), BadValueError,
        r'link "iron-coolant": .*a conductance is 0 or more'),
    "endless": (replace(TABLE, values=((float("inf"),) * 4,) * 3), BadValueError, "map holds inf"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_map_that_cannot_be_is_refused(case: str) -> None:
    table, kind, says = REFUSED[case]
    (link,) = NETWORK.links
    with pytest.raises(kind, match=says):
        check(replace(NETWORK, links=(replace(link, terms=(link.terms[0], Term(0.5, shape=table))),)))


def test_a_map_needs_scales_of_speed_and_torque() -> None:
    with pytest.raises(FeatureError, match='map: feature "torque" has no scale'):
        check(replace(NETWORK, scale={"speed": 8000.0, "current": 20.0}))


def test_a_loss_may_be_negative_in_a_map() -> None:
    (source,) = NETWORK.sources
    cooling = replace(TABLE, values=((-1.0,) * 4,) * 3)
    check(replace(NETWORK, sources=(replace(source, terms=(Term(1.0, shape=cooling),)),)))
