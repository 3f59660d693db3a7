"""A heat without a name over speed and load is drawn where the sessions were, and tells which way it goes."""

from __future__ import annotations

from dataclasses import replace

from made.diagnoses import UNKNOWN
from replay.show.reports.heat_map_plot import heat_maps
from replay.studies.diagnosis.answer import Diagnosis, HeatOverLoad, document, read

BRAKING = HeatOverLoad(
    speed_rpm=[0.0, 3000.0, 6000.0],
    torque_Nm=[-100.0, 0.0, 100.0],
    watts=[[0.0, 0.0, 0.0], [39.4, -1.0, -2.0], [900.0, -3.0, -4.0]],
    seconds=[[0.0, 600.0, 0.0], [300.0, 900.0, 700.0], [20.0, 400.0, 800.0]],
)


def _diagnosis(goes_with: list[str], found: HeatOverLoad | None = BRAKING) -> Diagnosis:
    heat = replace(UNKNOWN.unknown[0], node="magnet", goes_with=goes_with, map=found)
    return replace(UNKNOWN, unknown=[heat])


def test_the_plot_tells_where_the_heat_is_and_leaves_out_where_nobody_was() -> None:
    plot = heat_maps(_diagnosis(["braking"]))["magnet"]
    assert plot.title == "Magnet: 39 W more than most of the time while the motor brakes"
    assert plot.table is not None
    assert plot.table.head[:2] == ("speed [rpm]", "torque [Nm]")
    assert ("3,000", "−100", "+39.4", "5 min") in plot.table.rows
    assert len(plot.table.rows) == 6, "20 s at 6,000 rpm are too few"
    assert "+39.4<" in plot.svg and "+900" not in plot.svg


def test_a_heat_that_is_no_matter_of_braking_is_told_by_its_operating_point() -> None:
    found = replace(BRAKING, torque_Nm=[], current_A=[-200.0, 0.0, 200.0])
    plot = heat_maps(_diagnosis(["speed"], found))["magnet"]
    assert plot.title == "Magnet: 39 W more than most of the time at about 3,000 rpm and −200 A"


def test_a_heat_in_time_has_no_such_plot() -> None:
    assert heat_maps(UNKNOWN) == {}


def test_the_map_comes_back_from_the_sealed_answer() -> None:
    diagnosis = _diagnosis(["braking"])
    stored = document(diagnosis, {})
    assert stored["unknown"][0]["map"]["torque_Nm"] == BRAKING.torque_Nm
    assert "current_A" not in stored["unknown"][0]["map"]
    assert read(stored).unknown == diagnosis.unknown
    assert "map" not in document(UNKNOWN, {})["unknown"][0]
