from __future__ import annotations

import itertools

import numpy as np
import pytest

from twin.arithmetic.interleaving import PIECE, at_a_border, interleave, separate
from twin.arithmetic.vectors import LANES

COUNTS = (0, 1, LANES - 1, LANES, 3 * LANES + 5)


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_laid_side_by_side_is_each_array_from_its_place_on(count: int) -> None:
    rng = np.random.default_rng(count)
    sources = tuple(rng.normal(size=count + 9) for _ in range(LANES))
    rows = np.full((count, LANES), np.nan)
    assert interleave(sources, 4, rows)
    np.testing.assert_array_equal(rows, np.stack([own[4 : 4 + count] for own in sources], axis=1))


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_given_out_again_is_what_was_laid_in_and_nothing_beside_it(count: int) -> None:
    rows = np.random.default_rng(count).normal(size=(count, LANES))
    targets = tuple(at_a_border([(count + 2 * LANES,)] * LANES))
    for own in targets:
        own[:] = -7.0
    separate(rows, targets, LANES)
    for lane, own in enumerate(targets):
        np.testing.assert_array_equal(own[LANES : LANES + count], rows[:, lane])
        assert (own[:LANES] == -7.0).all() and (own[LANES + count :] == -7.0).all()


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_one_number_that_is_not_finite_is_told_wherever_it_is(wrong: float) -> None:
    count = LANES + 3
    for place in range(count + 1):
        sources = tuple(np.full(count + 1, 1e308) for _ in range(LANES))
        sources[place % LANES][place] = wrong
        assert interleave(sources, 0, np.empty((count, LANES))) == (place == count)  # the last is not asked for


def test_a_target_between_two_borders_is_refused() -> None:
    targets = tuple(at_a_border([(4 * LANES,)] * LANES))
    with pytest.raises(ValueError, match="border"):
        separate(np.zeros((LANES, LANES)), targets, 1)


def test_arrays_begin_at_borders_and_share_no_number() -> None:
    shapes = [(3, 5), (0, 4), (PIECE // 4 - 1, 3), (7,), (PIECE + 1,), (1, 1)]
    arrays = at_a_border(shapes)
    assert [own.shape for own in arrays] == shapes
    assert all(own.ctypes.data % (8 * LANES) == 0 for own in arrays if own.size)
    ends = sorted((own.ctypes.data, own.ctypes.data + own.nbytes) for own in arrays if own.size)
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(ends))
