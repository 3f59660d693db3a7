"""One unknown factor may multiply several places alike, as the slices of a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.integrator import frame, motor, s2
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.errors import FrameError
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import FilterStart, Reading
from twin.filters.unknowns import UnknownFactor, terms_of
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.motor.slicing import sliced
from twin.run.simulate import Frame, simulate

SLICES = ("loss.magnet_1.scale", "loss.magnet.scale", "loss.magnet_3.scale")


@pytest.fixture(scope="module")
def network() -> Network:
    return sliced(motor("reference_motor"), ["magnet", "rotor_surface", "rotor_core"], 3, 0.13)


def test_a_loss_that_is_larger_in_all_slices_is_found_by_a_sensor_at_one_of_them(network: Network) -> None:
    larger, at = 3.0, [term for cause in SLICES for term in terms_of(network, cause)]
    first = sum(len(link.terms) for link in network.links)

    def times(place: int, factor: float) -> float:
        return factor if place in at else 1.0

    places = iter(range(first, first + sum(len(source.terms) for source in network.sources)))
    sources = tuple(
        replace(
            source,
            terms=tuple(replace(t, coefficient=t.coefficient * times(next(places), larger)) for t in source.terms),
        )
        for source in network.sources
    )
    inputs = frame(network, s2(), 0.5)
    n, steps = len(network.nodes), len(inputs.features)
    start = FilterStart(np.full(n, 65.0), np.full(n, 0.1), 0.01)
    truth = _run(replace(network, sources=sources), inputs, start)
    names = [node.name for node in network.nodes]
    seen = truth[1:, names.index("rotor_surface_1")]
    reading = Reading(Sensor("RS", {"rotor_surface_1": 1.0}), seen, np.ones(steps), np.full(steps, 1e-4))
    factor = UnknownFactor(SLICES[0], 0.7, 0.0, SLICES[1:])
    found = filter_unknowns(network, inputs, start, [factor], [reading])
    assert found.found[-1, 0] == pytest.approx(np.log(larger), abs=0.1)
    middle = names.index("magnet")
    assert np.abs(found.temperatures[-200:, middle] - truth[-200:, middle]).max() < 0.3
    assert np.abs(_run(network, inputs, start)[-200:, middle] - truth[-200:, middle]).min() > 1.0


def _run(network: Network, inputs: Frame, start: FilterStart) -> np.ndarray:
    return simulate(compile_indexed(network, load=load), inputs, start.temperatures)


def test_a_place_that_two_factors_multiply_is_refused(network: Network) -> None:
    inputs = frame(network, s2(), 0.5)
    n = len(network.nodes)
    start = FilterStart(np.full(n, 65.0), np.full(n, 1.0))
    twice = [UnknownFactor(SLICES[0], 0.1, 0.0, SLICES[1:]), UnknownFactor(SLICES[1], 0.1, 0.0)]
    with pytest.raises(FrameError, match="another unknown multiplies the same coefficient"):
        filter_unknowns(network, inputs, start, twice, [])


@pytest.mark.parametrize(
    ("cause", "says"),
    [
        ("loss.magnt.scale", 'did you mean "loss.magnet"'),
        ("conductance.yoke-jakcet.scale", 'did you mean "conductance.yoke-jacket"'),
        ("loss.magnet.speed9", "its laws are"),
    ],
)
def test_what_the_network_has_not_is_told_with_what_it_has(network: Network, cause: str, says: str) -> None:
    with pytest.raises(FrameError, match=f'has no coefficient "{cause}": {says}'):
        terms_of(network, cause)
