"""Numbers of `LANES` runs laid side by side, and out of there again: blocks transposed in vector registers.

Row q of what lies side by side holds number q of every run: `interleave` of the runs 1 2 3 and 7 8 9, were there two
lanes, gives the rows 1 7 | 2 8 | 3 9, and `separate` the runs again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from twin.arithmetic.lane_code import address, transposed
from twin.arithmetic.vectors import LANES, vector, vectors

Floats = NDArray[np.float64]

_I32, _I64 = ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
# Most numbers of one piece of memory. One above 32 MiB glibc's malloc hands back to the system as soon as it is free,
# and the next has to be had page by page.
PIECE = 30_000_000 // 8


def at_a_border(shapes: Sequence[tuple[int, ...]]) -> list[Floats]:
    """Arrays of these shapes, not filled, that begin at borders of the machine's vectors. Several share one piece of
    memory, which is had faster than many pieces."""
    found: list[Floats] = []
    sizes = [-(-math.prod(shape) // LANES) * LANES for shape in shapes]
    first = 0
    while first < len(shapes):
        last, count = first + 1, sizes[first]
        while last < len(shapes) and count + sizes[last] <= PIECE:
            last, count = last + 1, count + sizes[last]
        piece = np.empty(count + LANES)
        place = -(piece.ctypes.data // piece.itemsize) % LANES
        for shape, size in zip(shapes[first:last], sizes[first:last], strict=True):
            found.append(piece[place : place + math.prod(shape)].reshape(shape))
            place += size
        first = last
    return found


def _pointers(context: Any, builder: Any, kinds: Any, arrays: Any, place: Any) -> list[Any]:
    """Where number `place` of each of a tuple of arrays is."""
    data = [address(context, builder, kind, builder.extract_value(arrays, c)) for c, kind in enumerate(kinds)]
    return [builder.gep(own, [place], inbounds=True) for own in data]


def _rows(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> list[Any]:
    """Where `LANES` rows of an array (Q, LANES) begin, from `row` on."""
    data, first = address(context, builder, kind, array), builder.mul(row, _I64(LANES))
    return [builder.gep(data, [builder.add(first, _I64(r * LANES))], inbounds=True) for r in range(LANES)]


def _turned(builder: Any, sources: list[Any], targets: list[Any], past_caches: bool) -> Any:
    """Transpose the block of numbers at `sources` to `targets`. The value is the sum of the numbers times 0, which is
    0 where each is finite.

    `past_caches`: targets are written without being read before, and lie at borders of vectors.
    """
    block = []
    for source in sources:
        loaded = builder.load(builder.bitcast(source, _VECTOR.as_pointer()))
        loaded.align = 8
        block.append(loaded)
    nothing = ir.Constant(_VECTOR, [0.0] * LANES)
    left = nothing
    for row in block:
        left = builder.fadd(left, builder.fmul(row, nothing))
    for row, target in zip(transposed(builder, block), targets, strict=True):
        stored = builder.store(row, builder.bitcast(target, _VECTOR.as_pointer()))
        stored.align = 8 * LANES if past_caches else 8
        if past_caches:
            stored.set_metadata("nontemporal", builder.module.add_metadata([_I32(1)]))
    return left


def _taking(typing: Any, sources: Any, place: Any, into: Any, row: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        pointers = _pointers(context, builder, signature.args[0], given[0], given[1])
        return _turned(builder, pointers, _rows(context, builder, signature.args[2], given[2], given[3]), False)

    return vector(sources, types.int64, into, types.int64), generate


_block_in: Any = intrinsic(_taking)


def _giving(typing: Any, rows: Any, row: Any, targets: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        pointers = _pointers(context, builder, signature.args[2], given[2], given[3])
        return _turned(builder, _rows(context, builder, signature.args[0], given[0], given[1]), pointers, True)

    return vector(rows, types.int64, targets, types.int64), generate


_block_out: Any = intrinsic(_giving)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def interleave(sources: tuple[Floats, ...], first: int, into: Floats) -> bool:
    """Fill `into` (Q, LANES): lane c from number `first` on of source c of `LANES` (flat). Returns whether all of it
    is finite."""
    whole = len(into) - len(into) % LANES
    sums = np.zeros((1, LANES))
    left = vectors(sums, (LANES,))
    for q in range(0, whole, LANES):
        left[0] += _block_in(sources, first + q, into, q)
    for c in range(LANES):
        for q in range(whole, len(into)):
            number = sources[c][first + q]
            into[q, c] = number
            sums[0, c] += 0.0 * number
    return bool(np.isfinite(sums.sum()))


@numba.njit(error_model="numpy", nogil=True, cache=True)
def separate(rows: Floats, targets: tuple[Floats, ...], first: int) -> None:
    """Write lane c of `rows` (Q, LANES) to target c of `LANES` (flat), from its number `first` on, past the caches.

    Raises `ValueError` where that is not at a border of vectors.
    """
    for target in targets:
        if (target.ctypes.data + 8 * first) % (8 * LANES) != 0:
            raise ValueError("a target does not begin at a border of vectors")
    whole = len(rows) - len(rows) % LANES
    for q in range(0, whole, LANES):
        _block_out(rows, q, targets, first + q)
    for c in range(LANES):
        for q in range(whole, len(rows)):
            targets[c][first + q] = rows[q, c]
