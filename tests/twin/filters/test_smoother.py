"""The smoother is the whole Gaussian of a session written out, filterpy's where that has one, and has no lag."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import rts_smoother

from benchmarks.integrator import frame, motor, s2
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.filters import smoother
from twin.filters.by_filterpy import Steps
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import AnyReading, FilterStart, HeatReading, Inputs, Reading, inputs_of
from twin.filters.smoother import SmootherEstimate, smoothed
from twin.filters.unknowns import Unknown, UnknownFactor, UnknownHeat
from twin.motor.network import Network, Term
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

Floats = np.ndarray[Any, Any]

SD_K = 0.05


def read(truth: Floats, names: list[str], taus: dict[str, float], step_s: float, missing: float = 0.2) -> list[Reading]:
    """Noisy readings of nodes, some lost, their mean times anywhere in the step."""
    rng, steps = np.random.default_rng(5), len(truth) - 1
    found = []
    for name, tau in taus.items():
        place = rng.uniform(0, 1, steps)
        edges = lagged(truth[:, names.index(name)], tau, step_s)
        value = edges[:-1] + place * np.diff(edges) + rng.normal(0, SD_K, steps)
        value[rng.random(steps) < missing] = np.nan
        found.append(Reading(Sensor(name, {name: 1.0}, time_constant_s=tau), value, place, np.full(steps, SD_K**2)))
    return found


def small(make_network: Any, make_frame: Any, steps: int = 30) -> tuple[Network, Frame, FilterStart, list[Reading]]:
    """A network whose heats are linear in temperature, so that the filter's F is exact and one at every estimate."""
    network: Network = make_network(4, n=5, linear=True)
    inputs: Frame = make_frame(network, 4, steps=steps)
    start = FilterStart(np.full(5, 40.0), np.linspace(0.5, 3.0, 5), 0.1)
    truth = simulate(compile_indexed(network, load=load), inputs, start.temperatures + 1.0)
    return network, inputs, start, read(truth, ["n0", "n1", "n2", "n3", "n4"], {"n0": 0.0, "n1": 2.0, "n3": 1.0}, 0.5)


def written_out(inputs: Inputs) -> tuple[Floats, Floats]:
    """Mean and variance (N + 1, S + m) of every state given every reading, by one solve of the joint Gaussian."""
    of = Steps(inputs)
    steps, m = inputs.values.shape
    places, noise = (np.broadcast_to(rows, (steps, m)) for rows in (inputs.places, inputs.variances))
    size = of.size + of.channels
    mean, spread = np.zeros((steps + 1, size)), np.zeros((steps + 1, size, steps + 1, size))
    mean[0, : of.size], spread[0, : of.size, 0, : of.size] = of.start
    for k in range(steps):
        matrix = np.zeros((size, size))
        mean[k + 1], matrix[:, : of.size] = of.extended(k, mean[k, : of.size])
        for before in range(k + 1):
            spread[k + 1, :, before] = matrix @ spread[k, :, before]
            spread[before, :, k + 1] = spread[k + 1, :, before].T
        spread[k + 1, :, k + 1] = matrix @ spread[k, :, k] @ matrix.T
        spread[k + 1, : of.size, k + 1, : of.size] += of.process
    rows, values, variances = [], [], []
    for k in range(steps):
        for j in range(m):
            if np.isfinite(inputs.values[k, j]):
                beyond = 0.0
                if j < of.channels:
                    h = of.row(j, places[k, j])
                else:  # the heat is linear in the state, and not 0 at 0
                    beyond, slopes = of.meter(j - of.channels, k, mean[k + 1, : of.size])
                    h = np.append(slopes, np.zeros(of.channels))
                    beyond -= float(h @ mean[k + 1])
                rows.append(np.concatenate([np.zeros((k + 1) * size), h, np.zeros((steps - k - 1) * size)]))
                values.append(inputs.values[k, j] - beyond)
                variances.append(noise[k, j])
    H, joint, flat = np.array(rows), spread.reshape((steps + 1) * size, -1), mean.reshape(-1)
    gain = np.linalg.solve(H @ joint @ H.T + np.diag(variances), H @ joint).T
    after = flat + gain @ (np.array(values) - H @ flat)
    left = np.diag(joint - gain @ H @ joint)
    return after.reshape(steps + 1, size), left.reshape(steps + 1, size)


@pytest.mark.parametrize("block", [40, 7, 1])
def test_it_is_the_whole_gaussian_written_out(
    block: int, make_network: Any, make_frame: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(smoother, "block_length", lambda _: block)
    network, inputs, start, thermometers = small(make_network, make_frame)
    unknowns = [UnknownHeat("n2", 40.0, 5.0), UnknownHeat("n4", 10.0, 1.0)]
    watts = np.random.default_rng(2).normal(200.0, 30.0, (2, 30))
    meters = [HeatReading("P", watts[0], np.full(30, 900.0)), HeatReading("Q", watts[1], np.full(30, 400.0), "coolant")]
    channels: list[AnyReading] = [*thermometers, *meters]
    ours = smoothed(network, inputs, start, unknowns, channels)
    mean, variance = written_out(inputs_of(network, inputs, start, unknowns, channels))
    assert np.abs(ours.temperatures - mean[:, :5]).max() < 1e-8
    assert np.abs(ours.found - mean[:, 5:7]).max() < 1e-8
    assert np.abs(ours.temperatures_sd**2 - variance[:, :5]).max() < 1e-8
    assert np.abs(ours.found_sd**2 - variance[:, 5:7]).max() < 1e-8 * 40.0**2


def test_it_agrees_with_filterpy_where_nothing_changes(make_network: Any, make_frame: Any) -> None:
    """Without inputs the network is x' = F x, the one case in which filterpy's smoother is right in both of its
    forms."""
    network, inputs, start, channels = small(make_network, make_frame, steps=60)
    inputs = Frame(inputs.step_s, np.zeros_like(inputs.features), np.zeros_like(inputs.boundaries))
    unknowns = [UnknownHeat("n2", 40.0, 5.0)]
    channels = [replace(r, sensor=replace(r.sensor, time_constant_s=0.0), place=np.full(60, 1.0)) for r in channels]
    ours = smoothed(network, inputs, start, unknowns, channels)
    of = inputs_of(network, inputs, start, unknowns, channels)
    steps = Steps(of)
    (x, P), Q = steps.start, steps.process
    F, variances = steps.matrix(0, x), np.broadcast_to(of.variances, of.values.shape)
    xs, Ps = [x], [P]
    for k in range(60):
        x, P = F @ x, F @ P @ F.T + Q
        for j in np.flatnonzero(np.isfinite(of.values[k])):
            h = np.append(of.parts.weights[j], 0.0)
            gain = P @ h / (h @ P @ h + variances[k, j])
            x, P = x + gain * (of.values[k, j] - h @ x), P - np.outer(gain, h @ P)
        xs.append(x)
        Ps.append(P)
    peer, spread, _, _ = rts_smoother(np.array(xs), np.array(Ps), [F] * 61, [Q] * 61)
    assert np.abs(peer[:, :5] - ours.temperatures).max() < 1e-9
    assert np.abs(peer[:, 5] - ours.found[:, 0]).max() < 1e-7
    assert np.abs(np.sqrt(spread[:, 5, 5]) - ours.found_sd[:, 0]).max() < 1e-7


def pulses(network: Network, inputs: Frame, watts: float, on_s: float) -> tuple[Floats, Floats]:
    """Temperatures under a hidden magnet loss that comes and goes, and that loss in each step."""
    edges, heat = [np.full((1, len(network.nodes)), 65.0)], []
    length = round(on_s / inputs.step_s)
    for i, first in enumerate(range(0, len(inputs.features), length)):
        part = slice(first, first + length)
        sources = [
            replace(s, terms=(*s.terms, Term(watts * (i % 2) or 1e-9))) if s.node == "magnet" else s
            for s in network.sources
        ]
        here = compile_indexed(replace(network, sources=tuple(sources)), load=load)
        edges.append(
            simulate(here, Frame(inputs.step_s, inputs.features[part], inputs.boundaries[part]), edges[-1][-1])[1:]
        )
        heat.append(np.full(len(inputs.features[part]), watts * (i % 2)))
    return np.concatenate(edges), np.concatenate(heat)


@pytest.fixture(scope="module")
def pulsed() -> tuple[SmootherEstimate, Floats, Floats]:
    network = motor("reference_motor")
    inputs = frame(network, s2(), 0.5)
    truth, heat = pulses(network, inputs, 150.0, 200.0)
    names = [node.name for node in network.nodes]
    channels = read(
        truth, names, {"endwinding_a_inner": 2.0, "endwinding_b_inner": 2.0, "rotor_surface": 2.0}, 0.5, 0.01
    )
    start = FilterStart(np.full(len(names), 65.0), np.full(len(names), 0.1), 1e-3)
    found = smoothed(network, inputs, start, [UnknownHeat("magnet", 50.0, 10.0)], channels)
    return found, truth, heat


def lag_steps(estimate: Floats, truth: Floats) -> int:
    """The delay of an estimate in steps at which it follows the truth best."""
    window = slice(200, -200)
    errors = [np.mean((estimate[200 + d : len(estimate) - 200 + d] - truth[window]) ** 2) for d in range(-60, 100)]
    return int(np.argmin(errors)) - 60


def test_the_lag_of_the_filter_is_gone(pulsed: tuple[SmootherEstimate, Floats, Floats]) -> None:
    found, truth, heat = pulsed
    late = lag_steps(found.filtered.found[1:, 0], heat)
    assert late >= 10, "the filter needs 5 s and more to see a loss that it infers from the rotor's surface"
    assert abs(lag_steps(found.found[:-1, 0], heat)) <= 2
    error = np.sqrt(np.mean((found.found[:-1, 0] - heat) ** 2))
    assert error < 0.7 * np.sqrt(np.mean((found.filtered.found[1:, 0] - heat) ** 2))
    magnet = 5
    assert (
        np.abs(found.temperatures - truth)[:, magnet].mean()
        < np.abs(found.filtered.temperatures - truth)[:, magnet].mean()
    )


def test_its_bands_are_narrower_and_hold(pulsed: tuple[SmootherEstimate, Floats, Floats]) -> None:
    found, truth, _ = pulsed
    assert (found.temperatures_sd <= found.filtered.temperatures_sd * (1 + 1e-9)).all()
    assert (found.found_sd <= found.filtered.found_sd * (1 + 1e-9)).all()
    assert (np.abs(found.temperatures - truth) < 3 * found.temperatures_sd + 1e-3).mean() > 0.95
    assert found.temperatures[-1] == pytest.approx(found.filtered.temperatures[-1], abs=1e-12)
    assert found.found[-1] == pytest.approx(found.filtered.found[-1], abs=1e-9)


def test_what_it_says_of_the_filter_is_what_the_filter_says(make_network: Any, make_frame: Any) -> None:
    network, inputs, start, channels = small(make_network, make_frame, steps=300)
    unknowns: list[Unknown] = [
        UnknownFactor("conductance.coolant-n0.scale", 0.2, 1e-3),
        UnknownHeat("n2", 40.0, 5.0),
    ]
    ours, alone = (
        smoothed(network, inputs, start, unknowns, channels).filtered,
        filter_unknowns(network, inputs, start, unknowns, channels),
    )
    assert (ours.temperatures == alone.temperatures).all()
    assert (ours.found == alone.found).all()
    assert ours.log_likelihood == pytest.approx(alone.log_likelihood, rel=1e-12)
    assert (ours.covariance == alone.covariance).all()


def test_a_constant_factor_is_known_from_the_first_step_on(make_network: Any, make_frame: Any) -> None:
    """What does not walk has one value and one band over the whole session."""
    network, inputs, start, channels = small(make_network, make_frame, steps=300)
    found = smoothed(network, inputs, start, [UnknownFactor("conductance.coolant-n0.scale", 0.2, 0.0)], channels)
    assert np.ptp(found.found) < 1e-6
    assert found.found[0, 0] == pytest.approx(found.filtered.found[-1, 0], abs=1e-6)
    assert found.found_sd[0, 0] == pytest.approx(found.filtered.found_sd[-1, 0], rel=1e-4)


def test_without_readings_it_is_the_filter(make_network: Any, make_frame: Any) -> None:
    network, inputs, start, _ = small(make_network, make_frame)
    found = smoothed(network, inputs, start, [UnknownHeat("n2", 40.0, 5.0)], [])
    assert (found.temperatures == found.filtered.temperatures).all()
    assert found.found_sd == pytest.approx(found.filtered.found_sd)
