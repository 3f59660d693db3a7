"""Calibration on synthetic sessions whose coefficients are known."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.calibration.calibrate import LEFT_FREE, Calibration, FittedParameter, calibrate, freedom, widened_noise
from twin.compiled.kernel import compile_network
from twin.differences.everyday import BOUND
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import ENOUGH, Fit, fit
from twin.fitting.model import BROAD, Model, Test
from twin.fitting.noise import ChannelNoise, Series
from twin.fitting.recorded import RecordedChannel
from twin.motor.features import evaluate, monomials, terms
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
MakeNetwork = Callable[..., Network]
MakeFrame = Callable[..., Frame]

NODES = ("winding", "yoke", "magnet")
STEP_S, FINE = 2.0, 4  # steps of a test, and how many of the truth are in one
STEPS = 900


def _motor(magnet: float = 30.0, yoke: float = 90.0, gap: float = 2.0, capacity: float = 120.0) -> Network:
    return Network(
        name="servo",
        nodes=(Node("winding", 90.0, "copper"), Node("yoke", 350.0, "iron"), Node("magnet", capacity, "magnet")),
        boundaries=(Boundary("coolant"),),
        links=(
            Link("winding", "yoke", (Term(12.0),)),
            Link("yoke", "coolant", (Term(25.0), Term(5.0, {"flow": 0.8}))),
            Link("yoke", "magnet", (Term(1.0), Term(gap, {"speed": 0.8}))),
        ),
        sources=(
            Source("winding", (Term(240.0, {"current": 2.0}, sd=0.05, copper=True),)),
            Source("yoke", (Term(yoke, {"speed": 1.5}, sd=0.15),)),
            Source("magnet", (Term(magnet, {"speed": 2.0}, sd=0.5),)),
        ),
        scale={"speed": 6000.0, "current": 20.0, "flow": 10.0},
    )


TRUTH = _motor(magnet=75.0, yoke=80.0, gap=3.0, capacity=140.0)


def _session(truth: Network, seed: int, flow: float = 0.0, bias: float = 0.0, tau_s: float = 0.0) -> Test:
    """1800 s of plateaus, the truth in finer steps; flow stands still unless said, so that its term acts on nothing."""
    rng = np.random.default_rng(seed)
    u = {name: np.repeat(rng.uniform(0, 1, STEPS // 30), 30) for name in ("speed", "current")}
    u["flow"] = np.full(STEPS, flow)
    phi, around = evaluate(monomials(truth), u, STEPS), np.full((STEPS, 1), 30.0)
    start, fine_s = np.array([26.0, 25.0, 27.0]), STEP_S / FINE
    fine = Frame(fine_s, np.repeat(phi, FINE, axis=0), np.repeat(around, FINE, axis=0))
    temperatures = simulate(compile_network(truth), fine, start)
    channels = []
    for i, node in enumerate(NODES):
        read = lagged(temperatures[:, i], tau_s, fine_s)
        true = ((read[1:] + read[:-1]) / 2).reshape(STEPS, FINE).mean(axis=1)
        noisy = true + rng.normal(0, 0.1, STEPS) + (bias if node == "yoke" else 0.0)
        sensor = Sensor(node, {node: 1.0}, bus="can1", noise=0.1, bias_sd=0.5, time_constant_s=tau_s)
        channels.append(RecordedChannel(sensor, noisy, np.ones(STEPS), np.full(STEPS, 0.5)))
    return Test(
        name=f"session {seed}",
        kind="s2",
        frame=Frame(STEP_S, phi, around),
        inputs=u,
        features={m.name: phi[:, j] for j, m in enumerate(monomials(truth))},
        initial=start + rng.normal(0, 0.3, 3),
        initial_sd=np.full(3, 0.5),
        channels=tuple(channels),
    )


@pytest.fixture(scope="module")
def sessions() -> tuple[Test, ...]:
    return _session(TRUTH, 1, bias=0.8), _session(TRUTH, 2)


@pytest.fixture(scope="module")
def found(sessions: tuple[Test, ...]) -> Calibration:
    return calibrate(_motor(), sessions)


def _named(found: Calibration) -> dict[str, FittedParameter]:
    return {estimate.name: estimate for estimate in found.estimates}


def _under_broad_noise(network: Network, *tests: Test) -> Fit:
    parameters = freedom(network, tests)
    return fit(Model(network, tests, parameters), np.zeros(len(parameters)))


def test_coefficients_that_differ_are_found_within_their_standard_errors(found: Calibration) -> None:
    assert found.fit.converged
    estimates = _named(found)
    for name, true in (
        ("loss.magnet.speed2", 75.0),
        ("loss.yoke.speed1.5", 80.0),
        ("conductance.yoke-magnet.speed0.8", 3.0),
        ("capacity.magnet.scale", 140.0),
        ("conductance.winding-yoke.constant", 12.0),
    ):
        estimate = estimates[name]
        assert abs(math.log(estimate.value / true)) < 3 * estimate.sd, name
    assert abs(math.log(estimates["loss.magnet.speed2"].value / 75.0)) < 0.15
    assert not any(estimate.held for estimate in found.estimates)


def test_the_network_says_the_estimates(found: Calibration) -> None:
    estimates = _named(found)
    for term, before, estimate in zip(terms(found.network), terms(_motor()), found.estimates, strict=False):
        assert term.coefficient == estimate.value
        assert before.coefficient == estimate.before
        assert estimate.value == pytest.approx(estimate.before * math.exp(estimate.log_change))
    assert len(found.estimates) == len(list(terms(found.network))) + len(NODES)
    for node in found.network.nodes:
        assert node.capacity == estimates[f"capacity.{node.name}.scale"].value
    bare = replace(found.network, nodes=(), links=(), sources=())
    assert bare == replace(_motor(), nodes=(), links=(), sources=())


def test_the_errors_of_a_replay_fall(found: Calibration) -> None:
    assert found.mae_before[1, "magnet"] > 4.0
    assert found.mae_after[1, "magnet"] < 0.5
    assert found.bias[0, "yoke"] == pytest.approx(0.8, abs=0.5)
    assert set(found.bias) == set(found.mae_before) == {(s, node) for s in (0, 1) for node in NODES}


def test_a_parameter_that_the_data_cannot_see_keeps_its_prior(found: Calibration) -> None:
    unseen = _named(found)["conductance.yoke-coolant.flow0.8"]
    assert unseen.sd == pytest.approx(unseen.prior_sd, rel=1e-9)
    assert unseen.value == pytest.approx(5.0, rel=1e-9)
    seen = _named(found)["conductance.yoke-coolant.constant"]
    assert seen.sd < LEFT_FREE * seen.prior_sd


def _dense(series: Series, noise: ChannelNoise) -> Floats:
    apart = np.abs(series.t_s[:, None] - series.t_s)
    white = np.diag((series.white_sd**2 + series.resolution**2 / 12) / series.samples)
    fast = noise.ar_sd**2 * np.exp(-apart / noise.ar_tau_s)
    covariance: Floats = white + fast + noise.ou_sd**2 * np.exp(-apart / noise.ou_tau_s)
    return covariance


def test_mode_and_standard_errors_are_those_of_the_normal_equations(found: Calibration) -> None:
    """Written out: central differences of the runs, and every channel's whole covariance."""
    model, beta = found.fit.model, found.fit.beta
    h = 1e-3 * model.sd
    ahead, back = ([model.residuals(beta + sign * step) for step in np.diag(h)] for sign in (1, -1))
    precision, slope = np.diag(1 / model.sd**2), -beta / model.sd**2
    for i, series in enumerate(model.residuals(beta)):
        columns = np.stack([(b[i].y - a[i].y) / (2 * h[p]) for p, (a, b) in enumerate(zip(ahead, back, strict=True))]).T
        weighed = np.linalg.solve(_dense(series, model.noise_of(series.channel)), columns)
        precision += columns.T @ weighed
        slope += weighed.T @ series.y
    covariance = np.linalg.inv(precision)
    expected = np.sqrt(np.diag(covariance))[: len(found.estimates)]
    np.testing.assert_allclose([e.sd for e in found.estimates], expected, rtol=2e-3)
    assert slope @ covariance @ slope / 2 < 2 * ENOUGH


def test_a_search_from_elsewhere_ends_at_the_same_mode(found: Calibration) -> None:
    start = np.random.default_rng(6).normal(0, 0.5, found.fit.beta.size)
    again = fit(found.fit.model, start)
    assert again.converged
    assert again.linearisations > 2
    assert again.cost == pytest.approx(found.fit.cost, abs=ENOUGH)
    away = np.abs(again.beta - found.fit.beta) / np.sqrt(found.fit.covariance_diagonal)
    assert away.max() < 0.3, found.fit.model.parameters[int(np.argmax(away))].name


def test_a_heat_and_its_sink_are_correlated(found: Calibration) -> None:
    place = {parameter.name: i for i, parameter in enumerate(found.fit.model.parameters)}
    heat, sink = place["loss.magnet.speed2"], place["conductance.yoke-magnet.speed0.8"]
    covariance = np.linalg.inv(found.fit.hessian)
    correlation = covariance[heat, sink] / math.sqrt(covariance[heat, heat] * covariance[sink, sink])
    assert correlation > 0.5, "only their ratio shows in the magnet's temperature"


def test_a_parameter_at_its_bound_is_held_and_the_others_go_on() -> None:
    prior = _motor()
    loose = replace(
        prior, sources=(*prior.sources[:2], Source("magnet", (replace(prior.sources[2].terms[0], sd=5.0),)))
    )
    result = calibrate(loose, (_session(_motor(magnet=30.0 * 8.0), 3),))
    held = _named(result)["loss.magnet.speed2"]
    assert held.held
    assert held.value == pytest.approx(120.0, rel=1e-3)
    assert result.fit.converged
    assert max(abs(e.log_change) for e in result.estimates) <= BOUND + 1e-12


def test_a_known_lag_is_no_error_of_the_model() -> None:
    slow = _session(_motor(), 4, tau_s=30.0)
    assert all(abs(e.log_change) < 3 * e.sd for e in calibrate(_motor(), (slow,)).estimates)
    ignored = tuple(replace(c, sensor=replace(c.sensor, time_constant_s=0.0)) for c in slow.channels)
    right, wrong = (_under_broad_noise(_motor(), test) for test in (slow, replace(slow, channels=ignored)))
    assert wrong.cost > right.cost + 20
    names = [parameter.name for parameter in wrong.model.parameters]
    assert wrong.beta[names.index("capacity.winding.scale")] > 0.1, "a lag that is not modelled bends the capacity"


def test_noise_is_widened_by_what_the_model_cannot_follow(sessions: tuple[Test, ...]) -> None:
    assert set(widened_noise(_under_broad_noise(_motor(), *sessions)).values()) == {BROAD}
    wave = 4.0 * np.sin(np.arange(STEPS) / 20.0)
    off = tuple(replace(c, measured=c.measured + (wave if c.name == "yoke" else 0)) for c in sessions[1].channels)
    tests = (sessions[0], replace(sessions[1], channels=off))
    near = _under_broad_noise(_motor(), *tests)
    wide = widened_noise(near)
    assert wide["yoke"].ar_sd > 2 * BROAD.ar_sd
    assert wide["yoke"].ou_sd / wide["yoke"].ar_sd == pytest.approx(BROAD.ou_sd / BROAD.ar_sd)
    again = calibrate(_motor(), tests)
    assert again.fit.model.noise == wide
    for before, after in zip(np.sqrt(near.covariance_diagonal), again.estimates, strict=False):
        assert after.sd >= before * 0.9, after.name


def test_laws_that_stand_twice_at_a_place_are_told_apart() -> None:
    twice = (Term(1.0, {"current": 2.0}, copper=True), Term(1.0, {"current": 2.0}))
    names = [p.name for p in freedom(replace(_motor(), sources=(Source("winding", twice),)), ())]
    assert names[-5:-3] == ["loss.winding.current2", "loss.winding.current2#2"]


# --- Columns of networks that nobody drew by hand --------------------------------------------------------------------


def _any_test(network: Network, frame: Frame) -> Test:
    """Plain, lagged and weighted sensors, some steps without samples; what they measured does not matter here."""
    rng, steps = np.random.default_rng(1), len(frame.features)
    names = [node.name for node in network.nodes]
    some, place = (rng.random(steps) < 0.8).astype(np.float64), rng.random(steps)
    sensors: tuple[tuple[Mapping[str, float], float, Floats, Floats], ...] = (
        ({names[0]: 1.0}, 0.0, some, place),
        ({names[-1]: 1.0}, 3.0, np.ones(steps), place),
        ({names[1]: 0.7, names[2]: 0.3}, 1.0, some, np.full(steps, 0.5)),
    )
    return Test(
        name="any",
        kind="drive",
        frame=frame,
        inputs={},
        features={},
        initial=np.linspace(25, 60, len(names)),
        initial_sd=np.full(len(names), 2.0),
        channels=tuple(
            RecordedChannel(
                Sensor(f"c{i}", weights, bus="can1", noise=0.1, bias_sd=0.5, time_constant_s=tau_s),
                np.zeros(steps),
                samples,
                at,
            )
            for i, (weights, tau_s, samples, at) in enumerate(sensors)
        ),
    )


@pytest.mark.parametrize(("seed", "n"), [(0, 5), (1, 5), (2, 5), (3, 5), (4, 60)])
def test_the_columns_of_any_network_are_the_slopes_of_its_residuals(
    seed: int, n: int, make_network: MakeNetwork, make_frame: MakeFrame
) -> None:
    network = make_network(seed, n=n)
    test = _any_test(network, make_frame(network, seed, steps=60))
    outside = [Parameter(f"outside {b}", actions.BoundaryBias(b), 1.0, 0) for b in range(2)]
    parameters = (*freedom(network, (test,)), *outside)
    model = Model(network, (test,), parameters)
    beta = np.random.default_rng(seed).uniform(-0.5, 0.5, len(parameters)) * model.sd
    columns = np.concatenate([part.columns for part in model.linearise(beta)])
    assert columns.shape[1] == len(parameters)
    rng = np.random.default_rng(seed)
    for p in rng.choice(len(parameters), min(40, len(parameters)), replace=False):
        step = np.zeros_like(beta)
        step[p] = 1e-3 * model.sd[p]
        ahead, back = (np.concatenate([s.y for s in model.residuals(beta + sign * step)]) for sign in (1, -1))
        expected = (back - ahead) / (2 * step[p])
        near = max(1e-3 * np.abs(expected).max(), 1e-9)
        np.testing.assert_allclose(columns[:, p], expected, rtol=0, atol=near, err_msg=parameters[p].name)
