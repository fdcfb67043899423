"""Shared tools for compiled kernels: the compiler decorator, pointers to arguments, and copy loops."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numba
from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from enliven.kernel_cache import choose_target, keep, listen_to_compiler

choose_target()
listen_to_compiler()


def njit(*, cache: bool = False, **options: Any) -> Any:
    """Compiles like ``numba.njit``, without the unused entry point for C.

    That entry point would be compiled with every kernel and took a tenth of the time.

    Args:
        cache: True to keep the machine code on disk; see :mod:`enliven.kernel_cache`.
        options: options of ``numba.njit``.
    """
    compiled = numba.njit(no_cfunc_wrapper=True, **options)
    return (lambda kernel: keep(compiled(kernel))) if cache else compiled


@structref.register
class HeldArgumentsType(types.StructRef):  # type: ignore[misc]
    """The type of held arguments in a kernel. Its one field ``values`` contains them; see :func:`hold`."""


class HeldArguments(structref.StructRefProxy):  # type: ignore[misc]
    """A pointer to arguments that stay the same over many calls, made by :func:`hold`.

    A kernel reads its ``values``.
    """

    __slots__ = ()


structref.define_boxing(HeldArgumentsType, HeldArguments)


def _held(values: tuple[Any, ...]) -> SimpleNamespace:
    """Holds values if compilation is disabled. Kernels compile the overload below instead."""
    return SimpleNamespace(values=values)


@overload(_held)
def _held_in_kernels(values):
    """Returns the function that builds a structure of these types inside a kernel."""
    kind = HeldArgumentsType((("values", types.unliteral(values)),))

    def make(values):
        held = structref.new(kind)
        held.values = values
        return held

    return make


@njit(cache=True)
def hold(values):
    """Returns a :class:`HeldArguments` of arrays, numbers, and tuples and named tuples of them.

    Numba inspects every array argument of a call, which takes 0.15 microseconds each. The kernels of a
    deformation graph take 53 arrays in each frame. A pointer to all of them takes the time of one. The arrays
    are not copied, so kernels see later changes to them. Numbers are copied and do not change.
    """
    return _held(values)


@njit(cache=True, nogil=True)
def copy_row(target: Any, source: Any) -> None:
    """Copies (N,) into (N,) without checking the lengths.

    ``target[:] = source`` checks them. Numba compiles the code that builds the error message into the kernel
    and into each kernel that calls it. That was a quarter of the compile time of the tracker's kernels.
    """
    for i in range(target.shape[0]):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def copy_rows(target: Any, source: Any) -> None:
    """Copies (N, M) into (N, M) without checking the shapes; see :func:`copy_row`."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True, nogil=True)
def quantile(ordered, share):
    """Returns the quantile of sorted values (N,) at a fraction in [0, 1], with linear interpolation."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
