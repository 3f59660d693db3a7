"""A motor that ran at one speed only, and what its tests could show of every candidate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from made import motor as made
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.fitting.noise import ChannelNoise
from twin.motor.sensor import Sensor
from twin.planning.detectable import Prospect, prospect

NOISE = ChannelNoise(ar_sd=0.03, ar_tau_s=60.0, ou_sd=0.05, ou_tau_s=600.0)
LIMIT_DEGC = 110.0


@pytest.fixture(scope="session")
def candidates() -> tuple[Candidate, ...]:
    observed = [Sensor(name, weights, "can1") for name, (weights, _) in made.CHANNELS.items()]
    every = generate(made.every_law(), observed, [InputChannel(name, "can1") for name in made.SINGLE])
    return tuple(c for i, c in enumerate(every) if c.cause.kind == "loss" or i % 4 == 0)


@pytest.fixture(scope="session")
def fitted(candidates: tuple[Candidate, ...]) -> Fit:
    network = made.every_law()
    network = replace(
        network, nodes=tuple(replace(n, limit_degC=LIMIT_DEGC if n.name == "winding" else None) for n in network.nodes)
    )
    steps = round(1800.0 / made.FINE_S)
    current = np.where(np.arange(steps) % 1200 < 400, 0.8, 0.2)
    drive = {"speed": np.full(steps, 0.5), "current": current, "flow": np.full(steps, 0.8)}
    initial = np.array([60.0, 50.0, 55.0, 45.0])
    tests = [made.recorded(network, drive, initial, more=added_monomials(candidates), seed=3)]
    model = Model(network, tests, everyday(network, tests), dict.fromkeys(made.CHANNELS, NOISE))
    return fit(model, np.zeros(len(model.parameters)))


@pytest.fixture(scope="session")
def found(fitted: Fit, candidates: tuple[Candidate, ...]) -> Prospect:
    return prospect(fitted, candidates)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    """As verbs compute: small matrices, whose threads would only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield
