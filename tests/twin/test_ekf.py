"""The filter agrees with filterpy on the reference motor, keeps its covariance positive and finds a heat that is there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from benchmarks.integrator import frame, motor, s2
from replay.engine.kernel_cache import load
from twin.ekf import HEAT_GRID, Noise, Reading, Start, _at_the_start, _parts, filter_heat, filter_heat_at_its_pace
from twin.ekf_step import Parts, advance, assemble, row
from twin.errors import FrameError
from twin.kernel import Compiled, compile_indexed
from twin.network import Network, Term
from twin.outputs import lagged
from twin.simulate import Frame, network_heat, simulate

Floats = np.ndarray[Any, Any]

NODE = "magnet"
LAGS = {"endwinding_a_inner": 2.0, "endwinding_b_inner": 0.0, "rotor_surface": 2.0, "teeth": 5.0}
HEAT_W = 60.0
NOISE_K = 0.05


def indexed(network: Network) -> Compiled:
    return compile_indexed(network, load=load)


@pytest.fixture(scope="module")
def network() -> Network:
    return motor("reference_motor")


@pytest.fixture(scope="module")
def compiled(network: Network) -> Compiled:
    return indexed(network)


@pytest.fixture(scope="module")
def inputs(network: Network) -> Frame:
    return frame(network, s2(), 0.5)


def with_heat(network: Network, watts: float) -> Network:
    """The motor with a constant heat at the magnets that its file does not know."""
    sources = [replace(s, terms=(*s.terms, Term(watts))) if s.node == NODE else s for s in network.sources]
    return replace(network, sources=tuple(sources))


def start(network: Network, sd: float = 1.0) -> Start:
    n = len(network.nodes)
    return Start(np.full(n, 65.0), np.full(n, sd), 50.0)


def readings(network: Network, inputs: Frame, temperatures: Floats, missing: float = 0.05) -> list[Reading]:
    """What sensors with lags and noise read of a run, some samples lost, their mean times anywhere in the step."""
    rng = np.random.default_rng(3)
    steps, nodes = len(inputs.features), [node.name for node in network.nodes]
    found = []
    for name, tau in LAGS.items():
        place = rng.uniform(0, 1, steps)
        edges = lagged(temperatures[:, nodes.index(name)], tau, inputs.step_s)
        value = edges[:-1] + place * np.diff(edges) + rng.normal(0, NOISE_K, steps)
        value[rng.random(steps) < missing] = np.nan
        found.append(Reading(name, {name: 1.0}, tau, value, place, np.full(steps, NOISE_K**2)))
    return found


def step_matrix(parts: Parts, inputs: Frame, k: int, start: Floats) -> Floats:
    """F (S, S), column by column."""
    size, n = len(parts.process), parts.program.n
    values, right = np.empty(n + 2 * len(parts.program.edge_to)), np.empty(n)
    assemble(parts, inputs.features[k], inputs.boundaries[k], start, values, right)
    x, out = np.eye(size, size + 1), np.empty((size, size + 1))
    advance(parts, values, right, x, out, np.empty((len(parts.program.weights), n, size + 1)))
    return out[:, :size]


def one_step(compiled: Compiled, inputs: Frame, k: int, start: Floats) -> Floats:
    """The temperatures one step on, by the open loop's own kernel."""
    part = Frame(inputs.step_s, inputs.features[k : k + 1], inputs.boundaries[k : k + 1])
    edges = simulate(compiled, part, start)
    return np.asarray(edges[1])


def test_it_agrees_with_filterpy_to_rounding(network: Network, compiled: Compiled, inputs: Frame) -> None:
    steps = 600
    inputs = Frame(inputs.step_s, inputs.features[:steps], inputs.boundaries[:steps])
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    channels = readings(network, inputs, hot)
    noise = Noise(3.0)
    ours = filter_heat(network, inputs, start(network), NODE, channels, noise)

    parts = _parts(network, inputs.step_s, NODE, channels, noise)
    n, size = parts.program.n, len(parts.process)
    both = _at_the_start(parts, start(network))
    peer = ExtendedKalmanFilter(dim_x=size, dim_z=len(channels))
    peer.P, peer.x, peer.Q = both[:, :size].copy(), both[:, size].copy(), np.diag(parts.process)
    worst = np.zeros(3)
    for k in range(steps):
        peer.F = step_matrix(parts, inputs, k, peer.x[:n])
        ahead = peer.F @ peer.x  # right for heat and readings; temperatures by the open loop, readings follow them
        temperatures = one_step(compiled, inputs, k, peer.x[:n]) + peer.F[:n, n] * peer.x[n]
        for j, at in enumerate(parts.state):
            if at >= 0:
                ahead[at] += parts.lag[j, 2] * parts.weights[j] @ (temperatures - ahead[:n])
        ahead[:n] = temperatures
        peer.x = ahead
        peer.P = peer.F @ peer.P @ peer.F.T + peer.Q
        seen = [j for j, channel in enumerate(channels) if np.isfinite(channel.value[k])]
        H = np.zeros((len(seen), size))
        for i, j in enumerate(seen):
            row(parts, j, channels[j].place[k], H[i])
        z = np.array([channels[j].value[k] for j in seen])
        R = np.diag([channels[j].variance[k] for j in seen])
        peer.update(z, lambda _, H=H: H, lambda x, H=H: H @ x, R=R)
        worst = np.maximum(
            worst,
            [
                np.abs(peer.x[:n] - ours.temperatures[k + 1]).max(),
                abs(peer.x[n] - ours.heat_W[k]),
                abs(peer.P[n, n] ** 0.5 - ours.heat_sd_W[k]),
            ],
        )
    assert worst[0] < 1e-9, "temperatures [K]"
    assert worst[1] < 1e-7, "heat [W]"
    assert worst[2] < 1e-7, "its standard deviation [W]"
    assert np.abs(peer.P - ours.covariance).max() < 1e-7


def test_what_a_channel_reads_is_what_the_open_loop_says_it_reads(network: Network, inputs: Frame) -> None:
    """Given the truth as start, a filter that may not move predicts every noiseless reading."""
    truth = simulate(indexed(network), inputs, start(network).temperatures)
    channels = readings(network, inputs, truth, missing=0.0)
    still = Start(start(network).temperatures, np.full(len(network.nodes), 1e-9), 1e-9)
    found = filter_heat(network, inputs, still, NODE, channels, Noise(1e-12, 1e-12))
    noise = np.random.default_rng(3)
    for j in range(len(channels)):
        noise.uniform(0, 1, len(inputs.features))
        expected = noise.normal(0, NOISE_K, len(inputs.features))
        noise.random(len(inputs.features))
        settled = 200  # a lagging reading may start 0.1 K off, and is corrected
        assert np.abs(found.innovations[settled:, j] - expected[settled:]).max() < 0.02


def test_without_readings_it_is_the_open_loop(network: Network, compiled: Compiled, inputs: Frame) -> None:
    found = filter_heat(network, inputs, start(network), NODE, [], Noise(1.0))
    assert np.abs(found.temperatures - simulate(compiled, inputs, start(network).temperatures)).max() < 1e-10
    assert not found.heat_W.any()
    assert (np.diff(found.heat_sd_W) > 0).all(), "what is not measured is forgotten"
    assert np.isnan(found.nis)


@pytest.mark.parametrize("linear", [True, False])
def test_the_step_is_differentiated_rightly(linear: bool, make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(4, linear=linear)
    inputs: Frame = make_frame(network, 4, steps=1)
    compiled, n = indexed(network), len(network.nodes)
    parts = _parts(network, inputs.step_s, network.nodes[0].name, [], Noise(1.0))
    at = np.linspace(40.0, 90.0, n)
    F = step_matrix(parts, inputs, 0, at)[:n, :n]
    shift = 0.01 * np.eye(n)
    differences = [
        (one_step(compiled, inputs, 0, at + d) - one_step(compiled, inputs, 0, at - d)) / 0.02 for d in shift
    ]
    # what is left out where losses are not linear in temperature is a second derivative times half a second
    assert np.abs(F - np.array(differences).T).max() < (1e-9 if linear else 5e-3)


def test_a_hidden_heat_is_found_within_its_band(network: Network, inputs: Frame) -> None:
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    found = filter_heat(network, inputs, start(network, 0.1), NODE, readings(network, inputs, hot), Noise(0.3, 1e-3))
    late = slice(len(inputs.features) // 2, None)
    assert abs(found.heat_W[late].mean() - HEAT_W) < 5.0
    assert (np.abs(found.heat_W - HEAT_W) < 4 * found.heat_sd_W)[late].all()
    assert found.heat_sd_W[-1] < 15.0
    assert found.nis == pytest.approx(1.0, abs=0.05)
    magnet = [node.name for node in network.nodes].index(NODE)
    assert np.abs(found.temperatures[late, magnet] - hot[late, magnet]).max() < 0.5, "of a node that it never saw"


def test_the_covariance_stays_positive_definite_over_a_hundred_thousand_steps(
    make_network: Any, make_frame: Any
) -> None:
    network: Network = make_network(7, n=5)
    inputs: Frame = make_frame(network, 7, steps=100_000)
    inputs = replace(inputs, boundaries=np.full_like(inputs.boundaries, 30.0))
    n, steps = len(network.nodes), len(inputs.features)
    at_rest = Start(np.full(n, 30.0), np.full(n, 4.0), 50.0)
    truth = simulate(indexed(network), inputs, at_rest.temperatures)
    exact = [
        Reading(name, {name: 1.0}, tau, truth[:-1, i], np.zeros(steps), np.full(steps, 1e-8))
        for i, (name, tau) in enumerate([("n0", 0.0), ("n1", 3.0)])
    ]
    found = filter_heat(network, inputs, at_rest, "n2", exact, Noise(5.0, 1e-3))
    assert (found.heat_sd_W > 0).all()
    assert (found.covariance == found.covariance.T).all()
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_the_likelihood_chooses_a_slow_walk_for_a_steady_heat_and_a_fast_one_for_jumps(
    network: Network, inputs: Frame
) -> None:
    at_start, quarter = start(network, 0.1), len(inputs.features) // 4
    plain = simulate(indexed(network), inputs, at_start.temperatures)
    loss = float(network_heat(network, inputs, plain).mean())
    jumping = [at_start.temperatures[None, :]]
    for i in range(4):
        part = slice(i * quarter, (i + 1) * quarter)
        heated = indexed(with_heat(network, 1500.0 if i % 2 else 1.0))
        inside = Frame(inputs.step_s, inputs.features[part], inputs.boundaries[part])
        jumping.append(simulate(heated, inside, jumping[-1][-1])[1:])
    steady, jumps = (
        filter_heat_at_its_pace(network, inputs, at_start, NODE, readings(network, inputs, truth), loss).noise.heat_W
        for truth in (plain, np.concatenate(jumping))
    )
    assert steady == min(HEAT_GRID) * loss
    assert jumps > steady


def test_what_cannot_be_filtered_is_refused(network: Network, inputs: Frame) -> None:
    steps = len(inputs.features)
    good = Reading("T", {"teeth": 1.0}, 0.0, np.full(steps, 60.0), np.zeros(steps), np.full(steps, 0.01))
    cases = [
        ("rotor", good, start(network), 'has no node "rotor": name one of'),
        (NODE, replace(good, weights={"tooth": 1.0}), start(network), 'has no node "tooth"'),
        (NODE, replace(good, value=np.zeros(3)), start(network), "give value, place and variance for each of"),
        (NODE, replace(good, variance=np.zeros(steps)), start(network), "a variance above 0: give it a noise"),
        (NODE, good, start(network, 0.0), "needs a standard deviation above 0"),
    ]
    for node, channel, begin, message in cases:
        with pytest.raises(FrameError, match=message):
            filter_heat(network, inputs, begin, node, [channel], Noise(1.0))


def test_a_node_without_a_loss_of_its_own_can_take_the_heat(network: Network, inputs: Frame) -> None:
    truth = simulate(indexed(network), inputs, start(network).temperatures)
    none = replace(network, sources=tuple(s for s in network.sources if s.node != NODE))
    found = filter_heat(
        none, frame(none, s2(), 0.5), start(network, 0.1), NODE, readings(none, inputs, truth), Noise(1.0, 1e-3)
    )
    assert found.heat_W[len(found.heat_W) // 2 :].mean() > 0
