"""What compiled kernels have in common: how they are compiled, arguments that stay, and copies by loops."""

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
    """``numba.njit`` without the second entry that lets C call a kernel: nothing does.

    The entry is compiled with every kernel, and took a tenth of the time.

    Args:
        cache: keep the machine code on disk, see :mod:`enliven.kernel_cache`.
        options: of ``numba.njit``.
    """
    compiled = numba.njit(no_cfunc_wrapper=True, **options)
    return (lambda kernel: keep(compiled(kernel))) if cache else compiled


@structref.register
class HeldType(types.StructRef):  # type: ignore[misc]
    """The type of held arguments in a kernel; ``values``, its one field, is what :func:`hold` was given."""


class Held(structref.StructRefProxy):  # type: ignore[misc]
    """A pointer to arguments that stay, made by :func:`hold`: a kernel reads its ``values``."""

    __slots__ = ()


structref.define_boxing(HeldType, Held)


def _held(values: tuple[Any, ...]) -> SimpleNamespace:
    """Holds values where nothing is compiled; kernels compile the following in its place."""
    return SimpleNamespace(values=values)


@overload(_held)
def _held_in_kernels(values):
    """Returns how a kernel makes a structure of values of these types."""
    kind = HeldType((("values", types.unliteral(values)),))

    def make(values):
        held = structref.new(kind)
        held.values = values
        return held

    return make


@njit(cache=True)
def hold(values):
    """Returns a :class:`Held` of arrays, numbers, and tuples and named tuples of them.

    Numba looks at every array of a call, 0.15 microseconds each. A kernel that takes many of them call after
    call, 53 in a frame of a deformation graph, takes a pointer to all of them in the time of one. The arrays
    are not copied: what is written into one is seen by the kernel. Numbers stay as they were.
    """
    return _held(values)


@njit(cache=True, nogil=True)
def copy_row(target: Any, source: Any) -> None:
    """Writes (N,) into (N,); the lengths are not checked.

    ``target[:] = source`` checks them, and Numba compiles the text of that error, joined strings, into the
    kernel and again into each one that calls it: a quarter of the time that the tracker's kernels took.
    """
    for i in range(target.shape[0]):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def copy_rows(target: Any, source: Any) -> None:
    """Writes (N, M) into (N, M) as :func:`copy_row` does."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True, nogil=True)
def quantile(ordered, share):
    """The number below which a share in [0, 1] of (N,) rising values is, between two of them linearly."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
