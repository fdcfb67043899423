"""Images of yes and no, compiled."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def pixels_of(mask):  # type: ignore[no-untyped-def]
    """(M,) int32 the masked pixels' places in reading order."""
    flat = mask.ravel()
    out, count = np.empty(len(flat) + 1, np.int32), 0
    for i in range(len(flat)):
        # Written without asking, and overwritten by the next one unless it is masked.
        out[np.uintp(count)] = i
        count += flat[i]
    return out[:count]
