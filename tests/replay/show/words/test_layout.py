from __future__ import annotations

import numpy as np
import pytest

from replay.show.words.layout import stress_layout, without_overlap


def _path(n: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    lengths = np.zeros((n, n))
    for i in range(n - 1):
        lengths[i, i + 1] = lengths[i + 1, i] = 1.0
    return lengths


def test_a_row_of_nodes_becomes_a_straight_line_of_its_own_lengths() -> None:
    start = np.random.default_rng(0).normal(size=(6, 2))
    start[:, 0] += np.arange(6)
    place = stress_layout(_path(6), start)
    np.testing.assert_allclose(np.linalg.norm(np.diff(place, axis=0), axis=1), 1.0, atol=0.02)
    assert np.linalg.norm(place[0] - place[-1]) == pytest.approx(5.0, abs=0.05)


def test_the_start_decides_the_orientation() -> None:
    right = stress_layout(_path(3), np.array([[0.0, 0.0], [1.0, 0.1], [2.0, 0.0]]))
    left = stress_layout(_path(3), np.array([[0.0, 0.0], [-1.0, 0.1], [-2.0, 0.0]]))
    assert right[0, 0] < right[2, 0] and left[0, 0] > left[2, 0]


def test_parts_without_a_link_stay_apart() -> None:
    lengths = np.zeros((4, 4))
    lengths[0, 1] = lengths[1, 0] = lengths[2, 3] = lengths[3, 2] = 1.0
    place = stress_layout(lengths, np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]))
    assert np.linalg.norm(place[0] - place[2]) > 1.2


def test_boxes_are_moved_until_none_overlaps() -> None:
    rng = np.random.default_rng(1)
    size = rng.uniform(0.5, 1.5, (30, 2))
    place = without_overlap(rng.normal(0, 1.5, (30, 2)), size)
    gap = np.abs(place[:, None] - place[None])
    room = (size[:, None] + size[None]) / 2
    inside = (room - gap > 1e-6).all(axis=2)
    assert not (inside & ~np.eye(30, dtype=np.bool_)).any()


def test_boxes_that_do_not_overlap_stay_where_they_are() -> None:
    place = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    np.testing.assert_array_equal(without_overlap(place, np.ones((3, 2))), place)
