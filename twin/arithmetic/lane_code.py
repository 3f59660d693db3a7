"""The instructions of `twin.arithmetic.lanes`, written out as vectors of LLVM through numba's interface for
extensions.

A compiler that has to find out for itself whether two rows of one array overlap stops making vectors of loops in one
release or the other, and does not say so. A product and the sum that it goes into are rounded once, wherever it runs:
the same bits on every machine, slowly where there is no such instruction (x86 before 2013).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from twin.arithmetic.vectors import LANES, everywhere

_I32, _I64, _F64 = ir.IntType(32), ir.IntType(64), ir.DoubleType()


def address(context: Any, builder: Any, kind: Any, given: Any) -> Any:
    """Where the first number of an array is, or of what is left of one (`pointer`)."""
    return given if isinstance(kind, types.CPointer) else context.make_array(kind)(context, builder, given).data


def _pointing(typing: Any, array: Any, place: Any) -> Any:
    """`pointer(array, place)`: where `array[place]` is, as an array without a length, for compiled functions.

    Compiled functions count who holds an array, each time that one is given it, in memory that all threads see; that
    costs more than most loops here. Whoever makes a pointer keeps the array.
    """
    kind: Any = types.CPointer
    signature = kind(array.dtype)(array, types.int64)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.gep(address(context, builder, signature.args[0], given[0]), [given[1]], inbounds=True)

    return signature, generate


pointer: Any = intrinsic(_pointing)


def _load(builder: Any, data: Any, place: Any, vector: Any) -> Any:
    """The vector at a place."""
    found = builder.load(builder.bitcast(builder.gep(data, [place], inbounds=True), vector.as_pointer()))
    found.align = 8
    return found


def _store(builder: Any, value: Any, data: Any, place: Any) -> None:
    """Write a vector to a place."""
    address = builder.gep(data, [place], inbounds=True)
    builder.store(value, builder.bitcast(address, value.type.as_pointer())).align = 8


def _index(builder: Any, indices: Any, place: Any) -> Any:
    """The index at a place."""
    return builder.load(builder.gep(indices, [place], inbounds=True))


def _pair(builder: Any, pair: Any) -> tuple[Any, Any]:
    """The two indices that `twin.arithmetic.lanes.paired` made one."""
    return builder.ashr(pair, _I64(32)), builder.and_(pair, _I64(0xFFFFFFFF))


def _number(builder: Any, data: Any, place: Any, vector: Any) -> Any:
    """The number at a place, in all lanes of a vector."""
    return everywhere(builder, builder.load(builder.gep(data, [place], inbounds=True)), vector)


def _less(builder: Any, total: Any, share: Any, other: Any) -> Any:
    """total - share other, rounded once."""
    vector = total.type
    name = f"llvm.fma.v{vector.count}f64"
    fused = builder.module.globals.get(name) or ir.Function(builder.module, ir.FunctionType(vector, [vector] * 3), name)
    return builder.call(fused, [share, builder.fneg(other), total])


def _join(phis: Sequence[Any], blocks: Mapping[Any, Sequence[Any]]) -> None:
    """Give numbers of a block the values that they have when one comes from each of the blocks before it."""
    for block, values in blocks.items():
        for phi, value in zip(phis, values, strict=True):
            phi.add_incoming(value, block)


def _sweeping(
    typing: Any,
    m: Any,
    at: Any,
    rows: Any,
    taken: Any,
    out: Any,
    base: Any,
    others: Any,
    factors: Any,
    shares: Any,
    less: Any,
    beside: Any,
    both: Any,
    lanes: Any,
) -> Any:
    """`sweep_mixed` for `lanes` numbers of each row, a literal; where the literal `both` is 0 `beside` is left out."""
    i, vector = types.int64, ir.VectorType(_F64, LANES)
    signature = types.void(m, at, i, i, i, i, i, i, i, i, i, both, lanes)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, at, rows, taken, out, base, others, factors, shares, less, beside, _, _ = given
        data = address(context, builder, signature.args[0], m)
        indices = address(context, builder, signature.args[1], at)
        none, one, every = _I64(0), _I64(1), range(0, lanes.literal_value, LANES)

        def vectors_at(first: Any) -> list[Any]:
            return [_load(builder, data, builder.add(first, _I64(c)), vector) for c in every]

        def all_less(totals: list[Any], share: Any, first: Any) -> list[Any]:
            return [_less(builder, total, share, row) for total, row in zip(totals, vectors_at(first), strict=True)]

        entry = builder.basic_block
        row, other, done, after = (builder.append_basic_block(name) for name in ("row", "other", "done", "swept"))
        first_row = _index(builder, indices, rows)
        builder.cbranch(builder.icmp_signed("<", first_row, none), after, row)
        builder.position_at_end(row)
        p, e, own = builder.phi(_I64), builder.phi(_I64), builder.phi(_I64)
        here, scale = _pair(builder, own)
        factor = _number(builder, data, builder.add(factors, scale), vector)
        before = [builder.fmul(factor, found) for found in vectors_at(builder.add(base, here))]
        if both.literal_value:
            share = _number(builder, data, builder.add(less, scale), vector)
            before = all_less(before, share, builder.add(beside, here))
        first = _index(builder, indices, builder.add(taken, e))
        builder.cbranch(builder.icmp_signed("<", first, none), done, other)
        builder.position_at_end(other)
        f, pair, totals = builder.phi(_I64), builder.phi(_I64), [builder.phi(vector) for _ in every]
        start, which = _pair(builder, pair)
        share = _number(builder, data, builder.add(shares, which), vector)
        left = all_less(totals, share, builder.add(others, start))
        next_f = builder.add(f, one)
        next_pair = _index(builder, indices, builder.add(taken, next_f))
        _join((f, pair, *totals), {row: (e, first, *before), other: (next_f, next_pair, *left)})
        builder.cbranch(builder.icmp_signed("<", next_pair, none), done, other)
        builder.position_at_end(done)
        end, ended = builder.phi(_I64), [builder.phi(vector) for _ in every]
        _join((end, *ended), {row: (e, *before), other: (next_f, *left)})
        for c, total in zip(every, ended, strict=True):
            _store(builder, total, data, builder.add(builder.add(out, here), _I64(c)))
        next_p, next_e = builder.add(p, one), builder.add(end, one)
        next_row = _index(builder, indices, builder.add(rows, next_p))
        _join((p, e, own), {entry: (none, none, first_row), done: (next_p, next_e, next_row)})
        builder.cbranch(builder.icmp_signed("<", next_row, none), after, row)
        builder.position_at_end(after)
        return context.get_dummy_value()

    return signature, generate


sweep_vectors: Any = intrinsic(prefer_literal=True)(_sweeping)


def _tiling(
    typing: Any,
    m: Any,
    at: Any,
    rows: Any,
    taken: Any,
    number: Any,
    out: Any,
    base: Any,
    others: Any,
    factor: Any,
    shares: Any,
    onward: Any,
    tile: Any,
    lanes: Any,
) -> Any:
    """`less` for `tile` rows of `lanes` numbers, both literals: what is loaded of another row serves all of them."""
    i, vector = types.int64, ir.VectorType(_F64, LANES)
    signature = types.void(m, at, i, i, i, i, i, i, i, i, i, tile, lanes)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, at, rows, taken, number, out, base, others, factor, shares, onward, _, _ = given
        data = address(context, builder, signature.args[0], m)
        indices = address(context, builder, signature.args[1], at)
        every = [(r, c) for r in range(tile.literal_value) for c in range(0, lanes.literal_value, LANES)]
        here = [_index(builder, indices, builder.add(rows, _I64(r))) for r in range(tile.literal_value)]
        own = [builder.add(shares, builder.mul(onward, _I64(r))) for r in range(tile.literal_value)]
        scale = _number(builder, data, factor, vector)
        before = [
            builder.fmul(scale, _load(builder, data, builder.add(builder.add(base, here[r]), _I64(c)), vector))
            for r, c in every
        ]
        entry = builder.basic_block
        other, tiled = (builder.append_basic_block(name) for name in ("other", "tiled"))
        builder.cbranch(builder.icmp_signed("<", _I64(0), number), other, tiled)
        builder.position_at_end(other)
        e, totals = builder.phi(_I64), [builder.phi(vector) for _ in every]
        start, which = _pair(builder, _index(builder, indices, builder.add(taken, e)))
        first = builder.add(others, start)
        row = {c: _load(builder, data, builder.add(first, _I64(c)), vector) for r, c in every if r == 0}
        share = [_number(builder, data, builder.add(begin, which), vector) for begin in own]
        left = [_less(builder, total, share[r], row[c]) for (r, c), total in zip(every, totals, strict=True)]
        following = builder.add(e, _I64(1))
        _join((e, *totals), {entry: (_I64(0), *before), other: (following, *left)})
        builder.cbranch(builder.icmp_signed("<", following, number), other, tiled)
        builder.position_at_end(tiled)
        ended = [builder.phi(vector) for _ in every]
        _join(ended, {entry: before, other: left})
        for (r, c), total in zip(every, ended, strict=True):
            _store(builder, total, data, builder.add(builder.add(out, here[r]), _I64(c)))
        return context.get_dummy_value()

    return signature, generate


tile_vectors: Any = intrinsic(prefer_literal=True)(_tiling)


def _scaling(typing: Any, m: Any, out: Any, factor: Any, base: Any, lanes: Any) -> Any:
    """`scaled` for `lanes` numbers, a literal."""
    i, vector = types.int64, ir.VectorType(_F64, lanes.literal_value)
    signature = types.void(m, i, types.float64, i, lanes)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, out, factor, base, _ = given
        data = address(context, builder, signature.args[0], m)
        row = _load(builder, data, base, vector)
        _store(builder, builder.fmul(everywhere(builder, factor, vector), row), data, out)
        return context.get_dummy_value()

    return signature, generate


scale_vectors: Any = intrinsic(prefer_literal=True)(_scaling)


def transposed(builder: Any, block: list[Any]) -> list[Any]:
    """The transpose of a block, `LANES` vectors of as many numbers: halves of halves change places across the
    diagonal."""
    turned = list(block)
    for half in (1, 2, 4):
        for r in (r for r in range(LANES) if not r & half):
            upper = [c - half + LANES if c & half else c for c in range(LANES)]
            lower = [c + LANES if c & half else c + half for c in range(LANES)]
            pair = turned[r], turned[r + half]
            for to, taken in ((r, upper), (r + half, lower)):
                turned[to] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(_I32, LANES), taken))
    return turned


def _turning(typing: Any, m: Any, out: Any, source: Any, length: Any, diagonal: Any) -> Any:
    """Transpose 8 x 8 numbers from `source` to `out`, rows `length` apart. If the literal `diagonal` is 1, numbers
    right of the diagonal stay as they are."""
    i, half_kept = types.int64, bool(diagonal.literal_value)
    signature = types.void(m, i, i, i, diagonal)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, out, source, length, _ = given
        data, vector = address(context, builder, signature.args[0], m), ir.VectorType(_F64, LANES)
        begun = [_load(builder, data, builder.add(source, builder.mul(length, _I64(r))), vector) for r in range(LANES)]
        block = transposed(builder, begun)
        for r in range(LANES):
            if half_kept:
                mask = ir.Constant(ir.VectorType(_I32, LANES), [c + LANES if c < r else c for c in range(LANES)])
                block[r] = builder.shuffle_vector(begun[r], block[r], mask)
            _store(builder, block[r], data, builder.add(out, builder.mul(length, _I64(r))))
        return context.get_dummy_value()

    return signature, generate


turn_block: Any = intrinsic(prefer_literal=True)(_turning)
