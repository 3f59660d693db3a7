"""The motor cut open: every node somewhere, none in another, each where its name and region put it."""

from __future__ import annotations

import numpy as np
import pytest

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from replay.engine.files.network_text import network_text
from replay.errors import MotorFileError
from replay.show.viewer.cut import HalfRing, mesh, parts
from twin.motor.network import Network
from twin.motor.slicing import sliced

MOTORS = ("hidden_effect", "hust_motor", "reference_motor")


def motor(name: str) -> Network:
    return read_motor((EXAMPLES / name / "motor.toml").read_bytes(), "motor.toml")


@pytest.mark.parametrize("name", MOTORS)
def test_every_node_has_a_part_and_no_two_are_in_one_place(name: str) -> None:
    network = motor(name)
    found = parts(network)
    assert sorted(part.node for part in found) == sorted(node.name for node in network.nodes)
    for i, one in enumerate(found):
        assert one.r[0] < one.r[1] and one.x[0] < one.x[1]
        for other in found[i + 1 :]:
            assert not (_overlap(one.r, other.r) and _overlap(one.x, other.x)), (one, other)


def _overlap(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return min(a[1], b[1]) - max(a[0], b[0]) > 1e-9


def test_ends_stand_before_and_behind_the_stack_and_the_rotor_within_the_stator() -> None:
    at = {part.node: part for part in parts(motor("hidden_effect"))}
    assert at["endwinding_a_inner"].x[1] < at["winding_a"].x[0] < at["winding_b"].x[1] < at["endwinding_b_inner"].x[0]
    inside_out = ["shaft", "rotor_core", "magnet", "rotor_surface", "teeth", "winding_a", "yoke", "jacket", "housing"]
    radii = [at[name].r[0] for name in inside_out]
    assert radii == sorted(radii)


def test_slices_lie_one_after_the_other() -> None:
    at = {part.node: part for part in parts(sliced(motor("hidden_effect"), ["magnet"], 3, 0.2))}
    first, middle, last = at["magnet_1"], at["magnet"], at["magnet_3"]
    assert first.r == middle.r == last.r
    assert first.x[1] < middle.x[0] < middle.x[1] < last.x[0]


def test_the_motor_file_may_say_where_a_node_is_drawn() -> None:
    text = (EXAMPLES / "hust_motor" / "motor.toml").read_text(encoding="utf-8")
    said = text.replace('name = "winding"\n', 'name = "winding"\nalong = [-1.2, 1.2]\nradius = [0.5, 0.7]\n', 1)
    at = {part.node: part for part in parts(read_motor(said.encode(), "motor.toml"))}
    assert (at["winding"].x, at["winding"].r) == ((-1.2, 1.2), (0.5, 0.7))
    assert len(at) == 3 and at["rotor"].x == parts(motor("hust_motor"))[0].x
    again = read_motor(network_text(read_motor(said.encode(), "motor.toml"), "drawn"), "drawn.toml")
    assert {part.node: part for part in parts(again)} == at
    for wrong, says in (("radius = [0.5, 0.7]", "radius is missing"), ("along = [-1.2, 1.2]", "along is missing")):
        with pytest.raises(MotorFileError, match=says):
            read_motor(said.replace(f"{wrong}\n", "").encode(), "motor.toml")
    with pytest.raises(MotorFileError, match="two numbers that rise from 0 to 1"):
        read_motor(said.replace("[0.5, 0.7]", "[0.5, 1.7]").encode(), "motor.toml")


def test_a_part_is_a_closed_half_ring_with_normals_that_point_out_of_it() -> None:
    corners, triangles, normals = mesh(HalfRing("n", (0.4, 0.6), (-1.0, 1.0)))
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    assert (corners[:, 1] >= -1e-9).all(), "behind the plane of the cut"
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    for middle, normal in zip((a + b + c) / 3, normals[triangles[:, 0]], strict=True):
        assert not _inside(middle + 0.01 * normal) and _inside(middle - 0.01 * normal)


def _inside(point: np.ndarray) -> bool:
    return bool(0.4 < np.hypot(point[1], point[2]) < 0.6 and abs(point[0]) < 1 and point[1] > 0)
