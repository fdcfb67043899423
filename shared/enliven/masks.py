"""Compiled functions for binary masks."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_BLOCK = 32
"""Number of pixels that are skipped together if none of them is masked."""


@njit(cache=True, nogil=True)
def pixels_of(mask):
    """Returns (M,) int32 the indices of masked pixels in reading order."""
    flat = mask.ravel()
    out, count = np.empty(len(flat) + 1, np.int32), 0
    whole = len(flat) // _BLOCK * _BLOCK
    for first in range(0, whole, _BLOCK):
        some = np.uint8(0)
        for i in range(_BLOCK):  # a fixed length, so that the loop is vectorised
            some |= np.uint8(flat[np.uintp(first + i)])
        if some == 0:
            continue
        for i in range(first, first + _BLOCK):
            # Write without a branch. The next pixel overwrites it unless this one is masked.
            out[np.uintp(count)] = i
            count += flat[i]
    for i in range(whole, len(flat)):
        out[np.uintp(count)] = i
        count += flat[i]
    return out[:count]
