from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from twin.calibration.calibrate import freedom
from twin.calibration.uncertainty import sd_K
from twin.compiled.kernel import STATEMENTS, compile_indexed, generate, statements
from twin.errors import BadValueError, DuplicateError, UnknownNodeError
from twin.fitting.model import Test
from twin.motor.check import check
from twin.motor.configured import configured
from twin.motor.features import evaluate, monomials
from twin.motor.network import (
    Boundary,
    Configuration,
    Fluid,
    FluidCircuit,
    Link,
    Network,
    Property,
    Source,
    TemperatureFactor,
    Term,
)
from twin.motor.slicing import MATERIAL, sliced
from twin.run.simulate import Frame, simulate

REFERENCE = EXAMPLES / "reference_motor" / "motor.toml"
CUT = ("jacket", "yoke", "teeth", "winding_a", "winding_b", "rotor_core", "rotor_surface", "magnet")


@pytest.fixture(scope="module")
def reference() -> Network:
    return read_motor(REFERENCE.read_bytes(), "motor.toml")


def _stem(name: str) -> str:
    """The node of a slice: its name without the number."""
    head, _, tail = name.rpartition("_")
    return head if tail.isdigit() else name


def _sums(network: Network) -> tuple[dict[str, float], dict[str, list[float]], dict[frozenset[str], list[float]]]:
    """Capacities, losses and conductances by the nodes that slices come from, term by term."""
    capacities: dict[str, float] = {}
    for node in network.nodes:
        capacities[_stem(node.name)] = capacities.get(_stem(node.name), 0.0) + node.capacity
    losses: dict[str, list[float]] = {}
    for source in network.sources:
        old = losses.setdefault(_stem(source.node), [0.0] * len(source.terms))
        losses[_stem(source.node)] = [a + t.coefficient for a, t in zip(old, source.terms, strict=True)]
    links: dict[frozenset[str], list[float]] = {}
    for link in network.links:
        key = frozenset((_stem(link.a), _stem(link.b)))
        if len(key) == 2:
            old = links.setdefault(key, [0.0] * len(link.terms))
            links[key] = [a + t.coefficient for a, t in zip(old, link.terms, strict=True)]
    return capacities, losses, links


def test_the_sums_of_a_sliced_motor_are_those_of_the_lumped_one(reference: Network) -> None:
    cut = sliced(reference, CUT, 12, 0.13)
    check(cut)
    assert len(cut.nodes) == 13 + 12 * 7
    halves = frozenset(("winding_a", "winding_b"))
    found, wanted = _sums(cut), _sums(reference)
    assert found[0] == pytest.approx(wanted[0])
    assert found[1].keys() == wanted[1].keys() and found[2].keys() == wanted[2].keys()
    for node, losses in wanted[1].items():
        assert found[1][node] == pytest.approx(losses), node
    for ends in wanted[2].keys() - {halves}:
        assert found[2][ends] == pytest.approx(wanted[2][ends]), ends


def test_the_parts_touch_slice_by_slice_and_the_ends_at_their_end(reference: Network) -> None:
    cut = sliced(reference, CUT, 8, 0.13)
    pairs = {frozenset((link.a, link.b)) for link in cut.links}
    assert frozenset(("teeth_1", "yoke_1")) in pairs and frozenset(("teeth_1", "yoke_2")) not in pairs
    assert frozenset(("winding_a_1", "teeth_1")) in pairs
    assert frozenset(("winding_b_1", "teeth")) in pairs, "side b begins in the middle of the stack"
    assert frozenset(("winding_a_1", "endwinding_a_inner")) in pairs
    assert frozenset(("winding_b_4", "endwinding_b_inner")) in pairs
    assert {pair for pair in pairs if {"air_a"} & pair and any("teeth" in n for n in pair)} == {
        frozenset(("air_a", "teeth_1"))
    }
    assert sum("coolant" in pair for pair in pairs) == 8
    assert frozenset(("winding_a_4", "winding_b_1")) in pairs, "the two halves are one row of copper"


def test_the_middle_slice_keeps_the_name_so_that_a_bench_file_stays_valid(reference: Network) -> None:
    cut = sliced(reference, CUT, 4, 0.13)
    assert {node.name for node in reference.nodes} <= {node.name for node in cut.nodes}
    assert [node.name for node in cut.nodes if node.name.startswith("teeth")] == [
        "teeth_1",
        "teeth_2",
        "teeth",
        "teeth_4",
    ]


def test_conduction_along_a_row_is_that_of_its_metal(reference: Network) -> None:
    cut = sliced(reference, CUT, 8, 0.13)
    along = next(link for link in cut.links if {link.a, link.b} == {"teeth_1", "teeth_2"})
    area = 2000.0 / MATERIAL["iron"][1] / 0.13
    assert along.terms[0].coefficient == pytest.approx(4.0 * area / (0.13 / 8))
    copper = next(link for link in cut.links if {link.a, link.b} == {"winding_a_1", "winding_a_2"})
    assert copper.terms[0].coefficient == pytest.approx(14.4 * 8 / 2), "14.4 W/K over half the stack in the file"


def _sd(values: Iterable[tuple[float, float]]) -> float:
    """Of the sum of independent (value, sd of its logarithm), as a share of the sum."""
    known = list(values)
    return float(np.sqrt(sum((value * sd) ** 2 for value, sd in known)) / sum(value for value, _ in known))


def test_cutting_says_nothing_new_of_a_value(reference: Network) -> None:
    """Sums of slices are known as well as the part's own capacity, losses and conductances."""
    cut = sliced(reference, CUT, 12, 0.13)
    for node in reference.nodes:
        assert _sd((n.capacity, n.sd) for n in cut.nodes if _stem(n.name) == node.name) == pytest.approx(
            node.sd, rel=5e-3
        ), node.name
    for source in reference.sources:
        same = [one.terms for one in cut.sources if _stem(one.node) == source.node]
        for term, slices in zip(source.terms, zip(*same, strict=True), strict=True):
            assert _sd((t.coefficient, t.sd) for t in slices) == pytest.approx(term.sd, rel=5e-3), source.node
    for link in reference.links:
        if {link.a, link.b} != {"winding_a", "winding_b"}:
            same = [one.terms for one in cut.links if {_stem(one.a), _stem(one.b)} == {link.a, link.b}]
            for term, slices in zip(link.terms, zip(*same, strict=True), strict=True):
                assert _sd((t.coefficient, t.sd) for t in slices) == pytest.approx(term.sd, rel=5e-3), link


@pytest.mark.parametrize(("row", "own"), [(("winding_a", "winding_b"), 0.1), (("teeth",), 0.4)])
def test_the_way_along_a_part_is_known_as_well_as_its_own_number(
    reference: Network, row: tuple[str, ...], own: float
) -> None:
    """As many resistances in series as lie between the middles of two halves, or along all of a part."""
    cut = sliced(reference, CUT, 12, 0.13)
    along = [one.terms[0] for one in cut.links if {_stem(one.a), _stem(one.b)} <= set(row)]
    assert len(along) == 11
    assert _sd((1 / t.coefficient, t.sd) for t in (along + along)[: 12 // len(row)]) == pytest.approx(own, rel=5e-3)


def _hot_spot_sd(network: Network, node: str) -> float:
    """[K], 20 min into a drive at half current, by the priors of the network alone."""
    steps = 600
    u = {"speed": np.full(steps, 0.4), "current": np.full(steps, 0.5), "flow": np.ones(steps)}
    frame = Frame(2.0, evaluate(monomials(network), u, steps), np.tile([65.0, 25.0], (steps, 1)))
    start = np.full(len(network.nodes), 65.0)
    test = Test("drive", "s1", frame, {}, {}, start, np.full(len(start), 1e-3), channels=())
    covariance = np.diag([parameter.sd**2 for parameter in freedom(network, ())])
    return sd_K(network, test, [(node, 1199.0)], covariance)[0]


@pytest.mark.parametrize("slices", [2, 8])
def test_a_sliced_motor_is_no_surer_of_its_hot_spot_than_the_lumped_one(reference: Network, slices: int) -> None:
    lumped = _hot_spot_sd(reference, "winding_a")
    assert 0.95 * lumped < _hot_spot_sd(sliced(reference, CUT, slices, 0.13), "winding_a") < 1.2 * lumped


def test_a_temperature_factor_follows_the_slice_at_its_place(reference: Network) -> None:
    factor = TemperatureFactor("teeth", -0.001, 20.0)
    sources = tuple(
        replace(s, terms=tuple(replace(t, temperature=factor) for t in s.terms))
        if s.node in ("yoke", "shaft", "bearing_a")
        else s
        for s in reference.sources
    )
    cut = sliced(replace(reference, sources=sources), CUT, 4, 0.13)
    followed = {s.node: s.terms[0].temperature.node for s in cut.sources if s.terms[0].temperature}
    assert followed == {
        "yoke_1": "teeth_1",
        "yoke_2": "teeth_2",
        "yoke": "teeth",
        "yoke_4": "teeth_4",
        "bearing_a": "teeth",
    }


def test_a_network_of_several_hundred_nodes_runs_by_the_index_program_and_agrees_in_the_mean(
    reference: Network,
) -> None:
    cut = sliced(reference, CUT, 40, 0.13)
    assert len(cut.nodes) == 293
    assert statements(generate(cut)) > STATEMENTS
    steps = 720
    u = {"speed": np.full(steps, 0.4), "current": np.full(steps, 0.5), "flow": np.ones(steps)}
    runs = {}
    for network in (reference, cut):
        frame = Frame(5.0, evaluate(monomials(network), u, steps), np.tile([65.0, 25.0], (steps, 1)))
        temperatures = simulate(compile_indexed(network), frame, np.full(len(network.nodes), 65.0))[-1]
        runs[network.name] = dict(zip((n.name for n in network.nodes), temperatures, strict=True))
    lumped, profile = runs.values()
    for name in ("teeth", "yoke", "magnet", "housing", "bearing_a"):
        mean = np.mean([t for n, t in profile.items() if _stem(n) == name])
        assert mean == pytest.approx(lumped[name], abs=1.5), name
    winding = [t for n, t in profile.items() if _stem(n) in ("winding_a", "winding_b")]
    assert max(winding) - min(winding) > 2.0, "the ends are hotter than the middle of the stack"


def test_a_node_that_a_circuit_flows_through_stays_whole(reference: Network) -> None:
    water = Fluid(Property((20.0,), (1050.0,)), Property((20.0,), (3500.0,)))
    wet = replace(reference, circuits=(FluidCircuit("channel", "coolant", ("jacket",), water),))
    assert sliced(wet, ["teeth"], 4, 0.13).circuits == wet.circuits
    with pytest.raises(
        BadValueError, match=r'^node "jacket": the fluid of circuit channel flows through it: leave it whole$'
    ):
        sliced(wet, CUT, 4, 0.13)


def test_what_cannot_be_cut_is_refused_with_what_to_do(reference: Network) -> None:
    with pytest.raises(
        UnknownNodeError, match=r'^node "yok": reference-150kW has no such node: did you mean "yoke"\?$'
    ):
        sliced(reference, ["teeth", "yok"], 4, 0.13)
    with pytest.raises(UnknownNodeError, match=r'^node "x": reference-150kW has no such node: known are shaft,'):
        sliced(reference, ["x"], 4, 0.13)
    with pytest.raises(DuplicateError, match="name it once"):
        sliced(reference, ["teeth", "teeth"], 4, 0.13)
    with pytest.raises(
        BadValueError, match=r'node "air_a": of region fluid conducts nothing along the shaft: leave it whole'
    ):
        sliced(reference, ["air_a"], 4, 0.13)
    with pytest.raises(BadValueError, match="5 slices cannot be shared out: give 2 or more, an even number"):
        sliced(reference, CUT, 5, 0.13)
    with pytest.raises(BadValueError, match=r"1 slices cannot be shared out: give 2 or more$"):
        sliced(reference, ["teeth"], 1, 0.13)
    with pytest.raises(BadValueError, match="a stack of 0 m has no length"):
        sliced(reference, ["teeth"], 4, 0.0)


def test_a_configuration_is_sliced_as_its_own_network_would_be(reference: Network) -> None:
    stator = Configuration(
        "stator_in_air",
        remove=("rotor_core", "rotor_surface", "magnet", "shaft", "jacket", "coolant"),
        links=(
            Link("yoke", "ambient", (Term(4.0, law="free_convection"),)),
            Link("winding_b", "winding_a", (Term(7.0),)),
            Link("teeth", "winding_a", (Term(30.0, temperature=TemperatureFactor("yoke", 0.001, 20.0)),)),
            Link("endwinding_a_inner", "bench", (Term(1.0),)),
        ),
        sources=(Source("yoke", (Term(12.0),)),),
    )
    gone = {*stator.remove, *(n.name for n in reference.nodes if n.name.startswith(("bearing", "shield", "housing")))}
    stator = replace(stator, remove=tuple(sorted(gone)))
    motor = replace(reference, boundaries=(*reference.boundaries, Boundary("bench")), configurations=(stator,))
    check(motor)
    cut = sliced(motor, CUT, 8, 0.13)
    check(cut)
    left = [name for name in CUT if name not in gone]
    found, wanted = configured(cut, stator.name), sliced(configured(motor, stator.name), left, 8, 0.13)
    assert {node.name: node for node in found.nodes} == {node.name: node for node in wanted.nodes}
    assert len(found.nodes) > 8
    for some in ("links", "sources"):
        places = [
            {frozenset((one.a, one.b)) if isinstance(one, Link) else one.node: one.terms for one in getattr(net, some)}
            for net in (found, wanted)
        ]
        assert places[0] == places[1]
    assert found.boundaries == wanted.boundaries
    assert found.circuits == wanted.circuits
