"""A number for each of many members, side by side: a type for compiled code whose every operation is one on vectors.

Code on such numbers reads as code on floats. LLVM keeps them in vector registers and splits them into as many as the
processor has in width, so that nothing hangs on whether a loop was found fit to be vectorised, and what a member gets
does not depend on its place among the others. Nothing is fused or rearranged: numbers are the same on every processor,
and infinities and not-a-number behave as ever.

In compiled code only: `load`, `store`, `where`, `bits`; `+ − * /`, comparisons,
`& | ^ ~`, `abs`, `max`, `math.sqrt`. A comparison gives a mask.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate
from numba.core.typing.templates import infer_global as _infer_global
from numba.extending import intrinsic as _intrinsic
from numba.extending import lower_builtin as _lower_builtin
from numba.extending import models, register_model

# Of these numba tells no types, or too narrow ones.
infer_global: Any = _infer_global
intrinsic: Any = _intrinsic
lower_builtin: Any = _lower_builtin

_DOUBLE = ir.DoubleType()


class _Wide(types.Type):
    part: ir.Type

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"{type(self).__name__}({width})")


class Lanes(_Wide):
    """The type of `width` doubles side by side."""

    part = _DOUBLE


class Mask(_Wide):
    """The type of `width` truth values side by side."""

    part = ir.IntType(1)


@register_model(Lanes)
@register_model(Mask)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Wide) -> None:
        super().__init__(manager, kind, ir.VectorType(kind.part, kind.width))  # type: ignore[no-untyped-call]


def _splat(context: Any, builder: Any, value: Any, given: Any, width: int) -> Any:
    """Return a value as lanes: itself, or a number in every lane; a mask as it is."""
    if isinstance(given, (Lanes, Mask)):
        return value
    value = context.cast(builder, value, given, types.float64)
    one = builder.insert_element(ir.Constant(ir.VectorType(_DOUBLE, width), ir.Undefined), value, ir.IntType(32)(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _define(function: Any, count: int, build: Callable[..., Any], result: type = Lanes, of: type = Lanes) -> None:
    """Teach the compiler a function of `count` lanes, of which all but one may be numbers.

    build: (builder, *vectors) -> the instruction.
    """

    @infer_global(function)
    class _Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            lanes: list[Any] = [kind for kind in args if isinstance(kind, of)]
            others = [kind for kind in args if not isinstance(kind, (of, types.Number))]
            if len(args) != count or not lanes or others or kws:
                return None
            kinds = [kind if isinstance(kind, of) else types.float64 for kind in args]
            return result(lanes[0].width)(*kinds)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        width = sig.return_type.width
        return build(builder, *(_splat(context, builder, *pair, width) for pair in zip(args, sig.args, strict=True)))

    for choice in range(1, 2**count if of is Lanes else 2):
        kinds = [of if (of is Mask or choice >> k & 1) else types.Float for k in range(count)]
        lower_builtin(function, *kinds)(lower)


def _max(builder: Any, a: Any, b: Any) -> Any:
    """Return the second where it is greater, as Python's max of floats does with not-a-number."""
    return builder.select(builder.fcmp_ordered(">", b, a), b, a)


def _call(name: str) -> Callable[..., Any]:
    """Return what builds a call of LLVM's intrinsic of this name."""

    def build(builder: Any, vector: Any) -> Any:
        kind = ir.FunctionType(vector.type, [vector.type])
        whole = f"llvm.{name}.v{vector.type.count}f64"
        return builder.call(builder.module.declare_intrinsic(whole, (), kind), [vector])

    return build


_define(operator.add, 2, ir.IRBuilder.fadd)
_define(operator.sub, 2, ir.IRBuilder.fsub)
_define(operator.mul, 2, ir.IRBuilder.fmul)
_define(operator.truediv, 2, ir.IRBuilder.fdiv)
_define(operator.neg, 1, ir.IRBuilder.fneg)
_define(abs, 1, _call("fabs"))
_define(math.sqrt, 1, _call("sqrt"))
_define(max, 2, _max)
for _compare, _sign in {operator.lt: "<", operator.gt: ">", operator.ge: ">=", operator.eq: "=="}.items():
    _define(_compare, 2, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b), Mask)
_define(operator.and_, 2, ir.IRBuilder.and_, Mask, Mask)
_define(operator.or_, 2, ir.IRBuilder.or_, Mask, Mask)
_define(operator.xor, 2, ir.IRBuilder.xor, Mask, Mask)
_define(operator.invert, 1, ir.IRBuilder.not_, Mask, Mask)


def _row(context: Any, builder: Any, array: Any, kind: Any, index: Any, width: int) -> Any:
    """Return a pointer to a row of a contiguous array, shape (row, width), as lanes."""
    data = context.make_array(kind)(context, builder, array).data
    start = builder.mul(index, ir.Constant(index.type, width))
    return builder.bitcast(builder.gep(data, [start]), ir.VectorType(_DOUBLE, width).as_pointer())


@intrinsic(prefer_literal=True)
def load(typing: Any, array: Any, row: Any, width: Any) -> Any:
    """Return a row of an array of doubles, shape (row, width)."""
    result = Lanes(width.literal_value)

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        pointer = _row(context, builder, args[0], sig.args[0], index, result.width)
        vector = builder.load(pointer)
        vector.align = 8
        return vector

    return result(array, row, width), build


@intrinsic
def store(typing: Any, array: Any, row: Any, value: Any) -> Any:
    """Keep lanes in a row of an array of doubles, shape (row, width)."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        pointer = _row(context, builder, args[0], sig.args[0], index, value.width)
        builder.store(args[2], pointer).align = 8
        return context.get_dummy_value()

    return types.void(array, row, value), build


@intrinsic
def where(typing: Any, mask: Any, yes: Any, no: Any) -> Any:
    """Return `yes` in the lanes of the mask and `no` in the others; both lanes or numbers. Of one number, too."""
    if isinstance(mask, types.Boolean):
        number = types.float64
        return number(mask, number, number), lambda context, builder, sig, args: builder.select(*args)
    kinds = [kind if isinstance(kind, Lanes) else types.float64 for kind in (yes, no)]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vectors = [_splat(context, builder, *pair, mask.width) for pair in zip(args[1:], sig.args[1:], strict=True)]
        return builder.select(args[0], *vectors)

    return Lanes(mask.width)(mask, *kinds), build


@intrinsic
def bits(typing: Any, mask: Any) -> Any:
    """Return a mask as a whole number, lane k as its bit k."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(mask.width)), ir.IntType(64))

    return types.int64(mask), build
