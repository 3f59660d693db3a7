"""What kind of test a session was, told from its channels alone."""

from __future__ import annotations

import gzip
import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import recognise, repeats, wltc
from made.channels import channel
from made.places import EXAMPLES

EXAMPLES = EXAMPLES / "hust_motor"


def noise(sd: float, size: int) -> NDArray[np.float64]:
    return np.random.default_rng(11).normal(0, sd, size)


def drive(speed: NDArray[np.float64], torque: NDArray[np.float64], rate_Hz: float = 1.0) -> list[ChannelData]:
    size = len(speed)
    return [
        channel("n", "speed", speed + noise(3, size), rate_Hz),
        channel("M", "torque", torque + noise(0.5, size), rate_Hz),
        channel("T", "temperature", 60 + noise(0.1, size), rate_Hz, role="observed", node="winding"),
    ]


def test_the_trace_is_the_published_one() -> None:
    assert len(wltc()) == 1801
    assert wltc().sum() == pytest.approx(83758.6)  # the checksum of the regulation
    assert wltc().max() == 131.3


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_three_wltc_in_a_row_at_any_gear_ratio_are_a_wltp(sign: float) -> None:
    lead = np.zeros(77)
    speed = np.r_[lead, np.tile(wltc()[:-1], 3), lead] * 118.0 * sign
    torque = np.gradient(np.abs(speed)) * 0.05 + 10
    kind, why = recognise(drive(speed, torque))
    assert kind == "wltp"
    assert why.startswith("speed follows ") and why.endswith("% of the WLTC class 3b trace, 3 times")


def test_a_wltp_is_recognised_at_another_rate_and_without_torque() -> None:
    speed = np.repeat(wltc(), 4) * 100.0
    assert recognise([channel("n", "speed", speed, rate_Hz=4.0)])[0] == "wltp"


@pytest.mark.parametrize(
    ("speed", "share"),
    [
        pytest.param(wltc()[:-1], "100 %", id="1,800 rows"),
        pytest.param(wltc()[1:], "100 %", id="from second 1"),
        pytest.param((wltc()[1:] + wltc()[:-1]) / 2, "100 %", id="stamps half a second off"),
        pytest.param(wltc()[2:], "90 %", id="from second 2"),
        pytest.param(wltc()[:-90], "95 %", id="without its last 5 %"),
    ],
)
def test_one_wltc_that_lacks_a_second_or_its_end_is_a_wltp(speed: NDArray[np.float64], share: str) -> None:
    kind, why = recognise(drive(speed * 100.0, np.abs(np.gradient(speed)) * 5))
    assert (kind, why) == ("wltp", f"speed follows {share} of the WLTC class 3b trace, once")


def test_two_wltc_of_which_the_second_is_cut_are_both_counted() -> None:
    kind, why = recognise([channel("n", "speed", np.r_[wltc()[:-1], wltc()[:-90]] * 100.0)])
    assert (kind, why) == ("wltp", "speed follows 98 % of the WLTC class 3b trace, 2 times")


def test_a_wltc_without_its_fastest_part_is_a_drive() -> None:
    assert recognise([channel("n", "speed", wltc()[:1400] * 100.0)])[0] == "drive"


def test_another_cycle_is_a_drive() -> None:
    shuffled = np.concatenate([part[::-1] for part in np.array_split(wltc(), 5)])
    kind, why = recognise(drive(shuffled * 100.0, np.abs(np.gradient(shuffled)) * 5))
    assert (kind, why.split(",")[0]) == ("drive", "speed varies")


def test_half_an_hour_at_one_point_is_s1_although_torque_is_trimmed() -> None:
    speed = np.r_[np.linspace(0, 6000, 60), np.full(2400, 6000.0), np.zeros(900)]
    torque = np.r_[np.zeros(60), np.linspace(118, 124, 2400), np.zeros(900)]
    kind, why = recognise(drive(speed, torque))
    assert kind == "s1"
    assert why.startswith("6,000 rpm and 121 Nm held for ") and why.endswith(" min")


def with_a_gap(channels: list[ChannelData], first: int, length: int) -> list[ChannelData]:
    """The channels, 1 Hz, without their samples from `first` on for `length` seconds."""
    kept = [i for i in range(len(channels[0].value)) if not first <= i < first + length]
    return [
        channel(c.spec.name, c.spec.quantity, c.value[kept], t_s=np.array(kept, dtype=float), role=c.spec.role)
        for c in channels
    ]


def test_a_gap_of_an_hour_is_no_hold() -> None:
    point = drive(np.full(4800, 6000.0), np.full(4800, 80.0))
    assert recognise(point)[0] == "s1"
    kind, why = recognise(with_a_gap(point, 600, 3600))
    assert kind == "other" and why.startswith("constant speed (6,000 rpm)")
    kind, why = recognise(with_a_gap(drive(np.full(6600, 6000.0), np.full(6600, 80.0)), 2400, 3600))
    assert (kind, why) == ("s1", "6,000 rpm and 80 Nm held for 40 min")


def test_seconds_that_a_bus_lost_end_no_hold() -> None:
    assert recognise(with_a_gap(drive(np.full(1200, 6000.0), np.full(1200, 80.0)), 600, 8))[0] == "s1"


def test_a_load_that_is_no_longer_recorded_is_not_held_on() -> None:
    speed, torque, _ = drive(np.full(2400, 6000.0), np.full(2400, 80.0))
    short = channel("M", "torque", torque.value[:600])
    assert recognise([speed, short])[0] == "other"


def test_speed_and_load_that_are_never_there_together_are_other() -> None:
    speed = channel("n", "speed", np.full(600, 6000.0))
    torque = channel("M", "torque", np.full(600, 80.0), t_s=np.arange(1000.0, 1600.0))
    assert recognise([speed, torque]) == (
        "other",
        "speed and load are at no time recorded together while the motor turns",
    )


def test_heat_is_counted_without_a_gap() -> None:
    oven = channel("T1", "temperature", np.full(7200, 230.0), role="observed", node="winding_a")
    assert recognise([oven])[1].startswith("2.0 h within 10 K")
    (cut,) = with_a_gap([oven], 1200, 4800)
    assert recognise([cut])[1].startswith("40 min within 10 K")


def test_two_such_points_are_s1_too() -> None:
    speed = np.r_[np.full(1500, 3000.0), np.full(1500, 9000.0)]
    kind, why = recognise(drive(speed, np.full(3000, 80.0)))
    assert kind == "s1" and why.endswith("; 2 such points")


@pytest.mark.parametrize("length", [10, 30, 60])
def test_short_pulses_with_rests_between_are_s2(length: int) -> None:
    pulse = np.r_[np.full(length, 210.0), np.full(240, 0.0)]
    torque = np.tile(pulse, 8)
    kind, why = recognise(drive(np.full(len(torque), 6000.0), torque))
    assert (kind, why) == ("s2", f"8 pulses of {length} s at about 210 Nm and 6,000 rpm, with rests between")


def test_pulses_that_a_limit_ends_have_other_lengths_and_are_s2() -> None:
    torque = np.concatenate([np.r_[np.full(length, 210.0), np.zeros(200)] for length in (60, 52, 41, 33)])
    kind, why = recognise(drive(np.full(len(torque), 2000.0), torque))
    assert kind == "s2" and why.startswith("4 pulses of 33 to 60 s")


def test_current_stands_in_for_torque() -> None:
    current = np.tile(np.r_[np.full(30, 400.0), np.zeros(240)], 5)
    kind, why = recognise([channel("n", "speed", np.full(1350, 2000.0)), channel("i", "current", current)])
    assert kind == "s2" and "400 A" in why


def test_current_at_standstill_is_a_dc_check() -> None:
    current = np.r_[np.zeros(60), np.full(2400, 160.0)]
    temperature = channel("T", "temperature", np.linspace(20, 130, 2460), node="endwinding_a")
    assert recognise([channel("I", "current_dc", current), temperature]) == (
        "dc_check",
        "160 A for 40 min, and no speed is recorded",
    )
    still = channel("n", "speed", np.zeros(2460))
    assert recognise([still, channel("I", "current", current), temperature])[1] == "160 A for 40 min, and nothing turns"


def test_heat_without_speed_or_current_is_ageing() -> None:
    oven = np.r_[np.linspace(25, 230, 600), np.full(3600 * 2, 230.0)]
    kind, why = recognise([channel("T1", "temperature", oven, role="observed", node="winding_a")])
    assert kind == "ageing" and why.startswith("2.0 h within 10 K of 230 °C")
    warm = channel("T1", "temperature", np.full(600, 60.0), node="oven")
    assert recognise([warm])[0] == "ageing"
    room = channel("T1", "temperature", np.full(600, 23.0), node="winding_a")
    assert recognise([room]) == ("other", "temperatures only, none above 23 °C, and no speed is recorded")


def test_electrical_values_of_the_insulation_are_an_insulation_check() -> None:
    channels = [channel("Riso", "insulation_resistance", [5e9]), channel("td", "tan_delta", [0.004])]
    assert recognise(channels) == ("insulation_check", "holds insulation resistance, tan delta")


def test_evaluated_checks_are_a_dc_check() -> None:
    assert recognise([channel("R", "thermal_resistance", [0.02]), channel("d", "dose", [24.0])])[0] == "dc_check"


def test_signals_that_nothing_explains_are_other() -> None:
    unknown = channel("x", "state", [1.0, 2.0])
    assert recognise([unknown]) == ("other", "no speed is recorded, and neither current nor temperature is recorded")
    assert recognise([]) == ("other", "nothing says what its signals mean: give it a bench file that does")


def test_a_constant_speed_with_steps_of_load_is_other() -> None:
    torque = np.repeat([20.0, 60.0, 110.0, 40.0], 300)
    kind, why = recognise(drive(np.full(1200, 500.0), torque))
    assert (kind, why.split(",")[0]) == ("other", "constant speed (500 rpm)")


def test_pulses_that_are_longer_than_those_of_s2_are_not_said_to_be_none() -> None:
    on = np.tile(np.r_[np.zeros(300), np.ones(600)], 6)
    kind, why = recognise(drive(1500.0 * on, 85.0 * on))
    says = "most of the load neither held for 15 min while it turns nor in pulses of 5 to 120 s"
    assert (kind, why) == ("other", f"constant speed (1,500 rpm), {says}")


@pytest.mark.parametrize(
    ("name", "kind"), [("id_1", "other"), ("id_3", "s1"), ("id_9", "drive"), ("id_10", "other"), ("id_12", "drive")]
)
def test_the_shipped_recordings_are_called_what_they_are(name: str, kind: str) -> None:
    with gzip.open(EXAMPLES / f"{name}.csv.gz", "rt") as file:
        data = np.genfromtxt(file, delimiter=",", names=True)
    channels = [channel("speed", "speed", data["speed"]), channel("Torque", "torque", data["Torque"])]
    assert recognise(channels)[0] == kind


def test_a_year_in_an_oven_takes_no_more_memory_than_it_has_samples_for() -> None:
    hours = np.arange(360 * 24)
    oven = channel("oven_air", "temperature", 180.0 + np.sin(hours), t_s=hours * 3600.0)
    tracemalloc.start()
    try:
        assert recognise([oven]) == ("ageing", "8639.0 h within 10 K of 181 °C, and no speed is recorded")
        assert tracemalloc.get_traced_memory()[1] < 400e6
    finally:
        tracemalloc.stop()


def test_a_drive_of_months_is_told_from_its_first_weeks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.catalogue.kinds.LONGEST_s", 2000)
    speed = np.r_[np.full(2000, 3000.0), 1500 + 1400 * np.sin(np.arange(6000) / 30)]
    assert recognise(drive(speed, np.full(8000, 100.0))) == ("s1", "3,000 rpm and 100 Nm held for 33 min")


def test_what_a_session_repeats_is_cut_apart() -> None:
    begin_ns = channel("n", "speed", np.zeros(1), rate_Hz=1.0).t_ns[0]
    twice = np.r_[np.zeros(30), wltc(), np.zeros(60), wltc(), np.zeros(200)] * 100.0
    spans = [((a - begin_ns) / 1e9, (b - begin_ns) / 1e9) for a, b in repeats([channel("n", "speed", twice)])]
    assert spans == [(30.0, 1831.0), (1891.0, 3692.0)]
    pulses = np.tile(np.r_[np.full(40, 100.0), np.zeros(200)], 4)
    spans = repeats(drive(np.full(len(pulses), 3000.0), pulses))
    assert np.diff([a for a, _ in spans]).tolist() == [240_000_000_000] * 3
    assert [b for _, b in spans[:-1]] == [a for a, _ in spans[1:]]
    assert repeats(drive(np.full(2000, 3000.0), np.full(2000, 50.0))) == []
    assert repeats([channel("T", "temperature", np.full(2000, 50.0))]) == []
