"""Influence of coefficients and capacities on node temperatures, and what tests teach of them."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from functools import cache
from itertools import pairwise, permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import every_law, pulses, recorded, smooth
from twin.calibration.calibrate import freedom
from twin.calibration.influence import Influence, columns, influence
from twin.calibration.point_choice import gain_nats, in_order, information, known_K
from twin.fitting.fit import fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import ChannelNoise
from twin.fitting.recorded import RecordedChannel
from twin.motor.network import Network, Term
from twin.motor.sensor import Sensor
from twin.run import block_columns

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
STEP = 1e-3  # of a logarithm


@cache
def _tests() -> list[Test]:
    drives = [pulses(600.0), smooth(900.0)]
    return [recorded(every_law(), drive, INITIAL, name=f"{i}") for i, drive in enumerate(drives)]


@pytest.fixture(scope="module")
def found() -> Influence:
    return influence(every_law(), _tests())


@pytest.fixture(scope="module")
def every_column() -> Floats:
    """(B, n, P) over all tests."""
    return np.concatenate([some for test in _tests() for some in columns(every_law(), test)])


def _with_every_node(network: Network, test: Test) -> Test:
    """The test as if every node had a thermometer that is always there."""
    steps = len(test.frame.features)
    there, middle = np.ones(steps), np.full(steps, 0.5)
    sensors = (Sensor(f"{i}", {node.name: 1.0}, noise=0.1) for i, node in enumerate(network.nodes))
    return replace(test, channels=tuple(RecordedChannel(one, 0 * there, there, middle) for one in sensors))


def _by_adjoints(network: Network, test: Test) -> Floats:
    """(B, n, P) by the columns of calibration and diagnosis, which go backwards over dense matrices."""
    model = Model(network, [_with_every_node(network, test)], freedom(network, ()))
    return np.stack([part.columns for part in model.linearise(np.zeros(len(model.parameters)))], axis=1)


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
    model = Model(network, [_with_every_node(network, test) for test in _tests()], ())
    of_test: dict[int, list[Floats]] = {}
    for series in model.residuals(np.zeros(0)):
        of_test.setdefault(series.session, []).append(-series.y)
    return np.concatenate([np.stack(own, axis=1) for own in of_test.values()])


def test_every_column_is_the_difference_that_a_changed_motor_makes(every_column: Floats) -> None:
    network = every_law()
    for p in range(every_column.shape[2]):
        up, down = (_blocks(_changed(network, p, np.exp(sign * STEP))) for sign in (1, -1))
        expected = (up - down) / (2 * STEP)
        np.testing.assert_allclose(every_column[:, :, p], expected, atol=2e-3 * max(1.0, np.abs(expected).max()))


def test_columns_are_those_of_calibration_to_rounding(every_column: Floats) -> None:
    expected = np.concatenate([_by_adjoints(every_law(), test) for test in _tests()])
    scale = np.abs(expected).max(axis=(0, 1))
    assert (scale > 0.01).all()
    assert (np.abs(every_column - expected) / scale).max() < 1e-7  # a course is settled to 1e-3 K there


def test_what_is_known_worse_counts_more(found: Influence, every_column: Floats) -> None:
    sd = np.array([p.sd for p in found.parameters])
    rms = np.sqrt((every_column**2).mean(axis=0)).T
    np.testing.assert_allclose(found.per_sd_K, rms * sd[:, None])
    assert found.per_sd_K[found.order(range(4))[0]].max() == found.per_sd_K.max()
    assert found.per_sd_K[found.order([2])[0], 2] == found.per_sd_K[:, 2].max()
    assert found.per_sd_K.shape == (len(found.parameters), 4)


def test_what_a_test_teaches_is_what_a_fit_to_it_knows() -> None:
    network, test = every_law(), _tests()[0]
    parameters = freedom(network, [test])
    whole = fit(Model(network, [test], parameters), np.zeros(len(parameters)), linearisations=1)
    shared = len(freedom(network, ()))
    prior = np.diag([p.sd**-2.0 for p in parameters[:shared]])
    sd = np.sqrt(np.diag(np.linalg.inv(prior + information(network, test, {}))))
    np.testing.assert_allclose(sd, np.sqrt(whole.covariance_diagonal)[:shared], rtol=1e-6)


def _information_by_adjoints(network: Network, test: Test, noise: dict[str, ChannelNoise]) -> Floats:
    """By the model that a calibration fits, whitened at once."""
    parameters = freedom(network, [test])
    model = Model(network, [test], parameters, noise)
    shared = len(freedom(network, ()))
    gram = np.diag(np.concatenate([np.zeros(shared), model.sd[shared:] ** -2.0]))
    for part in model.linearise(np.zeros(len(parameters))):
        white = model.whitened(part.series, part.columns)
        gram[np.ix_(part.at, part.at)] += white.T @ white
    own = slice(shared, None)
    found: Floats = gram[:shared, :shared] - gram[:shared, own] @ np.linalg.solve(gram[own, own], gram[own, :shared])
    return found


@pytest.mark.parametrize("held", [1, block_columns.HELD])
def test_information_is_that_of_a_calibration_to_rounding_however_few_blocks_are_held(
    held: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With lags, stamps anywhere in their steps, and blocks that are not there."""
    monkeypatch.setattr(block_columns, "HELD", held)
    rng, network, noise = np.random.default_rng(5), every_law(), {"Y_1": ChannelNoise(0.1, 30.0, 0.2, 900.0)}

    def patchy(channel: RecordedChannel) -> RecordedChannel:
        steps = channel.measured.size
        samples = np.float64(4.0) * ((rng.random(steps) < 0.8) & (np.arange(steps) % 75 > 12))
        return replace(channel, samples=samples, place=rng.random(steps))

    test = replace(_tests()[0], channels=tuple(patchy(channel) for channel in _tests()[0].channels))
    expected = _information_by_adjoints(network, test, noise)
    found = information(network, test, noise)
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_memory_for_columns_does_not_grow_with_the_length_of_a_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(block_columns, "HELD", 2**13)
    network, peaks = every_law(), []
    for seconds in (4000.0, 12000.0):
        test = recorded(network, smooth(seconds), INITIAL)
        tracemalloc.start()
        found = influence(network, [test])
        found.unknown_K([np.diag([p.sd**-2.0 for p in found.parameters])])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    columns_of_more = 8 * 800 * len(network.nodes) * len(found.parameters)  # bytes of so many more blocks
    assert peaks[1] - peaks[0] < 0.5 * columns_of_more


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


def test_an_order_begins_with_what_is_known_already(found: Influence, informations: list[Floats]) -> None:
    """After the first of all, the others come as they come after it, with the same gains."""
    first, *rest = in_order(informations, found)
    others = [one for one in range(3) if one != first.test]
    known = np.diag([p.sd**-2.0 for p in found.parameters]) + informations[first.test]
    after = in_order([informations[s] for s in others], found, known)
    assert [others[one.test] for one in after] == [one.test for one in rest]
    assert [one.gain for one in after] == pytest.approx([one.gain for one in rest])


def test_what_takes_long_comes_later(found: Influence, informations: list[Floats]) -> None:
    first = in_order(informations, found)[0].test
    hours = [100.0 if s == first else 1.0 for s in range(3)]
    assert in_order(informations, found, hours=hours)[-1].test == first


def test_every_further_test_leaves_less_unknown(found: Influence, informations: list[Floats]) -> None:
    prior = np.diag([p.sd**-2.0 for p in found.parameters])
    course = [known_K(prior, found), *(choice.known_K for choice in in_order(informations, found))]
    for before, after in pairwise(course):
        assert (after <= before + 1e-9).all()
    independent = np.sqrt((found.per_sd_K**2).sum(axis=0))  # under a prior without correlations
    np.testing.assert_allclose(course[0], independent)
