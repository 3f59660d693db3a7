"""Why a session ended, as far as load and temperatures tell."""

from __future__ import annotations

import numpy as np
import pytest

from ingest.bench.derating import DeratingRule
from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import wltc
from ingest.morning.ending import ended
from made.channels import channel

NOISE = np.random.default_rng(1).normal(0.0, 0.05, 6000)


def _session(on_s: int, after_s: int, tau_s: float, rise: float = 80.0) -> list[ChannelData]:
    """A load for `on_s`, then none for `after_s`; a winding that warms towards `rise` above 20 degC."""
    t = np.arange(on_s + after_s)
    warm = 20 + rise * (1 - np.exp(-np.minimum(t, on_s) / tau_s)) + NOISE[: len(t)]
    return [channel("M", "torque", np.where(t < on_s, 50.0, 0.0)), channel("T", "temperature", warm, role="observed")]


@pytest.mark.parametrize(
    ("on_s", "after_s", "tau_s", "kind", "reason"),
    [
        (5000, 600, 600.0, "s1", "steady"),
        (5000, 0, 600.0, "s1", "steady"),
        (1500, 600, 600.0, "s1", "not steady"),
        (1500, 0, 600.0, "s1", "log ends"),
        (1500, 600, 600.0, "drive", "unknown"),
        (100, 600, 600.0, "s1", "unknown"),
    ],
)
def test_the_end_of_a_hold(on_s: int, after_s: int, tau_s: float, kind: str, reason: str) -> None:
    assert ended(_session(on_s, after_s, tau_s), kind).reason == reason


def test_what_still_warmed_at_the_end_of_a_hold_is_named() -> None:
    found = ended(_session(1500, 600, 600.0), "s1")
    assert found.says.startswith("T still warmed by ") and found.says.endswith(" K/h in the last 10 min of load")


def test_whether_it_is_steady_a_coarse_reading_does_not_tell() -> None:
    load, warm = _session(5000, 600, 600.0)
    coarse = channel("T", "temperature", np.round(warm.value), role="observed")
    assert ended([load, coarse], "s1").reason == "unknown"


def test_a_limit_of_the_bench_file_is_told() -> None:
    channels = _session(1500, 600, 600.0)
    found = ended(channels, "s1", [DeratingRule("T", 93.0, 100.0)])
    assert (found.reason, found.says[:10]) == ("limit", "T was at 9")
    assert ended(channels, "s1", [DeratingRule("T", 120.0, 130.0)]).reason == "not steady"


def test_pulses_that_end_at_one_temperature_ended_at_a_limit() -> None:
    high = np.tile(np.r_[np.ones(40), np.zeros(200)], 5)
    saw = np.tile(np.r_[np.linspace(60, 150, 40), np.linspace(150, 60, 200)], 5) + NOISE[:1200]
    torque = channel("M", "torque", 200 * high)
    found = ended([torque, channel("T", "temperature", saw, role="observed")], "s2")
    assert (found.reason, found.says) == ("limit", "5 pulses ended with T at 150 °C (within 0.1 K)")
    rising = saw + np.linspace(0, 30, 1200)
    assert ended([torque, channel("T", "temperature", rising, role="observed")], "s2").reason == "unknown"


@pytest.mark.parametrize(
    ("until_s", "reason"), [(1801, "whole"), (1701, "aborted"), (900, "unknown")], ids=["whole", "cut", "half"]
)
def test_a_cycle_is_whole_or_was_broken_off(until_s: int, reason: str) -> None:
    speed = 45.0 * wltc()[:until_s]
    assert ended([channel("n", "speed", speed), channel("M", "torque", 0.01 * speed)], "wltp").reason == reason


def test_without_a_load_nobody_knows() -> None:
    assert ended([channel("T", "temperature", [20.0, 21.0])], "ageing").reason == "unknown"
