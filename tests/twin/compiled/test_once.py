"""What follows from a network is worked out once for each, and forgotten with it."""

from __future__ import annotations

import gc
from dataclasses import replace
from typing import Any

import numpy as np

from twin.compiled.once import once_a_network
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import AnyReading, FilterStart, Reading
from twin.filters.unknowns import Unknown, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.motor.sensor import Sensor


def test_a_network_is_asked_once_and_an_equal_one_again(make_network: Any) -> None:
    asked: list[str] = []

    @once_a_network
    def name(network: Network) -> str:
        asked.append(network.name)
        return network.name

    one: Network = make_network(3, n=4)
    other = replace(one, name="other")
    assert [name(one), name(one), name(other), name(one)] == [one.name, one.name, "other", one.name]
    assert asked == [one.name, "other"]


def test_nothing_is_kept_of_a_network_that_is_gone(make_network: Any) -> None:
    asked = []

    @once_a_network
    def count(network: Network) -> int:
        asked.append(len(network.nodes))
        return len(network.nodes)

    for _ in range(3):  # the next may well stand where the one before stood
        count(make_network(3, n=4))
        gc.collect()
    assert asked == [4, 4, 4]


def test_a_filter_does_not_know_what_was_asked_of_the_same_network_before(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(7, n=5)
    inputs = make_frame(network, 7, steps=50)
    rng, steps = np.random.default_rng(0), len(inputs.features)

    def reading(name: str, lag: float, place: float) -> Reading:
        return Reading(
            Sensor(name, {name: 1.0}, time_constant_s=lag),
            rng.normal(40.0, 0.1, steps),
            np.full(steps, place),
            np.full(steps, 0.01),
        )

    link = network.links[0]
    factor = UnknownFactor(f"conductance.{link.a}-{link.b}.scale", 0.1, 1e-3)
    begin = FilterStart(np.full(5, 40.0), np.ones(5))
    asked: list[tuple[FilterStart, list[Unknown], list[AnyReading]]] = [
        (begin, [UnknownHeat("n2", 50.0, 3.0)], [reading("n0", 0.0, 1.0)]),
        (begin, [UnknownHeat("n2", 50.0, 0.1)], [reading("n0", 0.0, 1.0)]),
        (replace(begin, walk_K=0.5), [UnknownHeat("n2", 50.0, 0.1)], [reading("n0", 0.0, 1.0)]),
        (begin, [UnknownHeat("n1", 50.0, 3.0)], [reading("n0", 0.0, 1.0)]),
        (begin, [UnknownHeat("n1", 50.0, 3.0)], [reading("n3", 0.0, 1.0)]),
        (begin, [UnknownHeat("n1", 50.0, 3.0)], [reading("n3", 4.0, 1.0)]),
        (begin, [UnknownHeat("n1", 50.0, 3.0)], [reading("n3", 4.0, 0.5)]),
        (begin, [UnknownHeat("n1", 50.0, 3.0), factor], [reading("n3", 0.0, 1.0), reading("n0", 0.0, 1.0)]),
    ]
    for start, unknowns, readings in (*asked, *reversed(asked)):
        again = filter_unknowns(network, inputs, start, unknowns, readings)
        alone = filter_unknowns(replace(network, name="alone"), inputs, start, unknowns, readings)
        assert np.array_equal(again.temperatures, alone.temperatures)
        assert np.array_equal(again.found_sd, alone.found_sd)
