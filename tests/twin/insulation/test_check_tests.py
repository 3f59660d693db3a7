"""What becomes of a test before a fit over checks: steps, places, windows, starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.fitting.recorded import RecordedChannel, Test
from twin.insulation.check_tests import (
    begun_alike,
    by_place,
    coarse,
    every_s,
    iron_moved,
    load,
    minutes_of_switches,
    of_iron,
    without_iron,
)
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

NETWORK = Network(
    name="stator",
    nodes=(Node("winding", 1000.0, "copper"), Node("head", 1500.0, "copper"), Node("yoke", 6000.0, "iron")),
    boundaries=(Boundary("air"),),
    links=(
        Link("winding", "head", (Term(20.0),)),
        Link("winding", "yoke", (Term(30.0),)),
        Link("yoke", "air", (Term(3.0),)),
    ),
    sources=(Source("winding", (Term(200.0, {"current": 2.0}),)), Source("head", (Term(100.0, {"current": 2.0}),))),
    scale={"current": 100.0},
)
STEPS = 6000


def channel(name: str, node: str, measured: Floats, samples: Floats | None = None) -> RecordedChannel:
    there = np.ones(measured.size) if samples is None else samples
    sensor = Sensor(name, {node: 1.0}, bus="log", noise=0.06, resolution=0.1, bias_sd=0.2)
    return RecordedChannel(sensor, measured, there, np.zeros(measured.size))


def made(current: Floats, channels: tuple[RecordedChannel, ...], step_s: float = 1.0, air: float = 20.0) -> Test:
    square = (current**2)[:, None]
    outside = np.full((current.size, 1), air)
    return Test(
        name="dc",
        kind="dc_check",
        frame=Frame(step_s, square, outside),
        inputs={"current": current},
        features={"current2": square[:, 0]},
        initial=np.array([50.0, 51.0, 52.0]),
        initial_sd=np.ones(3),
        channels=channels,
    )


def on_between(first: int, last: int) -> Floats:
    at = np.arange(STEPS)
    return np.where((at >= first) & (at <= last), 1.0, 0.0)


def test_steps_become_ten_seconds_and_keep_their_means_and_where_samples_were() -> None:
    ramp = np.arange(25.0)
    samples = np.where(ramp % 10 == 3, 2.0, 0.0)  # two samples in the fourth second of each ten
    found = coarse(made(ramp, (channel("A", "winding", ramp, samples),)))
    assert found.frame.step_s == 10.0
    assert found.frame.features[:, 0] == pytest.approx([28.5, 218.5])
    assert found.inputs["current"] == pytest.approx([4.5, 14.5])
    (one,) = found.channels
    assert one.measured == pytest.approx([3.0, 13.0])
    assert one.samples == pytest.approx([2.0, 2.0])
    assert one.place == pytest.approx([0.3, 0.3])


def test_steps_without_samples_stay_without() -> None:
    nothing = np.zeros(20)
    found = coarse(made(nothing, (channel("A", "winding", np.full(20, np.nan), nothing),)))
    assert not found.channels[0].samples.any()
    assert np.isfinite(found.channels[0].measured).all()


def test_sensors_of_one_place_are_their_mean_where_all_have_samples() -> None:
    gap = np.array([1.0, 1.0, 0.0, 1.0])
    test = made(
        np.zeros(4),
        (
            channel("A", "head", np.array([10.0, 20.0, 30.0, 40.0])),
            channel("B", "head", np.array([14.0, 24.0, 0.0, 44.0]), gap),
            channel("C", "head", np.full(4, 999.0)),
            channel("D", "yoke", np.full(4, 5.0)),
        ),
    )
    head, yoke = by_place(test, {"C": "moves alone"}).channels
    assert (head.name, yoke.name) == ("head", "yoke")
    assert head.samples == pytest.approx(gap)
    assert head.measured[gap > 0.0] == pytest.approx([12.0, 22.0, 42.0])
    assert (head.sensor.noise, head.sensor.bias_sd) == pytest.approx((0.06 / np.sqrt(2.0), 0.2 / np.sqrt(2.0)))
    assert (yoke.sensor.noise, yoke.sensor.bias_sd) == (0.06, 0.2)


def test_sensors_that_never_speak_together_are_no_place() -> None:
    odd = np.array([1.0, 0.0, 1.0, 0.0])
    two = (channel("A", "head", np.zeros(4), odd), channel("B", "head", np.zeros(4), 1.0 - odd))
    assert by_place(made(np.zeros(4), two), ()).channels == ()


def test_sensors_of_another_lag_are_another_place() -> None:
    slow = channel("B", "head", np.zeros(4))
    slow = replace(slow, sensor=replace(slow.sensor, time_constant_s=5.0))
    assert len(by_place(made(np.zeros(4), (channel("A", "head", np.zeros(4)), slow)), ()).channels) == 2


def test_iron_is_told_by_what_a_channel_follows_most() -> None:
    mixed = channel("M", "yoke", np.zeros(4))
    mixed = replace(mixed, sensor=replace(mixed.sensor, weights={"winding": 0.4, "yoke": 0.6}))
    test = made(np.zeros(4), (channel("A", "head", np.zeros(4)), mixed))
    assert [of_iron(NETWORK, one) for one in test.channels] == [False, True]
    assert [one.name for one in without_iron(NETWORK, test).channels] == ["A"]


def test_only_what_follows_iron_is_moved() -> None:
    two = (channel("A", "head", np.full(4, 30.0)), channel("B", "yoke", np.full(4, 20.0)))
    head, yoke = iron_moved(NETWORK, made(np.zeros(4), two), -0.5).channels
    assert (head.measured[0], yoke.measured[0]) == (30.0, 19.5)


def test_the_load_is_the_last_without_a_break() -> None:
    twice = on_between(100, 900) + on_between(2000, 4999)
    assert load(NETWORK, made(twice, ())) == (2000, 4999)
    assert load(NETWORK, made(np.ones(STEPS), ())) == (0, STEPS - 1)
    assert load(NETWORK, made(np.zeros(STEPS), ())) is None


def shown(test: Test) -> list[tuple[int, int]]:
    """First and last step of each stretch with samples."""
    there = np.concatenate([[0.0], test.channels[0].samples, [0.0]]) > 0.0
    edges = np.flatnonzero(np.diff(there.astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def minutes(current: Floats, begin_degC: float = 20.0) -> Test | None:
    return minutes_of_switches(NETWORK, made(current, (channel("A", "head", np.full(STEPS, begin_degC)),)), 20.0)


def test_the_first_minutes_are_those_behind_both_switches() -> None:
    found = minutes(on_between(300, 4499))
    assert found is not None
    assert shown(found) == [(180, 1499), (4380, 5699)]


def test_the_time_between_samples_is_that_of_the_rarest_channel() -> None:
    rare = np.where(np.arange(STEPS) % 7 == 0, 1.0, 0.0)
    often = np.zeros(STEPS)
    test = made(often, (channel("A", "head", often), channel("B", "yoke", often, rare)), step_s=10.0)
    assert every_s(test) == 70.0


def test_a_switch_with_less_behind_it_does_not_count() -> None:
    found = minutes(on_between(300, 5499))
    assert found is not None
    assert shown(found) == [(180, 1499)]
    assert minutes(on_between(5000, 5500)) is None


def test_a_sensor_that_is_silent_in_these_minutes_does_not_enter() -> None:
    warm, late = np.full(STEPS, 20.0), np.where(np.arange(STEPS) >= 5800, 1.0, 0.0)
    both = (channel("A", "head", warm), channel("B", "yoke", warm, late))
    found = minutes_of_switches(NETWORK, made(on_between(300, 4499), both), 20.0)
    assert found is not None
    assert [one.name for one in found.channels] == ["A"]
    assert minutes_of_switches(NETWORK, made(on_between(300, 4499), both[1:]), 20.0) is None


def test_a_record_that_begins_with_the_load_counts_only_from_rest() -> None:
    cold, warm = minutes(on_between(0, 4499)), minutes(on_between(0, 4499), begin_degC=60.0)
    assert cold is not None and warm is not None
    assert shown(cold) == [(0, 1199), (4380, 5699)]
    assert shown(warm) == [(4380, 5699)]


def begun(air: float) -> Test:
    late = np.where(np.arange(4) > 1, 1.0, 0.0)
    head = channel("A", "head", np.array([0.0, 0.0, 21.0, 30.0]), late)
    return begun_alike(NETWORK, made(np.zeros(4), (head, channel("B", "yoke", np.full(4, 22.0))), air=air))


def test_a_body_that_was_left_to_itself_starts_at_the_mean_of_its_sensors() -> None:
    found = begun(air=20.0)
    assert found.initial == pytest.approx([21.5, 21.5, 21.5])
    assert found.initial_sd == pytest.approx([0.1 + 0.2 * 1.5] * 3)


def test_a_warm_body_starts_where_each_sensor_says_and_not_surely() -> None:
    found = begun(air=5.0)
    assert found.initial == pytest.approx([21.5, 21.0, 22.0])
    assert found.initial_sd == pytest.approx([0.1 + 0.2 * 16.5] * 3)


def test_without_sensors_the_start_is_left_alone() -> None:
    test = made(np.zeros(4), ())
    assert begun_alike(NETWORK, test) is test
