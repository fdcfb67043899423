"""Kernels for binary masks."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_BLOCK = 32
"""Number of pixels in a block. A block without masked pixels is skipped by a single test."""


@njit(cache=True, nogil=True)
def pixels_of(mask):
    """Returns the flat indices (M,) int32 of the masked pixels, in row-major order."""
    flat = mask.ravel()
    out, count = np.empty(len(flat) + 1, np.int32), 0
    whole = len(flat) // _BLOCK * _BLOCK
    for first in range(0, whole, _BLOCK):
        some = np.uint8(0)
        for i in range(_BLOCK):  # The length is fixed, so that the compiler vectorises the loop.
            some |= np.uint8(flat[np.uintp(first + i)])
        if some == 0:
            continue
        for i in range(first, first + _BLOCK):
            # Write every index without a branch. If the pixel is not masked, the count does not increase, and
            # the next pixel overwrites the index.
            out[np.uintp(count)] = i
            count += flat[i]
    for i in range(whole, len(flat)):
        out[np.uintp(count)] = i
        count += flat[i]
    return out[:count]
