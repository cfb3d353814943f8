"""Eight numbers side by side in a vector register: for kernels on blocks too small for the compiler to vectorise.

A loop over the five entries of a row is unrolled before the compiler looks for loops to vectorise. Here each operation
is written on all lanes at once and becomes one instruction, or a few, on any processor. What needs five lanes uses
five: the other three hold whatever follows in memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model

LANES = 8

_REGISTER = ir.VectorType(ir.DoubleType(), LANES)
_ZERO = ir.Constant(_REGISTER, [0.0] * LANES)
_INT = ir.IntType(32)
_FUSED = ("contract",)
"""A product and the sum it goes into may be rounded once."""


class _Lanes(types.Type):
    """Numba's type of eight float64 in a register."""

    def __init__(self) -> None:
        super().__init__(name="lanes")


_LANES = _Lanes()
# numba's own annotations count the typing context among the arguments of a call
_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic
_literal_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic(prefer_literal=True)


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Lanes) -> None:
        super().__init__(manager, kind, _REGISTER)  # type: ignore[no-untyped-call]


def _shuffled(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    """Lanes of a (0 to 7) and of b (8 to 15) in a new order."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_INT, LANES), order))


def _place(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Where the entries of an array from `index` on begin, to be read as one vector."""
    data = context.make_array(kind)(context, builder, array).data
    vector = ir.VectorType(context.get_data_type(kind.dtype), LANES)
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())


@_intrinsic
def zero(_typing: Any) -> Any:
    """Zero in every lane."""
    return _LANES(), lambda context, builder, signature, arguments: _ZERO


@_intrinsic
def load(_typing: Any, array: Any, index: Any) -> Any:
    """``array[index : index + 8]`` of a flat array of floats, in double precision; not checked against its end."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, array, *arguments)
        single = array.dtype is types.float32
        value = builder.load(place, align=4 if single else 8)
        return builder.fpext(value, _REGISTER) if single else value

    return _LANES(array, types.intp), code


@_intrinsic
def store(_typing: Any, array: Any, index: Any, v: Any) -> Any:
    """``array[index : index + 8] = v`` of a flat array of float64; not checked against its end."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, array, *arguments[:2])
        builder.store(arguments[2], place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, _LANES), code


@_literal_intrinsic
def every(_typing: Any, v: Any, lane: Any) -> Any:
    """One lane of v, a literal number, in every lane."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _shuffled(builder, arguments[0], arguments[0], [lane.literal_value] * LANES)

    return _LANES(_LANES, lane), code


@_intrinsic
def plus_product(_typing: Any, s: Any, a: Any, b: Any) -> Any:
    """``s + a b``."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        s, a, b = arguments
        return builder.fadd(s, builder.fmul(a, b, flags=_FUSED), flags=_FUSED)

    return _LANES(_LANES, _LANES, _LANES), code


@_intrinsic
def minus_product(_typing: Any, s: Any, a: Any, b: Any) -> Any:
    """``s - a b``."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        s, a, b = arguments
        return builder.fsub(s, builder.fmul(a, b, flags=_FUSED), flags=_FUSED)

    return _LANES(_LANES, _LANES, _LANES), code


@_intrinsic
def plus_sums(_typing: Any, s: Any, a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:
    """s plus, in its first five lanes, the sums over all lanes of a, of b, c, d and e."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def folded(u: Any, v: Any, first: list[int], second: list[int]) -> Any:
            return builder.fadd(_shuffled(builder, u, v, first), _shuffled(builder, u, v, second))

        s, a, b, c, d, e = arguments
        even, odd = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
        front, back = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]
        abcd = folded(folded(a, b, even, odd), folded(c, d, even, odd), front, back)
        e = folded(folded(e, _ZERO, even, odd), _ZERO, front, back)
        return builder.fadd(s, folded(abcd, e, [0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]))

    return _LANES(*[_LANES] * 6), code


@_intrinsic
def fetch(_typing: Any, array: Any, index: Any) -> Any:
    """Ask the memory for ``array[index]``, to be read soon; any index is allowed."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte = builder.bitcast(_place(context, builder, array, *arguments), ir.IntType(8).as_pointer())
        kind = ir.FunctionType(ir.VoidType(), [byte.type, _INT, _INT, _INT])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", [byte.type], kind)
        builder.call(prefetch, [byte, _INT(0), _INT(3), _INT(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), code
