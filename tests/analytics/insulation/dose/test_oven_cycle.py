"""Cycles cut from traces whose hours are known in closed form or by construction."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.dose.arrhenius import RULES, equivalent_hours
from analytics.insulation.dose.oven_cycle import cycles, histogram, hours_above
from plant import insulation_campaign
from plant.timeline import Plan

Floats = NDArray[np.float64]
H = 3600.0


def trapezium(soak_h: float, top: float = 230.0, step_s: float = 60.0) -> Floats:
    """An hour at 25 degC, two up to `top`, `soak_h` there, two down, an hour at 25 degC."""
    times = np.array([0.0, 1.0, 3.0, 3.0 + soak_h, 5.0 + soak_h, 6.0 + soak_h]) * H
    value = np.interp(np.arange(0.0, times[-1], step_s), times, [25.0, 25.0, top, top, 25.0, 25.0])
    return value.astype(np.float64)


def clock(value: Floats, step_s: float = 60.0) -> Floats:
    return np.arange(float(value.size)) * step_s


SLOPE_H = 2.0 * 2.0 * 50.0 / 205.0  # two slopes of 2 h over 205 K, of which 50 K are above 180 degC


def test_heating_soak_and_cooling_are_cut_from_the_trace() -> None:
    value = trapezium(12.0)
    (cycle,) = cycles(clock(value), value)
    assert cycle.heating_from_s == pytest.approx(1.0 * H, abs=200.0)
    assert cycle.soak_from_s == pytest.approx(3.0 * H, abs=200.0)
    assert cycle.soak_to_s == pytest.approx(15.0 * H, abs=200.0)
    assert cycle.cooling_to_s == pytest.approx(17.0 * H, abs=200.0)
    assert cycle.highest_degC == 230.0
    assert cycle.soak_degC == pytest.approx(230.0, abs=0.1)
    assert cycle.hours_above == pytest.approx(12.0 + SLOPE_H, abs=1e-6)
    assert cycle.unknown_h == 0.0


def test_several_cycles_of_one_log_are_told_apart_and_the_last_may_last_60_h() -> None:
    value = np.concatenate([trapezium(12.0), trapezium(12.0), trapezium(60.0)])
    value += np.random.default_rng(1).normal(0.0, 0.5, value.size)
    found = cycles(clock(value), value)
    assert [cycle.hours_above for cycle in found] == pytest.approx(
        [12.0 + SLOPE_H, 12.0 + SLOPE_H, 60.0 + SLOPE_H], abs=0.02
    )
    soaks = [(cycle.soak_to_s - cycle.soak_from_s) / H for cycle in found]
    assert soaks == pytest.approx([12.0, 12.0, 60.0], abs=0.2)


def test_a_cycle_has_its_swing_and_its_fastest_rates() -> None:
    times = np.array([0.0, 1.0, 3.0, 9.0, 9.5, 12.0]) * H
    value = np.interp(np.arange(0.0, times[-1], 60.0), times, [25.0, 25.0, 230.0, 230.0, 30.0, 30.0])
    value += np.random.default_rng(3).normal(0.0, 0.1, value.size)
    (cycle,) = cycles(clock(value), value)
    assert cycle.swing_K == pytest.approx(205.0, abs=1.0)
    assert cycle.heating_K_per_min == pytest.approx(205.0 / 120.0, abs=0.1)
    assert cycle.cooling_K_per_min == pytest.approx(200.0 / 30.0, abs=0.1)


def test_a_quench_is_a_mean_over_five_minutes_and_no_rate_crosses_a_gap() -> None:
    value = trapezium(12.0)
    quenched = np.where(np.arange(value.size) < 600, value, 25.0)  # within a minute
    (cycle,) = cycles(clock(quenched), quenched)
    assert cycle.cooling_K_per_min == pytest.approx(205.0 / 5.0)
    kept = np.abs(np.arange(value.size) - 610) > 15  # the quench lies in a gap of half an hour
    (cycle,) = cycles(clock(quenched)[kept], quenched[kept])
    assert cycle.cooling_K_per_min == pytest.approx(0.0, abs=1e-9)
    (begun,) = cycles(clock(value[300:]), value[300:])
    assert begun.heating_K_per_min is None


def test_a_step_across_the_threshold_counts_in_part() -> None:
    t, value = np.array([0.0, H]), np.array([170.0, 190.0])
    assert hours_above(t, value, 180.0) == pytest.approx(0.5)
    assert hours_above(t, value, 185.0) == pytest.approx(0.25)
    assert hours_above(t, np.array([180.0, 180.0]), 180.0) == 0.0


def test_noise_at_the_threshold_makes_no_cycles_but_its_hours_count() -> None:
    value = 180.0 + np.random.default_rng(2).normal(0.0, 0.5, 5000)
    assert cycles(clock(value), value) == ()
    assert hours_above(clock(value), value) == pytest.approx(5000 / 120.0, rel=0.03)


def test_noise_on_a_slow_passage_of_the_threshold_does_not_cut_a_cycle() -> None:
    value = np.interp(np.arange(0.0, 30.0, 1 / 60), [0.0, 10.0, 20.0, 30.0], [170.0, 190.0, 190.0, 170.0])
    value += np.random.default_rng(3).normal(0.0, 1.0, value.size)
    assert len(cycles(clock(value), value)) == 1


def test_an_opened_door_does_not_cut_a_cycle_and_its_hours_are_left_out() -> None:
    value = trapezium(12.0)
    value[400:420] = 170.0
    (cycle,) = cycles(clock(value), value)
    assert cycle.hours_above == pytest.approx(12.0 + SLOPE_H - (19.0 + 1.0 / 3.0) / 60.0, abs=1e-6)


def test_hours_of_a_gap_are_not_counted_and_said() -> None:
    value = trapezium(12.0)
    kept = np.ones(value.size, np.bool_)
    kept[500:560] = False
    (cycle,) = cycles(clock(value)[kept], value[kept])
    assert cycle.unknown_h == pytest.approx(61.0 / 60.0)
    assert cycle.hours_above == pytest.approx(12.0 + SLOPE_H - 61.0 / 60.0, abs=1e-6)
    missing = np.where(kept, value, np.nan)
    assert cycles(clock(value), missing) == (cycle,)
    assert histogram(clock(value), missing).hours.sum() == pytest.approx(
        histogram(clock(value), value).hours.sum() - 61.0 / 60.0
    )


def test_a_log_that_begins_or_ends_above_the_threshold_says_so() -> None:
    value = trapezium(12.0)
    (begun,) = cycles(clock(value)[300:], value[300:])
    assert begun.heating_from_s is None and begun.cooling_to_s is not None
    (cut,) = cycles(clock(value)[:300], value[:300])
    assert cut.cooling_to_s is None and cut.heating_from_s is not None
    assert begun.hours_above + cut.hours_above == pytest.approx(12.0 + SLOPE_H - 1.0 / 60.0, abs=1e-6)


def test_hours_by_temperature_are_those_of_straight_lines_between_samples() -> None:
    t, value = np.array([0.0, 1.0, 2.0, 5.0]) * H, np.array([100.0, 102.0, 102.0, 101.0])
    made = histogram(t, value, 0.5)
    expected = {100.0: 0.125, 100.5: 0.25, 101.0: 0.25 + 0.75, 101.5: 0.25 + 1.5, 102.0: 0.125 + 1.0 + 0.75}
    assert dict(zip(made.centres_degC, made.hours, strict=True)) == pytest.approx(expected, abs=1e-9)


def test_equivalent_hours_under_any_rule_are_one_sum_over_the_histogram() -> None:
    fine = trapezium(12.0, 231.3, 1.0)
    made = histogram(clock(fine, 1.0)[::60], fine[::60])
    middle, hours = (fine[1:] + fine[:-1]) / 2.0, np.full(fine.size - 1, 1.0 / H)
    for rule in RULES:
        direct = equivalent_hours(middle, hours, 180.0, rule)
        assert equivalent_hours(made.centres_degC, made.hours, 180.0, rule) == pytest.approx(direct, rel=2e-4)


def test_a_flickering_sensor_costs_no_more_than_a_steady_one() -> None:
    value = np.where(np.arange(200_000) % 2 == 0, 25.0, 235.0)
    made = histogram(clock(value), value, 0.1)
    assert made.hours.sum() == pytest.approx(199_999 / 60.0)
    assert made.hours[1:-1] == pytest.approx(made.hours[1])


def test_an_empty_trace_has_no_cycles_and_no_hours() -> None:
    empty = np.zeros(0)
    assert cycles(empty, empty) == ()
    assert hours_above(empty, empty) == 0.0
    assert histogram(empty, empty).hours.size == 0


def test_time_that_falls_is_refused() -> None:
    with pytest.raises(ValueError, match="time falls after 60 s: sort the samples by time"):
        cycles(np.array([0.0, 60.0, 30.0]), np.array([20.0, 21.0, 22.0]))


def test_oven_logs_of_the_plant_give_their_true_hours_with_several_cycles_a_log_and_breaks() -> None:
    plan = Plan(stators=1, cycles=4, cycles_a_log=2, breaks=0.5, last_soak_h=60.0, electrical=False)
    stator = insulation_campaign.run(3, plan).stators[0]
    assert len(stator.oven_logs) == 2
    for place, log in enumerate(stator.oven_logs):
        true = sum(stator.hours_above[2 * place : 2 * place + 2])
        winding = log["T_winding"]
        assert hours_above(log.t_s, winding) == pytest.approx(true, abs=0.03)
        found = cycles(log.t_s, winding)
        assert len(found) >= 2
        assert sum(cycle.hours_above for cycle in found) == pytest.approx(true, abs=0.03)


def test_a_pause_of_the_log_at_the_foot_is_no_heating() -> None:
    before = np.concatenate([np.linspace(230.0, 20.0, 60), np.full(10, 20.0)])
    heating = np.concatenate([np.linspace(27.0, 230.0, 90), np.full(600, 230.0)])
    t_s = 60.0 * np.concatenate([np.arange(70), 70 + 30 * 60 + np.arange(690)])
    (_, found) = cycles(t_s, np.concatenate([before, heating]))
    assert found.heating_from_s == t_s[70]


def test_a_pause_of_the_log_at_the_foot_is_no_cooling() -> None:
    soak = np.concatenate([np.linspace(20.0, 230.0, 90), np.full(600, 230.0)])
    cooling = np.concatenate([np.linspace(230.0, 28.0, 60), np.full(20, 20.0), np.linspace(20.0, 230.0, 90)])
    t_s = 60.0 * np.concatenate([np.arange(750), 750 + 30 * 60 + np.arange(110)])
    found, _ = cycles(t_s, np.concatenate([soak, cooling]))
    assert (found.cooling_to_s, found.unknown_h) == (t_s[749], 0.0)


def test_a_check_that_stays_cold_counts_exactly_nothing() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        t = np.cumsum(rng.uniform(5.0, 61.0, 500))
        assert hours_above(t, rng.uniform(20.0, 150.0, 500), 180.0) == 0.0
        hot = rng.uniform(190.0, 230.0, 500)
        assert hours_above(t, hot, 180.0) == pytest.approx(float(t[-1] - t[0]) / 3600.0)
