"""Sensors that a person should look at, and those that are well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.quality import assess
from ingest.morning.repeat import lay
from ingest.morning.sensors import SensorFault, alone, since_before
from made.channels import channel
from made.repeated import run


def _soaked(off: float = 0.0, ambient: float = 22.0) -> list[ChannelData]:
    """Two minutes of rest, then warm: four thermometers of the motor, of which one reads `off` too much."""
    random = np.random.default_rng(3)
    rise = np.r_[np.zeros(120), np.linspace(0, 40, 600)]
    current = channel("I", "current", np.where(rise > 0, 100.0, 0.0))
    names = ("winding", "yoke", "teeth", "magnet")
    warm = [
        channel(f"T_{name}", "temperature", 22 + rise * (1 - k / 5) + random.normal(0, 0.1, 720), role="observed")
        for k, name in enumerate(names)
    ]
    warm[2] = channel("T_teeth", "temperature", warm[2].value + off, role="observed")
    return [current, *warm, channel("T_ambient", "temperature", np.full(720, ambient) + random.normal(0, 0.1, 720))]


def _alone(channels: Sequence[ChannelData], known: Sequence[str] = ()) -> list[tuple[str, str]]:
    return [(one.channel, one.fault) for one in alone(channels, assess(channels), known)]


def test_well_sensors_are_not_spoken_of() -> None:
    assert _alone(_soaked()) == []


def test_one_that_is_off_at_rest_disagrees_with_its_neighbours() -> None:
    channels = _soaked(off=-3.0)
    assert alone(channels, assess(channels), ()) == [
        SensorFault("T_teeth", "disagrees", "T_teeth reads 3.0 K less than 3 others at rest (22.0 °C)")
    ]


@pytest.mark.parametrize("ambient", [30.0, 12.0])
def test_where_motor_and_room_are_not_at_one_temperature_nothing_is_said(ambient: float) -> None:
    assert _alone(_soaked(off=-3.0, ambient=ambient)) == []


def test_open_constant_and_silent_thermometers_are_told_apart() -> None:
    channels = _soaked()
    wild = np.random.default_rng(5).normal(0.0, 1.0, 720)
    open_wire = channel("T_bearing", "temperature", 1372.0 + 0.01 * wild, role="observed")
    frozen = channel("T_housing", "temperature", np.r_[22.1, 22.2, np.full(718, 22.0)], role="observed")
    found = _alone([*channels, open_wire, frozen], ["T_oil", "T_yoke"])
    assert found == [("T_oil", "silent"), ("T_bearing", "dead"), ("T_housing", "dead")]


def test_an_offset_that_is_there_cold_and_warm_is_a_drift_and_a_hotter_motor_is_none() -> None:
    def faults(**more: float) -> list[tuple[str, str]]:
        found = lay(run(), run(noise_seed=2, **more)).channels  # type: ignore[arg-type]
        return [(one.channel, one.fault) for one in since_before(found, "monday")]

    assert faults(winding_K=3.0) == [("T_winding", "drifted")]
    assert faults(film=0.7) == []
    assert faults() == []


def test_two_sensors_that_read_as_each_other_did_were_exchanged() -> None:
    second = {one.spec.name: one for one in run(noise_seed=2)}
    winding, yoke = second["T_winding"], second["T_yoke"]
    crossed = [
        channel("T_winding", "temperature", yoke.value, role="observed", node="winding"),
        channel("T_yoke", "temperature", winding.value, role="observed", node="yoke"),
    ]
    others = [one for name, one in second.items() if name not in ("T_winding", "T_yoke")]
    (found,) = since_before(lay(run(), [*others, *crossed]).channels, "monday")
    assert found.fault == "swapped"
    assert found.says == "T_winding and T_yoke read as each other did in monday: exchanged"
