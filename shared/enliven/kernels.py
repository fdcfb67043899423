"""Shared tools for compiled kernels: the compiler decorator, execution in two threads, pointers to arguments,
and copy loops."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from types import SimpleNamespace
from typing import Any

import numba
from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from enliven.kernel_cache.cache import cache_kernel_on_disk
from enliven.kernel_cache.callees import compile_callees_without_entry_points
from enliven.kernel_cache.compiling import listen_to_compiler
from enliven.kernel_cache.native_set import should_begin_native_session
from enliven.kernel_cache.target import choose_target

choose_target(native=should_begin_native_session())
listen_to_compiler()
compile_callees_without_entry_points()


def njit(*, cache: bool = False, **options: Any) -> Any:
    """Compiles like ``numba.njit``, without the unused entry point for C.

    Compiling this entry point would take a tenth of the compile time of every kernel.

    Args:
        cache: True stores the machine code on disk, see :mod:`enliven.kernel_cache`.
        options: options of ``numba.njit``.
    """
    compiled = numba.njit(no_cfunc_wrapper=True, **options)
    return (lambda kernel: cache_kernel_on_disk(compiled(kernel))) if cache else compiled


@cache
def second_thread() -> ThreadPoolExecutor:
    """Returns an executor with one thread, which shares the work of the calling threads."""
    return ThreadPoolExecutor(1, "enliven-second")


def run_in_pieces(kernel: Callable[..., Any], count: int, length: int, *arguments: Any) -> None:
    """Calls ``kernel(*arguments, first, last)`` for pieces that cover 0 to ``count``, in two threads.

    The kernels release the global interpreter lock (GIL), and each kernel runs serially. Numba's parallel
    kernels are not used, because on some platforms only one thread of a process may call them. Each thread
    takes the next piece when it is idle. A piece writes only to its own part of the output, so the result is
    always the same.

    Args:
        length: the length of a piece. If there is only one piece, the calling thread computes it.
    If :func:`second_thread` is busy, the calling thread computes all pieces.
    """
    pieces = deque(range(0, count, length))

    def work(take: Callable[[], int]) -> None:
        while True:
            try:
                first = take()
            except IndexError:
                return
            kernel(*arguments, first, min(first + length, count))

    if len(pieces) < 2:
        work(pieces.popleft)
        return
    rest = second_thread().submit(work, pieces.pop)
    work(pieces.popleft)
    if not rest.cancel():
        rest.result()


@structref.register
class HeldArgumentsType(types.StructRef):  # type: ignore[misc]
    """The type of held arguments in a kernel. Its one field ``values`` contains them; see :func:`hold`."""


class HeldArguments(structref.StructRefProxy):  # type: ignore[misc]
    """A pointer to arguments that stay constant over many calls, created by :func:`hold`.

    A kernel reads them from ``values``.
    """

    __slots__ = ()


structref.define_boxing(HeldArgumentsType, HeldArguments)


def _hold_uncompiled(values: tuple[Any, ...]) -> SimpleNamespace:
    """Returns held values if compilation is disabled. Compiled kernels use the overload below instead."""
    return SimpleNamespace(values=values)


@overload(_hold_uncompiled)
def _make_held_constructor(values):
    """Returns the function that builds a structure with fields of these types inside a kernel."""
    kind = HeldArgumentsType((("values", types.unliteral(values)),))

    def make(values):
        held = structref.new(kind)
        held.values = values
        return held

    return make


@njit(cache=True)
def hold(values):
    """Returns a :class:`HeldArguments` for arrays, numbers, tuples and named tuples.

    Numba inspects every array argument of a call, which takes 0.15 microseconds per array. The kernels of a
    deformation graph have 53 array arguments in each frame. A pointer to all arrays takes only the time of
    one argument. The arrays are not copied, so kernels see later changes. Numbers are copied and do not
    change.
    """
    return _hold_uncompiled(values)


@njit(cache=True, nogil=True)
def copy_row(target: Any, source: Any) -> None:
    """Copies the array ``source`` (N,) to ``target`` without checking the lengths.

    ``target[:] = source`` checks the lengths. Numba compiles the code that builds the error message into the
    kernel, and into each kernel that calls it. This was a quarter of the compile time of the tracker's
    kernels.
    """
    for i in range(target.shape[0]):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def copy_rows(target: Any, source: Any) -> None:
    """Copies the array ``source`` (N, M) to ``target`` without checking the shapes. See :func:`copy_row`."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True, nogil=True)
def quantile(ordered, share):
    """Returns the quantile of the sorted values ``ordered`` (N,) at the fraction ``share`` in [0, 1], with
    linear interpolation."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
