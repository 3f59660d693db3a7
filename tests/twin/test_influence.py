"""Influence of coefficients and capacities on node temperatures, and what tests teach of them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
from made_motor import every_law, pulses, recorded, smooth
from numpy.typing import NDArray

from twin.calibration import freedom
from twin.fit import fit
from twin.influence import Influence, influence, with_every_node
from twin.model import Model, Test
from twin.network import Network, Term
from twin.point_choice import gain_nats, in_order, information, known_K

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
STEP = 1e-3  # of a logarithm
TESTS = [recorded(every_law(), drive, INITIAL, name=f"{i}") for i, drive in enumerate([pulses(600.0), smooth(900.0)])]


@pytest.fixture(scope="module")
def found() -> Influence:
    return influence(every_law(), TESTS)


def _changed(network: Network, place: int, factor: float) -> Network:
    """With one coefficient or, behind them, one capacity times a factor."""
    count, links, sources = 0, [], []
    for link in network.links:
        links.append(
            replace(link, terms=tuple(_scaled(t, place - count - i, factor) for i, t in enumerate(link.terms)))
        )
        count += len(link.terms)
    for source in network.sources:
        terms = tuple(_scaled(t, place - count - i, factor) for i, t in enumerate(source.terms))
        sources.append(replace(source, terms=terms))
        count += len(source.terms)
    nodes = [
        replace(n, capacity=n.capacity * (factor if i == place - count else 1)) for i, n in enumerate(network.nodes)
    ]
    return replace(network, nodes=tuple(nodes), links=tuple(links), sources=tuple(sources))


def _scaled(term: Term, left: int, factor: float) -> Term:
    return replace(term, coefficient=term.coefficient * (factor if left == 0 else 1))


def _blocks(network: Network) -> Floats:
    """Temperatures (B, n) of every node in every block of the tests."""
    model = Model(network, [with_every_node(network, test) for test in TESTS], ())
    of_test: dict[int, list[Floats]] = {}
    for series in model.residuals(np.zeros(0)):
        of_test.setdefault(series.session, []).append(-series.y)
    return np.concatenate([np.stack(own, axis=1) for own in of_test.values()])


def test_every_column_is_the_difference_that_a_changed_motor_makes(found: Influence) -> None:
    network = every_law()
    for p in range(len(found.parameters)):
        up, down = (_blocks(_changed(network, p, np.exp(sign * STEP))) for sign in (1, -1))
        expected = (up - down) / (2 * STEP)
        np.testing.assert_allclose(found.columns[:, :, p], expected, atol=2e-3 * max(1.0, np.abs(expected).max()))


def test_what_is_known_worse_counts_more(found: Influence) -> None:
    sd = np.array([p.sd for p in found.parameters])
    rms = np.sqrt((found.columns**2).mean(axis=0)).T
    np.testing.assert_allclose(found.per_sd_K, rms * sd[:, None])
    assert found.per_sd_K[found.order(range(4))[0]].max() == found.per_sd_K.max()
    assert found.per_sd_K[found.order([2])[0], 2] == found.per_sd_K[:, 2].max()
    assert found.per_sd_K.shape == (len(found.parameters), 4)


def test_what_a_test_teaches_is_what_a_fit_to_it_knows() -> None:
    network, test = every_law(), TESTS[0]
    parameters = freedom(network, [test])
    whole = fit(Model(network, [test], parameters), np.zeros(len(parameters)), linearisations=1)
    shared = len(freedom(network, ()))
    prior = np.diag([p.sd**-2.0 for p in parameters[:shared]])
    sd = np.sqrt(np.diag(np.linalg.inv(prior + information(network, test, {}))))
    np.testing.assert_allclose(sd, np.sqrt(whole.covariance_diagonal)[:shared], rtol=1e-6)


@pytest.fixture(scope="module")
def informations() -> list[Floats]:
    drives = [pulses(300.0), pulses(900.0, seed=1), smooth(600.0)]
    more: list[Test] = [recorded(every_law(), drive, INITIAL) for drive in drives]
    return [information(every_law(), test, {}) for test in more]


def test_the_first_test_of_the_order_teaches_most(found: Influence, informations: list[Floats]) -> None:
    prior = np.diag([p.sd**-2.0 for p in found.parameters])
    chosen = in_order(informations, found)
    assert sorted(choice.test for choice in chosen) == [0, 1, 2]
    assert chosen[0].gain == max(gain_nats(prior, own) for own in informations)


def test_the_order_changes_who_gets_what_and_not_the_sum(found: Influence, informations: list[Floats]) -> None:
    prior = np.diag([p.sd**-2.0 for p in found.parameters])
    total = sum(choice.gain for choice in in_order(informations, found))
    for order in permutations(range(3)):
        precision, summed = prior, 0.0
        for s in order:
            summed += gain_nats(precision, informations[s])
            precision = precision + informations[s]
        assert summed == pytest.approx(total)


def test_every_further_test_leaves_less_unknown(found: Influence, informations: list[Floats]) -> None:
    prior = np.diag([p.sd**-2.0 for p in found.parameters])
    course = [known_K(prior, found), *(choice.known_K for choice in in_order(informations, found))]
    for before, after in pairwise(course):
        assert (after <= before + 1e-9).all()
    independent = np.sqrt((found.per_sd_K**2).sum(axis=0))  # under a prior without correlations
    np.testing.assert_allclose(course[0], independent)
