"""Rows in the registers are what the sums say, of any length, and the compiler keeps them there."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from twin.lanes import LANES, NOBODY, NOWHERE, Store, less, mirrored, scaled, sweep, transposed, width

Floats = np.ndarray[Any, Any]

LENGTHS = (8, 16, 24, 32, 40, 88)


@numba.njit
def swept(m: Floats, at: Any, lists: Any, places: Any, length: int) -> None:
    out, base, factors, shares = places
    sweep(m, at, lists, out, base, out, factors, shares, length)


@numba.njit
def lessened(m: Floats, at: Any, starts: int, which: int, places: Any, length: int) -> None:
    out, base, others, factor, shares, rows = places
    less(m, at, rows, 3, starts, which, out, base, others, factor, shares, 5, length)


@numba.njit
def turned(m: Floats, at: Any, out: int, source: int, size: int, length: int) -> None:
    transposed(m, out, source, size, length)
    mirrored(m, source, size, length)
    scaled(m, at, out, out, source, 8)


def drawn(store: Store, *shape: int) -> tuple[int, Floats]:
    numbers = np.random.default_rng(len(shape) * 100 + shape[0]).normal(size=shape)
    return store.put(numbers), numbers


@pytest.mark.parametrize("length", LENGTHS)
def test_a_sweep_takes_complete_rows_of_what_it_makes(length: int) -> None:
    store = Store()
    base, rows = drawn(store, 4, length)
    factors, scale = drawn(store, 4)
    shares, taken = drawn(store, 5)
    out = store.rows(4, length)
    order, others = [2, 0, 3, 1], [[], [(2, 4)], [(2, 0), (0, 1)], [(3, 2), (0, 3), (2, 1)]]
    lists = store.sweep(
        [i * length for i in order], [3, 2, 1, 0], [[(i * length, share) for i, share in own] for own in others]
    )
    m, at = store.numbers(), store.indices()
    swept(m, at, lists, (out, base, factors, shares), length)
    expected = np.zeros((4, length))
    for i, factor, own in zip(order, (3, 2, 1, 0), others, strict=True):
        expected[i] = scale[factor] * rows[i] - sum((taken[s] * expected[j] for j, s in own), np.zeros(length))
    assert np.abs(m[out : out + 4 * length].reshape(4, length) - expected).max() < 1e-14


@pytest.mark.parametrize("length", LENGTHS)
def test_rows_that_take_the_same_others_have_shares_of_their_own(length: int) -> None:
    store = Store()
    base, rows = drawn(store, 3, length)
    others, source = drawn(store, 2, length)
    shares, taken = drawn(store, 3, 5)
    factor, out = store.put(np.array([1.5])), store.rows(3, length)
    places = store.index([0, length, 2 * length])
    starts, which = store.index([length, 0, -1]), store.index([4, 1])
    m, at = store.numbers(), store.indices()
    lessened(m, at, starts, which, (out, base, others, factor, shares, places), length)
    expected = 1.5 * rows - taken[:, [4]] * source[1] - taken[:, [1]] * source[0]
    assert np.abs(m[out : out + 3 * length].reshape(3, length) - expected).max() < 1e-14


@pytest.mark.parametrize("size", [5, 8, 21, 24])
def test_matrices_are_transposed_and_mirrored(size: int) -> None:
    store, length = Store(), width(size + 1)
    source, rows = drawn(store, length, length)
    out = store.rows(length, length)
    m, at = store.numbers(), store.indices()
    turned(m, at, out, source, size, length)
    found = m[out : out + length**2].reshape(length, length)
    assert np.array_equal(found[1:size, :size], rows[:size, :size].T[1:])
    upper = np.triu(rows[:size, :size])
    mirror = m[source : source + length**2].reshape(length, length)[:size, :size]
    assert np.array_equal(mirror, upper + np.triu(upper, 1).T)


def test_a_store_begins_at_a_border_of_the_vectors_and_keeps_what_it_was_given() -> None:
    store = Store()
    places = [store.put(np.arange(n, dtype=np.float64)) for n in (3, 8, 9)]
    m, at = store.numbers(), store.indices()
    assert m.ctypes.data % (LANES * m.itemsize) == 0
    assert [place % LANES for place in places] == [0, 0, 0]
    assert all(np.array_equal(m[p : p + n], np.arange(n)) for p, n in zip(places, (3, 8, 9), strict=True))
    assert (at[NOWHERE], at[NOBODY]) == (0, -1)


def test_whole_rows_are_multiplied_in_vectors() -> None:
    """A new numba, or a line that it cannot see through, would show here first: by time alone nobody notices."""
    store = Store()
    lists = store.sweep([0], [0], [[]])
    place = store.rows(1, 32)
    swept(store.numbers(), store.indices(), lists, (place, place, place, place), 32)
    (code,) = swept.inspect_llvm().values()
    for lanes in (8, 16, 32):
        assert code.count(f"fmul <{lanes} x double>") >= 2
        assert code.count(f"fsub <{lanes} x double>") >= 1
