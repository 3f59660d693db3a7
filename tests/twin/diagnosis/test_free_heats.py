"""A free heat: a hidden heat is found at its node, with its size and what it goes with."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from made import motor as made
from twin.diagnosis.free_heats import _in_time, describe, free_heats
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.unknown import SPACING_S, tent_times
from twin.differences.everyday import everyday
from twin.fitting.actions import HeatTent, Parameter
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.fitting.noise import ChannelNoise
from twin.motor.network import Network, Source, Term

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
QUIET = ChannelNoise(ar_sd=0.1, ar_tau_s=60.0, ou_sd=0.2, ou_tau_s=600.0)
HIDDEN_W = 80.0


def _hiding(network: Network, node: str, watts: float) -> Network:
    """A heat with a power of the flow that no law of the motor's losses has."""
    hidden = Term(watts, {"flow": 3.0})
    sources = [replace(s, terms=(*s.terms, hidden)) if s.node == node else s for s in network.sources]
    if node not in [s.node for s in sources]:
        sources.append(Source(node, (hidden,)))
    return replace(network, name=f"hiding-in-{node}", sources=tuple(sources))


@cache
def _fitted(node: str, watts: float) -> Fit:
    network = made.every_law()
    true = _hiding(network, node, watts) if watts else network
    tests = [made.recorded(network, made.slow(duration), INITIAL, true=true, seed=4) for duration in (7200.0, 3600.0)]
    model = Model(network, tests, everyday(network, tests), dict.fromkeys(made.CHANNELS, QUIET))
    return fit(model, np.zeros(len(model.parameters)))


@pytest.mark.parametrize("node", ["winding", "case"])
def test_a_hidden_heat_is_found_at_its_node(node: str) -> None:
    best, second = free_heats(_fitted(node, HIDDEN_W))[:2]
    assert best.node == node
    assert best.log_bayes_factor > 20
    assert best.log_bayes_factor > second.log_bayes_factor


def test_a_healthy_motor_has_no_free_heat() -> None:
    assert free_heats(_fitted("case", 0.0))[0].log_bayes_factor < 3


def test_heats_come_best_first_one_a_node() -> None:
    found = free_heats(_fitted("winding", HIDDEN_W))
    values = [heat.log_bayes_factor for heat in found]
    assert values == sorted(values, reverse=True)
    assert {heat.node for heat in found} == {"winding", "yoke", "magnet", "case"}


def test_a_heat_has_one_value_a_tent_of_every_test() -> None:
    fitted = _fitted("winding", HIDDEN_W)
    heat = free_heats(fitted)[0]
    assert len(heat.watts) == len(tent_times(7200.0)) + len(tent_times(3600.0))


def test_the_smoothed_heat_follows_the_hidden_one_in_time() -> None:
    fitted = _fitted("winding", HIDDEN_W)
    heat = free_heats(fitted)[0]
    flow = [test.inputs["flow"] for test in fitted.model.tests]
    hidden = np.concatenate(
        [HIDDEN_W * np.interp(tent_times(len(f) * 2.0), 2.0 * np.arange(len(f)) + 1.0, f) ** 3 for f in flow]
    )
    assert np.corrcoef(heat.watts, hidden)[0, 1] > 0.6


def test_a_heat_is_described_by_the_flow_that_it_goes_with() -> None:
    fitted = _fitted("winding", HIDDEN_W)
    unknown = describe(fitted, free_heats(fitted)[0])
    assert unknown.node == "winding"
    assert unknown.goes_with[0] == "flow"
    assert unknown.inputs["flow"][0] > 0.4
    low, high = unknown.temperature_degC
    assert 40.0 < low < high < 200.0


def test_a_loss_that_the_file_has_too_much_of_comes_out_negative() -> None:
    fitted = _fitted("winding", -HIDDEN_W)
    unknown = describe(fitted, free_heats(fitted)[0])
    assert unknown.node == "winding"
    assert sum(unknown.watts) / 2 < 0


def test_rows_of_the_heats_are_those_of_the_fit() -> None:
    """Against one linearisation of the whole model with the tents of one node."""
    fitted = _fitted("winding", HIDDEN_W)
    wanted = [
        Parameter("heat", HeatTent(2, time_s, SPACING_S), 1.0, test)
        for test, length_s in enumerate((7200.0, 3600.0))
        for time_s in tent_times(length_s)
    ]
    _, whole, _ = stacked(fitted, fitted.model.linearise(fitted.beta, wanted))
    at = 0
    for response in _in_time(fitted)[2]:
        own = whole[:, at : at + len(response.correlation)]
        at += len(response.correlation)
        np.testing.assert_allclose(response.columns, own[response.rows], rtol=1e-3, atol=1e-6)
        outside = np.delete(own, np.r_[response.rows], axis=0)
        assert np.abs(outside).max() == 0.0
