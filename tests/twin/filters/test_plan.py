"""The rows that `twin.filters.plan` and `twin.filters.readings` show are those of the motor that they describe."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from made.filter_example import example
from twin.filters.ekf import FilterRun, run_of
from twin.filters.inputs import Inputs
from twin.filters.plan import Plan, driven_of, drives_at, ends_of, right_hand_side, term_of, x_at
from twin.filters.readings import ReadingsPlan, entries_of, entry_of, observe
from twin.filters.step import carry
from twin.motor.heat_laws import NUMBER

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


@pytest.fixture(scope="module")
def inputs() -> Inputs:
    return example()


@pytest.fixture(scope="module")
def run(inputs: Inputs) -> FilterRun:
    return run_of(inputs)


@numba.njit(error_model="numpy")
def _rows(plan: Plan, at: Index) -> tuple[object, ...]:
    return term_of(plan, at, 0), ends_of(plan.laws, at, 2), ends_of(plan.laws, at, 3), driven_of(plan, at, 0)


@numba.njit(error_model="numpy")
def _places(plan: Plan) -> tuple[int, int, int]:
    return right_hand_side(plan) - plan.values, drives_at(plan) - plan.values, int(x_at(plan, 0, 2))


@numba.njit(error_model="numpy")
def _taken(r: ReadingsPlan, m: Floats, at: Index, q: int) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    later, earlier = entries_of(r.later, at, q), entries_of(r.earlier, at, q)
    return (
        [entry_of(r.later, m, at, e) for e in range(later[0], later[1])],
        [entry_of(r.earlier, m, at, e) for e in range(earlier[0], earlier[1])],
    )


def test_tables_have_the_rows_that_their_comments_show(run: FilterRun) -> None:
    plan, at = run.plan, run.at
    shown = {
        "places": (5, 6, [0, -1, NUMBER["copper"], -1, 0, 0], 3),
        "term": (1, 3, [0, 0, 0], 0),
        "plain": (1, 5, [0, 0, 1, 3, 5], 0),
        "rim": (1, 4, [2, 1, 9, 3], 0),
        "constant_heat": (1, 2, [4, 10], 0),
        "other": (1, 8, [3, 0, -1, -1, -1, -1, -1, -1], 0),
        "driven": (1, 4, [0, 0, 0, 1], 0),
        "bent": (1, 2, [0, 3], 0),
        "row": (1, 3, [0, 16, 32], 0),
        "node_start": (1, 3, [0, 1, 3], 0),
        "node": (1, 3, [0, 1, 2], 0),
        "channel_state": (1, 2, [-1, 6], 0),
        "channel_bias": (1, 3, [5, -1, -1], 0),
    }
    for name, (rows, columns, row, which) in shown.items():
        place = getattr(plan.laws if name == "places" else plan, name)
        assert at[place : place + rows * columns].reshape(rows, columns)[which].tolist() == row, name
    assert run.size == 7 and plan.length == 16
    assert [(pair >> 32, pair & 0xFFFFFFFF) for pair in at[plan.vary :][: plan.varied]] == [(2, 1), (3, 2), (4, 3)]
    assert run.m[plan.node_share :][:3].tolist() == [-1.0, -0.5, -0.5]


def test_names_of_rows_give_what_stands_in_them(run: FilterRun) -> None:
    assert _rows(run.plan, run.at) == ((0, 0, 0), (1, 3, -1), (0, -1, -1), (0, 0, 0, 1))
    assert _places(run.plan) == (8, 11, 2 * 16 + 7)


def test_a_reading_has_the_row_and_the_entries_that_are_shown(inputs: Inputs, run: FilterRun) -> None:
    run.begin(inputs)
    plan, r, m, at = run.plan, run.readings, run.m, run.at
    carry(plan, m, at, inputs.features[0], inputs.boundaries[0], True)
    assert observe(plan, r, m, at, inputs.boundaries[0], inputs.values[0], inputs.places[0], inputs.variances[0]) == 3
    row = m[r.crossed :][: r.stride]
    assert row[7] == pytest.approx(-4.67, abs=0.01)  # less the 50 degC read
    np.testing.assert_allclose(row[16:19], [1.98, 0.01, 1.15], atol=0.01)
    assert _taken(r, m, at, 0) == ([(-1.0, 0), (-1.0, 5)], [])
    assert _taken(r, m, at, 1) == ([(-0.25, 6)], [(-0.75, 6)])
