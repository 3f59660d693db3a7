"""Rows of matrices side by side in the vector registers: the few operations that the filters spend their time in.

All matrices of a run are in one flat array of numbers, rows of each of one length, a multiple of `LANES` and laid out from a border
of the machine's vectors (`Store`); all indices are in another. So every function here takes two arrays and places in them.
A row is worked on up to four vectors at a time, in registers while indices say which other rows take part: a sparse matrix costs
its entries, and nothing is written before it is complete.

The instructions are written out as vectors of LLVM, through numba's interface for extensions: a compiler that has to find out
whether two rows of one array overlap gives up, silently, one release or the other. No multiplication is fused with an
addition: the same bits on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

LANES = 8  # numbers of the widest vectors there are
NOWHERE, NOBODY = 0, 1  # places of the indices 0 and -1, a row and the end of a list

_I32, _I64, _F64 = ir.IntType(32), ir.IntType(64), ir.DoubleType()


def width(numbers: int) -> int:
    """The length of rows of so many numbers."""
    return -(-numbers // LANES) * LANES


class Sweep(NamedTuple):
    """Lists of `sweep`, as places of indices. `rows`, `scales` (number,): each row and which factor it has; `starts`, `which`: the others
    it takes and which share of them, of all rows one after the other, a start below 0 behind each row's last."""

    rows: int
    scales: int
    starts: int
    which: int
    number: int


class Store:
    """Collects numbers and indices; each is given the place where it will be in `numbers()` or `indices()`. The first indices are 0
    and -1."""

    def __init__(self) -> None:
        self._numbers: list[Floats] = []
        self._indices: list[Index] = []
        self._ends = [0, 0]
        self.index([0, -1])

    def rows(self, count: int, length: int) -> int:
        """Zeros."""
        return self.put(np.zeros(count * length))

    def put(self, numbers: Floats) -> int:
        place, flat = self._ends[0], np.zeros(width(numbers.size))
        flat[: numbers.size] = numbers.ravel()
        self._numbers.append(flat)
        self._ends[0] += flat.size
        return place

    def index(self, indices: Sequence[int] | Sequence[Sequence[int]] | Index) -> int:
        flat = np.array(indices, dtype=np.int64).ravel()
        place = self._ends[1]
        self._indices.append(flat)
        self._ends[1] += flat.size
        return place

    def sweep(self, rows: Sequence[int], scales: Sequence[int], others: Sequence[Sequence[tuple[int, int]]]) -> Sweep:
        """`others`: for each row the start and the share of each that it takes."""
        ended = [pair for own in others for pair in (*own, (-1, 0))]
        starts, which = ([pair[i] for pair in ended] for i in range(2))
        return Sweep(self.index(rows), self.index(scales), self.index(starts), self.index(which), len(rows))

    def numbers(self) -> Floats:
        wide = np.zeros(self._ends[0] + LANES)
        first = -(wide.ctypes.data // wide.itemsize) % LANES
        aligned = wide[first : first + self._ends[0]]
        aligned[:] = np.concatenate(self._numbers)
        return aligned

    def indices(self) -> Index:
        return np.concatenate(self._indices)


def _address(context: Any, builder: Any, array_type: Any, array: Any) -> Any:
    return context.make_array(array_type)(context, builder, array).data


def _load(builder: Any, data: Any, place: Any, vector: Any) -> Any:
    found = builder.load(builder.bitcast(builder.gep(data, [place], inbounds=True), vector.as_pointer()))
    found.align = 8
    return found


def _store(builder: Any, value: Any, data: Any, place: Any) -> None:
    address = builder.gep(data, [place], inbounds=True)
    builder.store(value, builder.bitcast(address, value.type.as_pointer())).align = 8


def _everywhere(builder: Any, value: Any, vector: Any) -> Any:
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, _I32(0))
    first = ir.Constant(ir.VectorType(_I32, vector.count), [0] * vector.count)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), first)


def _sweeping(
    typing: Any,
    m: Any,
    at: Any,
    out: Any,
    base: Any,
    others: Any,
    factors: Any,
    shares: Any,
    rows: Any,
    scales: Any,
    starts: Any,
    which: Any,
    count: Any,
    step: Any,
    alike: Any,
    lanes: Any,
) -> Any:
    """`sweep` for `lanes` numbers, a literal. `alike`: all rows take the same others by the first scale, as `less` does, the shares of
    each `step` from those of the row before."""
    i, vector = types.int64, ir.VectorType(_F64, lanes.literal_value)
    signature = types.void(m, at, i, i, i, i, i, i, i, i, i, i, i, types.boolean, lanes)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, at, out, base, others, factors, shares, rows, scales, starts, which, count, step, alike, _ = given
        alike = builder.trunc(alike, ir.IntType(1))
        data = _address(context, builder, signature.args[0], m)
        indices = _address(context, builder, signature.args[1], at)

        def index(place: Any, onward: Any) -> Any:
            return builder.load(builder.gep(indices, [builder.add(place, onward)], inbounds=True))

        def number(place: Any, onward: Any) -> Any:
            one = builder.load(builder.gep(data, [builder.add(place, onward)], inbounds=True))
            return _everywhere(builder, one, vector)

        entry = builder.basic_block
        row, edge, done, after = (builder.append_basic_block(name) for name in ("row", "edge", "done", "swept"))
        builder.cbranch(builder.icmp_signed("<", _I64(0), count), row, after)
        builder.position_at_end(row)
        p, e = builder.phi(_I64), builder.phi(_I64)
        here, own_shares = index(rows, p), builder.add(shares, builder.mul(p, step))
        factor = number(factors, index(scales, builder.select(alike, _I64(0), p)))
        before = builder.fmul(factor, _load(builder, data, builder.add(base, here), vector))
        first = index(starts, e)
        builder.cbranch(builder.icmp_signed("<", first, _I64(0)), done, edge)
        builder.position_at_end(edge)
        f, start, total = builder.phi(_I64), builder.phi(_I64), builder.phi(vector)
        other = _load(builder, data, builder.add(others, start), vector)
        left = builder.fsub(total, builder.fmul(number(own_shares, index(which, f)), other))
        following = builder.add(f, _I64(1))
        next_start = index(starts, following)
        for phi, entering, onward in ((f, e, following), (start, first, next_start), (total, before, left)):
            phi.add_incoming(entering, row)
            phi.add_incoming(onward, edge)
        builder.cbranch(builder.icmp_signed("<", next_start, _I64(0)), done, edge)
        builder.position_at_end(done)
        end, ended = builder.phi(_I64), builder.phi(vector)
        end.add_incoming(e, row)
        end.add_incoming(following, edge)
        ended.add_incoming(before, row)
        ended.add_incoming(left, edge)
        _store(builder, ended, data, builder.add(out, here))
        next_p = builder.add(p, _I64(1))
        next_e = builder.select(alike, _I64(0), builder.add(end, _I64(1)))
        for phi, entering, onward in ((p, _I64(0), next_p), (e, _I64(0), next_e)):
            phi.add_incoming(entering, entry)
            phi.add_incoming(onward, done)
        builder.cbranch(builder.icmp_signed("<", next_p, count), row, after)
        builder.position_at_end(after)
        return context.get_dummy_value()

    return signature, generate


_sweep: Any = intrinsic(prefer_literal=True)(_sweeping)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def sweep(
    m: Floats,
    at: Index,
    lists: Sweep,
    out: int,
    base: int,
    others: int,
    factors: int,
    shares: int,
    length: int,
) -> None:
    """Rows of `out`, one after the other, so that `others` may be rows of `out` that are complete; for row p and every c < `length`

    m[out + rows[p] + c] = m[factors + scales[p]] m[base + rows[p] + c]
                           - sum_e m[shares + which[e]] m[others + starts[e] + c],  e of row p
    """
    rows, scales, starts, which, count = lists
    while length >= 32:
        _sweep(m, at, out, base, others, factors, shares, rows, scales, starts, which, count, 0, False, 32)
        out, base, others, length = out + 32, base + 32, others + 32, length - 32
    if length >= 16:
        _sweep(m, at, out, base, others, factors, shares, rows, scales, starts, which, count, 0, False, 16)
        out, base, others, length = out + 16, base + 16, others + 16, length - 16
    if length >= 8:
        _sweep(m, at, out, base, others, factors, shares, rows, scales, starts, which, count, 0, False, 8)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def less(
    m: Floats,
    at: Index,
    rows: int,
    count: int,
    starts: int,
    which: int,
    out: int,
    base: int,
    others: int,
    factor: int,
    shares: int,
    onward: int,
    length: int,
) -> None:
    """The same where all rows take shares of the same others, and each row's shares are `onward` from those of the row before; for
    row p < `count` and every c < `length`

    m[out + rows[p] + c] = m[factor] m[base + rows[p] + c] - sum_e m[shares + p onward + which[e]] m[others + starts[e] + c]

    until `starts[e]` is below 0."""
    while length >= 32:
        _sweep(m, at, out, base, others, factor, shares, rows, NOWHERE, starts, which, count, onward, True, 32)
        out, base, others, length = out + 32, base + 32, others + 32, length - 32
    if length >= 16:
        _sweep(m, at, out, base, others, factor, shares, rows, NOWHERE, starts, which, count, onward, True, 16)
        out, base, others, length = out + 16, base + 16, others + 16, length - 16
    if length >= 8:
        _sweep(m, at, out, base, others, factor, shares, rows, NOWHERE, starts, which, count, onward, True, 8)


@numba.njit(error_model="numpy", nogil=True, forceinline=True)
def scaled(m: Floats, at: Index, out: int, factor: int, base: int, length: int) -> None:
    """m[out + c] = m[factor] m[base + c] for every c < `length`."""
    less(m, at, NOWHERE, 1, NOBODY, NOWHERE, out, base, base, factor, factor, 0, length)


def _turning(typing: Any, m: Any, out: Any, source: Any, length: Any, diagonal: Any) -> Any:
    """8 x 8 numbers from `source` on, transposed, from `out` on, rows `length` apart; if the literal `diagonal` is 1, those right of the
    diagonal stay as they are."""
    i, half_kept = types.int64, bool(diagonal.literal_value)
    signature = types.void(m, i, i, i, diagonal)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, out, source, length, _ = given
        data, vector = _address(context, builder, signature.args[0], m), ir.VectorType(_F64, LANES)
        block = []
        for r in range(LANES):
            block.append(_load(builder, data, builder.add(source, builder.mul(length, _I64(r))), vector))
        begun = list(block)
        for half in (1, 2, 4):  # blocks of that side change places across the diagonal
            for r in (r for r in range(LANES) if not r & half):
                upper = [c - half + LANES if c & half else c for c in range(LANES)]
                lower = [c + LANES if c & half else c + half for c in range(LANES)]
                above, below = block[r], block[r + half]
                for to, taken in ((r, upper), (r + half, lower)):
                    mask = ir.Constant(ir.VectorType(_I32, LANES), taken)
                    block[to] = builder.shuffle_vector(above, below, mask)
        for r in range(LANES):
            if half_kept:
                mask = ir.Constant(ir.VectorType(_I32, LANES), [c + LANES if c < r else c for c in range(LANES)])
                block[r] = builder.shuffle_vector(begun[r], block[r], mask)
            _store(builder, block[r], data, builder.add(out, builder.mul(length, _I64(r))))
        return context.get_dummy_value()

    return signature, generate


_turned: Any = intrinsic(prefer_literal=True)(_turning)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def transposed(m: Floats, out: int, source: int, size: int, length: int) -> None:
    """The first `size` columns of the rows at `source` become those at `out`, both of that length; up to the next multiple of `LANES`
    both ways."""
    for i in range(0, size, 8):
        for j in range(0, size, 8):
            _turned(m, out + j * length + i, source + i * length + j, length, 0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def mirrored(m: Floats, matrix: int, size: int, length: int) -> None:
    """What is right of the diagonal of `size` rows is written to the left of it, up to the next multiple of `LANES`."""
    for i in range(0, size, 8):
        _turned(m, matrix + i * length + i, matrix + i * length + i, length, 1)
        for j in range(i + 8, size, 8):
            _turned(m, matrix + j * length + i, matrix + i * length + j, length, 0)
