"""Images of yes and no, compiled."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_BLOCK = 32
"""Pixels that are passed over together where none of them is masked."""


@njit(cache=True, nogil=True)
def pixels_of(mask):
    """(M,) int32 the masked pixels' places in reading order."""
    flat = mask.ravel()
    out, count = np.empty(len(flat) + 1, np.int32), 0
    whole = len(flat) // _BLOCK * _BLOCK
    for first in range(0, whole, _BLOCK):
        some = np.uint8(0)
        for i in range(_BLOCK):  # of a fixed length, so that all of it is read at once
            some |= np.uint8(flat[np.uintp(first + i)])
        if some == 0:
            continue
        for i in range(first, first + _BLOCK):
            # Written without asking, and overwritten by the next one unless it is masked.
            out[np.uintp(count)] = i
            count += flat[i]
    for i in range(whole, len(flat)):
        out[np.uintp(count)] = i
        count += flat[i]
    return out[:count]
