"""A mass that follows a node: its lag is found with it, and it stands among the candidates once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from made.motor import CHANNELS, SINGLE, every_law, pulses, recorded
from twin.diagnosis.rounds import Round, scored, with_refits
from twin.differences.candidates import ATTACHED_LAGS_S, InputChannel, generate
from twin.differences.everyday import everyday
from twin.fitting import actions
from twin.fitting.fit import fit
from twin.fitting.model import Model
from twin.motor.network import Link, Network, Node, Term
from twin.motor.sensor import Sensor

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
MASS_J_PER_K, LAG_S = 150.0, 21.0  # between two of the lags that are tried
NEAREST_S = min(ATTACHED_LAGS_S, key=lambda lag_s: abs(np.log(lag_s / LAG_S)))
CANDIDATES = [
    c
    for c in generate(
        every_law(),
        [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
    )
    if c.cause.kind == "capacity"
]


def _with_mass() -> Network:
    network = every_law()
    mass, link = Node("mass", MASS_J_PER_K, "copper"), Link("winding", "mass", (Term(MASS_J_PER_K / LAG_S),))
    return replace(network, name="with-mass", nodes=(*network.nodes, mass), links=(*network.links, link))


@pytest.fixture(scope="module")
def found() -> Round:
    start = np.append(INITIAL, INITIAL[0])
    tests = [
        recorded(every_law(), pulses(600.0, seed=i), start, true=_with_mass(), seed=i, name=f"{i}") for i in range(2)
    ]
    model = Model(every_law(), tests, everyday(every_law(), tests))
    with threadpool_limits(1, user_api="blas"):
        return with_refits(scored(fit(model, np.zeros(len(model.parameters))), CANDIDATES), lambda _: None)


def test_every_cause_stands_there_once(found: Round) -> None:
    ids = [str(candidate.cause) for candidate in found.candidates]
    assert sorted(ids) == sorted(set(ids))
    assert len(found.parameters) == len(ids) == len(found.scores.sigma) == len(found.gram)


def test_the_nearest_lag_leads_and_the_mass_is_within_its_band(found: Round) -> None:
    best = found.best
    assert best is not None
    assert str(best.candidate.cause) == "capacity.winding.attached"
    assert isinstance(best.parameter.action, actions.Attached)
    assert best.parameter.action.lag_s == NEAREST_S
    assert abs(best.amplitude - MASS_J_PER_K) < 3 * best.sd
