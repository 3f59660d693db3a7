"""Heat, hot spots, limits and derating in sentences, and the two bars that have one length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ingest.bench.derating import DeratingRule
from made.runs import made_summary
from replay.engine.results.hot_spots import deratings, hot_spots, limits
from replay.engine.results.summary import Efficiency, HotSpot, LimitPassed, ModelledSpot
from replay.engine.specimen.aged import Aged
from replay.show.plots.heat_plots import parts_of
from replay.show.words import heat_words
from twin.motor.network import Network, Node
from twin.run.losses import HeatBalance, HeatPart, StoredHeat


def part(mean_W: float) -> HeatPart:
    """Of a run of a minute."""
    return HeatPart(mean_W=mean_W, energy_J=60.0 * mean_W)


LOSSES = HeatBalance(
    mean_W=100.0,
    energy_J=6000.0,
    kinds={"copper_dc": part(120.0), "iron": part(-20.0)},
    regions={},
    nodes={},
    boundaries={"coolant": part(130.0), "ambient": part(-10.0)},
    stored={"copper": StoredHeat(energy_J=-1500.0), "iron": StoredHeat(energy_J=300.0)},
    left_J=0.0,
)
NODES = (Node("winding", 1.0, "copper", limit_degC=100.0), Node("teeth", 1.0, "iron"), Node("shaft", 1.0, "rotor"))
MOTOR = Network("m", NODES, (), (), ())
T = np.array([[20.0, 20.0, 20.0], [90.0, 50.0, 30.0], [130.0, 60.0, 40.0], [110.0, 70.0, 50.0]])


def test_what_warms_the_motor_stands_with_the_sources() -> None:
    made, gone = parts_of(LOSSES, 60.0)
    assert made == [("copper DC", 120.0), ("from ambient", 10.0), ("from store", 20.0)]
    assert gone == [("coolant", 130.0), ("less iron", 20.0)]
    assert sum(watts for _, watts in made) == sum(watts for _, watts in gone)


def test_the_heat_of_a_run_in_a_sentence() -> None:
    efficiency = Efficiency(modelled=0.943, measured=None, mechanical_J=1.0)
    assert heat_words.heat(replace(made_summary(), losses=LOSSES, efficiency=efficiency)) == (
        "100 W of heat on average (copper DC 120 %, iron −20 %): 130 W into coolant, −10 W into ambient and −20 W "
        "stored; efficiency 94.3 % by the model"
    )
    assert heat_words.heat(made_summary()) is None


def test_an_efficiency_that_no_motor_has_is_said() -> None:
    efficiency = Efficiency(modelled=0.943, measured=0.95, mechanical_J=1.0)
    run = replace(made_summary(), losses=LOSSES, efficiency=efficiency)
    assert str(heat_words.heat(run)).endswith("94.3 % by the model, 95.0 % as recorded")
    assert str(heat_words.heat(replace(run, efficiency=replace(efficiency, measured=1.032)))).endswith(
        "103.2 % as recorded (no motor has that: torque, speed or electrical power is read wrong)"
    )


def test_the_hottest_winding_and_what_holds_the_magnets_with_place_time_and_margin() -> None:
    found = hot_spots(MOTOR, T, 0.5)
    assert found["winding"] == HotSpot(node="winding", max_degC=130.0, at_s=1.0, limit_degC=100.0, margin_K=-30.0)
    assert (found["magnet"].node, found["magnet"].margin_K) == ("shaft", None)
    bare = {spot: ModelledSpot(**vars(one)) for spot, one in found.items()}
    assert heat_words.hottest(replace(made_summary(), hot_spots=bare)) == (
        "hottest by the model: winding 130 °C at 0:00:01 (30.0 K ABOVE its limit) and magnet 50 °C at 0:00:02 "
        "(shaft, no limit given)"
    )


def test_time_above_a_limit_is_that_of_the_steps_means() -> None:
    found = limits(MOTOR, T, 0.5)
    assert found == {"winding": LimitPassed(limit_degC=100.0, above_s=1.0, max_degC=130.0)}
    (said,) = heat_words.above_limits(replace(made_summary(), limits=found))
    assert said == "winding, by the model, is above its limit of 100 °C for 1 s, up to 130 °C"


@pytest.mark.parametrize(("node", "spot"), [("winding", "winding"), ("teeth", "winding"), ("shaft", "magnet")])
def test_a_rule_protects_what_its_sensor_stands_for(node: str, spot: str) -> None:
    shown = np.array([20.0, 60.0, 100.0])
    (found,) = deratings([DeratingRule("NTC", 50.0, 150.0)], {"NTC": (node, shown)}, MOTOR, T, 0.5)
    assert found.protects == spot
    assert found.margin_K == (45.0 if spot == "winding" else None)  # 100 less the 55 of the first step


def test_a_rule_whose_sensor_is_not_there_is_left_out() -> None:
    assert deratings([DeratingRule("NTC", 50.0, 150.0)], {}, MOTOR, T, 0.5) == []


def test_a_derating_that_comes_too_late_is_said() -> None:
    shown = np.array([20.0, 30.0, 40.0])
    found = deratings([DeratingRule("NTC", 50.0, 150.0)], {"NTC": ("winding", shown)}, MOTOR, T, 0.5)
    (said,) = heat_words.derating(replace(made_summary(), derating=found))
    assert said.startswith(
        "Derating by NTC (50 to 150 °C): full current throughout; by the hottest winding of the model less"
    )
    assert "the hot spot asks for less current and the sensor does not" in said
    assert said.endswith("the hot spot reaches 120 °C, 20.0 K ABOVE its limit.")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1240.0, "W", "1,240 W"),
        (0.0125, "ohm", "12.5 mΩ"),
        (-3.456, "W", "−3.46 W"),
        (2.0, "ohm", "2 Ω"),
        (0.08, "Wb", "80 mWb"),
    ],
)
def test_a_number_has_the_unit_of_its_size(value: float, unit: str, text: str) -> None:
    assert heat_words.quantity(value, unit) == text


def test_in_brief_a_motor_that_has_a_rotor_but_no_magnet_is_not_told_of_one() -> None:
    spot = ModelledSpot(node="rotor", max_degC=84.0, at_s=1.0, limit_degC=None, margin_K=None)
    told = {node: replace(spot, node=node) for node in ("rotor", "magnet", "magnet_outer")}
    said = [heat_words.in_brief(replace(made_summary(), hot_spots={"magnet": one})) for one in told.values()]
    assert said == [["rotor 84 °C"], ["magnet 84 °C"], ["magnet 84 °C"]]


def test_a_band_is_said_with_what_it_holds() -> None:
    bare = {spot: ModelledSpot(**vars(one)) for spot, one in hot_spots(MOTOR, T, 0.5).items()}
    spots = {
        spot: replace(one, sd_K=5.0, ci95_degC=[one.max_degC - 9.8, one.max_degC + 9.8], band_from="motor file")
        for spot, one in bare.items()
    }
    assert heat_words.hottest(replace(made_summary(), hot_spots=spots)) == (
        "hottest by the model: winding 130 °C (120 to 140) at 0:00:01 (30.0 K ABOVE its limit) and magnet 50 °C (40 "
        "to 60) at 0:00:02 (shaft, no limit given); 95 %, by the sd of the motor file: calibrate it for a narrower "
        "one"
    )


def test_what_heat_has_left_is_said_with_where_that_is_known_from() -> None:
    old = Aged(places=["winding_a-teeth"], above_degC=180.0, dose_h=132.4, factor=0.81, sd=0.01, from_="law")
    (line,) = heat_words.aged(replace(made_summary(), ageing=[old]))
    assert line == "aged: 132 h above 180 °C before leave 81 % of winding a-teeth, by the law of the motor file"
    (line,) = heat_words.aged(replace(made_summary(), ageing=[replace(old, from_="abcdef1234567890")]))
    assert line.endswith("by the checks of assessment abcdef12")
    assert list(heat_words.aged(made_summary())) == []
