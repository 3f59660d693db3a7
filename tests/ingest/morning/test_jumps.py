"""Thermometers that jump together, and heat that does not look like it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.morning.jumps import jumps_together
from ingest.morning.sensors import jumping
from made.channels import channel
from made.places import EXAMPLES

Array = NDArray[np.float64]
TAUS_s = (120.0, 200.0, 300.0, 600.0)


def _motor(current: Array, speed: Array, picked_up: Array, wired: int = 3) -> list[ChannelData]:
    """A sample a second: four bodies of one motor, each behind its time constant; `wired` of them read what is
    `picked_up` beside."""
    random, heat = np.random.default_rng(7), 40.0 * (current / 100.0) ** 2
    channels = [channel("I", "current", current), channel("n", "speed", speed)]
    for k, tau in enumerate(TAUS_s):
        body = np.zeros(len(heat))
        for i in range(1, len(heat)):
            body[i] = body[i - 1] + (heat[i] - body[i - 1]) / tau
        read = 22.0 + body + random.normal(0.0, 0.1, len(heat)) + (picked_up if k < wired else 0.0)
        channels.append(channel(f"T_{k}", "temperature", read, role="observed"))
    return channels


def _stop_and_go() -> tuple[Array, Array]:
    """Loaded and turning, but for two minutes from 600 s and three from 1200 s on."""
    at = np.arange(1800)
    stands = ((at >= 600) & (at < 720)) | ((at >= 1200) & (at < 1380))
    return np.where(stands, 3.0, 100.0), np.where(stands, 0.0, 3000.0)


def test_what_a_live_inverter_adds_at_rest_is_found_with_its_thermometers_times_and_sizes() -> None:
    current, speed = _stop_and_go()
    at = np.arange(1800)
    live = np.where(((at >= 640) & (at < 680)) | ((at >= 1250) & (at < 1330)), 1.6, 0.0)
    channels = _motor(current, speed, live)
    found = jumps_together(channels[2:], channels)
    assert found is not None
    assert found.channels == ("T_0", "T_1", "T_2")
    np.testing.assert_allclose(found.at_s, [640, 680, 1250, 1330], atol=2)
    np.testing.assert_allclose(found.size_K, 1.6, atol=0.3)
    assert found.standing == 4


@pytest.mark.parametrize("wired", [1, 2])
def test_fewer_than_three_are_not_spoken_of(wired: int) -> None:
    current, speed = _stop_and_go()
    live = np.where((np.arange(1800) >= 640) & (np.arange(1800) < 680), 1.6, 0.0)
    assert jumping(_motor(current, speed, live, wired)) == []


def test_steps_and_pulses_of_load_are_no_jumps() -> None:
    current, speed = _stop_and_go()
    none = np.zeros(1800)
    assert jumping(_motor(current, speed, none)) == []
    pulses = np.where(np.arange(1800) % 90 < 10, 800.0, 0.0)  # 10 s each: shorter than what lies on both sides
    assert jumping(_motor(pulses, np.full(1800, 3000.0), none)) == []


def test_iron_of_little_mass_that_follows_the_speed_is_no_jump_and_what_goes_against_it_is() -> None:
    at = np.arange(1800)
    speed = np.where((at >= 600) & (at < 900) | (at >= 1300), 12_000.0, 1000.0)
    heat, body = 4.0 * (speed / 12_000.0) ** 1.5, np.zeros(1800)
    for i in range(1, 1800):
        body[i] = body[i - 1] + (heat[i] - body[i - 1]) / 6.0
    current, none = np.where(at < 100, 100.0, 20.0), np.zeros(1800)
    assert jumping(_motor(current, speed, none)) == []
    assert jumping(_motor(current, speed, body)) == [], "losses of teeth and bearings, within seconds"
    (found,) = jumping(_motor(current, speed, np.where(speed < 5000.0, 1.6, 0.0)))
    assert found.says.startswith("3 thermometers jump together by 1."), "warmer as the motor slows down"


def test_the_recorded_motor_stands_under_a_live_inverter() -> None:
    rows = np.genfromtxt(EXAMPLES / "hust_motor" / "id_12.csv.gz", delimiter=",", names=True)
    copper = ["endwind_1", "endwind_2", "activewind_1", "activewind_2"]
    others = [*copper, "slotside", "slotopen", "slotbottom", "outer_yoke", "endcap"]
    thermometers = ["bearing", "rotor", *others]
    inputs = [
        channel("current", "current", np.hypot(rows["IdFbk"], rows["IqFbk"])),
        channel("speed", "speed", rows["speed"]),
    ]
    channels = [*inputs, *(channel(name, "temperature", rows[name], role="ignored") for name in thermometers)]
    (found,) = jumping(channels)
    assert found.fault == "jumps"
    assert set(found.channel.split(", ")) == set(others)
    assert found.says.startswith("9 thermometers jump together by ")
    assert "of them while the motor stands" in found.says
