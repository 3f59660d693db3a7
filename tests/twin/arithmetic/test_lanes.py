"""Rows in the registers are what the sums say, of any length, and the compiler keeps them there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import (
    NOWHERE,
    LaneStore,
    Sweep,
    less,
    mirrored,
    record,
    row_less,
    scaled,
    sweep,
    sweep_mixed,
    transposed,
    width,
)
from twin.arithmetic.vectors import LANES

Floats = np.ndarray[Any, Any]

LENGTHS = (8, 16, 24, 32, 40, 88)


@numba.njit
def swept(m: Floats, at: Any, lists: Any, places: Any, length: int) -> None:
    out, base, factors, shares = places
    sweep(m, at, lists, out, base, out, factors, shares, length)


@numba.njit
def lessened(m: Floats, at: Any, taken: int, places: Any, count: int, length: int) -> None:
    out, base, others, factor, shares, rows = places
    less(m, at, rows, count, taken, 2, out, base, others, factor, shares, 5, length)


@numba.njit
def lessened_alone(m: Floats, at: Any, taken: int, places: Any, length: int) -> None:
    out, base, others, factor, shares, _ = places
    row_less(pointer(m, 0), pointer(at, 0), taken, 2, out, base, others, factor, shares, length)


@numba.njit
def swept_in_place(m: Floats, at: Any, lists: Any, places: Any, length: int) -> None:
    rows, beside, factors, shares, less = places
    sweep_mixed(m, at, lists, rows, rows, beside, rows, factors, less, shares, length)


@numba.njit
def doubled(m: Any, out: int, base: int, length: int) -> None:
    scaled(m, out, 2.0, base, length)


@numba.njit
def turned(m: Any, out: int, source: int, size: int, length: int) -> None:
    transposed(m, out, source, size, length)
    mirrored(m, source, size, length)


class Kept(NamedTuple):
    number: int
    lists: Sweep


@numba.njit
def swept_by_name(m: Floats, at: Any, kept: Any, rows: int) -> None:
    sweep(m, at, kept.lists, rows, rows, rows, rows, rows, 8)


def drawn(store: LaneStore, *shape: int) -> tuple[int, Floats]:
    numbers = np.random.default_rng(len(shape) * 100 + shape[0]).normal(size=shape)
    return store.put(numbers), numbers


@pytest.mark.parametrize("length", LENGTHS)
def test_a_sweep_takes_complete_rows_of_what_it_makes(length: int) -> None:
    store = LaneStore()
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
@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_rows_that_take_the_same_others_have_shares_of_their_own(count: int, length: int) -> None:
    store = LaneStore()
    base, rows = drawn(store, count, length)
    others, source = drawn(store, 2, length)
    shares, taken = drawn(store, count, 5)
    factor, out = store.put(np.array([1.5])), store.rows(count, length)
    places = (out, base, others, factor, shares, store.index([i * length for i in range(count)]))
    pairs = store.pairs([(length, 4), (0, 1)])
    m, at = store.numbers(), store.indices()
    expected = 1.5 * rows - taken[:, [4]] * source[1] - taken[:, [1]] * source[0]
    lessened(m, at, pairs, places, count, length)
    assert np.abs(m[out : out + count * length].reshape(count, length) - expected).max() < 1e-14
    m[out : out + count * length] = 0.0
    lessened_alone(m, at, pairs, places, length)
    assert np.abs(m[out : out + length] - expected[0]).max() < 1e-14


@pytest.mark.parametrize("length", LENGTHS)
def test_a_sweep_may_begin_with_two_rows_and_take_the_place_of_one(length: int) -> None:
    store = LaneStore()
    (base, rows), (beside, others) = drawn(store, 3, length), drawn(store, 4, length)
    (factors, scale), (shares, taken), (less, left) = drawn(store, 3), drawn(store, 2), drawn(store, 4)
    lists = store.sweep([length, 0, 2 * length], [1, 0, 2], [[], [(length, 1)], [(0, 0)]])
    m, at = store.numbers(), store.indices()
    expected = scale[:, None] * rows - left[:3, None] * others[:3]
    expected[0] -= taken[1] * expected[1]
    expected[2] -= taken[0] * expected[0]
    swept_in_place(m, at, lists, (base, beside, factors, shares, less), length)
    assert np.abs(m[base : base + 3 * length].reshape(3, length) - expected).max() < 1e-14


@pytest.mark.parametrize("length", LENGTHS)
def test_rows_are_scaled(length: int) -> None:
    store = LaneStore()
    base, row = drawn(store, 1, length)
    out = store.rows(1, length)
    m = store.numbers()
    doubled(m, out, base, length)
    assert np.array_equal(m[out : out + length], 2.0 * row[0])


@pytest.mark.parametrize("size", [2, 5, 8, 9, 18, 21, 24])
def test_matrices_are_transposed_and_mirrored(size: int) -> None:
    store, length = LaneStore(), width(size + 1)
    source, rows = drawn(store, length, length)
    out = store.rows(length, length)
    m = store.numbers()
    turned(m, out, source, size, length)
    found = m[out : out + length**2].reshape(length, length)
    assert np.array_equal(found[:size, :size], rows[:size, :size].T)
    upper = np.triu(rows[:size, :size])
    mirror = m[source : source + length**2].reshape(length, length)[:size, :size]
    assert np.array_equal(mirror, upper + np.triu(upper, 1).T)


def test_a_store_begins_at_a_border_of_the_vectors_and_keeps_what_it_was_given() -> None:
    store = LaneStore()
    places = [store.put(np.arange(n, dtype=np.float64)) for n in (3, 8, 9)]
    m, at = store.numbers(), store.indices()
    assert m.ctypes.data % (LANES * m.itemsize) == 0
    assert [place % LANES for place in places] == [0, 0, 0]
    assert all(np.array_equal(m[p : p + n], np.arange(n)) for p, n in zip(places, (3, 8, 9), strict=True))
    assert at[NOWHERE] == 0


def test_a_record_has_its_fields_by_name_for_compiled_functions() -> None:
    store = LaneStore()
    base, rows = drawn(store, 2, 8)
    lists = store.sweep([0, 8], [0, 1], [[], [(0, 1)]])
    m, at = store.numbers(), store.indices()
    kept = record(Kept(3, lists))
    assert (kept.number, kept.lists.rows, kept.lists.others) == (3, *lists)
    swept_by_name(m, at, kept, base)
    assert np.array_equal(m[base : base + 8], rows[0, 0] * rows[0])


def test_whole_rows_are_multiplied_in_vectors() -> None:
    """A new numba, or a line that it cannot see through, would show here first: by time alone nobody notices."""
    store = LaneStore()
    lists = store.sweep([0], [0], [[]])
    place = store.rows(1, 32)
    m, at = store.numbers(), store.indices()
    swept(m, at, lists, (place, place, place, place), 32)
    (code,) = swept.inspect_llvm().values()
    vectors = 1 + 2 + 3 + 4  # of 8, 16, 24 and 32 numbers
    assert code.count("fmul <8 x double>") >= vectors
    assert code.count("call <8 x double> @llvm.fma.v8f64") >= vectors
