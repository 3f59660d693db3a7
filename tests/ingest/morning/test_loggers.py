"""Which clocks of a day's logs are compared, and what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import wltc
from ingest.facts.events import ClockAligned, SessionRecorded
from ingest.morning.loggers import LoggerClock, compared
from made.channels import channel

SPEED = 45.0 * wltc()


def _session(name: str, absolute: bool = True) -> SessionRecorded:
    return SessionRecorded(
        session=name,
        name=name,
        kind="drive",
        kind_why="",
        specimen=None,
        batch=None,
        bench=None,
        configuration=None,
        attributes={},
        absolute=absolute,
        start_ns=0,
        end_ns=1_800_000_000_000,
        files=[],
    )


def _stamped(bus: str, late_s: float, seed: int, quantity: str = "speed", ppm: float = 0.0) -> ChannelData:
    noise = np.random.default_rng(seed).normal(0, 20, len(SPEED))
    t = np.arange(len(SPEED)) * (1 + 1e-6 * ppm) + late_s
    return replace(channel(f"{quantity}_{bus}", quantity, SPEED + noise, t_s=t), buses=(bus,))


def _one(first: ChannelData, *others: ChannelData) -> LoggerClock:
    (found,) = compared(
        [(_session("night"), [first, replace(first, spec=replace(first.spec, name="more")), *others])], str
    )
    return found


def test_a_late_clock_is_late_by_what_is_said() -> None:
    found = _one(_stamped("can1", 0.0, 1), _stamped("can2", 5.0, 2))
    assert found.says == "can2 is 5.0 s late against can1 (±0.6 s), by speed_can2 and speed_can1"
    assert not found.agrees
    event = found.event()
    assert isinstance(event, ClockAligned)
    assert (event.session, event.clock, event.reference) == ("night", "can2", "can1")
    assert event.offset_s == pytest.approx(5.0, abs=0.1)


def test_an_early_clock_that_drifts() -> None:
    found = _one(_stamped("can1", 0.0, 1), _stamped("can2", -12.0, 2, ppm=400.0))
    assert found.says.startswith("can2 is 11.6 s early against can1 (±0.6 s) and drifts by +")
    event = found.event()
    assert event.drift_ppm == pytest.approx(400.0, abs=2 * event.drift_sd_ppm)


def test_clocks_that_agree_are_said_to() -> None:
    found = _one(_stamped("can1", 0.0, 1), _stamped("can2", 0.1, 2))
    assert found.agrees
    assert found.says == "can2 and can1 agree within 0.58 s, by speed_can2 and speed_can1"


def test_loggers_with_nothing_in_common_cannot_be_compared() -> None:
    found = _one(_stamped("can1", 0.0, 1), _stamped("box", 0.0, 2, quantity="temperature"))
    assert found.offset is None
    assert found.says == "box against can1: cannot tell: no two of their channels measure the same"


def test_channels_that_contradict_each_other_tell_nothing() -> None:
    others = [_stamped("can2", 5.0, 2), _stamped("can2", 9.0, 3, quantity="torque")]
    first = [_stamped("can1", 0.0, 1), _stamped("can1", 0.0, 4, quantity="torque")]
    (found,) = compared([(_session("night"), [*first, first[0], *others])], str)
    assert found.offset is None
    assert "tells" in found.says


@pytest.mark.parametrize(("absolute", "count"), [(True, 1), (False, 0)])
def test_logs_of_their_own_are_compared_where_their_stamps_are_absolute(absolute: bool, count: int) -> None:
    logs = [_stamped("can1", 0.0, 1), _stamped("can1", 7.0, 2)]
    found = compared([(_session(name, absolute), [one]) for name, one in zip("ab", logs, strict=True)], str)
    assert len(found) == count
    for one in found:
        assert one.says.startswith("b can1 is 7.0 s late against a can1")


def test_a_log_that_holds_the_channels_of_another_has_its_clock_compared() -> None:
    """Two loggers on two buses: of each bus the channels count once, and both clocks of the second are late."""
    buses = [_stamped("can1", 0.0, 1), _stamped("can2", 0.0, 2)]
    found = compared(
        [
            (
                _session("night"),
                [replace(one, raws=("a", "b"), buses=one.buses * 2, beside=_later(one)) for one in buses],
            )
        ],
        {"a": "box.blf", "b": "late.blf"}.__getitem__,
    )
    said = [one.says for one in found]
    assert len(said) == 3
    assert "can1 of late.blf is 4.0 s late against can1 (±0.6 s), by speed_can1" in said
    assert "can2 of late.blf is 4.0 s late against can2 (±0.6 s), by speed_can2" in said
    assert any(one.startswith("can2 and can1 agree within") for one in said)


def _later(one: ChannelData) -> ChannelData:
    return replace(one, t_ns=one.t_ns + 4_000_000_000, raw=np.ones_like(one.raw), raws=("a", "b"), buses=one.buses * 2)


def test_two_loggers_of_one_steady_test_are_compared_by_what_both_have_seen() -> None:
    """The run-up lies before the other's start, and its end behind it; and a temperature tells too."""
    for name, quantity, level in (("Torque", "torque", 80.0), ("TC", "temperature", 120.0)):
        noise = np.random.default_rng(3).normal(0, 1, 12_000)
        value = np.where((np.arange(12_000) > 100) & (np.arange(12_000) < 11_900), level, 0.0) + noise
        first, second = (channel(name, quantity, value, t_s=np.arange(12_000) * 0.1 + late) for late in (0.0, 37.02))
        first, second = (replace(one, raws=("a", "b"), buses=("can1", "can1")) for one in (first, second))
        second = replace(second, raw=np.ones_like(second.raw))
        found = compared([(_session("night"), [replace(first, beside=second)])], lambda raw: f"{raw}.blf")
        (said,) = (one.says for one in found)
        assert said.startswith("can1 of b.blf is 37.02 s late against can1 (±0.06 s)"), said
        assert said.endswith(f", by {name}")


def test_a_channel_of_which_only_another_log_holds_anything_usable_is_compared_with_nothing() -> None:
    one = _stamped("can1", 0.0, 1)
    fills = replace(one, raw=np.ones_like(one.raw), raws=("a", "b"), buses=("can1", "can1"))
    assert compared([(_session("night"), [replace(fills, beside=_later(one))])], str) == []
