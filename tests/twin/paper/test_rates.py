"""The rows that `twin.paper.rates` shows are those of the motor that it names."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from made.filter_example import example
from twin.arithmetic.lanes import LaneStore, record
from twin.paper.rates import Rates, cell_of, into_of, rates_of, shares_of, term_of

Index = NDArray[np.int64]


@numba.njit(error_model="numpy")
def _rows(rates: Rates, at: Index) -> tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
    return term_of(rates, at, 0), into_of(rates, at, 0), cell_of(rates, at, rates.entries)


def test_tables_have_the_rows_that_their_comments_show() -> None:
    inputs, store = example(), LaneStore()
    capacities = np.array([node.capacity for node in inputs.network.nodes])
    _, multiplied = shares_of(inputs.parts, inputs.features.shape[1])
    rates = rates_of(inputs.parts, multiplied, capacities, inputs.boundaries.shape[1], inputs.frame.step_s, store)
    assert rates.size == 7 and rates.length == 8
    assert _rows(record(rates), store.indices()) == ((0, 0, 9, 10), (0, 1, 0, 3, 7, 5, 1, 7), (8, 2, 3))
