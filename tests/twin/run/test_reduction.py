from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from twin.compiled.kernel import compile_indexed
from twin.motor.check import check
from twin.motor.configured import configured, restored
from twin.motor.features import evaluate, monomial, monomials
from twin.motor.merging import merged, merged_configurations
from twin.motor.network import (
    Boundary,
    Configuration,
    Fluid,
    FluidCircuit,
    Link,
    Network,
    Node,
    Property,
    Source,
    TemperatureFactor,
    Term,
)
from twin.motor.slicing import sliced
from twin.run.initial import conductances
from twin.run.reduction import LEADING, RUN_BELOW, Error, FullRun, Reduced, _State, _Work, reductions, smallest
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

REFERENCE = EXAMPLES / "reference_motor" / "motor.toml"
CUT = ("jacket", "yoke", "teeth", "winding_a", "winding_b", "rotor_core", "rotor_surface", "magnet")
STEP_S = 5.0


def _course(network: Network, seed: int, minutes: int = 60) -> FullRun:
    """Loads that jump every two minutes, from a motor at coolant temperature."""
    rng = np.random.default_rng(seed)
    steps = round(minutes * 60 / STEP_S)
    held = round(120 / STEP_S)
    u = {name: np.repeat(rng.uniform(0.1, 0.6, steps // held + 1), held)[:steps] for name in ("speed", "current")}
    u["flow"] = np.ones(steps)
    around = np.tile([65.0, 25.0][: len(network.boundaries)], (steps, 1))
    frame = Frame(STEP_S, evaluate(monomials(network), u, steps), around)
    return FullRun(frame, simulate(compile_indexed(network), frame, np.full(len(network.nodes), 65.0)))


def _for(network: Network, full: Network, frame: Frame) -> Frame:
    """The inputs of the full network for one that uses fewer products of features."""
    columns = [monomials(full).index(monomial) for monomial in monomials(network)]
    return replace(frame, features=np.ascontiguousarray(frame.features[:, columns]))


def _small(conductance: float) -> Network:
    """Two copper lumps joined by `conductance`, iron with a loss that follows the second, coolant."""
    follows = TemperatureFactor("winding_b", -0.001, 20.0)
    return Network(
        name="small",
        nodes=(
            Node("winding_a", 300.0, "copper", 0.1, 180.0),
            Node("winding_b", 100.0, "copper", 0.2, 155.0),
            Node("iron", 2000.0, "iron"),
        ),
        boundaries=(Boundary("coolant"),),
        links=(
            Link("winding_a", "winding_b", (Term(conductance),)),
            Link("winding_a", "iron", (Term(10.0, sd=0.2), Term(2.0, {"flow": 0.8}))),
            Link("iron", "winding_b", (Term(5.0, sd=0.4),)),
            Link("iron", "coolant", (Term(20.0),)),
        ),
        sources=(
            Source("winding_a", (Term(400.0, {"current": 2.0}, copper=True),)),
            Source("winding_b", (Term(100.0, {"current": 2.0}, copper=True), Term(20.0, {"speed": 1.0}))),
            Source("iron", (Term(50.0, {"speed": 1.5}, temperature=follows),)),
        ),
        scale={"speed": 1000.0, "current": 100.0, "flow": 10.0},
    )


def test_merging_two_nodes_that_an_infinite_conductance_joins_changes_nothing() -> None:
    full = _small(1e9)
    course = _course(full, 1)
    (_, reduced) = reductions(full, [course], [course], ["winding_a", "iron"], [], 2, compile_indexed)
    assert [set(group) for group in reduced.groups.values()] == [{"winding_a", "winding_b"}, {"iron"}]
    assert reduced.trained.largest_K < 1e-5
    assert np.ptp(course.temperatures[:, 0]) > 20, "the test moves the motor"


@cache
def _cut() -> tuple[Network, Network, FullRun, FullRun]:
    reference = read_motor(REFERENCE.read_bytes(), "motor.toml")
    full = sliced(reference, CUT, 8, 0.13)
    return reference, full, _course(full, 1), _course(full, 2, 20)


INTEREST = (
    "teeth",
    "yoke",
    "winding_a",
    "winding_b",
    "endwinding_a_outer",
    "endwinding_b_outer",
    "magnet",
    "rotor_surface",
)


def _error_of_the_lumped_motor(reference: Network, full: Network, course: FullRun, interest: Sequence[str]) -> float:
    """Root mean square [K] of the reference's own 21 nodes against the sliced run."""
    run = simulate(compile_indexed(reference), _for(reference, full, course.frame), np.full(21, 65.0))
    names, sliced_names = ([node.name for node in network.nodes] for network in (reference, full))
    off = [run[:, names.index(n)] - course.temperatures[:, sliced_names.index(n)] for n in interest]
    return float(np.sqrt(np.mean(np.square(off))))


def test_a_sliced_motor_reduces_back_to_the_error_of_the_lumped_one() -> None:
    reference, full, course, kept = _cut()
    assert len(full.nodes) > RUN_BELOW
    levels = reductions(full, [course], [kept], INTEREST, INTEREST, 15, compile_indexed)
    at_21 = next(level for level in levels if len(level.groups) == 21)
    own = _error_of_the_lumped_motor(reference, full, course, INTEREST)
    print(f"21 nodes: {at_21.trained.rms_K:.3f} K, the reference's own {own:.3f} K")
    assert at_21.trained.rms_K < 1.1 * own
    assert at_21.kept is not None and at_21.kept.rms_K < 1.2 * _error_of_the_lumped_motor(
        reference, full, kept, INTEREST
    )
    for level in levels:
        assert sorted(n for group in level.groups.values() for n in group) == sorted(node.name for node in full.nodes)
        assert all(len(set(group) & set(INTEREST)) <= 1 for group in level.groups.values()), "those apart stay apart"
        assert set(INTEREST) <= set(level.groups), "and keep their names"
        assert sum(node.capacity for node in level.network.nodes) == pytest.approx(sum(n.capacity for n in full.nodes))
        check(level.network)


def test_the_estimate_ranks_pairs_as_their_runs_do() -> None:
    """Of the reference's coupled pairs, the one that the estimate puts first is among the best three of all runs."""
    reference, _, _, _ = _cut()
    course = _course(reference, 3, 30)
    levels = reductions(reference, [course], [], INTEREST, INTEREST, 20, compile_indexed)
    best = levels[-1].trained.rms_K
    errors = []
    for link in reference.links:
        if link.b not in ("coolant", "ambient") and not {link.a, link.b} <= set(INTEREST):
            network = merged(reference, {link.a: (link.a, link.b)})
            where = {n: next((k for k, v in {link.a: (link.a, link.b)}.items() if n in v), n) for n in INTEREST}
            names = [node.name for node in network.nodes]
            run = simulate(compile_indexed(network), _for(network, reference, course.frame), np.full(20, 65.0))
            full = [node.name for node in reference.nodes]
            off = [run[:, names.index(where[n])] - course.temperatures[:, full.index(n)] for n in INTEREST]
            errors.append(float(np.sqrt(np.mean(np.square(off)))))
    assert best <= sorted(errors)[2] * 1.001


def _steady(network: Network, speed: float, current: float) -> FullRun:
    """Half an hour at one load."""
    steps = round(1800 / STEP_S)
    u = {"speed": np.full(steps, speed), "current": np.full(steps, current), "flow": np.ones(steps)}
    frame = Frame(STEP_S, evaluate(monomials(network), u, steps), np.tile([65.0, 25.0], (steps, 1)))
    return FullRun(frame, simulate(compile_indexed(network), frame, np.full(len(network.nodes), 65.0)))


def test_kept_courses_decide_which_of_the_leading_pairs_is_merged() -> None:
    reference, _, _, _ = _cut()
    slow, fast = _steady(reference, 0.3, 0.5), _steady(reference, 1.0, 0.05)
    work = _Work(reference, [slow], [fast], INTEREST, INTEREST, compile_indexed)
    start = _State(reference, tuple((i,) for i in range(len(reference.nodes))))
    options = [work.joined(start, [pair]) for pair in work.pairs(start)[:LEADING]]
    trained, kept = ([work.error(one, [course]).rms_K for one in options] for course in (slow, fast))
    assert np.argmin(trained) != np.argmin(kept), "the test has something to decide"
    (_, chosen) = reductions(reference, [slow], [fast], INTEREST, INTEREST, 20, compile_indexed)
    assert chosen.kept is not None and chosen.kept.rms_K == pytest.approx(min(kept))
    (_, alone) = reductions(reference, [slow], [], INTEREST, INTEREST, 20, compile_indexed)
    assert alone.kept is None and alone.trained.rms_K == pytest.approx(min(trained))


def _level(nodes: int, trained_K: float, kept_K: float | None) -> Reduced:
    errors = [None if mean is None else Error(mean, mean, mean, "teeth") for mean in (trained_K, kept_K)]
    assert errors[0] is not None
    return Reduced(_small(1.0), {f"n{i}": (f"n{i}",) for i in range(nodes)}, errors[0], errors[1])


def test_the_smallest_network_is_the_one_of_fewest_nodes_that_the_kept_courses_allow() -> None:
    levels = [_level(9, 0.0, 0.0), _level(5, 0.1, 0.4), _level(4, 0.2, 0.6), _level(3, 0.3, 0.5), _level(2, 0.4, 0.9)]
    found = smallest(levels, 0.5)
    assert found is levels[3]
    assert smallest([replace(level, kept=None) for level in levels], 0.25) == replace(levels[2], kept=None)
    assert smallest(levels, 0.3) is None, "the full network is no smaller one"


def test_the_estimate_is_exact_for_a_linear_network_at_rest() -> None:
    full = replace(_small(3.0), sources=(Source("winding_a", (Term(400.0),)), Source("winding_b", (Term(90.0),))))
    steps = 4000
    frame = Frame(60.0, evaluate(monomials(full), {"flow": np.ones(steps)}, steps), np.full((steps, 1), 65.0))
    settled = simulate(compile_indexed(full), frame, np.full(3, 65.0))[-1]
    short = replace(frame, features=frame.features[:20], boundaries=frame.boundaries[:20])
    course = FullRun(short, np.tile(settled, (21, 1)))
    names = ["winding_a", "winding_b", "iron"]
    work = _Work(full, [course], [], names, [], compile_indexed)
    state = _State(full, ((0,), (1,), (2,)))
    for first, second in ((0, 1), (0, 2), (1, 2)):
        (estimate,) = work.estimates(state, np.array([first]), np.array([second]))
        reduced = merged(full, {"both": (names[first], names[second])})
        run = simulate(compile_indexed(reduced), _for(reduced, full, frame), np.full(2, 65.0))[-1]
        place = [node.name for node in reduced.nodes]
        held = [run[place.index("both" if k in (first, second) else names[k])] for k in range(3)]
        assert estimate == pytest.approx(float(np.sqrt(np.mean(np.square(held - settled)))), rel=1e-6)
        assert estimate > 0.1


def test_nodes_that_stay_apart_are_merged_only_when_nothing_else_is_left() -> None:
    full = _small(1e9)
    course = _course(full, 1, 10)
    names = ["winding_a", "winding_b", "iron"]
    sizes = [list(level.groups) for level in reductions(full, [course], [], names, names[:2], 1, compile_indexed)]
    assert sizes[1] == ["winding_a", "winding_b"]
    assert sizes[2] == ["winding_a"]


def _cooled() -> Network:
    """A plate over three stations of a coolant channel."""
    fluid = Fluid(Property((20.0,), (1050.0,)), Property((20.0,), (3500.0,)))
    stations = ("water_1", "water_2", "water_3")
    return Network(
        name="cooled",
        nodes=(Node("plate", 500.0, "housing"), *(Node(name, 60.0, "fluid") for name in stations)),
        boundaries=(Boundary("inlet"),),
        links=tuple(Link("plate", name, (Term(30.0),)) for name in stations),
        sources=(Source("plate", (Term(800.0, {"current": 2.0}),)),),
        scale={"current": 100.0, "flow": 2.0},
        circuits=(FluidCircuit("channel", "inlet", stations, fluid),),
    )


def test_stations_of_a_circuit_merge_with_the_next_ones_only() -> None:
    full = _cooled()
    course = _course(full, 4, 10)
    levels = reductions(full, [course], [], ["plate"], [], 1, compile_indexed)
    assert [len(level.groups) for level in levels] == [4, 3, 2], "the plate and the fluid stay two"
    assert [len(level.network.circuits[0].nodes) for level in levels] == [3, 2, 1]
    for level in levels:
        check(level.network)
        assert set(level.network.circuits[0].nodes) < set(level.groups)


def test_merged_nodes_have_the_sums_of_their_members() -> None:
    network = merged(_small(7.0), {"winding": ("winding_a", "winding_b")})
    check(network)
    winding, iron = network.nodes
    assert (winding.name, winding.capacity, winding.limit_degC) == ("winding", 400.0, 155.0)
    assert winding.sd == pytest.approx(math.hypot(300 * 0.1, 100 * 0.2) / 400)
    assert [(link.a, link.b) for link in network.links] == [("winding", "iron"), ("iron", "coolant")]
    assert network.links[0].terms == (Term(15.0, sd=math.hypot(10 * 0.2, 5 * 0.4) / 15), Term(2.0, {"flow": 0.8}))
    assert network.sources[0].terms[0] == Term(500.0, {"current": 2.0}, sd=math.hypot(160.0, 40.0) / 500, copper=True)
    assert network.sources[0].terms[1] == Term(20.0, {"speed": 1.0})
    assert network.sources[1].terms[0].temperature == TemperatureFactor("winding", -0.001, 20.0)
    assert iron == _small(7.0).nodes[2]


def test_slices_that_are_merged_are_known_as_well_as_the_part_was() -> None:
    reference, full, _, _ = _cut()
    slices = [node.name for node in full.nodes if node.name.rstrip("0123456789_") == "teeth"]
    assert len(slices) == 8
    whole = merged(full, {"teeth": slices})
    before, after = ({node.name: node.sd for node in network.nodes} for network in (reference, whole))
    assert after["teeth"] == pytest.approx(before["teeth"], rel=5e-3)


def test_terms_that_cancel_are_left_out() -> None:
    full = _small(7.0)
    sources = (Source("winding_a", (Term(5.0),)), Source("winding_b", (Term(-5.0),)))
    assert merged(replace(full, sources=sources), {"winding": ("winding_a", "winding_b")}).sources == ()


def test_a_merged_station_drops_out_of_the_row_of_its_circuit() -> None:
    both = merged(_cooled(), {"water": ("water_1", "water_2")})
    assert both.circuits[0].nodes == ("water", "water_3")
    assert merged(both, {"water": ("water", "water_3")}).circuits[0].nodes == ("water",)


@pytest.mark.parametrize("seed", range(5))
def test_merging_is_the_sum_over_groups_of_capacities_conductances_and_losses(
    make_network: Callable[..., Network], seed: int
) -> None:
    full = make_network(seed, 9)
    groups = {"n0": ("n0", "n3"), "n1": ("n1", "n4", "n7"), "late": ("n8", "n5")}
    small = merged(full, groups)
    check(small)
    new = {member: name for name, members in groups.items() for member in members}
    member = np.array([[new.get(name, name) == other for other in small.names] for name in full.names], dtype=float)
    rng = np.random.default_rng(seed)
    phi = dict(zip(monomials(full), rng.random(len(monomials(full))).tolist(), strict=True))
    G, g = (conductances(net, np.array([phi[m] for m in monomials(net)])) for net in (full, small))
    expected = member.T @ G @ member
    np.testing.assert_allclose(g, expected - np.diag(np.diag(expected)), rtol=1e-12, atol=1e-12)
    assert [n.capacity for n in small.nodes] == pytest.approx([n.capacity for n in full.nodes] @ member[:9, :5])

    def heat(net: Network) -> float:
        return float(sum(t.coefficient * phi.get(monomial(t), 1.0) for s in net.sources for t in s.terms))

    assert heat(small) == pytest.approx(heat(full))


RIGS = (
    Configuration("dry", ("coolant",), (Link("iron", "air", (Term(2.0),)), Link("iron", "winding_b", (Term(6.0),)))),
    Configuration("hot", (), (), (Source("winding_b", (Term(9.0),)), Source("iron", (Term(3.0),)))),
    Configuration("half", ("winding_b",), (), (Source("iron", (Term(3.0),)),)),
    Configuration("iron_alone", ("winding_a", "winding_b"), (), (Source("iron", (Term(3.0),)),)),
)


def _rigged() -> Network:
    small = _small(7.0)
    return replace(small, boundaries=(*small.boundaries, Boundary("air")), configurations=RIGS)


def _by_place(network: Network) -> tuple[dict[frozenset[str], tuple[Term, ...]], dict[str, tuple[Term, ...]]]:
    links = {frozenset((link.a, link.b)): link.terms for link in network.links}
    return links, {source.node: source.terms for source in network.sources}


def test_configurations_of_a_merged_motor_are_what_their_own_networks_merge_to() -> None:
    motor, groups = _rigged(), {"winding": ("winding_a", "winding_b"), "iron": ("iron",)}
    check(motor)
    rigs = merged_configurations(motor, groups)
    assert [rig.name for rig in rigs] == ["dry", "hot", "iron_alone"], "half a winding is no node of the merged motor"
    small = restored(replace(motor, configurations=rigs), merged(configured(motor, None), groups))
    check(small)
    assert [boundary.name for boundary in small.boundaries] == ["coolant", "air"]
    for rig in rigs:
        there = {node.name for node in configured(motor, rig.name).nodes}
        left = {name: members for name, members in groups.items() if there & set(members)}
        found, wanted = configured(small, rig.name), merged(configured(motor, rig.name), left)
        assert found.nodes == wanted.nodes
        assert found.boundaries == wanted.boundaries
        assert _by_place(found) == _by_place(wanted)
    assert rigs[1].links == ()  # nothing is said twice
    assert merged_configurations(replace(motor, configurations=()), groups) == ()


def test_a_configuration_in_which_a_loss_cancels_has_no_merged_version() -> None:
    cancels = Configuration("cancels", (), (), (Source("iron", (Term(5.0),)), Source("winding_a", (Term(-5.0),))))
    motor = replace(_small(7.0), configurations=(cancels,))
    other = tuple(source for source in motor.sources if source.node != "winding_b")
    assert merged_configurations(replace(motor, sources=other), {"all": ("winding_a", "iron")}) == ()
