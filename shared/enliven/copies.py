"""Copies between arrays of one shape inside compiled kernels, by loops.

``target[:] = source`` of two arrays looks at their shapes, and Numba compiles the words of that error, joined
strings, into the kernel and again into each one that calls it: a quarter of the time that the tracker's
kernels took to compile. The shapes are not looked at here.
"""

from __future__ import annotations

from typing import Any

from numba import njit


@njit(cache=True, nogil=True)
def copy_row(target: Any, source: Any) -> None:
    """Writes (N,) into (N,)."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def copy_rows(target: Any, source: Any) -> None:
    """Writes (N, M) into (N, M)."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
