from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from replay.engine.motor_file import read_motor
from replay.engine.network_text import network_text
from twin.network import (
    Boundary,
    Copper,
    Fluid,
    FluidCircuit,
    Link,
    Network,
    Node,
    Property,
    Shape,
    Source,
    TemperatureFactor,
    Term,
)

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", ["reference_motor", "hust_four_nodes"])
def test_a_network_written_and_read_is_itself(name: str) -> None:
    network = read_motor((EXAMPLES / name / "motor.toml").read_bytes(), "motor.toml")
    text = network_text(network, "Written by a test.")
    assert read_motor(text, "written.toml") == network
    assert text.decode().splitlines()[1] == "# Written by a test."


def test_every_kind_of_factor_is_written() -> None:
    fluid = Fluid(Property((20.0, 90.0), (1050.0, 1005.0)), Property((20.0,), (3500.0,)))
    shape = Shape((0.0, 0.5, 1.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.2))
    factor = TemperatureFactor("plate", -0.001, 20.0)
    network = Network(
        name="all",
        nodes=(Node("plate", 500.0, "housing", 0.2, 90.0), Node("water", 60.0, "fluid"), Node("lump", 9.0, "copper")),
        boundaries=(Boundary("inlet"),),
        links=(
            Link("plate", "water", (Term(30.0), Term(3.0, {"flow": 0.8}, sd=0.2))),
            Link("lump", "plate", (Term(1.5, law="radiation"),)),
        ),
        sources=(
            Source("plate", (Term(80.0, {"speed": 1.5}, sd=0.3, temperature=factor, shape=shape),)),
            Source("lump", (Term(9.0, {"current": 2.0}, sd=0.05, copper=True), Term(-2.0, {"speed": 1.0}, sd=0.4))),
        ),
        copper=Copper(0.0039, 25.0),
        scale={"speed": 6000.0, "current": 20.0, "flow": 8.0},
        circuits=(FluidCircuit("channel", "inlet", ("water",), fluid),),
    )
    assert read_motor(network_text(network, "x"), "all.toml") == network


def test_numbers_are_written_to_seven_digits() -> None:
    network = read_motor((EXAMPLES / "hust_motor" / "motor.toml").read_bytes(), "motor.toml")
    third = replace(network, nodes=(replace(network.nodes[0], capacity=1000 / 3), *network.nodes[1:]))
    assert b"capacity = 333.3333\n" in network_text(third, "x")
