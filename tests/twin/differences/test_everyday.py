"""What a healthy motor may do: each difference once, with a prior, moving something, and nothing that is already
there."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import CHANNELS, every_law, pulses, recorded
from twin.differences.everyday import (
    alike_links,
    alike_sources,
    both_sides,
    everyday,
    largest_conductance,
    mean_conductances,
    mean_loss_W,
    of_test,
)
from twin.fitting import actions
from twin.fitting.actions import Parameter, Scale
from twin.fitting.model import Model, Test
from twin.motor import sensor_laws
from twin.motor.features import Monomial, monomial, terms
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.paths import missing, terms_of

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
BUSES = {"W_1": "can1", "Y_1": "can2", "R_1": "can2"}
NODES = ("winding", "yoke", "magnet", "case")


@pytest.fixture(scope="module")
def tests() -> list[Test]:
    more = (Monomial((("current", 2.0),)),)
    return [recorded(every_law(), pulses(400.0, seed=i), INITIAL, buses=BUSES, more=more) for i in range(2)]


@pytest.fixture(scope="module")
def found(tests: list[Test]) -> tuple[Parameter, ...]:
    return everyday(every_law(), tests)


def test_every_difference_is_said_once_and_has_a_prior(found: tuple[Parameter, ...]) -> None:
    assert max(Counter((p.name, p.test) for p in found).values()) == 1
    assert max(Counter((p.action, p.test) for p in found).values()) == 1
    for p in found:
        assert 0 < p.sd < np.inf, p.name
        assert p.low <= 0 <= p.high, p.name
        assert p.low < p.high, p.name


def test_every_difference_moves_a_reading(found: tuple[Parameter, ...], tests: list[Test]) -> None:
    model = Model(every_law(), tests, found)
    moved = np.zeros(len(found))
    for part in model.linearise(np.zeros(len(found))):
        np.maximum.at(moved, part.at, np.abs(part.columns).max(axis=0))
    assert np.isfinite(moved).all()
    still = [p.name for p, most in zip(found, moved, strict=True) if most * p.sd < 1e-9]
    assert still == []


def test_every_term_and_every_capacity_may_differ(found: tuple[Parameter, ...]) -> None:
    every = list(terms(every_law()))
    scaled = {p.action.terms: p.sd for p in found if isinstance(p.action, actions.Scale)}
    assert {terms for terms in scaled if len(terms) > 1} == set(), "no two of these places are alike"
    for i, term in enumerate(every):
        assert scaled[(i,)] == term.sd
    nodes = {p.action.nodes for p in found if isinstance(p.action, actions.Capacity)}
    assert nodes >= {(i,) for i in range(4)}


def test_a_path_is_missing_only_where_there_is_none(found: tuple[Parameter, ...]) -> None:
    linked = {frozenset((link.a, link.b)) for link in every_law().links}
    pairs = missing(every_law())
    assert len(pairs) == len({frozenset(pair) for pair in pairs})
    for a, b in pairs:
        assert frozenset((a, b)) not in linked
        assert a in NODES, "a boundary comes last, and two of them never meet"
    assert ("winding", "magnet") in pairs, "both touch the yoke"
    assert ("magnet", "ambient") in pairs


def test_a_test_brings_its_own_starts_biases_and_boundaries(tests: list[Test]) -> None:
    own = list(of_test(every_law(), tests[1], 1))
    assert {p.test for p in own} == {1}
    counted = Counter(type(p.action) for p in own)
    assert counted[actions.Start] == 4
    assert counted[sensor_laws.Bias] == len(CHANNELS)
    assert counted[actions.BoundaryBias] == 2
    starts = [p for p in own if isinstance(p.action, actions.Start)]
    assert [p.action for p in starts] == [actions.Start(i) for i in range(4)]
    assert all(p.sd >= sd for p, sd in zip(starts, tests[1].initial_sd, strict=True))


def test_what_all_tests_share_is_there_once_however_many_they_are(
    found: tuple[Parameter, ...], tests: list[Test]
) -> None:
    more = everyday(every_law(), [*tests, tests[0]])
    assert [p.name for p in more if p.test is None] == [p.name for p in found if p.test is None]
    assert sum(p.test == 2 for p in more) == sum(p.test == 0 for p in more) > 0


def test_a_clock_is_of_one_bus(found: tuple[Parameter, ...]) -> None:
    clocks = {p.action.channels for p in found if isinstance(p.action, actions.Late)}
    assert clocks == {("W_1",), ("Y_1", "R_1")}


def test_terms_are_found_by_their_place() -> None:
    links, sources = terms_of(every_law())
    every = list(terms(every_law()))
    for link in every_law().links:
        assert tuple(every[i] for i in links[link.a, link.b]) == link.terms
    for source in every_law().sources:
        assert tuple(every[i] for i in sources[source.node]) == source.terms
    assert sorted(i for own in (*links.values(), *sources.values()) for i in own) == list(range(len(every)))


def test_means_over_the_tests_weigh_every_step_alike(tests: list[Test]) -> None:
    short = replace(tests[1], frame=replace(tests[1].frame, features=tests[1].frame.features[:50]))
    u = {f: np.concatenate([tests[0].features[f], tests[1].features[f][:50]]) for f in ("speed", "flow")}
    conductances = mean_conductances(every_law(), [tests[0], short])
    assert conductances["winding", "yoke"] == 12.0
    named = np.concatenate([tests[0].features["flow0.8"], tests[1].features["flow0.8"][:50]])
    assert conductances["yoke", "coolant"] == pytest.approx(15 + 10 * named.mean())
    assert conductances["yoke", "coolant"] == pytest.approx(15 + 10 * (u["flow"] ** 0.8).mean(), rel=1e-3)
    largest = largest_conductance(every_law(), [tests[0], short])
    assert largest["winding"] == 12.0
    assert largest["yoke"] == largest["coolant"] == conductances["yoke", "coolant"]
    total = sum(
        term.coefficient
        * np.concatenate([t.features[monomial(term).name] for t in tests])[: len(tests[0].frame.features) + 50].mean()
        for source in every_law().sources
        for term in source.terms
    )
    assert mean_loss_W(every_law(), [tests[0], short]) == pytest.approx(total)


def two_sided() -> Network:
    """Both ends of a winding alike, but for a second law of one of them."""
    ends = ("end_a", "end_b")
    return Network(
        name="two-sided",
        nodes=(Node("winding", 500.0, "copper"), *(Node(end, 200.0, "copper") for end in ends)),
        boundaries=(Boundary("air_a"), Boundary("air_b"), Boundary("coolant")),
        links=(
            *(Link("winding", end, (Term(5.0),)) for end in ends),
            *(Link(end, f"air_{end[-1]}", (Term(1.0), Term(2.0, {"speed": 0.7}))) for end in ends),
            Link("winding", "coolant", (Term(50.0, {"flow": 0.8}),)),
        ),
        sources=(
            Source("winding", (Term(900.0, {"current": 2.0}, copper=True),)),
            Source("end_a", (Term(300.0, {"current": 2.0}, copper=True),)),
            Source("end_b", (Term(300.0, {"current": 2.0}, copper=True), Term(20.0, {"current": 1.0}))),
        ),
    )


def test_both_sides_of_a_motor_are_off_together_where_their_laws_are_of_one_form() -> None:
    assert alike_links(two_sided()) == {
        "winding-end": (("winding", "end_a"), ("winding", "end_b")),
        "end-air": (("end_a", "air_a"), ("end_b", "air_b")),
        "winding-coolant": (("winding", "coolant"),),
    }
    assert alike_sources(two_sided()) == {"end": ("end_a", "end_b"), "winding": ("winding",)}
    assert _together(two_sided()) == {
        "conductance.winding-end.both0": [Term(5.0)] * 2,
        "conductance.end-air.both0": [Term(1.0)] * 2,
        "conductance.end-air.both1": [Term(2.0, {"speed": 0.7})] * 2,
        "loss.end.both0": [Term(300.0, {"current": 2.0}, copper=True)] * 2,
    }


def test_a_law_that_one_side_has_more_leaves_the_others_together() -> None:
    more = Link("end_a", "air_a", (Term(2.0, {"speed": 0.7}), Term(0.5, {"flow": 0.5}), Term(1.0)))
    links = tuple(more if link.a == "end_a" else link for link in two_sided().links)
    network = replace(two_sided(), links=links)
    together = [own for name, own in _together(network).items() if name.startswith("conductance.end-air")]
    assert together == [[Term(2.0, {"speed": 0.7})] * 2, [Term(1.0)] * 2]


def _together(network: Network) -> dict[str, list[Term]]:
    """The terms that one factor of both sides moves."""
    laws = list(terms(network))
    return {p.name: [laws[i] for i in p.action.terms] for p in both_sides(network) if isinstance(p.action, Scale)}
