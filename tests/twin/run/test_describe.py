from __future__ import annotations

import math
from dataclasses import replace

import pytest

from benchmarks.integrator import motor
from made.laws import OIL
from twin.motor.network import (
    Boundary,
    Configuration,
    FluidCircuit,
    Link,
    Map,
    Network,
    Node,
    Shape,
    Source,
    Term,
)
from twin.run.describe import describe

LUMP = Network(
    name="lump",
    nodes=(Node("a", 100.0, "other"),),
    boundaries=(Boundary("coolant"),),
    links=(Link("a", "coolant", (Term(4.0, {"speed": 1.0}),)),),
    sources=(),
    scale={"speed": 1000.0},
)


def test_the_reference_motor_is_the_papers_size() -> None:
    found = describe(motor("reference_motor"))
    assert (found.nodes, found.sources) == (21, 13)
    assert 70 <= found.coefficients <= 81
    assert found.kernel == "straight-line"
    assert found.warnings == ()
    assert 1 < found.at_full_s[1] < found.at_full_s[0] < 3600
    assert "21 nodes, 2 boundaries" in found.text()


def test_time_constants_are_those_of_the_modes() -> None:
    found = describe(LUMP)
    assert found.at_full_s == pytest.approx((25.0, 25.0))
    assert found.at_rest_s == (math.inf, math.inf)
    assert "without end" in found.text()
    assert found.to_json()["at_rest_s"] == [None, None]


def test_one_is_not_plural_and_no_time_is_a_power_of_ten() -> None:
    slow = describe(replace(LUMP, nodes=(Node("a", 505_500.0, "other"),)))
    lines = slow.text().splitlines()
    assert lines[0] == "lump: 1 node, 1 boundary, 1 link, 0 sources"
    assert lines[1].endswith("1; with 1 capacity 2 unknowns")
    assert (
        lines[4] == "time constants without end to without end at rest, 126,000 s to 126,000 s with all features at 1"
    )


def test_a_summed_loss_below_zero_is_a_warning_with_place() -> None:
    loss = Source("a", (Term(10.0, {"speed": 1.0}), Term(-30.0, {"speed": 2.0})))
    (warning,) = describe(replace(LUMP, sources=(loss,))).warnings
    assert warning == 'the summed loss of "a" falls to -20 W at speed 1.0: a negative loss cools'


def test_negative_terms_whose_sum_stays_positive_are_no_warning() -> None:
    assert describe(motor("hust_motor")).warnings == ()


def test_a_shape_counts_in_features_and_in_the_sign_of_the_sum() -> None:
    shape = Shape((0.0, 0.5, 1.0), (0.0, 0.0, 0.5), (0.0, 0.0, 0.1))
    loss = Source("a", (Term(10.0), Term(-9.0, shape=shape)))
    assert describe(replace(LUMP, sources=(replace(loss, terms=(Term(10.0), Term(-9.0))),))).warnings == ()
    found = describe(replace(LUMP, sources=(loss,)))
    assert found.features == ("speed", "current")
    assert found.warnings == (
        'the summed loss of "a" falls to -4.4 W at current 1.0, speed 1.0: a negative loss cools',
    )


def test_circuits_laws_maps_and_configurations_are_said_in_words() -> None:
    table = Map((0.0, 1.0), (0.0, 2.0), ((0.0, 5.0), (20.0, 40.0)))
    network = replace(
        LUMP,
        nodes=(*LUMP.nodes, Node("oil_1", 50.0, "fluid")),
        links=(*LUMP.links, Link("a", "oil_1", (Term(2.0, law="free_convection"),))),
        sources=(Source("a", (Term(1.0, shape=table),)),),
        scale={"speed": 1000.0, "torque": 30.0, "flow": 6.0},
        circuits=(FluidCircuit("oil", "coolant", ("oil_1",), OIL, "flow_oil"),),
        configurations=(Configuration("dry", ("oil_1",)),),
    )
    found = describe(network)
    assert found.circuits == ("oil: coolant > oil_1, 170 W/K at 6 l/min of 20 degC",)
    assert found.laws == ("free_convection a-oil_1",)
    assert found.maps == ("a: 0 to 1000 rpm, 0 to 60 Nm",)
    assert found.configurations == ("dry: 1 node, 1 boundary, 1 link, 1 source, without oil_1",)
    assert found.features == ("speed", "torque", "flow_oil")
    assert found.text().splitlines()[6:] == [
        "circuit        oil: coolant > oil_1, 170 W/K at 6 l/min of 20 degC",
        "law            free_convection a-oil_1",
        "map            a: 0 to 1000 rpm, 0 to 60 Nm",
        "configuration  dry: 1 node, 1 boundary, 1 link, 1 source, without oil_1",
    ]


def test_fluid_that_flows_is_fast() -> None:
    cooled = replace(LUMP, links=(), scale={"flow": 6.0}, circuits=(FluidCircuit("oil", "coolant", ("a",), OIL),))
    assert describe(cooled).at_full_s == pytest.approx((100.0 / 170.0, 100.0 / 170.0))
    assert describe(cooled).at_rest_s == (math.inf, math.inf)


def test_a_map_that_falls_below_zero_is_a_warning() -> None:
    table = Map((0.0, 1.0), (0.0, 1.0), ((0.0, 5.0), (-20.0, 40.0)))
    both = replace(LUMP, sources=(Source("a", (Term(2.0, shape=table),)),), scale={"speed": 1000.0, "torque": 30.0})
    assert describe(both).warnings == (
        'the summed loss of "a" falls to -40 W at speed 1.0, torque 0.0: a negative loss cools',
    )
