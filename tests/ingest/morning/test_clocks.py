"""Offset and drift between two loggers' clocks: found to what is said, and not told where they cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import wltc
from ingest.morning.clocks import CannotTellError, ClockOffset, align, pairs
from made.channels import channel

Array = NDArray[np.float64]


def _plateaus(seed: int, seconds: int) -> Array:
    """Speed at 10 Hz: plateaus of 15 to 90 s with ramps of a second."""
    random = np.random.default_rng(seed)
    lengths = random.integers(15, 90, seconds // 15)
    speed = np.repeat(random.uniform(0, 6000, len(lengths)), 10 * lengths)[: 10 * seconds]
    return np.convolve(speed, np.full(10, 0.1), "same")


def _second_logger(
    speed: Array, seed: int, late_s: float, ppm: float, rate_Hz: float, quantity: str = "speed"
) -> ChannelData:
    """The same speed [10 Hz] as another logger has it: another gain and noise, and a clock that is late and drifts."""
    random = np.random.default_rng(100 + seed)
    true = np.arange(3.0, len(speed) / 10 - 3.0, 1 / rate_Hz)
    value = 1.02 * np.interp(true, np.arange(len(speed)) / 10, speed) + 40 + random.normal(0, 15, len(true))
    stamps = true + late_s + 1e-6 * ppm * (true - len(speed) / 20) + random.normal(0, 0.002, len(true))
    return channel("n2", quantity, value, t_s=stamps)


def _first_logger(speed: Array, seed: int) -> ChannelData:
    return channel("n1", "speed", speed + np.random.default_rng(seed).normal(0, 10, len(speed)), 10.0)


def _found(seed: int, late_s: float, ppm: float, rate_Hz: float, seconds: int = 3600) -> ClockOffset:
    speed = _plateaus(seed, seconds)
    return align(_first_logger(speed, seed), _second_logger(speed, seed, late_s, ppm, rate_Hz))


def test_offset_and_drift_lie_within_what_is_said_over_many_draws() -> None:
    off = []
    for seed in range(16):
        late_s, ppm = np.random.default_rng(seed).uniform([-40, -150], [40, 150])
        found = _found(seed, late_s, ppm, 1.0)
        assert found.offset_sd_s < 0.35 and found.drift_sd_ppm < 40
        off.append(((found.offset_s - late_s) / found.offset_sd_s, (found.drift_ppm - ppm) / found.drift_sd_ppm))
    assert np.abs(off).max() < 3.5
    assert np.mean(np.abs(off) < 2.0) > 0.9
    assert np.std(np.array(off)[:, 1]) > 0.4, "nor is more uncertainty said than there is"


@pytest.mark.parametrize("interval_s", [1.0, 5.0])
def test_the_band_of_a_drift_holds_where_edges_fall_anywhere_between_the_samples(interval_s: float) -> None:
    """Ramps of 0.1 s at any moment: a slower logger knows of each edge between which two samples it was."""
    off = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        edges, levels = np.cumsum(random.uniform(15, 90, 240)), random.uniform(0, 6000, 240)
        at = np.searchsorted(edges, np.arange(36_000) / 10)
        late_s, ppm = random.uniform([-20, -80], [20, 80])
        second = _second_logger(levels[at], seed, late_s, ppm, 1 / interval_s)
        found = align(_first_logger(levels[at], seed), second)
        off.append((found.drift_ppm - ppm) / found.drift_sd_ppm)
    assert np.abs(off).max() < 3.0 and np.sqrt(np.mean(np.square(off))) < 1.3


def test_fast_loggers_tell_a_hundredth_of_a_second() -> None:
    found = _found(3, 0.25, 0.0, 10.0)
    assert found.offset_s == pytest.approx(0.25, abs=2 * found.offset_sd_s)
    assert found.offset_sd_s < 0.04


def test_on_the_wltc_a_second_logger_is_late_by_5_s() -> None:
    speed = np.repeat(wltc(), 10) * 45.0
    found = align(_first_logger(speed, 1), _second_logger(speed, 1, 5.0, 0.0, 1.0))
    assert found.offset_s == pytest.approx(5.0, abs=2 * found.offset_sd_s)
    assert abs(found.drift_ppm) < 2.5 * found.drift_sd_ppm


@pytest.mark.parametrize("seed", range(4))
def test_two_different_drives_tell_no_lag(seed: int) -> None:
    first, second = (
        _first_logger(_plateaus(seed, 1800), seed),
        _second_logger(_plateaus(seed + 50, 1800), seed, 0, 0, 1),
    )
    with pytest.raises(CannotTellError, match="do not show one thing"):
        align(first, second)


def test_what_repeats_tells_no_lag() -> None:
    pulses = np.tile(np.repeat([0.0, 5000.0], [400, 100]), 60)
    with pytest.raises(CannotTellError, match="repeats"):
        align(_first_logger(pulses, 1), _second_logger(pulses, 1, 4.0, 0.0, 1.0))


def test_a_clock_that_is_set_in_between_is_no_offset() -> None:
    speed = _plateaus(1, 3600)
    second = _second_logger(speed, 1, 0.0, 0.0, 1.0)
    half = second.t_ns > 1_800_000_000_000
    jumped = channel("n2", "speed", second.value, t_s=(second.t_ns + 6_000_000_000 * half) / 1e9)
    with pytest.raises(CannotTellError, match="no straight line"):
        align(_first_logger(speed, 1), jumped)


def test_a_hold_and_a_short_time_tell_nothing() -> None:
    hold = np.full(9000, 3000.0)
    with pytest.raises(CannotTellError):
        align(_first_logger(hold, 1), _second_logger(hold, 1, 4.0, 0.0, 1.0))
    short = _plateaus(1, 200)
    with pytest.raises(CannotTellError, match=r"at once for 19\d s only"):
        align(_first_logger(short, 1), _second_logger(short, 1, 0.0, 0.0, 1.0))


@pytest.mark.filterwarnings("error")
def test_a_stretch_at_rest_tells_no_lag_and_warns_of_nothing() -> None:
    """Both stand still for more than the first half: no correlation can be said there."""
    speed = _plateaus(2, 3600)
    speed[:20_000] = 0.0
    late = channel("n2", "speed", np.roll(speed, 30), 10.0)
    assert align(channel("n1", "speed", speed, 10.0), late).offset_s == pytest.approx(3.0, abs=0.1)


def test_torque_goes_with_current_and_a_temperature_with_nothing() -> None:
    torque, current = channel("M", "torque", [0, 1]), channel("I", "current", [0, 1])
    warm = channel("T", "temperature", [0, 1])
    assert [(x.spec.name, y.spec.name) for x, y in pairs([torque, warm], [warm, current, torque])] == [
        ("M", "M"),
        ("M", "I"),
    ]
