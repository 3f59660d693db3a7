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
    (found,) = compared([(_session("night"), [first, replace(first, spec=replace(first.spec, name="more")), *others])])
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
    (found,) = compared([(_session("night"), [*first, first[0], *others])])
    assert found.offset is None
    assert "tells" in found.says


@pytest.mark.parametrize(("absolute", "count"), [(True, 1), (False, 0)])
def test_logs_of_their_own_are_compared_where_their_stamps_are_absolute(absolute: bool, count: int) -> None:
    logs = [_stamped("can1", 0.0, 1), _stamped("can1", 7.0, 2)]
    found = compared([(_session(name, absolute), [one]) for name, one in zip("ab", logs, strict=True)])
    assert len(found) == count
    for one in found:
        assert one.says.startswith("b can1 is 7.0 s late against a can1")
