from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from replay.engine.files.network_text import network_text
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.motor.features import evaluate, monomials
from twin.motor.network import (
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
from twin.motor.slicing import sliced
from twin.run.reduction import FullRun, Reduced, reductions
from twin.run.simulate import Frame, simulate


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


REFERENCE = EXAMPLES / "reference_motor"
CUT = ("yoke", "teeth", "winding_a", "winding_b", "rotor_core", "rotor_surface", "magnet")
MEASURED = ("teeth", "yoke", "winding_a", "magnet")


def _curve(full: Network, steps: int) -> tuple[Reduced, ...]:
    """Every size down to two nodes that nothing but their names keeps apart, by a run at half speed and current in
    steps of 5 s."""
    u = {"speed": np.full(steps, 0.5), "current": np.full(steps, 0.5), "flow": np.ones(steps)}
    frame = Frame(5.0, evaluate(monomials(full), u, steps), np.tile([65.0, 25.0], (steps, 1)))
    course = FullRun(frame, simulate(compile_indexed(full, load=load), frame, np.full(len(full.nodes), 65.0)))
    return reductions(full, [course], [], MEASURED, MEASURED, 2, lambda network: compile_indexed(network, load=load))


def test_every_size_of_a_reduction_can_be_written() -> None:
    """A merged node keeps the name of its measured member and gets the region of most of its capacity."""
    full = sliced(read_motor((REFERENCE / "motor.toml").read_bytes(), "motor.toml"), CUT, 4, 0.13)
    levels = _curve(full, 60)
    assert [len(level.groups) for level in levels] == list(range(len(full.nodes), 1, -1))
    for level in levels:
        found = read_motor(network_text(level.network, "x"), "merged.toml")
        assert [node.region for node in found.nodes] == [node.region for node in level.network.nodes]
        for source, wanted in zip(found.sources, level.network.sources, strict=True):
            assert [term.sd for term in source.terms] == pytest.approx([term.sd for term in wanted.terms])


def test_sizes_of_the_shipped_motor_of_several_hundred_nodes_can_be_written() -> None:
    levels = {
        len(level.groups): level for level in _curve(read_motor((REFERENCE / "sliced.toml").read_bytes(), "s"), 24)
    }
    for size in (22, 15, 13, 10, 8, 6):
        found = read_motor(network_text(levels[size].network, "x"), "merged.toml")
        assert [node.name for node in found.nodes] == list(levels[size].groups)
