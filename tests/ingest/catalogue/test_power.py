"""Electrical power in, mechanical power out, and what cannot be true of the two."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.power import PowerBalance, balance, lacking, two_currents
from made.channels import channel

T = np.arange(3600.0)
SPEED = np.full(3600, 3000.0)
TORQUE = 50.0 + 50.0 * np.sin(T / 300)
SHAFT = TORQUE * SPEED * 2 * np.pi / 60


def machine(power: NDArray[np.float64], torque: NDArray[np.float64] = TORQUE) -> list[ChannelData]:
    return [channel("n", "speed", SPEED), channel("M", "torque", torque), channel("P", "power", power)]


def balanced(channels: list[ChannelData]) -> PowerBalance:
    found = balance(channels)
    assert found is not None
    return found


def test_energies_and_mean_loss_are_the_integrals() -> None:
    found = balanced(machine(SHAFT + 500.0))
    assert found.mean_loss_W == pytest.approx(500.0)
    assert found.mechanical_kWh == pytest.approx(SHAFT.sum() / 3.6e6)
    assert found.electrical_kWh - found.mechanical_kWh == pytest.approx(0.5)
    assert found.possible and found.impossible_share == 0.0
    assert found.says.startswith("power balances: ") and "500 W lost on average" in found.says


@pytest.mark.parametrize("missing", ["speed", "torque", "power"])
def test_no_balance_is_said_where_a_quantity_is_missing_but_which_one_is(missing: str) -> None:
    left = [one for one in machine(SHAFT) if one.spec.quantity != missing]
    assert balance(left) is None
    assert lacking({one.spec.quantity for one in left}) == [missing.replace("power", "electrical power")]
    assert lacking({"speed", "torque", "voltage_dc", "current_dc"}) == []


def test_electrical_power_comes_from_dq_values_where_no_power_is_recorded() -> None:
    shaft = machine(SHAFT)[:2]
    dq = {"voltage_d": -20.0, "current_d": -30.0, "voltage_q": 100.0, "current_q": 60.0}
    found = balanced([*shaft, *(channel(name, name, np.full(3600, value)) for name, value in dq.items())])
    assert found.electrical_kWh == pytest.approx(3 * (600.0 + 6000.0) / 1000)
    assert found.electrical_from == "3 (Ud Id + Uq Iq), rms"


def test_electrical_power_comes_from_the_dc_link_where_nothing_else_is_recorded() -> None:
    dc = [channel("U", "voltage_dc", np.full(3600, 400.0)), channel("I", "current_dc", np.full(3600, 50.0))]
    found = balanced([*machine(SHAFT)[:2], *dc])
    assert found.electrical_kWh == pytest.approx(20.0)
    assert "inverter losses included" in found.electrical_from


def test_an_ignored_power_channel_is_not_used() -> None:
    ignored = channel("P", "power", SHAFT, role="ignored")
    assert balance([*machine(SHAFT)[:2], ignored]) is None


@pytest.mark.parametrize(("power", "torque"), [(SHAFT + 800.0, -TORQUE), (-SHAFT - 800.0, TORQUE)])
def test_torque_or_power_of_the_wrong_sign_is_named(power: NDArray[np.float64], torque: NDArray[np.float64]) -> None:
    found = balanced(machine(power, torque))
    assert not found.possible
    assert found.says == (
        "electrical and mechanical power have opposite signs for 100 % of the time under load: "
        "torque, speed or power has the wrong sign"
    )


def test_torque_of_the_wrong_scale_is_named_with_the_ratio() -> None:
    found = balanced(machine(SHAFT / 0.9, torque=TORQUE * 1.3))
    assert found.says == (
        f"loss is below zero for {100 * found.impossible_share:.0f} % of the time under load: "
        "the shaft gives 1.17 times the "
        "electrical power while driving: check scale, unit and convention of torque and power"
    )


def test_a_second_of_lag_between_two_meters_is_no_finding() -> None:
    torque = 60.0 + 60.0 * np.sign(np.sin(T / 40))
    shaft = torque * SPEED * 2 * np.pi / 60
    assert balanced(machine(np.r_[0.0, shaft[:-1]] + 0.1 * shaft + 100.0, torque=torque)).possible


def test_time_under_load_is_that_of_the_samples_and_not_longer_than_the_session() -> None:
    pulses = np.where(T[:1010] % 30 < 10, 100.0, 0.0)
    few = [channel("n", "speed", SPEED[:1010]), channel("M", "torque", pulses)]
    found = balanced([*few, channel("P", "power", pulses * 320.0)])
    assert found.loaded_h * 3600 == pytest.approx(np.sum(pulses > 0))


@pytest.mark.parametrize(
    ("times", "says"),
    [(1.0, ""), (2**0.5, "1.41 times hypot(d, q) under load: amplitudes and rms"), (10.0, "10.00 times hypot(d, q)")],
)
def test_a_phase_current_is_held_against_its_d_and_q_parts(times: float, says: str) -> None:
    parts = [channel("d", "current_d", -0.6 * TORQUE), channel("q", "current_q", 0.8 * TORQUE)]
    found = two_currents([*parts, channel("I", "current", times * TORQUE)])
    assert (found or "").startswith(f"I is {says}") if says else found is None
    assert two_currents(parts) is None
    still = [channel(name, f"current_{name}", np.zeros(9)) for name in ("d", "q")]
    assert two_currents([*still, channel("I", "current", np.zeros(9))]) is None


def test_a_motor_that_does_not_turn_has_nothing_to_balance() -> None:
    channels = [channel("n", "speed", 0 * T), channel("M", "torque", TORQUE), channel("P", "power", 0 * T + 300.0)]
    assert balanced(channels).says == "no mechanical power: nothing to balance"


def test_efficiency_by_cell_is_output_over_input_both_ways() -> None:
    braking = np.where(T < 1800, 100.0, -100.0)
    shaft = braking * SPEED * 2 * np.pi / 60
    found = balanced(machine(np.where(shaft > 0, shaft / 0.9, shaft * 0.8), torque=braking))
    assert [round(cell.efficiency, 6) for cell in found.efficiency] == [0.8, 0.9]
    assert sum(cell.minutes for cell in found.efficiency) == pytest.approx(60.0)
    assert found.possible


def test_values_are_held_on_the_stamps_of_the_slowest_channel() -> None:
    fast = channel("n", "speed", np.repeat(SPEED, 10), rate_Hz=10.0)
    slow = channel("M", "torque", TORQUE[::2], rate_Hz=0.5)
    found = balanced([fast, slow, channel("P", "power", SHAFT + 500.0)])
    assert found.mean_loss_W == pytest.approx(500.0)
    assert found.mechanical_kWh == pytest.approx(SHAFT[::2].sum() * 2 / 3.6e6)


def test_time_without_samples_of_one_channel_is_left_out() -> None:
    there = (T < 1000) | (T > 2000)
    power = channel("P", "power", (SHAFT + 500.0)[there], t_s=T[there])
    found = balanced([*machine(SHAFT)[:2], power])
    assert found.electrical_kWh - found.mechanical_kWh == pytest.approx(0.5 * there.sum() / 3600, rel=0.01)


def test_amplitudes_that_were_taken_for_rms_values_are_told_by_half_the_efficiency() -> None:
    into = SHAFT / 0.9  # 1.5 (Ud Id + Uq Iq) of amplitudes
    dq = {"voltage_d": 0.0 * T, "current_d": 0.0 * T, "voltage_q": np.full(3600, 100.0), "current_q": into / 150.0}
    recorded = [*machine(SHAFT)[:2], *(channel(name, name, value) for name, value in dq.items())]
    found = balanced(recorded)
    assert found.amplitudes and not found.possible
    assert found.says == (
        "the shaft gives only 45 % of the electrical power while driving, and would give 90 % if voltages and currents "
        'are amplitudes: then say so in the bench file, convention = "peak"'
    )
    assert balanced(machine(2.0 * into)).says.startswith("power balances")  # a power meter knows no amplitudes
