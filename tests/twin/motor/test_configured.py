"""The same motor on another rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.laws import OIL
from twin.compiled.structure import described
from twin.errors import BadNameError, ConfigurationError, CutOffError, DuplicateError, NetworkError, UnknownNodeError
from twin.motor.check import check
from twin.motor.configured import configured, restored
from twin.motor.network import (
    Boundary,
    Configuration,
    FluidCircuit,
    Link,
    Network,
    Node,
    Source,
    TemperatureFactor,
    Term,
)

STATOR = Configuration(
    "stator_in_air",
    remove=("magnet", "jacket_1"),
    links=(Link("air", "yoke", (Term(3.0, law="free_convection"),)), Link("yoke", "winding", (Term(9.0),))),
    sources=(Source("yoke", (Term(5.0),)),),
)
MOTOR = Network(
    "motor",
    tuple(Node(name, 100.0 * (i + 1), "other")
        for i, name in enumerate(("winding", "yoke", "magnet", "jacket_1", "jacket_2"))),
    (Boundary("coolant"), Boundary("air")),
    (
        Link("winding", "yoke", (Term(12.0),)),
        Link("yoke", "magnet", (Term(2.0, {"speed": 0.5}),)),
        Link("yoke", "jacket_1", (Term(20.0),)),
        Link("yoke", "jacket_2", (Term(21.0),)),
    ),
    (Source("winding", (Term(100.0, {"current": 2.0}),)), Source("magnet", (Term(7.0),)), Source("yoke", (Term(4.0),))),
    scale={"speed": 1000.0, "current": 10.0, "flow": 5.0},
    circuits=(FluidCircuit("jacket", "coolant", ("jacket_1", "jacket_2"), OIL),),
    configurations=(STATOR, Configuration("dry", ("jacket_1", "jacket_2"), (Link("yoke", "air", (Term(1.0),)),))),
)  # fmt: skip


def test_what_is_removed_takes_its_links_losses_and_fluid_along() -> None:
    check(MOTOR)
    found = configured(MOTOR, "stator_in_air")
    assert [node.name for node in found.nodes] == ["winding", "yoke", "jacket_2"]
    assert [(link.a, link.b, link.terms[0].coefficient) for link in found.links] == [
        ("yoke", "winding", 9.0),
        ("yoke", "jacket_2", 21.0),
        ("air", "yoke", 3.0),
    ]
    assert [(source.node, source.terms[0].coefficient) for source in found.sources] == [
        ("winding", 100.0),
        ("yoke", 5.0),
    ]
    assert [circuit.nodes for circuit in found.circuits] == [("jacket_2",)]
    assert [boundary.name for boundary in found.boundaries] == ["coolant", "air"]
    assert found.configurations == ()


def test_every_other_coefficient_is_that_of_the_motor() -> None:
    found = configured(replace(MOTOR, nodes=(Node("winding", 123.0, "copper"), *MOTOR.nodes[1:])), "dry")
    assert found.links[:2] == MOTOR.links[:2]
    assert found.sources == MOTOR.sources
    np.testing.assert_array_equal(described(found)[1].capacities, [123.0, 200.0, 300.0])


def test_boundaries_and_circuits_that_nothing_touches_are_left_out() -> None:
    dry = configured(MOTOR, "dry")
    assert [boundary.name for boundary in dry.boundaries] == ["air"]
    assert dry.circuits == ()
    whole = configured(MOTOR, None)
    assert [boundary.name for boundary in whole.boundaries] == ["coolant"]
    measured = replace(MOTOR, boundaries=(*MOTOR.boundaries, Boundary("cell")))
    assert [boundary.name for boundary in configured(measured, None).boundaries] == ["coolant", "cell"]
    assert (whole.links, whole.circuits) == (MOTOR.links, MOTOR.circuits)


def test_a_motor_without_configurations_is_itself() -> None:
    plain = replace(MOTOR, configurations=())
    assert configured(plain, None) == plain


def test_a_version_of_the_whole_motor_gets_back_what_only_configurations_have() -> None:
    whole = configured(MOTOR, None)
    new = replace(whole, links=(Link("winding", "yoke", (Term(13.0),)), *whole.links[1:]))
    found = restored(MOTOR, new)
    assert found == replace(MOTOR, links=new.links)
    assert restored(MOTOR, whole) == MOTOR


def test_an_unknown_configuration_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigurationError, match=r'^motor "motor" has no .*"wet": known are stator_in_air, dry$'):
        configured(MOTOR, "wet")
    with pytest.raises(ConfigurationError, match="it has none: add"):
        configured(replace(MOTOR, configurations=()), "wet")


FOLLOWS = Link("winding", "yoke", (Term(1.0, temperature=TemperatureFactor("magnet", 0.1, 20.0)),))
REFUSED: dict[str, tuple[Configuration, type[NetworkError], str]] = {
    "name": (Configuration("Dry"), BadNameError, 'configuration "Dry": a name begins with a-z'),
    "unknown": (Configuration("x", ("magnt",)), UnknownNodeError,
        'remove: there is no node or boundary "magnt": did you mean "magnet"'),
    "twice": (Configuration("x", ("magnet", "magnet")), DuplicateError, 'remove: "magnet" stands there twice'),
    "cut off": (Configuration("x", ("jacket_1", "jacket_2")), CutOffError,
        'configuration "x": node "winding": no path of links'),
    "link to what is gone": (
        Configuration("x", ("magnet",), (Link("magnet", "yoke", (Term(1.0),)),)),
        UnknownNodeError,
        'configuration "x": link "magnet-yoke": there is no node or boundary "magnet"',
    ),
    "goes with what is gone": (
        Configuration("x", ("magnet",), (FOLLOWS,)),
        UnknownNodeError,
        'link "winding-yoke": term 1: temperature: there is no node "magnet"',
    ),
    "again": (Configuration("x", (), (FOLLOWS, Link("yoke", "winding", (Term(1.0),)))), DuplicateError,
        "two of its links are of winding-yoke"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_configuration_that_is_no_motor_is_refused(case: str) -> None:
    one, kind, says = REFUSED[case]
    with pytest.raises(kind, match=says):
        check(replace(MOTOR, configurations=(one,)))


def test_two_configurations_have_two_names() -> None:
    with pytest.raises(DuplicateError, match='configuration "dry": this name is already taken'):
        check(replace(MOTOR, configurations=(MOTOR.configurations[1],) * 2))
