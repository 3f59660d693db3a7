"""How long a session stays in each cell of speed and torque."""

from __future__ import annotations

import numpy as np
import pytest

from ingest.catalogue.operating_points import cells, draw, round_edges
from made.channels import channel

T = np.arange(3600.0)
SPEED = channel("n", "speed", np.where(T < 1200, 1000.0, 8000.0))
TORQUE = channel("M", "torque", np.where(T < 2400, 120.0, -40.0))


def test_minutes_lie_in_the_cell_of_their_speed_and_signed_torque() -> None:
    found = cells([SPEED, TORQUE])
    assert found is not None
    at = {
        (sum(found.x_edges[column : column + 2]) / 2, sum(found.y_edges[row : row + 2]) / 2): minutes
        for row, line in enumerate(found.minutes)
        for column, minutes in enumerate(line)
        if minutes
    }
    assert at == {(1000.0, 125.0): 20.0, (8000.0, 125.0): 20.0, (8000.0, -50.0): 20.0}
    assert (found.x, found.y) == ("speed_rpm", "torque_Nm")


def test_current_stands_in_for_torque() -> None:
    found = cells([SPEED, channel("Id", "current_d", 0 * T + 30.0), channel("Iq", "current_q", 0 * T + 40.0)])
    assert found is not None and found.y == "current_A"
    (row,) = found.minutes
    assert found.y_edges == (49.75, 50.25) and sum(row) == 60.0


def test_without_speed_or_load_there_are_no_cells() -> None:
    assert cells([SPEED]) is None
    assert cells([TORQUE]) is None


@pytest.mark.parametrize(
    ("low", "high", "middles"),
    [
        (0.0, 15_990.0, [0, 2000, 4000, 6000, 8000, 10_000, 12_000, 14_000, 16_000]),
        (-61.0, 146.0, [-50, -25, 0, 25, 50, 75, 100, 125, 150]),
        (0.0, 100.0, [0, 20, 40, 60, 80, 100]),
        (1997.0, 2003.0, [2000]),
    ],
)
def test_cells_lie_around_round_values_and_hold_every_value(low: float, high: float, middles: list[float]) -> None:
    edges = round_edges(np.array([low, high]), 10)
    assert ((edges[1:] + edges[:-1]) / 2).tolist() == middles
    assert edges[0] <= low and high <= edges[-1]


@pytest.mark.parametrize(
    ("set_points", "noise", "most", "middles"),
    [
        ([0.0, 1500.0], 0.6, 10, [0, 250, 500, 750, 1000, 1250, 1500]),
        ([0.0, 750.0, 2400.0], 0.6, 10, [0, 400, 800, 1200, 1600, 2000, 2400]),
        ([0.0, 35.0, 70.0], 0.2, 8, [0, 25, 50, 75]),
    ],
)
def test_a_set_point_with_its_noise_lies_in_one_cell(
    set_points: list[float], noise: float, most: int, middles: list[float]
) -> None:
    own = np.random.default_rng(1).normal(0.0, noise, (len(set_points), 1000))
    edges = round_edges((np.array(set_points)[:, None] + own).ravel(), most)
    assert ((edges[1:] + edges[:-1]) / 2).tolist() == middles
    for point in set_points:
        assert len(set(np.searchsorted(edges, point + own[0]))) == 1


@pytest.mark.parametrize("value", [0.0, -3.7, 5000.0])
def test_a_constant_has_one_cell(value: float) -> None:
    edges = round_edges(np.full(3, value), 10)
    assert len(edges) == 2 and edges[0] <= value < edges[1]


def test_the_map_says_minutes_and_shades_them() -> None:
    found = cells([SPEED, TORQUE])
    assert found is not None
    text = draw(found)
    assert text.count("██20.0") == 3
    assert text.splitlines()[0].startswith("   torque [Nm] │ minutes by speed [rpm]")
    assert max(map(len, text.splitlines())) <= 100
    narrow = draw(found, width=40)
    assert max(map(len, narrow.splitlines())) <= 40 and "more columns up to 8000" in narrow
