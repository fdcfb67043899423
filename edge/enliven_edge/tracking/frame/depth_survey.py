"""Statistics of a whole depth image, in one pass over some of its pixels."""

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
def _survey(depth, step, near):  # type: ignore[no-untyped-def]
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
