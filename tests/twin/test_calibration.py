"""Calibration on synthetic sessions whose coefficients are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.calibration import (
    BOUND,
    BROAD,
    Calibration,
    Channel,
    Kernels,
    Problem,
    Recorded,
    calibrate,
    kernels,
    names,
)
from twin.calibration_noise import fitted_noise, widened_noise
from twin.features import evaluate, monomials
from twin.kernel import compile_network
from twin.network import Boundary, Link, Network, Node, Source, Term
from twin.outputs import Output, reading
from twin.simulate import Frame, simulate

Floats = NDArray[np.float64]
STEP_S = 2.0


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


def _session(truth: Network, seed: int, flow: float = 0.0, bias: float = 0.0, tau_s: float = 0.0) -> Recorded:
    """900 s of plateaus; flow stands still unless said, so that its term acts on nothing."""
    rng, steps = np.random.default_rng(seed), 900
    u = {name: np.repeat(rng.uniform(0, 1, steps // 30), 30) for name in ("speed", "current")}
    u["flow"] = np.full(steps, flow)
    frame = Frame(STEP_S, evaluate(monomials(truth), u, steps), np.full((steps, 1), 30.0))
    start = np.array([26.0, 25.0, 27.0])
    temperatures = simulate(compile_network(truth), frame, start)
    channels = []
    for node in ("winding", "yoke", "magnet"):
        output = Output({node: 1.0}, tau_s, np.ones(steps), np.full(steps, 0.5))
        read = reading(output, temperatures, ["winding", "yoke", "magnet"], STEP_S)
        noisy = (read[1:] + read[:-1]) / 2 + rng.normal(0, 0.1, steps) + (bias if node == "yoke" else 0.0)
        channels.append(Channel(node, output, noisy, 0.1, 0.0, 0.5))
    return Recorded(frame, start + rng.normal(0, 0.3, 3), np.full(3, 0.5), tuple(channels))


@pytest.fixture(scope="module")
def kernel() -> Kernels:
    return kernels(_motor())


@pytest.fixture(scope="module")
def found(kernel: Kernels) -> Calibration:
    truth = _motor(magnet=75.0, yoke=80.0, gap=3.0, capacity=140.0)
    sessions = (_session(truth, 1, bias=0.8), _session(truth, 2))
    return calibrate(Problem(_motor(), sessions), kernel)


def test_coefficients_that_differ_are_found_within_their_standard_errors(found: Calibration) -> None:
    assert found.converged
    estimates = {estimate.name: estimate for estimate in found.estimates}
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


def test_the_errors_of_a_replay_fall(found: Calibration) -> None:
    assert found.mae_before[1, "magnet"] > 4.0
    assert found.mae_after[1, "magnet"] < 0.5
    assert found.bias[0, "yoke"] == pytest.approx(0.8, abs=0.5)


def test_a_parameter_that_the_data_cannot_see_keeps_its_prior(found: Calibration) -> None:
    unseen = next(e for e in found.estimates if e.name == "conductance.yoke-coolant.flow0.8")
    assert unseen.free
    assert unseen.prior_left == pytest.approx(1.0, abs=1e-9)
    assert unseen.value == pytest.approx(5.0, rel=1e-9)
    seen = next(e for e in found.estimates if e.name == "conductance.yoke-coolant.constant")
    assert not seen.free


def test_a_search_from_elsewhere_ends_at_the_same_mode(found: Calibration, kernel: Kernels) -> None:
    truth = _motor(magnet=75.0, yoke=80.0, gap=3.0, capacity=140.0)
    problem = Problem(_motor(), (_session(truth, 1, bias=0.8), _session(truth, 2)))
    again = calibrate(problem, kernel, np.random.default_rng(6).normal(0, 0.5, found.beta.size))
    assert again.converged
    assert again.iterations > 2
    assert again.log_posterior == pytest.approx(found.log_posterior, abs=0.05)
    for a, b in zip(again.estimates, found.estimates, strict=True):
        assert abs(a.log_change - b.log_change) < 0.1 * b.sd, a.name


def test_correlations_are_those_of_the_covariance(found: Calibration) -> None:
    np.testing.assert_allclose(np.diag(found.correlation), 1.0)
    assert np.abs(found.correlation).max() <= 1.0 + 1e-12
    place = {name: i for i, name in enumerate(names(_motor()))}
    heat, sink = place["loss.magnet.speed2"], place["conductance.yoke-magnet.speed0.8"]
    assert found.correlation[heat, sink] > 0.5, "only their ratio shows in the magnet's temperature"


def test_a_parameter_at_its_bound_is_held_and_the_others_go_on(kernel: Kernels) -> None:
    truth = _motor(magnet=30.0 * 8.0)
    prior = _motor()
    loose = replace(
        prior, sources=(*prior.sources[:2], Source("magnet", (replace(prior.sources[2].terms[0], sd=5.0),)))
    )
    result = calibrate(Problem(loose, (_session(truth, 3),)), kernel)
    held = next(e for e in result.estimates if e.name == "loss.magnet.speed2")
    assert held.held
    assert held.value == pytest.approx(120.0)
    assert result.converged
    assert max(abs(e.log_change) for e in result.estimates) <= BOUND + 1e-12


def test_a_known_lag_is_no_error_of_the_model(kernel: Kernels) -> None:
    truth = _motor()
    slow = _session(truth, 4, tau_s=30.0)
    result = calibrate(Problem(_motor(), (slow,)), kernel)
    assert all(abs(e.log_change) < 3 * e.sd for e in result.estimates)
    ignored = tuple(replace(c, output=replace(c.output, time_constant_s=0.0)) for c in slow.channels)
    wrong = calibrate(Problem(_motor(), (replace(slow, channels=ignored),)), kernel)
    assert wrong.log_posterior < result.log_posterior - 20
    capacity = next(e for e in wrong.estimates if e.name == "capacity.winding.scale")
    assert capacity.log_change > 0.1, "a lag that is not modelled bends the capacity"


def test_fitted_noise_is_that_of_the_data(found: Calibration, kernel: Kernels) -> None:
    truth = _motor(magnet=75.0, yoke=80.0, gap=3.0, capacity=140.0)
    problem = Problem(_motor(), (_session(truth, 1, bias=0.8), _session(truth, 2)))
    noise = fitted_noise(problem, kernel, found.beta)
    assert set(noise) == {"winding", "yoke", "magnet"}
    assert max(n.ar_sd for n in noise.values()) < 0.1, "white noise alone was put in"
    sharp = calibrate(replace(problem, noise=noise), kernel, found.beta)
    assert sharp.converged
    assert all(s.sd <= 1.001 * e.sd for s, e in zip(sharp.estimates, found.estimates, strict=True))


def test_noise_is_widened_by_what_the_model_cannot_follow(found: Calibration, kernel: Kernels) -> None:
    truth = _motor(magnet=75.0, yoke=80.0, gap=3.0, capacity=140.0)
    sound = Problem(_motor(), (_session(truth, 1, bias=0.8), _session(truth, 2)))
    assert set(widened_noise(sound, kernel, found.beta).values()) == {BROAD}
    wave = 4.0 * np.sin(np.arange(900) / 20.0)
    off = tuple(replace(c, measured=c.measured + (wave if c.name == "yoke" else 0)) for c in sound.sessions[1].channels)
    problem = replace(sound, sessions=(sound.sessions[0], replace(sound.sessions[1], channels=off)))
    near = calibrate(problem, kernel)
    wide = widened_noise(problem, kernel, near.beta)
    assert wide["yoke"].ar_sd > 2 * BROAD.ar_sd
    assert wide["yoke"].ou_sd / wide["yoke"].ar_sd == pytest.approx(BROAD.ou_sd / BROAD.ar_sd)
    again = calibrate(replace(problem, noise=wide), kernel, near.beta)
    for before, after, name in zip(near.estimates, again.estimates, names(_motor()), strict=True):
        assert after.sd >= before.sd * 0.9, name


def test_laws_that_stand_twice_at_a_place_are_told_apart() -> None:
    twice = (Term(1.0, {"current": 2.0}, copper=True), Term(1.0, {"current": 2.0}))
    network = replace(_motor(), sources=(Source("winding", twice),))
    assert names(network)[-5:-3] == ("loss.winding.current2", "loss.winding.current2#2")
