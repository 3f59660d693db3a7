"""Where a hot spot is: a node, and between the slices of a bar the highest point of its profile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from replay.engine.results.as_json import to_json
from replay.engine.results.hot_spots import hot_spots
from replay.engine.results.summary import HotSpot, SpotProfile
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.slicing import sliced

Floats = NDArray[np.float64]

LUMPED = Network(
    "m",
    (Node("magnet", 900.0, "magnet", limit_degC=150.0), Node("end_a", 300.0, "rotor"), Node("end_b", 300.0, "rotor")),
    (Boundary("air"),),
    (
        Link("magnet", "end_a", (Term(40.0),)),
        Link("magnet", "end_b", (Term(10.0),)),
        Link("end_a", "air", (Term(5.0),)),
        Link("end_b", "air", (Term(5.0),)),
    ),
    (Source("magnet", (Term(50.0),)),),
)
BAR = sliced(LUMPED, ["magnet"], 3, 0.12)
ROW = ["magnet_1", "magnet", "magnet_3"]


def a_bar(peak_at: float, peak_degC: float, falls: float) -> Floats:
    """(2, n): cold, then a bar whose temperature falls with the square of the distance [slices] from its hottest point;
    the middle slice is from -1/2 to 1/2."""
    edges = np.array([-1.5, -0.5, 0.5, 1.5]) - peak_at
    means = peak_degC - falls * np.diff(edges**3) / 3
    later = [means[ROW.index(node.name)] if node.name in ROW else 20.0 for node in BAR.nodes]
    return np.array([np.full(len(later), 20.0), later])


def profile(spot: HotSpot) -> SpotProfile:
    assert spot.profile is not None
    return spot.profile


@pytest.mark.parametrize(("peak_at", "towards"), [(0.31, "magnet_3"), (-0.2, "magnet_1"), (0.0, None)])
def test_the_hottest_place_of_a_bar_in_slices_is_that_of_the_bar(peak_at: float, towards: str | None) -> None:
    found = hot_spots(BAR, a_bar(peak_at, 140.0, 8.0), 0.5)["magnet"]
    assert (found.node, found.at_s) == ("magnet", 0.5)
    assert found.max_degC < 139.4
    assert profile(found).max_degC == pytest.approx(140.0, abs=1e-9)
    assert profile(found).slices == pytest.approx(abs(peak_at), abs=1e-9)
    assert towards in (None, profile(found).towards)


def test_a_bar_of_one_temperature_is_nowhere_hotter() -> None:
    middle_first = replace(BAR, nodes=tuple(sorted(BAR.nodes, key=lambda node: node.name != "magnet")))
    top = profile(hot_spots(middle_first, np.full((2, len(BAR.nodes)), 140.0), 0.5)["magnet"])
    assert (top.max_degC, top.slices) == (140.0, 0.0)


def test_three_slices_say_what_many_do() -> None:
    """The means over thirds of a bar that loses heat at its ends, unevenly, and along its sides."""
    cooled = replace(LUMPED, links=(*LUMPED.links, Link("magnet", "air", (Term(0.2),))))
    fine = sliced(cooled, ["magnet"], 45, 0.12)
    degC = at_rest(fine)
    row = np.array([i for i, node in enumerate(fine.nodes) if node.region == "magnet"])
    thirds = dict(zip(ROW, degC[row].reshape(3, -1).mean(axis=1).tolist(), strict=True))
    coarse = np.array([[thirds.get(node.name, 20.0) for node in BAR.nodes]] * 2)
    few, many = hot_spots(BAR, coarse, 0.5)["magnet"], hot_spots(fine, np.stack([degC, degC]), 0.5)["magnet"]
    highest = profile(many).max_degC
    assert highest - few.max_degC > 5 * abs(highest - profile(few).max_degC)
    hottest = (1 + row.tolist().index(place_of(fine, many.node)) - 0.5) / 15  # of a third
    assert profile(few).slices == pytest.approx(abs(hottest - 1.5), abs=0.1)


def place_of(network: Network, name: str) -> int:
    return [node.name for node in network.nodes].index(name)


def at_rest(network: Network) -> Floats:
    """The steady temperatures (n,) with air at 20 degC."""
    place = {node.name: i for i, node in enumerate(network.nodes)}
    matrix, heat = np.zeros((len(place), len(place))), np.zeros(len(place))
    for link in network.links:
        conductance = sum(term.coefficient for term in link.terms)
        for a, b in ((link.a, link.b), (link.b, link.a)):
            if a in place:
                matrix[place[a], place[a]] += conductance
                if b in place:
                    matrix[place[a], place[b]] -= conductance
                else:
                    heat[place[a]] += conductance * 20.0
    for source in network.sources:
        heat[place[source.node]] += sum(term.coefficient for term in source.terms)
    return np.asarray(np.linalg.solve(matrix, heat), np.float64)


def test_lumps_of_other_sizes_and_the_end_of_a_row_have_no_profile() -> None:
    lumped = hot_spots(LUMPED, np.array([[20.0, 20.0, 20.0], [90.0, 50.0, 40.0]]), 0.5)["magnet"]
    assert lumped.profile is None
    assert set(to_json(lumped)) == {"node", "max_degC", "at_s", "limit_degC", "margin_K"}
    uneven = replace(
        BAR,
        nodes=tuple(
            replace(node, capacity=1.1 * node.capacity) if node.name == "magnet_3" else node for node in BAR.nodes
        ),
    )
    assert hot_spots(uneven, a_bar(0.3, 140.0, 8.0), 0.5)["magnet"].profile is None
    at_the_end = hot_spots(BAR, a_bar(0.9, 140.0, 8.0), 0.5)["magnet"]
    assert at_the_end.node == "magnet_3"
    assert at_the_end.profile is None
