"""Ids of causes as what a filter is to find."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from replay.engine.results.asked_unknowns import asked_unknowns
from replay.engine.results.filtered import HEAT_WALK_SHARE, MOST_FACTOR_SD, heats_elsewhere
from replay.errors import ReplayDataError
from twin.errors import CauseError, FrameError
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor

MOTOR = Network(
    "m",
    (Node("winding_a", 1.0, "copper"), Node("winding_b", 1.0, "copper"), Node("teeth", 1.0, "iron")),
    (Boundary("coolant"),),
    (
        Link("winding_a", "teeth", (Term(4.0, {}, sd=0.3), Term(2.0, {"flow": 0.8}, sd=0.4))),
        Link("winding_b", "teeth", (Term(4.0, {}, sd=0.3), Term(2.0, {"flow": 0.8}, sd=0.4))),
        Link("teeth", "coolant", (Term(9.0, {}, sd=0.9),)),
    ),
    (Source("winding_a", (Term(100.0, {"current": 2.0}, sd=0.1),)), Source("teeth", (Term(10.0, {}, sd=0.2),))),
)
SENSORS: Any = [
    SimpleNamespace(sensor=Sensor("NTC_1", {"teeth": 1.0}, bias_sd=0.5)),
    SimpleNamespace(sensor=Sensor("W", {"winding_a": 1.0})),
]


def factor(of: str, sd: float, *also: str) -> UnknownFactor:
    return UnknownFactor(of, sd, sd * HEAT_WALK_SHARE, also)


def asked(*causes: str) -> dict[str, Unknown]:
    return asked_unknowns(MOTOR, causes, {"winding_a": 900.0, "teeth": 100.0}, SENSORS)


@pytest.mark.parametrize(
    ("cause", "unknown"),
    [
        ("loss.teeth.constant", UnknownHeat("teeth", 100.0, 0.1)),
        ("loss.teeth.scale", factor("loss.teeth.scale", 0.2)),
        ("conductance.winding_a-teeth.scale", factor("conductance.winding_a-teeth.scale", 0.4)),
        ("conductance.teeth-winding_b.constant", factor("conductance.teeth-winding_b.constant", 0.3)),
        (
            "conductance.winding-teeth.flow0.8",
            factor("conductance.winding_a-teeth.flow0.8", 0.4, "conductance.winding_b-teeth.flow0.8"),
        ),
        ("conductance.teeth-coolant.scale", factor("conductance.teeth-coolant.scale", MOST_FACTOR_SD)),
        ("sensor.teeth.bias", UnknownBias("NTC_1", 0.5)),
        ("sensor.winding_a.bias", UnknownBias("W", 0.01)),
    ],
)
def test_an_id_asks_for_a_heat_a_factor_or_an_error(cause: str, unknown: Unknown) -> None:
    assert asked(cause) == {cause: unknown}


def test_losses_come_first_whatever_the_order() -> None:
    assert list(asked("sensor.teeth.bias", "loss.teeth.scale")) == ["loss.teeth.scale", "sensor.teeth.bias"]


@pytest.mark.parametrize(
    ("causes", "error", "says"),
    [
        (("clock.can2.offset",), ReplayDataError, "no filter finds that: give loss.NODE.constant"),
        (("loss.teeth.speed2",), ReplayDataError, "no filter finds that"),
        (("sensor.yoke.bias",), ReplayDataError, "there are teeth, winding_a"),
        (("loss.teeth.scale", "loss.teeth.constant"), ReplayDataError, "two losses at teeth cannot be told apart"),
        (("magnet",), CauseError, "write kind.place.law"),
        (("conductance.winding_a-coolant.scale",), FrameError, "has no coefficient"),
    ],
)
def test_what_no_filter_finds_is_refused_in_a_line(causes: tuple[str, ...], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says) as raised:
        asked(*causes)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("asked_for", "elsewhere"),
    [
        (UnknownHeat("teeth", 1.0, 1.0), {"winding_a": 900.0}),
        (UnknownFactor("loss.winding_b.current2", 0.1, 0.0), {"teeth": 100.0}),  # of the same part as winding_a
        (UnknownFactor("conductance.teeth-coolant.scale", 0.1, 0.0), {"winding_a": 900.0}),
        (UnknownFactor("conductance.winding_a-teeth.scale", 0.1, 0.0), {}),
        (UnknownBias("NTC_1", 1.0), {"winding_a": 900.0}),
    ],
)
def test_what_is_wrong_at_thermometers_is_a_heat_where_nothing_else_is_asked(
    asked_for: Unknown, elsewhere: dict[str, float]
) -> None:
    found = heats_elsewhere(MOTOR, {"winding_a": 900.0, "teeth": 100.0}, [o.sensor for o in SENSORS], [asked_for])
    assert {heat.node: heat.sd_W for heat in found} == elsewhere
