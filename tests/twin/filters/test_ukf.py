"""The unscented filter agrees with filterpy's, is the extended one where heats are linear, and bends where they are
not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.filters import ukf
from twin.filters.by_filterpy import Steps
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import AnyReading, FilterStart, HeatReading, Reading, inputs_of
from twin.filters.ukf import filter_unscented
from twin.filters.unknowns import Unknown, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

Floats = np.ndarray[Any, Any]

SD_K = 0.05
STEPS = 80
MIXED: tuple[Unknown, ...] = (UnknownFactor("conductance.coolant-n0.scale", 0.3, 0.01), UnknownHeat("n2", 40.0, 5.0))


def case(make_network: Any, make_frame: Any, linear: bool) -> tuple[Network, Frame, FilterStart, list[Reading]]:
    network: Network = make_network(4, n=5, linear=linear)
    inputs: Frame = make_frame(network, 4, steps=STEPS)
    start = FilterStart(np.full(5, 40.0), np.linspace(0.5, 3.0, 5), 0.1)
    truth = simulate(compile_indexed(network, load=load), inputs, start.temperatures + 1.0)
    rng, channels = np.random.default_rng(5), []
    for i, tau in ((0, 0.0), (1, 2.0), (3, 1.0)):
        value = lagged(truth[:, i], tau, 0.5)[1:] + rng.normal(0, SD_K, STEPS)
        value[rng.random(STEPS) < 0.2] = np.nan
        channels.append(
            Reading(
                Sensor(f"n{i}", {f"n{i}": 1.0}, time_constant_s=tau), value, np.ones(STEPS), np.full(STEPS, SD_K**2)
            )
        )
    return network, inputs, start, channels


@pytest.mark.parametrize("linear", [True, False])
def test_it_agrees_with_filterpy(linear: bool, make_network: Any, make_frame: Any) -> None:
    """filterpy keeps the points of the prediction for the reading, from before the noise of the step: they are drawn
    anew here."""
    network, inputs, start, channels = case(make_network, make_frame, linear)
    ours = filter_unscented(network, inputs, start, MIXED, channels)
    of = inputs_of(network, inputs, start, MIXED, channels)
    steps, sought = Steps(of), of.parts.sought

    def step(x: Floats, dt: float, k: int) -> Floats:
        return steps.moved(k, x)

    def reading(x: Floats, seen: Floats) -> Floats:
        read: Floats = steps.now[seen] @ x
        return read

    points = MerweScaledSigmaPoints(steps.size, ukf.ALPHA, ukf.BETA, ukf.KAPPA)
    peer = UnscentedKalmanFilter(steps.size, 3, 0.5, reading, step, points)
    (peer.x, peer.P), peer.Q = steps.start, steps.process
    inverse, worst = np.argsort(of.order), np.zeros(3)
    variances = np.broadcast_to(of.variances, of.values.shape)
    for k in range(STEPS):
        peer.predict(k=k)
        peer.sigmas_f = points.sigma_points(peer.x, peer.P)
        seen = np.flatnonzero(np.isfinite(of.values[k]))
        if len(seen):
            peer.update(of.values[k, seen], R=np.diag(variances[k, seen]), seen=seen)
        found = peer.x[5:sought][inverse] - ours.found[k + 1]
        sd = np.sqrt(np.diag(peer.P))[5:sought][inverse] - ours.found_sd[k + 1]
        worst = np.maximum(
            worst, [np.abs(peer.x[:5] - ours.temperatures[k + 1]).max(), np.abs(found).max(), np.abs(sd).max()]
        )
    assert worst[0] < 1e-9, "temperatures [K]"
    assert worst[1] < 1e-7, "unknowns"
    assert worst[2] < 1e-7, "their standard deviations"


def test_where_heats_are_linear_it_is_the_extended_filter(make_network: Any, make_frame: Any) -> None:
    network, inputs, start, channels = case(make_network, make_frame, linear=True)
    channels = [replace(r, place=np.linspace(0, 1, STEPS)) for r in channels]
    heat = [UnknownHeat("n2", 40.0, 5.0)]
    watts = np.random.default_rng(2).normal(200.0, 30.0, STEPS)
    read: list[AnyReading] = [
        *channels,
        HeatReading("P", watts, np.full(STEPS, 900.0)),
        HeatReading("Q", watts, np.full(STEPS, 900.0), "coolant"),
    ]
    one, other = (f(network, inputs, start, heat, read) for f in (filter_unscented, filter_unknowns))
    assert np.abs(one.temperatures - other.temperatures).max() < 1e-9
    assert np.abs(one.found - other.found).max() < 1e-7
    assert np.abs(one.covariance - other.covariance).max() < 1e-6
    assert one.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-9)


def test_a_wide_factor_moves_the_mean_as_quadrature_says(make_network: Any, make_frame: Any) -> None:
    """Without readings the mean of exp(p) over p is above 1: the extended filter does not see that, the unscented
    does."""
    network, inputs, start, _ = case(make_network, make_frame, linear=True)
    start = replace(start, sd=np.full(5, 1e-6), walk_K=0.0)
    source = network.sources[0].node
    wide = [UnknownFactor(f"loss.{source}.scale", 0.5, 0.0)]
    unscented = filter_unscented(network, inputs, start, wide, []).temperatures[-1]
    extended = filter_unknowns(network, inputs, start, wide, []).temperatures[-1]
    mean = np.zeros(5)
    for at, weight in zip(*np.polynomial.hermite_e.hermegauss(12), strict=True):
        sources = [
            replace(s, terms=tuple(replace(t, coefficient=t.coefficient * float(np.exp(0.5 * at))) for t in s.terms))
            if s.node == source
            else s
            for s in network.sources
        ]
        drawn = compile_indexed(replace(network, sources=tuple(sources)), load=load)
        mean += weight / np.sqrt(2 * np.pi) * simulate(drawn, inputs, start.temperatures)[-1]
    hot = int(np.argmax(mean - extended))
    assert mean[hot] - extended[hot] > 0.1
    assert np.abs(unscented - mean).max() < 0.1 * (mean[hot] - extended[hot])


def test_its_covariance_stays_positive(make_network: Any, make_frame: Any) -> None:
    network, inputs, start, channels = case(make_network, make_frame, linear=False)
    sharp = [replace(r, variance=np.full(STEPS, 1e-10)) for r in channels]
    found = filter_unscented(network, inputs, start, MIXED, sharp)
    assert (found.covariance == found.covariance.T).all()
    assert np.linalg.eigvalsh(found.covariance).min() > 0
