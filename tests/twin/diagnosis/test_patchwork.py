"""When terms that survived are names, and when they only stand in together for a law that the list lacks."""

from __future__ import annotations

import pytest

from made.motor import CHANNELS, SINGLE, every_law
from twin.diagnosis.patchwork import Survivor, is_patchwork, nodes_of
from twin.differences.candidates import InputChannel, generate
from twin.motor.sensor import Sensor

CANDIDATES = {
    str(c.cause): c
    for c in generate(
        every_law(),
        [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
    )
}
MAGNET, YOKE, CASE = "loss.magnet.scale", "loss.yoke.speed2", "loss.case.constant"  # in a row, one link apart


def _is(*terms: tuple[str, float], alone: float = 30.0) -> bool:
    """Terms and what they are needed; each asked for as much as the others' law too while it was `alone`."""
    return is_patchwork([Survivor(CANDIDATES[name], value, alone) for name, value in terms], every_law())


def test_one_term_is_a_name() -> None:
    assert not _is((MAGNET, 8.0))
    assert not is_patchwork([], every_law())


def test_a_strong_term_stays_a_name_beside_a_weak_one() -> None:
    assert not _is((MAGNET, 50.0), (YOKE, 8.0))


@pytest.mark.parametrize("order", [1, -1])
def test_neighbours_that_need_each_other_are_patchwork(order: int) -> None:
    assert _is(*((MAGNET, 15.0), (YOKE, 9.0))[::order])


def test_neighbours_that_are_asked_for_alone_and_no_less_together_are_two_names() -> None:
    assert not _is((MAGNET, 18.5), (YOKE, 17.6), alone=17.0)
    assert not _is((MAGNET, 18.5), (YOKE, 17.6), alone=20.0)
    assert _is((MAGNET, 18.5), (YOKE, 17.6), alone=21.0), "the other took ln 20 of it"
    assert _is((MAGNET, 18.5), (YOKE, 17.6), alone=2.0), "nobody asked for it before the other was there"


def test_several_weak_neighbours_count_together() -> None:
    assert _is((YOKE, 20.0), (MAGNET, 6.0), (CASE, 6.0))
    assert not _is((YOKE, 20.0), (MAGNET, 6.0))


def test_terms_that_are_far_apart_are_two_names() -> None:
    assert not _is((MAGNET, 15.0), (CASE, 14.0))


@pytest.mark.parametrize("name", ["sensor.magnet.lag", "input.current.gain", "boundary.coolant.bias"])
def test_what_changes_no_temperature_of_a_node_is_near_nothing(name: str) -> None:
    assert nodes_of(CANDIDATES[name], every_law()) == frozenset()
    assert not _is((MAGNET, 15.0), (name, 14.0))
