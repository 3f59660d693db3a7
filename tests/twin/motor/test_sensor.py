"""What a sensor follows, in a word."""

from __future__ import annotations

from twin.motor.sensor import Sensor


def test_a_sensor_is_called_after_the_node_that_it_follows_by_more_than_half() -> None:
    alone, mixed = Sensor("T", {"winding": 1.0}), Sensor("NTC", {"winding": 0.4, "teeth": 0.6})
    assert (alone.node, alone.label) == ("winding", "winding")
    assert (mixed.node, mixed.label) == ("teeth", "teeth")


def test_one_that_follows_two_nodes_alike_is_called_after_both() -> None:
    assert Sensor("NTC", {"winding": 0.5, "teeth": 0.5}).label == "0.5 winding + 0.5 teeth"
