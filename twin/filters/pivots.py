"""Elimination by one pivot with few neighbours, written out: loops of two to four turns take longer to begin and end
than to run."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from twin.arithmetic.lane_code import address

_I64 = ir.IntType(64)


def _eliminating(
    typing: Any, m: Any, at: Any, values: Any, upper: Any, lower: Any, update: Any, pivot: Any, count: Any
) -> Any:
    """Eliminate by one pivot with `count` neighbours, a literal; `pivot` is its inverse, `upper` and `lower` are
    where its entries right of it and below it begin.

    Each product lower x pivot x upper is taken from the entry of `values` whose place is the next index at `update`.
    Then lower entries are multiplied by the pivot, and upper ones too.
    """
    i = types.int64
    signature = types.void(m, at, i, i, i, i, types.float64, count)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        m, at, values, upper, lower, update, pivot, _ = given
        data, indices = (address(context, builder, signature.args[k], array) for k, array in enumerate((m, at)))
        every = range(count.literal_value)

        def entry(first: Any, e: int) -> Any:
            return builder.gep(data, [builder.add(first, _I64(e))], inbounds=True)

        def place(k: int) -> Any:
            index = builder.load(builder.gep(indices, [builder.add(update, _I64(k))], inbounds=True))
            return builder.gep(data, [builder.add(values, index)], inbounds=True)

        right = [builder.load(entry(upper, e)) for e in every]
        shares = [builder.fmul(builder.load(entry(lower, e)), pivot) for e in every]
        for k, (share, other) in enumerate((share, other) for share in shares for other in right):
            to = place(k)
            builder.store(builder.fsub(builder.load(to), builder.fmul(share, other)), to)
        for e in every:
            builder.store(shares[e], entry(lower, e))
            builder.store(builder.fmul(right[e], pivot), entry(upper, e))
        return context.get_dummy_value()

    return signature, generate


eliminate_few: Any = intrinsic(prefer_literal=True)(_eliminating)
