"""What is said of each channel: rate, range, noise, gaps, and stretches that tell nothing new."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.quality import assess, findings, noise_of, seconds
from ingest.morning.sensors import alone
from made.channels import channel, logged
from made.places import EXAMPLES

EXAMPLES = EXAMPLES / "hust_motor"
HOUR = np.arange(3600.0)
WAVE = 60 + 20 * np.sin(HOUR / 200) + 0.3 * np.sin(HOUR / 7)


def temperature(value: NDArray[np.float64], name: str = "MAG_1", **more: Any) -> ChannelData:
    return channel(name, "temperature", np.round(value, 1), **({"role": "observed", "node": "magnet"} | more))


def moving(name: str = "torque") -> ChannelData:
    return channel(name, "torque", 100 * np.sin(HOUR / 30))


def stretches(*channels: ChannelData) -> list[tuple[str, int, int]]:
    return [(one.kind, one.first, one.last) for one in assess(channels)[0].stretches]


def noise(sd: float, size: int = 3600) -> NDArray[np.float64]:
    return np.random.default_rng(7).normal(0, sd, size)


def held(*spans: tuple[int, int], value: NDArray[np.float64] = WAVE) -> NDArray[np.float64]:
    """`value` with noise, that holds its value over each span; the samples beside it differ by 0.2."""
    copy = value + noise(0.1)
    for first, last in spans:
        copy[first : last + 1] = copy[first]
        for beside in {first - 1, last + 1} & set(range(len(copy))):
            copy[beside] = copy[first] + 0.2
    return copy


def test_rate_range_and_steps_are_those_of_the_samples() -> None:
    (found,) = assess([channel("n", "speed", [0.0, 0.5, 2.0, 1.0] * 20, rate_Hz=2.0)])
    assert (found.samples, found.rate_Hz, found.low, found.high, found.resolution) == (80, 2.0, 0.0, 2.0, 0.5)


def test_noise_is_seen_on_a_steep_ramp_with_steps() -> None:
    value = 5.0 * HOUR + 40.0 * (HOUR > 1000) + noise(0.3)
    assert noise_of(value) == pytest.approx(0.3, rel=0.05)
    assert noise_of(3.0 * HOUR) == pytest.approx(0.0, abs=1e-9)
    assert noise_of(HOUR[:5]) is None


def test_a_held_stretch_is_found_with_its_ends_and_all_but_its_first_sample_is_bad() -> None:
    data = temperature(held((1000, 1239), (2200, 2439)))
    (found, _) = assess([data, moving()])
    assert [(one.kind, one.first, one.last) for one in found.stretches] == [("held", 1000, 1239), ("held", 2200, 2439)]
    assert found.stretches[0].duration_s == 239.0
    assert found.good[1000] and not found.good[1001:1240].any() and found.good[1240:2201].all()
    assert [flag.says for flag in findings([found])] == ["MAG_1 is held for up to 239 s, 2 times: masked"]


@pytest.mark.parametrize("last", [1239, 3599])
def test_the_value_that_an_open_thermocouple_jumps_to_was_not_measured(last: int) -> None:
    value = held((1000, last))
    value[1000 : last + 1] = 1372.0
    (found, _) = assess([temperature(value), moving()])
    assert [(one.first, one.last) for one in found.stretches] == [(1000, last)]
    assert not found.good[1000 : last + 1].any() and found.good[:1000].all()
    (flag,) = findings([found])
    assert flag.says.startswith(f"MAG_1 is {flag.flag} at 1,372 for ")


def test_a_held_stretch_needs_another_channel_that_moves() -> None:
    data = temperature(held((1000, 1239)))
    assert stretches(data) == []
    assert stretches(data, channel("n", "speed", np.zeros(3600))) == []
    jitter = channel("i", "current", noise(1))  # its last digit changes all the time: no movement
    assert stretches(data, jitter) == []
    assert stretches(data, moving()) == [("held", 1000, 1239)]


def test_a_channel_of_another_file_does_not_count_as_movement() -> None:
    data = temperature(held((1000, 1239)))
    other = channel("torque", "torque", 100 * np.sin(HOUR / 30), raw="b" * 64)
    assert stretches(data, other) == []


def test_healthy_rest_is_not_held() -> None:
    """Cooling to rest in 0.1 K steps, while a draught moves the ambient by 2 K."""
    rest = temperature(22.0 + 40.0 * np.exp(-HOUR / 250) + noise(0.02), "endwinding")
    repeats = np.diff(np.flatnonzero(np.diff(rest.value) != 0)).max()
    assert repeats > 200
    draught = channel("ambient", "temperature", np.round(22 + np.sin(HOUR / 60), 1), node="ambient")
    assert stretches(rest, draught) == []


@pytest.mark.parametrize("name", ["id_1", "id_3", "id_9", "id_10", "id_12"])
def test_nothing_of_a_healthy_recording_is_held(name: str) -> None:
    """Currents repeat for up to 1,160 s there, temperatures for up to 318 s."""
    data = np.genfromtxt(EXAMPLES / f"{name}.csv.gz", delimiter=",", names=True)
    quantities = {"Torque": "torque", "speed": "speed", "IdFbk": "current_d", "IqFbk": "current_q", "Ud": "voltage_d"}
    channels = [
        channel(column, quantities.get(column, "temperature"), data[column])
        for column in data.dtype.names or ()
        if column not in ("IdRef", "IqRef", "Uq", "Pele_PI")
    ]
    assert findings(assess(channels)) == []


def test_an_input_at_exactly_zero_is_never_held() -> None:
    speed = np.where((HOUR > 1000) & (HOUR < 2500), 0.0, 3000 + noise(3))
    assert stretches(channel("n", "speed", speed), moving()) == []
    assert stretches(channel("n", "speed", speed + 7.0), moving()) != []


def test_a_run_of_five_seconds_is_not_held_however_fast_the_channel() -> None:
    value = noise(1, 20_000)
    value[3000:3501] = value[3000]  # 5.0 s
    value[9000:9511] = value[9000]  # 5.1 s
    fast = channel("i", "current", value, rate_Hz=100.0)
    other = channel("torque", "torque", np.sin(np.arange(20_000) / 90), rate_Hz=100.0)
    assert stretches(fast, other) == [("held", 9000, 9510)]


def test_a_channel_that_dies_is_stuck_to_the_end() -> None:
    falling = held((3000, 3599), value=WAVE)
    assert stretches(temperature(falling), moving()) == [("stuck", 3000, 3599)]
    assert [flag.flag for flag in findings(assess([temperature(falling), moving()]))] == ["stuck"]


def test_a_run_of_ten_minutes_is_stuck() -> None:
    assert stretches(temperature(held((1000, 1650))), moving()) == [("stuck", 1000, 1650)]


def test_a_dead_channel_is_stuck_from_beginning_to_end() -> None:
    assert stretches(temperature(np.full(3600, 23.0)), moving()) == [("stuck", 0, 3599)]


def test_a_clipped_channel_is_saturated_and_none_of_it_is_good() -> None:
    clipped = np.minimum(WAVE + noise(0.1), 78.0)
    (found, _) = assess([temperature(clipped), moving()])
    assert {one.kind for one in found.stretches} == {"saturated"}
    assert all(one.value == 78.0 for one in found.stretches)
    assert not found.good[found.stretches[0].first]
    assert "is saturated at 78 for up to" in findings([found])[0].says


def test_a_channel_that_sticks_three_times_at_one_value_is_saturated_there() -> None:
    value = held((500, 560), (1500, 1560), (2500, 2560))
    for first in (500, 1500, 2500):
        value[first : first + 61] = 52.6
    assert {kind for kind, _, _ in stretches(temperature(value), moving())} == {"saturated"}


def test_the_last_value_before_a_dropout_at_the_peak_is_held_and_not_saturated() -> None:
    value = np.where(HOUR < 1000, 20 + HOUR / 20, 30.0) + noise(0.1)
    value[990:1300] = 75.0
    assert stretches(temperature(value), moving()) == [("held", 990, 1299)]


def test_an_input_that_is_constant_is_used_as_it_stands_and_never_saturated() -> None:
    speed = channel("n", "speed", np.full(3600, 7000.0))
    pulses = channel("M", "torque", np.where(HOUR % 300 < 60, 140.0, 40 + noise(2)))
    clipped = channel("i", "current", np.minimum(WAVE + noise(0.1), 78.0))
    steps = channel("U", "voltage_dc", np.where(HOUR < 1500, 700.0, np.where(HOUR < 2400, 650 + noise(1), 600.0)))
    found = assess([speed, pulses, clipped, steps, moving()])
    says = [flag.says for flag in findings(found)]
    assert says[0] == "n is constant at 7,000 for 60 min (used as it stands)"
    assert says[1] == "M is constant at 140 for up to 59 s, 12 times (used as it stands)"
    assert says[2].startswith("i is constant at 78 for up to ") and says[2].endswith(" times (used as it stands)")
    assert says[3] == "U is constant for up to 25 min, 2 times (used as it stands)"
    assert [flag.flag for flag in findings(found)] == ["stuck", "held", "held", "stuck"]
    assert all(one.good.all() for one in found)


def test_two_long_holds_beside_each_other_are_both_found() -> None:
    assert stretches(temperature(held((1000, 1399), (1401, 1800))), moving()) == [
        ("held", 1000, 1399),
        ("held", 1401, 1800),
    ]


def test_a_set_value_repeats_by_its_nature() -> None:
    assert stretches(channel("n_set", "speed_command", np.where(HOUR < 1800, 500.0, 700.0)), moving()) == []


def test_an_ignored_channel_is_described_but_not_flagged() -> None:
    found = assess([temperature(held((1000, 1239)), role="ignored"), moving()])
    assert found[0].stretches and findings(found) == []


def test_gaps_are_over_five_medians_and_over_a_second() -> None:
    slow = np.r_[np.arange(100.0), np.arange(104.9, 200.0)]  # 5.9 s
    fast = np.r_[np.arange(0, 10, 0.01), np.arange(10.9, 20, 0.01), np.arange(22, 30, 0.01)]
    (a, b) = assess([channel("a", "torque", np.sin(slow), t_s=slow), channel("b", "torque", np.sin(fast), t_s=fast)])
    assert [gap.duration_s for gap in a.gaps] == [pytest.approx(5.9)]
    assert [gap.duration_s for gap in b.gaps] == [pytest.approx(2.01)]
    assert [flag.says for flag in findings([a])] == ["a has no samples for 5.9 s"]


def test_one_sample_is_a_channel_too() -> None:
    (found,) = assess([channel("r", "resistance", [0.01])])
    assert (found.rate_Hz, found.low, found.noise, found.resolution, found.stretches) == (None, 0.01, None, None, ())


def test_twenty_channels_of_a_hundred_thousand_samples_take_seconds_at_most() -> None:
    t = np.arange(100_000) / 10
    channels = [
        temperature(50 + 20 * np.sin(t / (300 + 10 * i)) + noise(0.05, len(t)), f"T{i}", rate_Hz=10.0)
        for i in range(20)
    ]
    start = time.perf_counter()
    assert len(assess(channels)) == 20
    assert time.perf_counter() - start < 5.0


@pytest.mark.parametrize(("value", "text"), [(0.84, "0.8 s"), (240.0, "240 s"), (900.0, "15 min"), (12_600.0, "3.5 h")])
def test_durations_are_said_as_a_person_says_them(value: float, text: str) -> None:
    assert seconds(value) == text


@pytest.mark.parametrize(("first", "last", "kind"), [(0, 39, "held"), (1000, 1039, "held"), (3500, 3599, "stuck")])
def test_a_record_that_repeats_is_said_once_and_is_no_fault_of_a_sensor(first: int, last: int, kind: str) -> None:
    channels = logged(first, last, step=0.01, rest=0.0)
    found = assess(channels)
    assert {(one.kind, one.first, one.last) for each in found for one in each.stretches} == {(kind, first, last)}
    assert [len(each.stretches) for each in found] == [1] * 6
    assert not found[3].good[first + 1 : last + 1].any() and found[3].good.sum() == 3600 - (last - first)
    (flag,) = findings(found)
    assert flag.flag == "record_repeated"
    assert flag.says == (
        f"one record is repeated for {last - first} s (speed, torque and 4 more), as a logger does that waits for its "
        "trigger or has lost its source: temperatures masked"
    )
    assert alone(channels, found, []) == []


def test_coarse_channels_at_rest_repeat_no_record() -> None:
    assert findings(assess(logged(0, 39, step=1.0, rest=0.02))) == []


def test_some_fine_channels_at_rest_among_others_repeat_no_record() -> None:
    frozen, moving_on = logged(0, 39, step=0.01, rest=0.0), logged(0, 39, step=0.01)
    found = assess([*frozen[:3], *moving_on[3:]])
    assert not any(one.together for each in found for one in each.stretches)
