"""What compiled kernels have in common: how they are compiled, and copies by loops."""

from __future__ import annotations

from typing import Any

import numba

from enliven.kernel_cache import keep


def njit(*, cache: bool = False, **options: Any) -> Any:
    """``numba.njit`` without the second entry that lets C call a kernel: nothing does.

    The entry is compiled with every kernel, and took a tenth of the time.

    Args:
        cache: keep the machine code on disk, as :mod:`enliven.kernel_cache` does.
        options: of ``numba.njit``.
    """
    compiled = numba.njit(no_cfunc_wrapper=True, **options)
    return (lambda kernel: keep(compiled(kernel))) if cache else compiled


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
def quantile(ordered, share):  # type: ignore[no-untyped-def]
    """The number below which a share in [0, 1] of (N,) rising values is, between two of them linearly."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (at - low) * (ordered[high] - ordered[low])
