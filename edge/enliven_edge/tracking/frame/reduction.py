"""A depth image, reduced to the working resolution, and statistics of the whole one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import UInt16
from enliven.kernels import njit

_SAMPLES = 12_000
"""Pixels that are looked at, about: enough for shares to a percent, at a fraction of the cost of all."""
_NEAR_MM = 300
"""Millimetres: nearer depth is a hand or a cloth before the lens."""


@dataclass(frozen=True)
class DepthSurvey:
    """The statistics of one depth image.

    Attributes:
        known: the share of the pixels with a known depth.
        usable: the share that is known and at least 0.3 m away.
        speckle: the share that is unknown between a known left and a known right neighbour.
        mark: a hash of the image; two images with the same mark are the same image.
    """

    known: float
    usable: float
    speckle: float
    mark: int


def survey(depth: UInt16) -> DepthSurvey:
    """The survey of an (H, W) uint16 depth image in millimetres; 0 and 65535 are not known."""
    height, width = depth.shape
    step = max(1, round((height * width / _SAMPLES) ** 0.5))
    known, usable, speckle, count, mark = _survey(np.ascontiguousarray(depth), step, _NEAR_MM)
    total = max(1, count)
    return DepthSurvey(known / total, usable / total, speckle / total, int(mark))


@njit(cache=True, nogil=True)
def _survey(depth, step, near):
    """Counts over every ``step``-th row and column, and an FNV-1a hash of those pixels."""
    height, width = depth.shape
    known, usable, speckle, count = 0, 0, 0, 0
    mark = np.uint64(14695981039346656037)
    for v in range(step // 2, height, step):
        for u in range(step // 2, width, step):
            d = depth[v, u]
            count += 1
            mark = (mark ^ np.uint64(d)) * np.uint64(1099511628211)
            if d != 0 and d != 65535:
                known += 1
                if d >= near:
                    usable += 1
            elif 0 < u < width - 1:
                left, right = depth[v, u - 1], depth[v, u + 1]
                if left != 0 and left != 65535 and right != 0 and right != 65535:
                    speckle += 1
    return known, usable, speckle, count, mark


_SIDE = 3
"""Samples of a block, along and across, that are looked at."""
_NEAREST = np.uint16(0)
"""Millimetres of a sample without a measurement; nothing known is as near."""
_FARTHEST = np.uint16(65535)
"""Millimetres of a sample without a measurement in other sensors; nothing known is as far."""


@njit(cache=True, nogil=True)
def reduce_depth(depth, stride, height, width):
    """The lower median of up to nine known samples of every stride x stride block, in metres.

    A median keeps a depth edge an edge, where a mean would invent points between the two sides. A whole row
    of blocks is worked on at once: the inner loops are minima and maxima of rows.
    """
    out = np.empty((height, width))
    step = max(1, stride // _SIDE)
    side = min(_SIDE, (stride + step - 1) // step)
    # A small block has fewer samples: the missing ones are unknown.
    samples, odd = np.zeros((_SIDE * _SIDE, width), np.uint16), np.empty(width, np.bool_)
    for v in range(height):
        for r in range(side):
            row, first = depth[v * stride + r * step], r * side
            if stride == _SIDE:
                _part_in_three(samples[first], samples[first + 1], samples[first + 2], row)
                continue
            for k in range(side):
                for u in range(width):
                    samples[first + k, u] = row[np.uintp(u * stride + k * step)]
        _balance(samples, odd)
        _medians(samples, out[v])
    return out


@njit(cache=True, nogil=True)
def _part_in_three(first, second, third, row):
    """Every third of a row from its first, second and third on, each (width,): read as they lie, at once.

    With a factor that the compiler knows it does so many at a time, three times as fast as one by one; 3 is
    that of images of 640 columns.
    """
    for u in range(len(first)):
        first[u], second[u], third[u] = row[3 * u], row[3 * u + 1], row[3 * u + 2]


@njit(cache=True, nogil=True)
def _balance(samples, odd):
    """Makes every other unknown sample of each column of (9, width) the nearest and the rest the farthest.

    A pair of them leaves the median of the known where it was, and an odd one makes it the lower one. With
    no sample known the median is the nearest: unknown again.
    """
    odd[:] = False
    for k in range(len(samples)):
        for u in range(len(odd)):
            sample = samples[k, u]
            unknown = (sample == _NEAREST) | (sample == _FARTHEST)
            outermost = _FARTHEST if odd[u] else _NEAREST
            samples[k, u] = outermost if unknown else sample
            odd[u] ^= unknown


@njit(cache=True, nogil=True)
def _medians(samples, out):
    """(width,) metres: the median of each column of (9, width) millimetres.

    Of three ordered triples: the median of the greatest of the least, the median of the middle ones, and the
    least of the greatest.
    """
    a, b, c, d, e, f, g, h, i = (samples[0], samples[1], samples[2], samples[3], samples[4], samples[5],
                                 samples[6], samples[7], samples[8])  # fmt: skip
    for u in range(len(out)):
        low_a, middle_a, high_a = _ordered(a[u], b[u], c[u])
        low_b, middle_b, high_b = _ordered(d[u], e[u], f[u])
        low_c, middle_c, high_c = _ordered(g[u], h[u], i[u])
        low = max(low_a, max(low_b, low_c))
        _, middle, _ = _ordered(middle_a, middle_b, middle_c)
        high = min(high_a, min(high_b, high_c))
        out[u] = _ordered(low, middle, high)[1] * 1e-3


@njit(cache=True, nogil=True)
def _ordered(a, b, c):
    """Three numbers, the least first."""
    a, b = min(a, b), max(a, b)
    b, c = min(b, c), max(b, c)
    return min(a, b), max(a, b), c


@njit(cache=True, nogil=True)
def known_pixels(z):
    """The number of an (h, w) image's pixels that have depth."""
    count = 0
    for v in range(z.shape[0]):
        for u in range(z.shape[1]):
            count += z[v, u] > 0.0
    return count


@njit(cache=True, nogil=True)
def is_same(one, other):
    """Whether two (h, w) images are equal; it ends with the first row that is not."""
    if one.shape != other.shape:
        return False
    for v in range(one.shape[0]):
        differ = 0
        for u in range(one.shape[1]):
            differ += one[v, u] != other[v, u]
        if differ > 0:
            return False
    return True
