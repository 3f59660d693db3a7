"""Vectors of `LANES` numbers as values of compiled functions: what is written for one run is compiled for `LANES` at
once.

`vectors` makes an array with a last axis of lanes into one whose entries are vectors. Their sums, products,
quotients, square roots, `np.minimum`, `np.maximum` and comparisons (1.0 where they hold, else 0.0) are one
instruction each, or a few where the machine's vectors are narrower; no compiler has to find out for itself that a
loop can be made into them. No multiplication is fused with an addition: every lane has the bits that a number has.
Outside of compiled functions the same statements run over numpy's rows.
"""

from __future__ import annotations

import hashlib
import inspect
import operator
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model
from numba.np.arrayobj import populate_array

LANES = 8  # numbers of the widest vectors there are

_I32, _I64, _F64 = ir.IntType(32), ir.IntType(64), ir.DoubleType()
_VECTOR = ir.VectorType(_F64, LANES)
_ONES = ir.Constant(_VECTOR, [1.0] * LANES)
_ZEROS = ir.Constant(_VECTOR, [0.0] * LANES)


class Vector(types.Type):
    """`LANES` numbers; a single number becomes one where it meets one."""

    def __init__(self) -> None:
        super().__init__(name=f"vector{LANES}")

    def can_convert_from(self, typing: Any, other: Any) -> Any:
        """A single number becomes a vector."""
        return Conversion.promote if isinstance(other, types.Float) else None

    def unify(self, typing: Any, other: Any) -> Any:
        """A vector and a single number are vectors."""
        return self if isinstance(other, types.Float) else None


vector = Vector()


@register_model(Vector)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def everywhere(builder: Any, value: Any, vector: Any) -> Any:
    """One number in all lanes of a vector."""
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, _I32(0))
    first = ir.Constant(ir.VectorType(_I32, vector.count), [0] * vector.count)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), first)


@lower_cast(types.float64, Vector)  # type: ignore[no-untyped-call, untyped-decorator]
def _cast(context: Any, builder: Any, number: Any, kind: Any, value: Any) -> Any:
    return everywhere(builder, value, _VECTOR)


def _define(operation: Any, made: Callable[..., Any], count: int = 2) -> None:
    """Define an operation of `count` vectors as the instructions that `made(builder, *values)` gives."""
    given = (vector,) * count

    class Template(ConcreteTemplate):
        cases = (signature(vector, *given),)  # type: ignore[no-untyped-call]

    infer_global(operation)(Template)  # type: ignore[no-untyped-call]

    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return made(builder, *values)

    lower_builtin(operation, *given)(lowered)  # type: ignore[no-untyped-call]


def _compared(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), _ONES, _ZEROS)


def _chosen(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


def _root(builder: Any, value: Any) -> Any:
    kind = ir.FunctionType(_VECTOR, [_VECTOR])
    root = cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64")  # type: ignore[no-untyped-call]
    return builder.call(root, [value])


for _operations, _made in (
    ((operator.add, operator.iadd), ir.IRBuilder.fadd),
    ((operator.sub, operator.isub), ir.IRBuilder.fsub),
    ((operator.mul, operator.imul), ir.IRBuilder.fmul),
    ((operator.truediv, operator.itruediv), ir.IRBuilder.fdiv),
):
    for _operation in _operations:
        _define(_operation, _made)
_define(operator.neg, ir.IRBuilder.fneg, 1)
_define(operator.lt, _compared("<"))
_define(operator.le, _compared("<="))
_define(np.minimum, _chosen("<"))
_define(np.maximum, _chosen(">"))
_define(np.sqrt, _root, 1)


def vectors(array: Any, lanes: tuple[int, ...]) -> Any:
    """An array (..., LANES) as one (...) whose entries are vectors, in compiled functions where `lanes` is (LANES,);
    the array itself where `lanes` is (), and where nothing is compiled."""
    return array


@overload(vectors, strict=False, inline="always")
def _vectors(array: Any, lanes: Any) -> Any:
    return (lambda array, lanes: array) if len(lanes) == 0 else (lambda array, lanes: _of_vectors(array))


def _keep_borders(builder: Any) -> None:
    """Have all that this function keeps on the stack begin at borders of vectors, as it does where something there is
    that is looked at. Else each vector lies across two lines of the cache, which costs a large kernel a fifth more
    time."""
    place = cgutils.alloca_once(builder, _VECTOR)  # type: ignore[no-untyped-call]
    place.align = 8 * LANES
    builder.asm(ir.FunctionType(ir.VoidType(), [place.type]), "", "r", [place], side_effect=True)


def _as_vectors(typing: Any, array: Any) -> Any:
    # "Not aligned" as numbers are at borders of 8 bytes, not at those of vectors.
    signature = types.Array(vector, array.ndim - 1, "C", aligned=False)(array)

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        _keep_borders(builder)
        numbers = context.make_array(signature.args[0])(context, builder, given[0])
        made = context.make_array(signature.return_type)(context, builder)
        populate_array(  # type: ignore[no-untyped-call]
            made,
            data=builder.bitcast(numbers.data, made.data.type),
            shape=cgutils.unpack_tuple(builder, numbers.shape)[:-1],  # type: ignore[no-untyped-call]
            strides=cgutils.unpack_tuple(builder, numbers.strides)[:-1],  # type: ignore[no-untyped-call]
            itemsize=_I64(8 * LANES),
            meminfo=numbers.meminfo,
            parent=numbers.parent,
        )
        value = made._getvalue()
        return impl_ret_borrowed(context, builder, signature.return_type, value)  # type: ignore[no-untyped-call]

    return signature, generate


_of_vectors: Any = intrinsic(_as_vectors)

# A compiled text that is kept names what it was compiled with.
MARK = f"# vectors {hashlib.sha256(inspect.getsource(sys.modules[__name__]).encode()).hexdigest()[:16]}\n"
