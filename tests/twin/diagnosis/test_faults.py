"""Masked data faults: evidence that a channel was held, counted in blocks and given what the fit leaves open."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from made import motor as made
from twin.diagnosis.faults import Stretch, cause_of, dropout_evidence, fault_evidence
from twin.differences.everyday import everyday
from twin.errors import EvidenceError
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.fitting.noise import ChannelNoise
from twin.fitting.recorded import RecordedChannel
from twin.motor.causes import parse

Floats = NDArray[np.float64]

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
NOISE = ChannelNoise(ar_sd=0.05, ar_tau_s=60.0, ou_sd=0.05, ou_tau_s=600.0)
FIRST_S, LAST_S = 600.0, 1000.0


@cache
def _fitted(lacking: str = "") -> Fit:
    """Two tests; in the first the channels are masked from 600 s to 1000 s, in the second `lacking` is not there."""
    network = made.every_law()
    kept = np.ones(900)
    kept[300:500] = 0.0
    masked = made.recorded(network, made.smooth(1800.0), INITIAL, seed=1, samples=dict.fromkeys(made.CHANNELS, kept))
    other = made.recorded(network, made.pulses(1200.0), INITIAL, seed=2)
    other = replace(other, channels=tuple(c for c in other.channels if c.name != lacking))
    tests = (masked, other)
    noise = dict.fromkeys(made.CHANNELS, NOISE)
    return fit(Model(network, tests, everyday(network, tests), noise), np.zeros(len(everyday(network, tests))))


def _raw(channel: str, first_s: float = FIRST_S, last_s: float = LAST_S, hold: bool = False) -> tuple[Floats, Floats]:
    """Samples at 4 Hz of what the channel showed in the first test; held at their first value."""
    rng = np.random.default_rng(7)
    test = made.recorded(made.every_law(), made.smooth(1800.0), INITIAL)
    means = next(c.measured for c in test.channels if c.name == channel)
    t_s = np.arange(first_s, last_s, 0.25)
    values = np.interp(t_s, 2.0 * np.arange(len(means)) + 1.0, means)
    values = np.full_like(values, values[0]) if hold else values + rng.normal(0, made.WHITE_SD, len(values))
    return t_s, values


def _stretch(values: Floats, kind: str = "stuck") -> list[Stretch]:
    return [Stretch(kind, FIRST_S, LAST_S, float(values[0]))]


def test_the_evidence_is_the_gaussian_one_of_the_blocks() -> None:
    fitted = _fitted()
    t_s, values = _raw("W_1")
    stretches = _stretch(values)
    test = fitted.model.tests[0]
    at = np.floor(t_s / 2.0).astype(int)
    samples = np.bincount(at, minlength=900).astype(float)
    means = np.bincount(at, values, minlength=900) / np.maximum(samples, 1)
    w_1 = test.channels[0]
    # samples at 0, 0.25 .. 1.75 s of a step stand at 0.4375 of it
    w_1 = RecordedChannel(w_1.sensor, means, samples, place=np.full(900, 0.4375))
    shown = replace(test, channels=(w_1, *test.channels[1:]))
    model = Model(fitted.model.network, (shown, fitted.model.tests[1]), fitted.model.parameters, fitted.model.noise)
    part = model.linearise(fitted.beta)[0]
    a = np.zeros((len(part.columns), len(fitted.beta)))
    a[:, part.at] = part.columns
    white = part.series.white_variance
    apart = np.abs(part.series.t_s[:, None] - part.series.t_s)
    slow = NOISE.ar_sd**2 * np.exp(-apart / NOISE.ar_tau_s) + NOISE.ou_sd**2 * np.exp(-apart / NOISE.ou_tau_s)
    live = multivariate_normal(np.zeros(len(a)), np.diag(white) + slow + a @ np.linalg.inv(fitted.hessian) @ a.T)
    block, half_a_step = means[300:500].reshape(-1, 5).mean(axis=1), w_1.sensor.resolution / 2
    held = multivariate_normal(np.full(len(a), values[0]), np.diag(white))
    beyond = np.copysign(np.maximum(np.abs(part.series.y) - half_a_step, 0.0), part.series.y)
    expected = held.logpdf(block) - live.logpdf(beyond)
    assert len(part.series.y) == 40
    assert fault_evidence(fitted, 0, "W_1", stretches, t_s, values) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("channel", list(made.CHANNELS))
def test_a_channel_that_was_held_while_the_motor_warmed_is_told(channel: str) -> None:
    t_s, values = _raw(channel, hold=True)
    assert fault_evidence(_fitted(), 0, channel, _stretch(values), t_s, values) > 20


@pytest.mark.parametrize("channel", list(made.CHANNELS))
def test_a_channel_that_followed_the_motor_was_live(channel: str) -> None:
    t_s, values = _raw(channel)
    assert fault_evidence(_fitted(), 0, channel, _stretch(values), t_s, values) < -20


@pytest.mark.parametrize(("step_K", "least", "most"), [(0.1, 500.0, 2000.0), (1.0, 20.0, 100.0), (3.0, -3.0, 3.0)])
def test_a_sensor_of_coarse_steps_stands_still_while_the_motor_stays_within_one(
    step_K: float, least: float, most: float
) -> None:
    """The yoke warms by 3.6 K meanwhile, from 49.0 to 52.7 degC: whole steps of 3 K read 51, nothing else does."""
    fitted = _fitted()
    tests = [
        replace(one, channels=tuple(replace(c, sensor=replace(c.sensor, resolution=step_K)) for c in one.channels))
        for one in fitted.model.tests
    ]
    model = Model(fitted.model.network, tests, fitted.model.parameters, fitted.model.noise)
    t_s, values = _raw("Y_1")
    shown = np.full_like(values, round(values.mean() / step_K) * step_K)
    evidence = fault_evidence(replace(fitted, model=model), 0, "Y_1", _stretch(shown), t_s, shown)
    assert least < evidence < most


def test_samples_repeated_by_the_bus_bring_no_evidence_of_their_own() -> None:
    t_s, values = _raw("Y_1", hold=True)
    fitted = _fitted()
    once = fault_evidence(fitted, 0, "Y_1", _stretch(values), t_s, values)
    finer = np.arange(FIRST_S, LAST_S, 0.025)
    often = fault_evidence(fitted, 0, "Y_1", _stretch(values), finer, np.full(len(finer), values[0]))
    blocks = 40
    assert once > 0
    # Ten times more alike: a block each, no sample each.
    assert abs(often - once) < np.log(10) / 2 * blocks + 0.05 * once


def test_short_silences_of_a_radio_are_everyday() -> None:
    t_s, values = _raw("W_1", hold=True)
    short = [Stretch("held", first_s, first_s + 20.0, float(values[0])) for first_s in (600.0, 700.0, 800.0, 900.0)]
    assert fault_evidence(_fitted(), 0, "W_1", short, t_s, values) == 0.0


def test_without_a_sample_in_a_stretch_nothing_is_said() -> None:
    assert fault_evidence(_fitted(), 0, "W_1", [], *_raw("W_1")) == 0.0
    outside = [Stretch("held", 5000.0, 5100.0, 50.0)]
    assert fault_evidence(_fitted(), 0, "W_1", outside, *_raw("W_1")) == 0.0


def test_samples_outside_the_stretch_do_not_count() -> None:
    fitted = _fitted()
    t_s, values = _raw("W_1", hold=True)
    wider_t, wider = _raw("W_1", 300.0, 1500.0)
    wider[np.isin(wider_t, t_s)] = values
    inside = [Stretch("stuck", FIRST_S, LAST_S - 0.1, float(values[0]))]
    assert fault_evidence(fitted, 0, "W_1", inside, wider_t, wider) == pytest.approx(
        fault_evidence(fitted, 0, "W_1", inside, t_s, values)
    )


def test_a_channel_masked_in_the_whole_test_is_known_from_another() -> None:
    fitted = _fitted("Y_1")
    t_s = np.arange(0.0, 1200.0, 0.25)
    values = np.full(len(t_s), 50.0)
    assert fault_evidence(fitted, 1, "Y_1", [Stretch("stuck", 0.0, 1200.0, 50.0)], t_s, values) > 20


def test_a_channel_that_no_test_has_is_refused_with_those_there_are() -> None:
    with pytest.raises(EvidenceError, match='channel "X_9": no test of the fit has it: give one of W_1, Y_1, R_1'):
        fault_evidence(_fitted(), 0, "X_9", [], np.zeros(0), np.zeros(0))


def test_times_and_values_of_different_number_are_refused() -> None:
    with pytest.raises(EvidenceError, match='channel "W_1": 2 times for 1 values'):
        fault_evidence(_fitted(), 0, "W_1", [], np.zeros(2), np.zeros(1))


@pytest.mark.parametrize(
    ("kind", "law"), [("held", "hold"), ("stuck", "stuck"), ("saturated", "saturation"), ("dropout", "dropout")]
)
def test_every_kind_of_stretch_has_its_cause_id(kind: str, law: str) -> None:
    assert str(cause_of("magnet", kind)) == f"sensor.magnet.{law}"
    assert parse(f"sensor.magnet.{law}") == cause_of("magnet", kind)


def test_frames_lost_at_thirty_per_cent_are_told_and_at_one_per_cent_are_everyday() -> None:
    assert dropout_evidence(12600, 3800) > 1000
    assert dropout_evidence(17800, 180) < 0
    assert dropout_evidence(18000, 0) < 0
    assert dropout_evidence(0, 0) == 0.0


def test_evidence_of_lost_frames_is_the_binomial_one() -> None:
    shares = (np.arange(200000) + 0.5) / 200000
    uniform = np.mean(shares**6 * (1 - shares) ** 24)
    everyday = 0.02**6 * 0.98**24
    assert dropout_evidence(30, 6) == pytest.approx(np.log(uniform / everyday), rel=1e-6)


def test_more_gaps_than_frames_are_refused() -> None:
    with pytest.raises(EvidenceError, match="5 gaps among 3 frames"):
        dropout_evidence(3, 5)
