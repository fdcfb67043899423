"""The kernels of the depth codec: they find the occurring levels, and compute the residuals of the LOCO-I
prediction.

LOCO-I: Weinberger, Seroussi and Sapiro, "The LOCO-I lossless image compression algorithm", IEEE TIP 9(8),
2000, equation 1 (the median edge detector). Here it is applied to levels of depth, with holes kept separate.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, UInt8, UInt16
from enliven.kernels import njit


@njit(cache=True, nogil=True)
def mark_levels(depth: UInt16) -> Bool:
    """Returns (65536,) True for each non-zero value that occurs in the image ``depth`` (H, W)."""
    occurs = np.zeros(65536, np.bool_)
    for value in depth.ravel():
        occurs[value] = True
    occurs[0] = False
    return occurs


@njit(cache=True, nogil=True)
def predict_level(w: int, n: int, nw: int, ne: int, last: int) -> int:
    """Predicts a level from the neighbouring levels: west, north, north-west, north-east, and the last known
    level. A level of 0 is unknown."""
    if w != 0 and n != 0:
        if nw == 0:
            return (w + n) >> 1
        high, low = max(w, n), min(w, n)
        if nw >= high:
            return low
        return high if nw <= low else w + n - nw
    if w != 0:
        return w
    if n != 0:
        return n
    return ne if ne != 0 else last


@njit(cache=True, nogil=True)
def predict_image(depth: UInt16, ranks: UInt16, count: int) -> UInt8:
    """Computes the residuals (1 or 2, H, W) of an image: their low bytes and, if there are more than 255
    levels, their high bytes.

    Args:
        depth: (H, W) millimetres.
        ranks: (65536,) the level of each value, 0..count.
        count: the number of levels P.
    """
    height, width = depth.shape
    wide = count > 255
    planes = np.empty((2 if wide else 1, height, width), np.uint8)
    above = np.zeros(width + 2, np.int32)
    row = np.zeros(width + 2, np.int32)
    last, half, least = (count + 1) // 2, count // 2, -((count - 1) // 2)
    for y in range(height):
        w, nw, n = 0, 0, int(above[0])
        for x in range(width):
            v, ne = int(np.int64(ranks[depth[y, x]])), int(above[x + 1])
            s = 0
            if v != 0:
                r = v - predict_level(w, n, nw, ne, last)
                if r > half:
                    r -= count
                elif r < least:
                    r += count
                s = 2 * r if r > 0 else 1 - 2 * r
                last = v
            planes[0, y, x] = s & 255
            if wide:
                planes[1, y, x] = s >> 8
            row[x] = v
            w, nw, n = v, n, ne
        row[width] = 0
        above, row = row, above
    return planes


@njit(cache=True, nogil=True)
def restore_image(planes: UInt8, values: UInt16, count: int, depth: UInt16) -> bool:
    """Restores the image ``depth`` (H, W) from the residuals ``planes`` (1 or 2, H, W). Returns False if a
    decoded level is outside 0..count.

    Args:
        planes: low bytes, and high bytes if there are more than 255 levels.
        values: (count + 1,) the depth of each level in millimetres.
        count: the number of levels P.
        depth: (H, W) receives the image, millimetres.
    """
    height, width = depth.shape
    wide = planes.shape[0] == 2
    above = np.zeros(width + 2, np.int32)
    row = np.zeros(width + 2, np.int32)
    last = (count + 1) // 2
    for y in range(height):
        w, nw, n = 0, 0, int(above[0])
        for x in range(width):
            s, ne = int(np.int64(planes[0, y, x])), int(above[x + 1])
            if wide:
                s |= int(np.int64(planes[1, y, x])) << 8
            if s > count:
                return False
            v = 0
            if s != 0:
                r = -(s >> 1) if s & 1 else s >> 1
                v = predict_level(w, n, nw, ne, last) + r
                if v > count:
                    v -= count
                elif v < 1:
                    v += count
                last = v
            depth[y, x] = values[v]
            row[x] = v
            w, nw, n = v, n, ne
        above, row = row, above
    return True
