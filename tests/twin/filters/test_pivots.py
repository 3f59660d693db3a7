"""A step's matrix is eliminated in place, by pivots of few neighbours and of many."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from twin.filters.matrix import eliminate

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class Full(NamedTuple):
    """Of a matrix without an entry that is 0: each pivot has all later ones as neighbours."""

    n: int
    edges: int
    values: int
    order: int
    edge_start: int
    update: int


@numba.njit(error_model="numpy")
def eliminated(plan: Full, m: Floats, at: Index) -> None:
    eliminate(plan, m, at)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 9])
def test_a_full_matrix_is_eliminated_as_it_is_by_hand(n: int) -> None:
    rng = np.random.default_rng(n)
    matrix = rng.normal(size=(n, n)) + 3.0 * n * np.eye(n)
    edges = [(i, j) for i in range(n) for j in range(i + 1, n)]
    where = {(i, i): i for i in range(n)}
    where |= {edge: n + e for e, edge in enumerate(edges)}
    where |= {(j, i): n + len(edges) + e for e, (i, j) in enumerate(edges)}
    values = np.empty(n + 2 * len(edges))
    for place, e in where.items():
        values[e] = matrix[place]
    starts = np.cumsum([0, *(n - 1 - p for p in range(n))])
    update = [where[i, j] for p in range(n) for i in range(p + 1, n) for j in range(p + 1, n)]
    at = np.array([*range(n), *starts, *update, 0], dtype=np.int64)
    eliminated(Full(n, len(edges), 0, 0, n, 2 * n + 1), values, at)
    left = matrix.copy()
    for p in range(n):
        for i in range(p + 1, n):
            left[i, p] /= left[p, p]
            left[i, p + 1 :] -= left[i, p] * left[p, p + 1 :]
    for (i, j), e in where.items():
        expected = 1 / left[i, i] if i == j else left[i, j] if i > j else left[i, j] / left[i, i]
        assert values[e] == pytest.approx(expected, rel=1e-12)
