from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from twin.compiled.sparse import Pattern, factorise
from twin.compiled.structure import structure
from twin.motor.network import Network


def _entries(pattern: Pattern) -> int:
    """Off-diagonal entries of one factor, fill included."""
    return sum(map(len, pattern.later))


def test_a_star_is_eliminated_from_its_tips_without_fill() -> None:
    pattern = factorise(5, [(0, i) for i in range(1, 5)])
    assert _entries(pattern) == 4
    assert pattern.order[:3] == (1, 2, 3)


def test_a_ring_of_n_fills_n_minus_3() -> None:
    assert _entries(factorise(7, [(i, (i + 1) % 7) for i in range(7)])) == 7 + 4


@pytest.mark.parametrize("seed", range(5))
def test_the_pattern_holds_every_entry_of_the_dense_factors(seed: int, make_network: Callable[..., Network]) -> None:
    made = structure(make_network(seed, n=12))
    pattern, n = made.pattern, made.n
    rng = np.random.default_rng(seed)
    matrix = np.eye(n) * 50.0
    for group in made.groups:
        for i, j in ((group.a, group.b), (group.a, group.other), (group.b, group.other)):
            if 0 <= i < n and 0 <= j < n and i != j:
                matrix[i, j], matrix[j, i] = -rng.random(2)
    dense = matrix[np.ix_(pattern.order, pattern.order)]
    for p in range(n):
        dense[p + 1 :, p] /= dense[p, p]
        dense[p + 1 :, p + 1 :] -= np.outer(dense[p + 1 :, p], dense[p, p + 1 :])
    allowed = {frozenset((pattern.order.index(p), pattern.order.index(j))) for p in range(n) for j in pattern.later[p]}
    found = {frozenset((int(i), int(j))) for i, j in np.argwhere(np.abs(dense) > 1e-14) if i != j}
    assert found <= allowed
