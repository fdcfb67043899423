"""Compiled measures of a blob of pixels: widths of its rows, filled cells, outline and edges."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.frame.reduction import known_pixels

BIN = 0.04
"""Bin size in metres for measuring widths. A head covers several bins."""
GRID = 0.06
"""Cell size in metres for measuring the filled part of the upright box. A few samples fall into each cell."""
_MIN_MEASURED_OUTLINE = 0.1
"""Minimum fraction of an outline with measured depth beyond it to decide whether it is free."""
_MIN_MEASURED_IN_OPEN = 0.3
"""Like ``_MIN_MEASURED_OUTLINE``, in a large hall or outdoors, where few pixels have a measured depth to
compare with.
"""
_MAX_OPEN_DEPTH = 0.4
"""Maximum fraction of pixels with depth in an image of a large hall or outdoors, where most depths are beyond
the sensor's range."""


@njit(cache=True, nogil=True)
def least_eigenvalue(xx, yy, zz, xy, xz, yz):
    """Returns the smallest eigenvalue of a symmetric 3 by 3 matrix, by the trigonometric cubic formula."""
    mean = (xx + yy + zz) / 3.0
    x, y, z = xx - mean, yy - mean, zz - mean
    size = np.sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if size == 0.0:
        return mean
    determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)
    angle = np.arccos(min(1.0, max(-1.0, determinant / (2.0 * size * size * size)))) / 3.0
    return mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)


@njit(cache=True, nogil=True)
def widths_at(along, height, crown, bands):
    """Returns (B,) widths in metres, rounded to bins, that (M,) points fill along a line within each band of
    height.

    Args:
        along: (M,) coordinates in metres along the line.
        height: (M,) metres above the floor.
        crown: height of the crown in metres.
        bands: (B, 2) metres below the crown of the start and end of each band.
    """
    first = np.floor(along.min() / BIN)
    met = np.zeros((len(bands), int(np.floor(along.max() / BIN) - first) + 1), np.bool_)
    lowest = crown - bands[:, 1].max()
    for i in range(len(along)):
        if height[i] <= lowest:
            continue
        place = int(np.floor(along[i] / BIN) - first)
        for b in range(len(bands)):
            if crown - bands[b, 1] < height[i] <= crown - bands[b, 0]:
                met[b, place] = True
    # ``met.sum(1)`` would compile the formatting of its error message, two thirds of this kernel's time.
    widths = np.zeros(len(bands))
    for b in range(len(bands)):
        for place in range(met.shape[1]):
            widths[b] += met[b, place]
        widths[b] *= BIN
    return widths


@njit(cache=True, nogil=True)
def filled_cells(along, height):
    """Returns the number of cells of an upright grid that (M,) points fill."""
    left, low = np.floor(along.min() / GRID), np.floor(height.min() / GRID)
    wide, tall = int(np.floor(along.max() / GRID) - left), int(np.floor(height.max() / GRID) - low)
    met = np.zeros((wide + 1, tall + 1), np.bool_)
    for i in range(len(along)):
        met[int(np.floor(along[i] / GRID) - left), int(np.floor(height[i] / GRID) - low)] = True
    return _count(met, 0, wide + 1, 0, tall + 1)


@njit(cache=True, nogil=True)
def outline_of_pixels(z, mask, pixels):
    """Returns the fractions of a mask's outline next to farther pixels, nearer pixels and the image border.

    The outline consists of the sides and the top. The fourth value is whether the mask extends beyond the
    lower image border. Depth is compared three pixels away, because the first pixels may be on the edge
    itself. If too little depth is known around the outline, the whole outline counts as free.

    Args:
        z: (h, w) metres.
        mask: (h, w) the blob.
        pixels: (N,) the flat indices of the mask's pixels, in reading order.
    """
    height, width = z.shape
    farther, nearer, other, unknown = 0, 0, 0, 0
    for i in _edges(mask, pixels):
        v, u = i // width, i % width
        for q, p, y, x in ((v, u - 1, v, u - 3), (v, u + 1, v, u + 3), (v - 1, u, v - 3, u)):
            if q < 0 or p < 0 or p >= width or mask[q, p]:
                continue
            if y >= 0 and 0 <= x < width and not mask[y, x]:
                if z[y, x] == 0.0:
                    unknown += 1
                    continue
                step = 0.05 + 0.012 * z[v, u] * z[v, u]
                farther += z[y, x] > z[v, u] + step
                nearer += z[y, x] < z[v, u] - step
                other += abs(z[y, x] - z[v, u]) <= step
    # Count the image border as a part of the outline.
    border = (
        _count(mask, 0, 1, 0, width)
        + _count(mask, 0, height, 0, 1)
        + _count(mask, 0, height, width - 1, width)
    )
    cut = _count(mask, max(0, height - 2), height, 0, width) > 0.05 * width
    total = max(1.0, farther + nearer + other + border)
    around = total + unknown
    is_measured = total >= _MIN_MEASURED_OUTLINE * around
    if not is_measured or (
        total < _MIN_MEASURED_IN_OPEN * around and known_pixels(z) <= _MAX_OPEN_DEPTH * z.size
    ):
        return 1.0, 0.0, border / total, cut
    return farther / total, nearer / total, border / total, cut


@njit(cache=True, nogil=True)
def _count(mask, top, bottom, left, right):
    """Returns the number of masked pixels in the rows ``top`` to ``bottom`` and the columns ``left`` to
    ``right``.
    """
    count = 0
    for v in range(top, bottom):
        for u in range(left, right):
            count += mask[v, u]
    return count


@njit(cache=True, nogil=True)
def _edges(mask, pixels):
    """Returns (M,) the masked indices that have an unmasked neighbour at a side or above.

    The result may also contain other pixels at the image border.
    """
    flat, width = mask.ravel(), mask.shape[1]
    out, count = np.empty(len(pixels) + 1, np.int32), 0
    for n in range(len(pixels)):
        i = np.int64(pixels[n])
        left, right = np.uintp(max(0, i - 1)), np.uintp(min(len(flat) - 1, i + 1))
        above = np.uintp(max(0, i - width))
        out[np.uintp(count)] = i
        count += not (flat[left] and flat[right] and flat[above])
    return out[:count]
