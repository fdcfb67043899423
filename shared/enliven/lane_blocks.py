"""Operations on small dense blocks in SIMD registers, for kernels: 6x6 float32 in rows of eight lanes.

A block is inverted, transposed or quantised entirely in registers (:mod:`enliven.lanes`), without
intermediate memory writes. Use the functions only inside ``@njit`` functions.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from enliven.lanes import EIGHT, I32, I64, address_of, vector_of

_ROWS = 6
"""Number of rows of a block, and of used numbers in a row: three for rotation and three for translation of a
node.
"""
_VECTOR = vector_of(EIGHT)
_UNDEFINED_VECTOR = ir.Constant(_VECTOR, ir.Undefined)
_ZERO_VECTOR = ir.Constant(_VECTOR, [0.0] * 8)
_INT16_VECTOR = ir.VectorType(ir.IntType(16), 8)
_MAX_INT16 = 32767.0
"""The largest int16."""
_MIN_BLOCK_SCALE = 1e-30
"""Lower limit of a block's largest number, so that a block of zeros also has a scale."""


def _shuffle(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(I32, 8), lanes))


def _load_rows(builder: Any, first: Any) -> list[Any]:
    """Loads six rows, starting at the address ``first``."""
    loaded = []
    for r in range(_ROWS):
        loaded.append(builder.load(builder.gep(first, [ir.Constant(I64, r)])))
        loaded[-1].align = 4
    return loaded


def _store_rows(builder: Any, rows: list[Any], first: Any) -> None:
    """Stores six rows, starting at the address ``first``."""
    for r, row in enumerate(rows):
        builder.store(row, builder.gep(first, [ir.Constant(I64, r)])).align = 4


def _call_intrinsic(builder: Any, name: str, *args: Any) -> Any:
    """Calls an intrinsic function of LLVM on vectors of eight numbers."""
    function = builder.module.globals.get(name) or ir.Function(
        builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * len(args)), name
    )
    return builder.call(function, args)


def _fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    return _call_intrinsic(builder, "llvm.fmuladd.v8f32", a, b, c)


def _broadcast(value: float) -> Any:
    """Returns a vector with ``value`` in every lane."""
    return ir.Constant(_VECTOR, [value] * 8)


def _transpose_rows(builder: Any, rows: list[Any]) -> list[Any]:
    """Returns the six rows of the transposed block. The unused last lanes are 0."""
    rows = [*rows, _ZERO_VECTOR, _ZERO_VECTOR]
    # Interleave two rows at a time, separately for the lower and the upper half of the columns.
    pairs = [
        [
            _shuffle(builder, rows[r], rows[r + 1], [half * 4 + i // 2 + 8 * (i % 2) for i in range(8)])
            for r in (0, 2, 4, 6)
        ]
        for half in (0, 1)
    ]
    columns = []
    for c in range(_ROWS):
        a, b, d, e = pairs[c // 4]
        at = 2 * (c % 4)
        low = _shuffle(builder, a, b, [at, at + 1, at + 8, at + 9, 0, 0, 0, 0])
        high = _shuffle(builder, d, e, [at, at + 1, at + 8, at + 9, 0, 0, 0, 0])
        columns.append(_shuffle(builder, low, high, [0, 1, 2, 3, 8, 9, 10, 11]))
    return columns


def _block_addresses(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Returns the addresses of two blocks, each given as an array and an index."""
    return [address_of(context, builder, sig.args[k], args[k], args[k + 1], EIGHT) for k in (0, 2)]


@intrinsic
def transpose6(typing, source, index, target, to):
    """Writes the transpose of the block at ``index`` of ``source`` to index ``to`` of ``target``. Unused
    lanes are 0.
    """

    def generate(context, builder, sig, args):
        first, there = (
            address_of(context, builder, sig.args[k], args[k], args[k + 1], EIGHT) for k in (0, 2)
        )
        _store_rows(builder, _transpose_rows(builder, _load_rows(builder, first)), there)
        return context.get_dummy_value()

    return signature(types.void, source, types.intp, target, types.intp), generate


@intrinsic
def mirror6(typing, source, index, target, to, sign):
    """Completes a symmetric block from its lower half, and multiplies it by ``sign``. Reads it at ``index``
    of ``source``, and writes it to index ``to`` of ``target``.
    """

    def generate(context, builder, sig, args):
        first, destination = (
            address_of(context, builder, sig.args[k], args[k], args[k + 1], EIGHT) for k in (0, 2)
        )
        rows, mirrored = _load_rows(builder, first), []
        signs = _shuffle(
            builder,
            builder.insert_element(_UNDEFINED_VECTOR, args[4], ir.Constant(I32, 0)),
            _UNDEFINED_VECTOR,
            [0] * 8,
        )
        for r, (row, column) in enumerate(zip(rows, _transpose_rows(builder, rows), strict=True)):
            full_row = _shuffle(builder, row, column, [i if i <= r else 8 + i for i in range(8)])
            mirrored.append(builder.fmul(signs, full_row))
        _store_rows(builder, mirrored, destination)
        return context.get_dummy_value()

    return signature(types.void, source, types.intp, target, types.intp, types.float32), generate


@intrinsic
def invert6(typing, block, index, sign):
    """Replaces the symmetric block at ``index`` by its inverse, by Gauss-Jordan elimination.

    Returns True if ``sign`` times the block is positive definite. Otherwise, the result is not an inverse.

    The row of a pivot p in column k is divided by p, and its entry in that column is set to 1 + 1/p.
    Subtracting f times this row from a row with f in that column gives f - f (1 + 1/p) = -f/p, as required.
    So only whole registers are written, and no single numbers.
    """

    def generate(context, builder, sig, args):
        first = address_of(context, builder, sig.args[0], args[0], args[1], EIGHT)
        rows, definite = _load_rows(builder, first), ir.Constant(ir.IntType(1), 1)
        for k in range(_ROWS):
            unit = ir.Constant(_VECTOR, [float(i == k) for i in range(8)])
            pivot = _shuffle(builder, rows[k], _UNDEFINED_VECTOR, [k] * 8)
            number = builder.fmul(builder.extract_element(pivot, ir.Constant(I32, 0)), args[2])
            positive = builder.fcmp_ordered(">", number, ir.Constant(ir.FloatType(), 0.0))
            definite = builder.and_(definite, positive)
            inverse = builder.fdiv(_broadcast(1.0), pivot)
            row = _fma(builder, inverse, unit, builder.fmul(inverse, rows[k]))
            for i in range(_ROWS):
                if i != k:
                    factor = builder.fneg(_shuffle(builder, rows[i], _UNDEFINED_VECTOR, [k] * 8))
                    rows[i] = _fma(builder, factor, row, rows[i])
            rows[k] = builder.fsub(row, unit)
        _store_rows(builder, rows, first)
        return definite

    return signature(types.boolean, block, types.intp, types.float32), generate


@intrinsic
def totals6(typing, a, b, c, d, e, f):
    """Returns a vector with lanes that are the sums of six vectors of eight numbers. The last two lanes are
    0."""

    def generate(context, builder, sig, args):
        def paired(u: Any, v: Any) -> Any:
            # Add neighbouring lanes of u and v, such that the sums of u and v alternate. Stay within each
            # half of the vector, because moving lanes between the halves is slow.
            even = _shuffle(builder, u, v, [0, 2, 8, 10, 4, 6, 12, 14])
            return builder.fadd(even, _shuffle(builder, u, v, [1, 3, 9, 11, 5, 7, 13, 15]))

        first = paired(paired(args[0], args[1]), paired(args[2], args[3]))
        last = paired(paired(args[4], args[5]), _ZERO_VECTOR)
        low = _shuffle(builder, first, last, [0, 1, 2, 3, 8, 9, 10, 11])
        return builder.fadd(low, _shuffle(builder, first, last, [4, 5, 6, 7, 12, 13, 14, 15]))

    return signature(EIGHT, *[EIGHT] * 6), generate


@intrinsic
def shorten6(typing, block, index, short, to):
    """Quantises the block at ``index`` to int16, in six rows of six, at ``to`` of ``short``.

    Returns the scale factor from the int16 values to the block's numbers. Two numbers after the values are
    overwritten.
    """

    def generate(context, builder, sig, args):
        rows = _load_rows(builder, address_of(context, builder, sig.args[0], args[0], args[1], EIGHT))
        most = _broadcast(_MIN_BLOCK_SCALE)
        for row in rows:
            most = _call_intrinsic(
                builder, "llvm.maxnum.v8f32", most, _call_intrinsic(builder, "llvm.fabs.v8f32", row)
            )
        for step in (4, 2, 1):
            other = _shuffle(builder, most, _UNDEFINED_VECTOR, [(i + step) % 8 for i in range(8)])
            most = _call_intrinsic(builder, "llvm.maxnum.v8f32", most, other)
        data = context.make_array(sig.args[2])(context, builder, args[2]).data
        scale = builder.fdiv(_broadcast(_MAX_INT16), most)
        for r, row in enumerate(rows):
            whole = _call_intrinsic(builder, "llvm.rint.v8f32", builder.fmul(scale, row))
            whole = builder.trunc(builder.fptosi(whole, ir.VectorType(I32, 8)), _INT16_VECTOR)
            place = builder.gep(data, [builder.add(args[3], ir.Constant(I64, _ROWS * r))])
            builder.store(whole, builder.bitcast(place, _INT16_VECTOR.as_pointer())).align = 2
        return builder.extract_element(builder.fdiv(most, _broadcast(_MAX_INT16)), ir.Constant(I32, 0))

    return signature(types.float32, block, types.intp, short, types.intp), generate


@intrinsic
def loadshort8(typing, short, index):
    """Loads eight int16 at ``index`` as a vector of eight float32."""
    if short.dtype != types.int16:
        return None

    def generate(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        loaded = builder.load(builder.bitcast(builder.gep(data, [args[1]]), _INT16_VECTOR.as_pointer()))
        loaded.align = 2
        return builder.sitofp(builder.sext(loaded, ir.VectorType(I32, 8)), _VECTOR)

    return signature(EIGHT, short, types.intp), generate
