"""Rows of matrices side by side in the vector registers: the few operations that the filters spend their time in.

All matrices of a run are in one flat array of numbers `m`, all indices in another, `at`; a place is where something
begins in one of them, and every function takes both, or pointers to them (`twin.arithmetic.lane_code.pointer`), and
places. `LaneStore` lays them out: a row has a multiple of `LANES` numbers and begins at a border of the machine's
vectors.

A row is worked on up to four vectors at a time, in registers while indices say which other rows take part: a sparse
matrix costs its entries, and nothing is written before it is complete.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.interleaving import at_a_border
from twin.arithmetic.lane_code import scale_vectors, sweep_vectors, tile_vectors, turn_block
from twin.arithmetic.vectors import LANES

Floats = NDArray[np.float64]
Index = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., Any])
Fields = TypeVar("Fields", bound=NamedTuple)

NOWHERE = 0  # place of the index 0: row 0, and the pair 0, 0

u = np.uint64  # numba then asks of no index whether it counts from the end


def width(numbers: int) -> int:
    """The length of a row that holds so many numbers: the next multiple of `LANES`."""
    return -(-numbers // LANES) * LANES


def within(function: Function) -> Function:
    """Compile a function into the compiled ones that call it. It cannot be called from Python: a way in from there
    takes numba as long to compile as a short function."""
    no_way_in: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, numba.njit(error_model="numpy", nogil=True, forceinline=True, **no_way_in)(function))


class Sweep(NamedTuple):
    """The places of two lists of pairs (`paired`) that say what `sweep` does, an index below 0 behind the last.

    `rows`: where each row begins and which factor it has. `others`: for each row in turn the others that it takes,
    where each begins and which share of it, and again an index below 0. Rows of 16 numbers of which the second takes
    the first times share 5, and the third takes the second times share 6 and row 48 times share 7, are

        rows      0 0 | 16 1 | 32 2 | -1 0
        others    -1 0 | 0 5 | -1 0 | 16 6 | 48 7 | -1 0
    """

    rows: int
    others: int


@within
def paired(first: int, second: int) -> int:
    """Two indices as one number, which is loaded at once."""
    return first << 32 | second


@within
def both(pair: int) -> tuple[int, int]:
    """The two indices that `paired` made one."""
    return pair >> 32, pair & 0xFFFFFFFF


class LaneStore:
    """Collects numbers and indices of a run; each method that adds some returns the place where they will be in
    `numbers()` or `indices()`. The index 0 stands first (`NOWHERE`)."""

    def __init__(self) -> None:
        self._numbers: list[tuple[int, Floats]] = []
        self._indices = [0]
        self._end = 0

    def rows(self, count: int, length: int) -> int:
        """Room for `count` rows of `length` numbers, all 0."""
        place = self._end
        self._end += width(count * length)
        return place

    def put(self, numbers: Floats) -> int:
        """Numbers, one row after the other."""
        place = self.rows(1, numbers.size)
        self._numbers.append((place, numbers))
        return place

    def index(self, indices: Iterable[int]) -> int:
        """Indices."""
        place = len(self._indices)
        self._indices += indices
        return place

    def table(self, rows: Iterable[Iterable[int]]) -> int:
        """Rows of indices, one after the other."""
        return self.index(itertools.chain.from_iterable(rows))

    def pairs(self, pairs: Iterable[tuple[int, int]]) -> int:
        """Pairs of indices as `paired` makes them."""
        return self.index([first << 32 | second for first, second in pairs])

    def sweep(self, rows: Sequence[int], scales: Sequence[int], others: Sequence[Sequence[tuple[int, int]]]) -> Sweep:
        """The lists of a `Sweep`: where `rows` begin, which factor (`scales`) each has, and for each row pairs of
        where another begins that it takes, and which share."""
        end = (-1, 0)
        taken = itertools.chain.from_iterable((*own, end) for own in others)
        return Sweep(self.pairs([*zip(rows, scales, strict=True), end]), self.pairs(taken))

    def numbers(self) -> Floats:
        """All numbers, from a border of the machine's vectors on."""
        (found,) = at_a_border([(self._end,)])
        found[:] = 0.0
        for place, numbers in self._numbers:
            found[place : place + numbers.size] = numbers.ravel()
        return found

    def indices(self) -> Index:
        """All indices."""
        return np.array(self._indices, dtype=np.int64)


def aligned(numbers: Floats) -> Floats:
    """A copy (N,) of numbers that begins at a border of the machine's vectors."""
    (copy,) = at_a_border([(numbers.size,)])
    copy[:] = numbers.ravel()
    return copy


def record(fields: Fields) -> Fields:
    """The same fields, those of a tuple within as a record within, as one record in memory: compiled functions then
    take one address and not every field, which is what they take longest to compile for. They read fields by the same
    names; so does Python, but for names that numpy has for itself, such as `size`."""

    def kinds(of: Any) -> Any:
        return [(name, kinds(value)) for name, value in of._asdict().items()] if hasattr(of, "_asdict") else np.int64

    return cast(Fields, np.array([tuple(fields)], dtype=kinds(fields)).view(np.recarray)[0])


@numba.njit(error_model="numpy", nogil=True, cache=True)
def sweep(
    m: Floats, at: Index, lists: Sweep, out: int, base: int, others: int, factors: int, shares: int, length: int
) -> None:
    """Fill rows of `out`, one after the other, so that `others` may be rows of `out` that are complete. Row and scale
    are a pair of `lists.rows`, start_e and which_e those of `lists.others` that are the row's; for every c < `length`

        m[out + row + c] = m[factors + scale] m[base + row + c] - sum_e m[shares + which_e] m[others + start_e + c]
    """
    rows, taken = lists.rows, lists.others
    while length >= 32:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, factors, base, 0, 32)
        out, base, others, length = out + 32, base + 32, others + 32, length - 32
    if length >= 24:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, factors, base, 0, 24)
    elif length >= 16:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, factors, base, 0, 16)
    elif length >= 8:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, factors, base, 0, 8)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def sweep_mixed(
    m: Floats,
    at: Index,
    lists: Sweep,
    out: int,
    base: int,
    beside: int,
    others: int,
    factors: int,
    less: int,
    shares: int,
    length: int,
) -> None:
    """As `sweep`, from the rows of `base` and those of `beside`

    m[out + row + c] = m[factors + scale] m[base + row + c] - m[less + scale] m[beside + row + c] - sum_e ...
    """
    rows, taken = lists.rows, lists.others
    while length >= 32:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, less, beside, 1, 32)
        out, base, beside, others, length = out + 32, base + 32, beside + 32, others + 32, length - 32
    if length >= 24:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, less, beside, 1, 24)
    elif length >= 16:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, less, beside, 1, 16)
    elif length >= 8:
        sweep_vectors(m, at, rows, taken, out, base, others, factors, shares, less, beside, 1, 8)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def less(
    m: Floats,
    at: Index,
    rows: int,
    count: int,
    taken: int,
    number: int,
    out: int,
    base: int,
    others: int,
    factor: int,
    shares: int,
    onward: int,
    length: int,
) -> None:
    """As `sweep` where all rows take shares of the same others: `number` pairs at `taken`. Rows are `count` indices
    at `rows`; the shares of each begin `onward` numbers behind those of the row before it. For the p-th row and every
    c < `length`

        m[out + row + c] = m[factor] m[base + row + c] - sum_e m[shares + p onward + which_e] m[others + start_e + c]

    No row of `out` may be among the others.
    """
    for p in range(0, count - 3, 4):
        own, c = shares + p * onward, 0
        while c <= length - 32:
            tile_vectors(m, at, rows + p, taken, number, out + c, base + c, others + c, factor, own, onward, 4, 32)
            c += 32
        if c <= length - 24:
            tile_vectors(m, at, rows + p, taken, number, out + c, base + c, others + c, factor, own, onward, 4, 24)
        elif c <= length - 16:
            tile_vectors(m, at, rows + p, taken, number, out + c, base + c, others + c, factor, own, onward, 4, 16)
        elif c <= length - 8:
            tile_vectors(m, at, rows + p, taken, number, out + c, base + c, others + c, factor, own, onward, 4, 8)
    for p in range(count - count % 4, count):
        row = at[u(rows + p)]
        row_less(m, at, taken, number, out + row, base + row, others, factor, shares + p * onward, length)


@within
def row_less(
    m: Floats,
    at: Index,
    taken: int,
    number: int,
    out: int,
    base: int,
    others: int,
    factor: int,
    shares: int,
    length: int,
) -> None:
    """`less` for the one row that begins at `out`; the others may be rows of the same matrix that are complete."""
    while length >= 32:
        tile_vectors(m, at, NOWHERE, taken, number, out, base, others, factor, shares, 0, 1, 32)
        out, base, others, length = out + 32, base + 32, others + 32, length - 32
    if length >= 24:
        tile_vectors(m, at, NOWHERE, taken, number, out, base, others, factor, shares, 0, 1, 24)
    elif length >= 16:
        tile_vectors(m, at, NOWHERE, taken, number, out, base, others, factor, shares, 0, 1, 16)
    elif length >= 8:
        tile_vectors(m, at, NOWHERE, taken, number, out, base, others, factor, shares, 0, 1, 8)


@within
def scaled(m: Floats, out: int, factor: float, base: int, length: int) -> None:
    """m[out + c] = factor m[base + c] for every c < `length`."""
    for c in range(0, length - 31, 32):
        scale_vectors(m, out + c, factor, base + c, 32)
    for c in range(length - length % 32, length, 8):
        scale_vectors(m, out + c, factor, base + c, 8)


@within
def _in_blocks(size: int) -> int:
    """Up to which row a matrix is turned in blocks of `LANES`: one or two rows beyond are faster number by number."""
    return size - size % LANES if size % LANES < 3 else -(-size // LANES) * LANES


@numba.njit(error_model="numpy", nogil=True, cache=True)
def transposed(m: Floats, out: int, source: int, size: int, length: int) -> None:
    """Transpose `size` rows at `source`, of their first `size` numbers each, to rows at `out`; all are `length` long.
    What stands behind them is kept, or comes from behind those at `source`."""
    blocks = _in_blocks(size)
    for i in range(0, blocks, 8):
        for j in range(0, blocks, 8):
            turn_block(m, out + j * length + i, source + i * length + j, length, 0)
    for i in range(blocks, size):
        for j in range(size):
            m[u(out + j * length + i)] = m[u(source + i * length + j)]
            m[u(out + i * length + j)] = m[u(source + j * length + i)]


@within
def as_rows(m: Floats, out: int, source: int, size: int, length: int, first: int, end: int) -> None:
    """Columns `first` to at least `end` of `size` rows at `source` become rows at `out`; `first` is a multiple of
    `LANES`."""
    for j in range(first, end, 8):
        for i in range(0, size, 8):
            turn_block(m, out + (j - first) * length + i, source + i * length + j, length, 0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def mirrored(m: Floats, matrix: int, size: int, length: int) -> None:
    """Make a matrix of `size` rows symmetric: what is right of the diagonal is copied to the left of it, at least up
    to column `size`."""
    blocks = _in_blocks(size)
    for i in range(0, blocks, 8):
        turn_block(m, matrix + i * length + i, matrix + i * length + i, length, 1)
        for j in range(i + 8, blocks, 8):
            turn_block(m, matrix + j * length + i, matrix + i * length + j, length, 0)
    for i in range(blocks, size):
        for j in range(i):
            m[u(matrix + i * length + j)] = m[u(matrix + j * length + i)]
