"""Which held samples of a session are weighed as a sensor's fault."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ingest.catalogue.channels import ChannelData
from made.channels import channel, logged
from replay.studies.diagnosis import data_faults as studied
from replay.studies.diagnosis.data_faults import data_faults
from twin.motor.sensor import Sensor

SENSORS = [Sensor("T_a", {"a": 1.0}), Sensor("T_b", {"b": 1.0}), Sensor("T_c", {"c": 1.0})]


def _held(channels: list[ChannelData], first: int, last: int) -> list[ChannelData]:
    """The channels with a sensor that repeats its value over a span, while a torque moves."""
    value, seconds = channels[-1].value.copy(), np.arange(3600.0)
    value[first : last + 1] = value[first]
    moving = channel("T_shaft", "torque", 100 * np.sin(seconds / 30))
    return [*channels[:-1], moving, channel("T_c", "temperature", value, role="observed", node="c")]


def test_a_record_that_repeats_is_no_fault_of_a_sensor_and_a_sensor_that_repeats_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(studied, "fault_evidence", lambda *_: 20.0)
    test = SimpleNamespace(start_ns=0, channels=SENSORS)
    current = cast(Any, SimpleNamespace(model=SimpleNamespace(tests=[test])))
    repeated = logged(0, 39, step=0.01, rest=0.0)
    assert data_faults(current, [repeated], SENSORS, 6.0) == []
    (fault,) = data_faults(current, [_held(repeated, 1000, 1059)], SENSORS, 6.0)
    assert (str(fault.cause), fault.says) == ("sensor.c.hold", {0: "held for 59 s: masked"})
