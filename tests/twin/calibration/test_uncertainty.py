"""How uncertain a run is at one place and time: against runs of motors that are drawn from what is not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import FINE_S, every_law, recorded, smooth, truth
from twin.calibration.calibrate import freedom
from twin.calibration.uncertainty import coarse, sd_K
from twin.motor.features import terms
from twin.motor.network import Network
from twin.run.simulate import Frame

START = np.array([35.0, 40.0, 30.0, 28.0])
DURATION_S, AT_S = 900.0, 755.0


def _drawn(network: Network, ln: NDArray[np.float64]) -> Network:
    """The network with ln coefficients and ln capacities moved."""
    factors = iter(np.exp(ln))
    links = [
        replace(link, terms=tuple(replace(t, coefficient=t.coefficient * next(factors)) for t in link.terms))
        for link in network.links
    ]
    sources = [
        replace(source, terms=tuple(replace(t, coefficient=t.coefficient * next(factors)) for t in source.terms))
        for source in network.sources
    ]
    nodes = [replace(node, capacity=node.capacity * next(factors)) for node in network.nodes]
    return replace(network, links=tuple(links), sources=tuple(sources), nodes=tuple(nodes))


def test_it_is_the_spread_of_motors_drawn_from_what_is_not_known() -> None:
    network, drive = every_law(), smooth(DURATION_S)
    size = sum(1 for _ in terms(network)) + len(network.nodes)
    rng = np.random.default_rng(3)
    mixed = rng.normal(0, 0.02, (size, size))
    covariance = mixed @ mixed.T / size + 1e-4 * np.eye(size)
    test = replace(recorded(network, drive, START), initial_sd=np.full(4, 0.4))
    found = sd_K(network, test, [("winding", AT_S), ("magnet", AT_S)], covariance)
    ends = []
    for _ in range(150):
        one = _drawn(network, rng.multivariate_normal(np.zeros(size), covariance))
        ends.append(truth(one, drive, START + rng.normal(0, 0.4, 4))[round(AT_S / FINE_S)])
    spread = np.std(ends, axis=0)
    assert found == pytest.approx((spread[0], spread[2]), rel=0.2)
    assert min(found) > 0.1


def test_what_is_known_and_begins_as_measured_has_no_spread() -> None:
    network = every_law()
    test = replace(recorded(network, smooth(300.0), START), initial_sd=np.full(4, 1e-6))
    nothing = np.zeros((len(freedom(network, ())),) * 2)
    assert sd_K(network, test, [("yoke", 295.0)], nothing) == pytest.approx((0.0,), abs=1e-5)


def test_inputs_are_averaged_into_whole_blocks_up_to_a_time() -> None:
    values = np.arange(100.0)[:, None]
    found = coarse(Frame(0.5, values, values + 1000.0), 31.0)
    assert found.step_s == 2.0
    assert found.features.shape == (20, 1)
    np.testing.assert_array_equal(found.features[:3, 0], [1.5, 5.5, 9.5])
    np.testing.assert_array_equal(found.boundaries[:3, 0], [1001.5, 1005.5, 1009.5])
    ended = coarse(Frame(0.5, values, values), 50.0)
    assert ended.features.shape == (30, 1)
    np.testing.assert_array_equal(ended.features[25:, 0], np.full(5, 99.0))
