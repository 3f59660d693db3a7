"""Every healthy difference has plain words of its own, and a size that people know."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from made.motor import every_law, recorded, smooth
from twin.diagnosis.in_words import COPPER, LAGS, LOSSES, MEASURED_LOSS, PATHS, Plain
from twin.differences.everyday import everyday
from twin.fitting.actions import Parameter
from twin.fitting.model import Test
from twin.motor.network import Link, Network, Node, Source, Term

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])


@pytest.fixture(scope="module")
def tests() -> list[Test]:
    return [recorded(every_law(), smooth(600.0), INITIAL, name=name) for name in ("one", "two")]


@pytest.fixture(scope="module")
def differences(tests: list[Test]) -> dict[str, Parameter]:
    return {p.name: p for p in everyday(every_law(), tests) if p.test in (None, 0)}


@pytest.fixture(scope="module")
def plain() -> Plain:
    return Plain(every_law())


def test_each_has_words_of_its_own_without_names_of_code(plain: Plain, differences: dict[str, Parameter]) -> None:
    says = Counter((plain.says(one), one.test) for one in differences.values())
    assert max(says.values()) == 1
    signals = ("W_1", "Y_1", "R_1")
    for text, _ in says:
        assert not re.search(r"_|\.\D|term\d", re.sub("|".join(signals), "", text)), text


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("term0", "the heat path between winding and yoke"),
        ("term2", "the heat path between yoke and coolant (the part with flow to the power 0.8)"),
        ("term9", "the loss in winding (the part with speed squared and current squared)"),
        ("conductance.yoke-coolant.flow", "the exponent of flow in the heat path between yoke and coolant"),
        ("conductance.yoke-magnet.temperature", "how the heat path between yoke and magnet changes with temperature"),
        ("conductance.winding-magnet", "a heat path between winding and magnet that the file does not have"),
        ("map.yoke.0", "the loss in yoke at low speed"),
        ("map.yoke.4i", "how the loss in yoke follows current near 9,000 rpm"),
        ("loss.magnet.standstill", "heat by the current's ripple in magnet"),
        ("capacity.case", "the heat capacity of case"),
        ("sensor.W_1.gain", "the gain of W_1"),
        ("sensor.W_1.bias", "the offset of W_1"),
        ("sensor.W_1.beside.yoke", "the share of yoke in what W_1 reads"),
        ("clock.can1.drift", "the drift of the clock of can1"),
        ("boundary.coolant.bias", "the reading of coolant"),
        ("start.yoke", "the temperature of yoke at the start"),
    ],
)
def test_the_words_say_what_it_is_of(plain: Plain, differences: dict[str, Parameter], name: str, says: str) -> None:
    assert plain.says(differences[name]) == says


@pytest.mark.parametrize(
    ("name", "kind", "place"),
    [
        ("term2", "conductance", "yoke-coolant"),
        ("term9", "loss", "winding"),
        ("map.yoke.4i", "loss", "yoke"),
        ("loss.yoke.temperature", "loss", "yoke"),
        ("conductance.winding-magnet", "conductance", "winding-magnet"),
        ("capacity.case", "capacity", "case"),
        ("sensor.W_1.beside.yoke", "sensor", "W_1"),
        ("clock.can1.offset", "clock", "can1"),
        ("input.current.gain", "input", "current"),
    ],
)
def test_kind_and_place_are_those_of_causes(
    plain: Plain, differences: dict[str, Parameter], name: str, kind: str, place: str
) -> None:
    assert plain.kind_and_place(differences[name]) == (kind, place)


@pytest.mark.parametrize(
    ("name", "number", "size"),
    [
        ("term2", np.log(1.62), (0.62, "1")),
        ("capacity.case", -np.log(2.0), (-0.5, "1")),
        ("map.yoke.4i", -0.4, (-0.4, "1")),
        ("conductance.yoke-coolant.flow", 0.2, (0.2, "")),
        ("conductance.yoke-magnet.temperature", 0.004, (0.004, "1/K")),
        ("conductance.winding-magnet", 0.3, (0.3, "W/K")),
        ("loss.magnet.standstill", 2.5, (2.5, "W")),
        ("sensor.W_1.gain", 0.02, (0.02, "1")),
        ("sensor.W_1.lag", 1.5, (1.5, "s")),
        ("clock.can1.drift", 20.0, (20.0, "ppm")),
        ("boundary.coolant.bias", 0.4, (0.4, "K")),
    ],
)
def test_a_size_is_told_as_people_count_it(
    plain: Plain, differences: dict[str, Parameter], name: str, number: float, size: tuple[float, str]
) -> None:
    value, unit = plain.amount(differences[name], number)
    assert value == pytest.approx(size[0])
    assert unit == size[1]


def test_what_is_held_says_where(plain: Plain, differences: dict[str, Parameter]) -> None:
    assert plain.bound(replace(differences["term2"], high=np.log(4.0))) == "a factor of 4"
    assert "nothing of the loss is left" in plain.bound(differences["map.yoke.4i"])
    assert "as far below nothing" in plain.bound(differences["conductance.winding-magnet"])


def test_each_has_a_test_that_would_tell_more(plain: Plain, differences: dict[str, Parameter]) -> None:
    for one in differences.values():
        assert plain.sharper(one)
    yoke, copper = differences["map.yoke.4i"], differences["term9"]
    assert plain.sharper(copper) == f"{COPPER[0]}, or {MEASURED_LOSS}"
    assert plain.sharper(yoke) == f"{LOSSES[0]}, {LOSSES[1]}, or {MEASURED_LOSS}"
    assert plain.sharper(yoke, copper).count(MEASURED_LOSS) == 1
    assert plain.sharper(differences["sensor.W_1.lag"]) == plain.sharper(differences["capacity.case"]) == LAGS[0]
    assert plain.sharper(differences["conductance.yoke-coolant.flow"]) == ", or ".join(PATHS)


def test_groups_are_families_where_there_is_one(plain: Plain, differences: dict[str, Parameter]) -> None:
    groups = {name: plain.group(one) for name, one in differences.items()}
    assert groups["map.yoke.4i"] == "form of the losses in iron"
    assert groups["term2"] == "films"
    assert groups["capacity.case"] == "capacities"
    assert groups["sensor.W_1.beside.yoke"] == "places of readings"
    assert groups["input.current.gain"] == "readings of inputs"


def test_both_sides_of_a_motor_are_told_as_one(tests: list[Test]) -> None:
    """`film_a` and `film_b` mirror each other."""
    network = every_law()
    twins = Network(
        name="twins",
        nodes=tuple(Node(f"head_{side}", 900.0, "copper") for side in "ab"),
        boundaries=network.boundaries,
        links=tuple(Link(f"head_{side}", "coolant", (Term(3.0),)) for side in "ab"),
        sources=tuple(Source(f"head_{side}", (Term(80.0, {"current": 2.0}, copper=True),)) for side in "ab"),
        scale=network.scale,
    )
    both = [replace(test, channels=(), initial=INITIAL[:2], initial_sd=test.initial_sd[:2]) for test in tests]
    says = {p.name: Plain(twins).says(p) for p in everyday(twins, both)}
    assert says["conductance.head-coolant.both0"] == "the heat path between head and coolant on both sides"
    assert says["loss.head.both0"] == "the loss in head on both sides"
    assert says["term1"] == "the heat path between head b and coolant"
