"""Short vectors in the processor's own registers, for compiled loops: four float64, or eight float32.

Numba turns plain loops over three or four numbers into scalar code; the small dense blocks of a deformation
graph are then several times slower than the machine allows. Here is the least that mends it: a value that
is one vector register, read from and written to flat arrays. LLVM lowers it to whatever the processor has
(AVX, NEON), so it is as portable as the loops around it. For use inside ``@njit`` functions only.

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

_I32, _I64 = ir.IntType(32), ir.IntType(64)


class Lanes(types.Type):
    """Numba's type of a vector register: ``count`` numbers of the type ``scalar``."""

    def __init__(self, count: int, scalar: types.Float) -> None:
        self.count, self.scalar = count, scalar
        super().__init__(name=f"Lanes({count} x {scalar})")


def _element(kind: Lanes) -> ir.Type:
    return ir.DoubleType() if kind.scalar.bitwidth == 64 else ir.FloatType()


def _vector(kind: Lanes) -> ir.VectorType:
    return ir.VectorType(_element(kind), kind.count)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, _vector(kind))


FOUR = Lanes(4, types.float64)
EIGHT = Lanes(8, types.float32)
QUAD = Lanes(4, types.float32)

for _operator, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):

    @type_callable(_operator)
    def _type_pair(context: Any):  # type: ignore[no-untyped-def]
        def typer(a: Any, b: Any) -> Any:
            return a if isinstance(a, Lanes) and a == b else None

        return typer

    @lower_builtin(_operator, Lanes, Lanes)
    def _lower_pair(context, builder, sig, args, instruction=_instruction):  # type: ignore[no-untyped-def]
        return getattr(builder, instruction)(*args)


def _address(context: Any, builder: Any, array_type: Any, array: Any, index: Any, kind: Lanes) -> Any:
    """A pointer to the vector that begins at ``array[index]``."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _vector(kind).as_pointer())


def _splat(builder: Any, kind: Lanes, scalar: Any) -> Any:
    """The vector of ``scalar`` in every lane."""
    vector = _vector(kind)
    none = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(none, scalar, ir.Constant(_I32, 0))
    return builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(_I32, kind.count), [0] * kind.count))


def _make_load(kind: Lanes) -> Any:
    @intrinsic
    def load(typing, array, index):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            loaded = builder.load(_address(context, builder, sig.args[0], args[0], args[1], kind))
            loaded.align = kind.scalar.bitwidth // 8
            return loaded

        return signature(kind, array, types.intp), generate

    return load


def _make_store(kind: Lanes) -> Any:
    @intrinsic
    def store(typing, array, index, value):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            place = _address(context, builder, sig.args[0], args[0], args[1], kind)
            builder.store(args[2], place).align = kind.scalar.bitwidth // 8
            return context.get_dummy_value()

        return signature(types.void, array, types.intp, kind), generate

    return store


def _make_splat(kind: Lanes) -> Any:
    @intrinsic
    def splat(typing, scalar):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            return _splat(builder, kind, args[0])

        return signature(kind, kind.scalar), generate

    return splat


def _make_fma(kind: Lanes) -> Any:
    @intrinsic
    def fma(typing, scalar, times, plus):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            vector = _vector(kind)
            name = f"llvm.fmuladd.v{kind.count}f{kind.scalar.bitwidth}"
            function = builder.module.globals.get(name) or ir.Function(
                builder.module, ir.FunctionType(vector, [vector] * 3), name
            )
            return builder.call(function, [_splat(builder, kind, args[0]), args[1], args[2]])

        return signature(kind, kind.scalar, kind, kind), generate

    return fma


def _make_total(kind: Lanes) -> Any:
    @intrinsic
    def total(typing, value):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            half, count = args[0], kind.count
            none = ir.Constant(_vector(kind), ir.Undefined)
            while count > 1:
                # The upper half onto the lower one, until one number is left.
                count //= 2
                lanes = [count + i if i < count else 0 for i in range(kind.count)]
                upper = builder.shuffle_vector(
                    half, none, ir.Constant(ir.VectorType(_I32, kind.count), lanes)
                )
                half = builder.fadd(half, upper)
            return builder.extract_element(half, ir.Constant(_I32, 0))

        return signature(kind.scalar, kind), generate

    return total


def _make_transpose(rows: int) -> Any:
    """Only for blocks of ``rows`` rows of eight, of which the first ``rows`` lanes count, at most eight."""

    @intrinsic
    def transpose(typing, source, index, target, to):  # type: ignore[no-untyped-def]
        def generate(context, builder, sig, args):  # type: ignore[no-untyped-def]
            vector = _vector(EIGHT)
            data = [_address(context, builder, sig.args[k], args[k], args[k + 1], EIGHT) for k in (0, 2)]

            def shuffled(a: Any, b: Any, lanes: list[int]) -> Any:
                return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_I32, 8), lanes))

            loaded = []
            for r in range(rows):
                loaded.append(builder.load(builder.gep(data[0], [ir.Constant(_I64, r)])))
                loaded[-1].align = 4
            loaded += [ir.Constant(vector, [0.0] * 8)] * (8 - rows)
            # Two rows interleaved, for the lower and the upper half of the columns.
            pairs = [
                [
                    shuffled(loaded[r], loaded[r + 1], [half * 4 + i // 2 + 8 * (i % 2) for i in range(8)])
                    for r in (0, 2, 4, 6)
                ]
                for half in (0, 1)
            ]
            for c in range(rows):
                a, b, d, e = pairs[c // 4]
                at = 2 * (c % 4)
                low = shuffled(a, b, [at, at + 1, at + 8, at + 9, 0, 0, 0, 0])
                high = shuffled(d, e, [at, at + 1, at + 8, at + 9, 0, 0, 0, 0])
                whole = shuffled(low, high, [0, 1, 2, 3, 8, 9, 10, 11])
                place = builder.gep(data[1], [ir.Constant(_I64, c)])
                builder.store(whole, place).align = 4
            return context.get_dummy_value()

        return signature(types.void, source, types.intp, target, types.intp), generate

    return transpose


transpose6 = _make_transpose(6)
"""transpose6(source, index, target, to): a 6x6 block in rows of eight, transposed; the other lanes are 0."""
load4, store4, splat4, fma4, total4 = (
    make(FOUR) for make in (_make_load, _make_store, _make_splat, _make_fma, _make_total)
)
load8, store8, splat8, fma8, total8 = (
    make(EIGHT) for make in (_make_load, _make_store, _make_splat, _make_fma, _make_total)
)
loadq, storeq, splatq, fmaq = (make(QUAD) for make in (_make_load, _make_store, _make_splat, _make_fma))
"""load(array, index), store(array, index, v), splat(scalar), fma(scalar, v, w) = scalar v + w, total(v)."""
