"""SIMD vectors in the processor's registers, for kernels: four float64, or eight float32.

Numba compiles plain loops over three or four numbers to scalar code. For the small dense blocks of a
deformation graph, this code is several times slower than SIMD code. This module provides a type with one
vector register as its value, and functions that load it from and store it to flat arrays. LLVM lowers it to
the processor's instructions (AVX, NEON), so it is portable. Use the functions only inside ``@njit``
functions.

    v = load4(x, 4 * j)                 # x: a contiguous float64 array of one dimension
    store4(out, 4 * j, fma4(0.5, v, load4(out, 4 * j)))
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

I32, I64 = ir.IntType(32), ir.IntType(64)


class Lanes(types.Type):
    """The Numba type of a vector register with ``count`` numbers of the type ``scalar``."""

    def __init__(self, count: int, scalar: types.Float) -> None:
        self.count, self.scalar = count, scalar
        super().__init__(name=f"Lanes({count} x {scalar})")


def _llvm_element_type(kind: Lanes) -> ir.Type:
    return ir.DoubleType() if kind.scalar.bitwidth == 64 else ir.FloatType()


def vector_of(kind: Lanes) -> ir.VectorType:
    """Returns the LLVM type of a vector register."""
    return ir.VectorType(_llvm_element_type(kind), kind.count)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, vector_of(kind))


FOUR = Lanes(4, types.float64)
EIGHT = Lanes(8, types.float32)
QUAD = Lanes(4, types.float32)

for _operator, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):

    @type_callable(_operator)
    def _type_pair(context: Any) -> Any:
        def typer(a: Any, b: Any) -> Any:
            return a if isinstance(a, Lanes) and a == b else None

        return typer

    @lower_builtin(_operator, Lanes, Lanes)
    def _lower_pair(context: Any, builder: Any, sig: Any, args: Any, instruction: str = _instruction) -> Any:
        return getattr(builder, instruction)(*args)


def address_of(context: Any, builder: Any, array_type: Any, array: Any, index: Any, kind: Lanes) -> Any:
    """Returns a pointer to the vector that starts at ``array[index]``."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), vector_of(kind).as_pointer())


def _splat(builder: Any, kind: Lanes, scalar: Any) -> Any:
    """Returns a vector with ``scalar`` in every lane."""
    vector = vector_of(kind)
    none = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(none, scalar, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(I32, kind.count), [0] * kind.count))


def _make_load(kind: Lanes) -> Any:
    @intrinsic
    def load(typing, array, index):
        if array.dtype != kind.scalar:
            return None

        def generate(context, builder, sig, args):
            loaded = builder.load(address_of(context, builder, sig.args[0], args[0], args[1], kind))
            loaded.align = kind.scalar.bitwidth // 8
            return loaded

        return signature(kind, array, types.intp), generate

    return load


def _make_store(kind: Lanes) -> Any:
    @intrinsic
    def store(typing, array, index, value):
        if array.dtype != kind.scalar:
            return None

        def generate(context, builder, sig, args):
            place = address_of(context, builder, sig.args[0], args[0], args[1], kind)
            builder.store(args[2], place).align = kind.scalar.bitwidth // 8
            return context.get_dummy_value()

        return signature(types.void, array, types.intp, kind), generate

    return store


def _make_splat(kind: Lanes) -> Any:
    @intrinsic
    def splat(typing, scalar):
        def generate(context, builder, sig, args):
            return _splat(builder, kind, args[0])

        return signature(kind, kind.scalar), generate

    return splat


def _make_fma(kind: Lanes) -> Any:
    @intrinsic
    def fma(typing, scalar, times, plus):
        def generate(context, builder, sig, args):
            vector = vector_of(kind)
            name = f"llvm.fmuladd.v{kind.count}f{kind.scalar.bitwidth}"
            function = builder.module.globals.get(name) or ir.Function(
                builder.module, ir.FunctionType(vector, [vector] * 3), name
            )
            first = args[0] if whole else _splat(builder, kind, args[0])
            return builder.call(function, [first, args[1], args[2]])

        whole = isinstance(scalar, Lanes)
        return signature(kind, kind if whole else kind.scalar, kind, kind), generate

    return fma


def _make_total(kind: Lanes) -> Any:
    @intrinsic
    def total(typing, value):
        def generate(context, builder, sig, args):
            half, count = args[0], kind.count
            none = ir.Constant(vector_of(kind), ir.Undefined)
            while count > 1:
                # Add the upper half of the lanes to the lower half, until only one number is left.
                count //= 2
                lanes = [count + i if i < count else 0 for i in range(kind.count)]
                upper = builder.shuffle_vector(half, none, ir.Constant(ir.VectorType(I32, kind.count), lanes))
                half = builder.fadd(half, upper)
            return builder.extract_element(half, ir.Constant(I32, 0))

        return signature(kind.scalar, kind), generate

    return total


@intrinsic
def widened4(typing, array, index):
    """Loads four float32 of an array as a vector of four float64."""
    if array.dtype != types.float32:
        return None

    def generate(context, builder, sig, args):
        loaded = builder.load(address_of(context, builder, sig.args[0], args[0], args[1], QUAD))
        loaded.align = 4
        return builder.fpext(loaded, vector_of(FOUR))

    return signature(FOUR, array, types.intp), generate


@intrinsic
def narrowed4(typing, value):
    """Converts a vector of four float64 to a vector of four float32."""

    def generate(context, builder, sig, args):
        return builder.fptrunc(args[0], vector_of(QUAD))

    return signature(QUAD, FOUR), generate


def _shuffled4(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(I32, 4), lanes))


@intrinsic
def cross4(typing, a, b):
    """Returns the cross product of two vectors of three numbers. The fourth lane is 0."""

    def generate(context, builder, sig, args):
        def ahead(v: Any) -> Any:
            return _shuffled4(builder, v, v, [1, 2, 0, 3])

        u, v = args
        return ahead(builder.fsub(builder.fmul(u, ahead(v)), builder.fmul(ahead(u), v)))

    return signature(FOUR, FOUR, FOUR), generate


@intrinsic
def totals4(typing, a, b, c):
    """Returns a vector with lanes that are the sums of three vectors of four numbers. The fourth lane is
    0."""

    def generate(context, builder, sig, args):
        def paired(u: Any, v: Any) -> Any:
            # Add neighbouring lanes of u and v, such that the sums of u and v alternate. Stay within each
            # half of the vector, because moving lanes between the halves is slow.
            even = _shuffled4(builder, u, v, [0, 4, 2, 6])
            return builder.fadd(even, _shuffled4(builder, u, v, [1, 5, 3, 7]))

        first, last = paired(args[0], args[1]), paired(args[2], ir.Constant(vector_of(FOUR), [0.0] * 4))
        low = _shuffled4(builder, first, last, [0, 1, 4, 5])
        return builder.fadd(low, _shuffled4(builder, first, last, [2, 3, 6, 7]))

    return signature(FOUR, FOUR, FOUR, FOUR), generate


@intrinsic
def turned8(typing, rows, index, value):
    """Multiplies each half of a vector of eight with a 3x3 matrix in rows of four.

    Each half has three numbers and an ignored fourth number. The result of a half is the sum of the matrix
    rows, weighted by its three numbers.
    """

    def generate(context, builder, sig, args):
        vector, total = vector_of(EIGHT), None
        first = address_of(context, builder, sig.args[0], args[0], args[1], QUAD)
        for k in range(3):
            row = builder.load(builder.gep(first, [ir.Constant(I64, k)]))
            row.align = 4
            none = ir.Constant(vector_of(QUAD), ir.Undefined)
            twice = builder.shuffle_vector(
                row, none, ir.Constant(ir.VectorType(I32, 8), [0, 1, 2, 3, 0, 1, 2, 3])
            )
            lanes = ir.Constant(ir.VectorType(I32, 8), [k] * 4 + [4 + k] * 4)
            weight = builder.shuffle_vector(args[2], ir.Constant(vector, ir.Undefined), lanes)
            product = builder.fmul(weight, twice)
            total = product if total is None else builder.fadd(total, product)
        return total

    return signature(EIGHT, rows, types.intp, EIGHT), generate


def _make_reorder(order: list[int]) -> Any:
    @intrinsic
    def reorder(typing, value):
        def generate(context, builder, sig, args):
            none = ir.Constant(vector_of(EIGHT), ir.Undefined)
            return builder.shuffle_vector(args[0], none, ir.Constant(ir.VectorType(I32, 8), order))

        return signature(EIGHT, EIGHT), generate

    return reorder


together8, apart8 = _make_reorder([0, 1, 2, 4, 5, 6, 3, 7]), _make_reorder([0, 1, 2, 6, 3, 4, 5, 7])
"""Functions that reorder eight lanes with two groups of three numbers. ``together8`` moves the free lane
after each group to the end, and ``apart8`` is the inverse.
"""
load4, store4, splat4, fma4, total4 = (
    make(FOUR) for make in (_make_load, _make_store, _make_splat, _make_fma, _make_total)
)
load8, store8, splat8, fma8, total8 = (
    make(EIGHT) for make in (_make_load, _make_store, _make_splat, _make_fma, _make_total)
)
loadq, storeq, splatq, fmaq = (make(QUAD) for make in (_make_load, _make_store, _make_splat, _make_fma))
"""Functions for vectors of this type: load(array, index), store(array, index, v), splat(scalar), and
fma(a, v, w) = a v + w with a number or vector a."""
