"""The filter in the paper's form is that of the small form but for its integrator, and filterpy's to rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from benchmarks.integrator import frame, motor, s2, wltp_like
from replay.engine.kernel_cache import load
from twin.ekf import filter_unknowns
from twin.ekf_paper import at_edges, at_the_start, filter_with_rates, heats_of, predict, sensor_row, transition
from twin.errors import FrameError
from twin.filter_inputs import HeatReading, Reading, Start, inputs_of
from twin.kernel import compile_indexed
from twin.law_heats import law_heats
from twin.network import Network
from twin.outputs import lagged
from twin.simulate import Frame, simulate
from twin.unknowns import UnknownFactor, UnknownHeat

Floats = np.ndarray[Any, Any]

SD_K = 0.1


def read(network: Network, truth: Floats, taus: dict[str, float], step_s: float) -> list[Reading]:
    rng, steps, names = np.random.default_rng(3), len(truth) - 1, [node.name for node in network.nodes]
    found = []
    for name, tau in taus.items():
        place = rng.uniform(0.3, 0.7, steps)
        edges = lagged(truth[:, names.index(name)], tau, step_s)
        value = edges[:-1] + place * np.diff(edges) + rng.normal(0, SD_K, steps)
        value[rng.random(steps) < 0.05] = np.nan
        found.append(Reading(name, {name: 1.0}, tau, value, place, np.full(steps, SD_K**2)))
    return found


def still(make_network: Any, make_frame: Any, step_s: float, seconds: float) -> tuple[Network, Frame, Start]:
    """A network of any laws under inputs that do not change."""
    network: Network = make_network(4, n=5)
    one: Frame = make_frame(network, 4, steps=1)
    steps = round(seconds / step_s)
    inputs = Frame(step_s, np.repeat(one.features, steps, 0), np.repeat(one.boundaries, steps, 0))
    return network, inputs, Start(np.full(5, 40.0), np.full(5, 2.0))


@pytest.mark.parametrize(("drive", "worst_K", "mean_K"), [(s2, 0.7, 0.02), (wltp_like, 0.2, 0.01)])
def test_on_the_reference_motor_both_forms_estimate_the_same(drive: Any, worst_K: float, mean_K: float) -> None:
    """The worst is at the endwindings where full current begins, for the length of a step: inputs are means of two steps here."""
    network = motor("reference_motor")
    inputs, heat = frame(network, drive(), 0.5), [UnknownHeat("magnet", 50.0, 3.0)]
    n = len(network.nodes)
    truth = simulate(compile_indexed(network, load=load), inputs, np.full(n, 66.0))
    taus = {"endwinding_a_inner": 2.0, "endwinding_b_inner": 2.0, "rotor_surface": 2.0}
    channels, start = read(network, truth, taus, 0.5), Start(np.full(n, 65.0), np.full(n, 1.0))
    small, paper = (f(network, inputs, start, heat, channels) for f in (filter_unknowns, filter_with_rates))
    off = np.abs(small.temperatures - paper.temperatures)
    assert off.max() < worst_K
    assert off.mean() < mean_K
    apart = np.abs(small.found - paper.found) / small.found_sd
    assert apart.max() < 0.2, "of a standard deviation of the heat"
    assert apart.mean() < 0.03
    assert np.abs(paper.found_sd / small.found_sd - 1)[20:].max() < 0.02


def test_the_forms_come_together_as_the_step_gets_small(make_network: Any, make_frame: Any) -> None:
    """The same readings, at the ends of steps of 1 s, in ever finer steps: what is left is the integrators', and half a step of the heat's walk."""
    off = []
    for step_s in (0.5, 0.25, 0.125):
        network, inputs, start = still(make_network, make_frame, step_s, 60.0)
        steps, parts = len(inputs.features), round(1 / step_s)
        rng = np.random.default_rng(1)
        value = np.full(steps, np.nan)
        value[parts - 1 :: parts] = 45.0 + rng.normal(0, SD_K, 60)
        channels = [Reading("n0", {"n0": 1.0}, 0.0, value, np.ones(steps), np.full(steps, SD_K**2))]
        heat = [UnknownHeat("n2", 40.0, 5.0)]
        small, paper = (f(network, inputs, start, heat, channels) for f in (filter_unknowns, filter_with_rates))
        off.append(np.abs(small.temperatures - paper.temperatures)[parts * 5 :: parts].max())
    assert off[0] / off[1] > 2
    assert off[1] / off[2] > 2
    assert off[2] < 0.03


def test_without_readings_it_is_the_trapezoidal_rule(make_network: Any, make_frame: Any) -> None:
    errors = []
    for step_s in (0.5, 0.25):
        network, inputs, start = still(make_network, make_frame, step_s, 40.0)
        fine = Frame(step_s / 32, np.repeat(inputs.features, 32, 0), np.repeat(inputs.boundaries, 32, 0))
        truth = simulate(compile_indexed(network, load=load), fine, start.temperatures)[::32]
        found = filter_with_rates(network, inputs, start, [UnknownHeat("n2", 40.0, 5.0)], [])
        errors.append(np.abs(found.temperatures - truth).max())
        assert np.abs(found.found).max() < 1e-12
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.6)
    assert errors[1] < 0.01


def test_factors_and_heats_are_left_to_other_filters(make_network: Any, make_frame: Any) -> None:
    network, inputs, start = still(make_network, make_frame, 0.5, 10.0)
    factor: Any = UnknownFactor("conductance.coolant-n0.scale", 0.1, 0.0)
    with pytest.raises(FrameError, match="estimates heats alone"):
        filter_with_rates(network, inputs, start, [factor], [])
    meter: Any = HeatReading("losses", np.full(20, 100.0), np.ones(20))
    with pytest.raises(FrameError, match="reads temperatures alone"):
        filter_with_rates(network, inputs, start, [], [meter])


def test_the_capacitor_equation_holds_without_error(make_network: Any, make_frame: Any) -> None:
    """Gamma = 0 leaves as many free numbers as there are temperatures and heats; the rest of the covariance is rounding."""
    network, inputs, start = still(make_network, make_frame, 0.5, 60.0)
    channels = [Reading("n0", {"n0": 1.0}, 0.0, np.full(120, 45.0), np.ones(120), np.full(120, SD_K**2))]
    found = filter_with_rates(network, inputs, start, [UnknownHeat("n2", 40.0, 5.0)], channels)
    spread = np.linalg.eigvalsh(found.covariance)
    assert len(spread) == 2 * 5 + 1
    assert spread[5] > 1e-8
    assert np.abs(spread[:5]).max() < 1e-11 * spread[-1]
    assert (found.covariance == found.covariance.T).all()


def test_it_agrees_with_filterpy_to_rounding(make_network: Any, make_frame: Any) -> None:
    """All measurements of a step at once, R singular, as the paper has it: filterpy is given F, Q, H, R and the predicted mean."""
    network: Network = make_network(4, n=5)
    inputs: Frame = make_frame(network, 4, steps=60)
    start = Start(np.full(5, 40.0), np.full(5, 2.0))
    truth = simulate(compile_indexed(network, load=load), inputs, start.temperatures + 1.0)
    channels = read(network, truth, {"n0": 0.0, "n1": 2.0, "n3": 1.0}, 0.5)
    heat = [UnknownHeat("n2", 40.0, 5.0), UnknownHeat("n4", 20.0, 1.0)]
    ours = filter_with_rates(network, inputs, start, heat, channels)

    of, laws = inputs_of(network, inputs, start, heat, channels), law_heats(network)
    amounts, around = at_edges(laws.amounts(inputs.features)), at_edges(inputs.boundaries)
    capacities = np.array([node.capacity for node in network.nodes])
    shift, process, state = transition(of, 0.5)
    x, covariance = at_the_start(of, laws, amounts[0], around[0], capacities, state)
    places, variances = (np.broadcast_to(rows, of.values.shape) for rows in (of.places, of.variances))
    size, rise, slope = len(x), np.empty(5), np.empty((5, 5))
    peer = ExtendedKalmanFilter(dim_x=size, dim_z=5)
    peer.x, peer.P, peer.Q = x[:, 0], covariance, process
    worst = 0.0
    for k in range(60):
        peer.F, ahead = shift, peer.x[:, None].copy()
        predict(laws, capacities, of.parts.heats, shift, 0.5, amounts, around, k, ahead, rise, slope)
        peer.x, peer.P = ahead[:, 0], shift @ peer.P @ shift.T + process
        heats_of(laws, amounts[k + 1], peer.x[:5].copy(), around[k + 1], np.empty(5), slope)
        perfect = np.zeros((5, size))
        perfect[:, :5], perfect[:, 5:10] = -slope / capacities[:, None], np.eye(5)
        perfect[of.parts.heats, [10, 11]] = -1 / capacities[of.parts.heats]
        seen = np.flatnonzero(np.isfinite(of.values[k]))
        sensors = np.empty((len(seen), size))
        for i, j in enumerate(seen):
            tau, place = channels[j].time_constant_s, places[k, j]
            sensor_row(of.parts.weights[j], tau, int(state[j]), (1 - place) * 0.5, 5, sensors[i])
        H = np.concatenate([perfect, sensors])
        z = np.concatenate([perfect @ peer.x + rise / capacities - peer.x[5:10], of.values[k, seen]])
        R = np.diag(np.concatenate([np.zeros(5), variances[k, seen]]))
        peer.update(z, lambda _, H=H: H, lambda x, H=H: H @ x, R=R)
        worst = max(worst, np.abs(peer.x[:5] - ours.temperatures[k + 1]).max())
        assert np.abs(peer.x[10:12] - ours.found[k + 1]).max() < 1e-6, "heats [W]"
        assert np.abs(np.sqrt(np.diag(peer.P)[10:12]) - ours.found_sd[k + 1]).max() < 1e-6, (
            "their standard deviations [W]"
        )
    assert worst < 1e-9, "temperatures [K]"
    assert np.abs(peer.P - ours.covariance).max() < 1e-7


@pytest.mark.parametrize("tau", [0.0, 2.0])
def test_what_is_not_singular_stays_positive_definite_over_many_steps(
    make_network: Any, make_frame: Any, tau: float
) -> None:
    """Good to 0.0001 K after a start known to 1000 K: of the covariance of z, heats and lagging readings 14 digits cancel at once."""
    steps = 100_000
    network, inputs, start = still(make_network, make_frame, 0.5, steps / 2)
    unsure = Start(start.temperatures, np.full(5, 1000.0))
    value, place = 45.0 + np.random.default_rng(2).normal(0, 1e-4, steps), np.full(steps, 0.4)
    for cut in (1, 100, steps):
        some = Frame(0.5, inputs.features[:cut], inputs.boundaries[:cut])
        channels = [Reading("n0", {"n0": 1.0}, tau, value[:cut], place[:cut], np.full(cut, 1e-8))]
        found = filter_with_rates(network, some, unsure, [UnknownHeat("n2", 40.0, 0.0)], channels)
        free = [*range(5), *range(10, len(found.covariance))]
        spread = np.linalg.eigvalsh(found.covariance[np.ix_(free, free)])
        assert spread[0] > 0
        assert (found.temperatures_sd > 0).all()
        assert (found.found_sd > 0).all()
