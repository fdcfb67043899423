"""Whether a group of pixels may be a person, by size and shape alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.segment.shape_kernels import (
    BIN,
    GRID,
    filled_cells,
    least_eigenvalue,
    outline_of_pixels,
    widths_at,
)

SMALLEST_AREA = 0.06
"""Square metres seen of a person at the least: a head and a shoulder; smaller groups are noise or things."""
LARGEST_AREA = 1.6
"""Square metres seen of a person at the most: three times the usual."""
_SHORTEST = 0.3
"""Metres that a person is tall at the least, lying down."""
_WIDEST = 2.4
"""Metres that a person is wide at the most, arms spread or lying."""
_DEEPEST = 1.6
"""Metres that a person is deep at the most, arms or legs held forward."""
_TALLEST = 2.6
"""Metres above the floor of the highest crown: a tall person's raised hands."""
_MUCH = 0.7
"""Square metres beyond which more of a group makes it no more like a person."""
_HIGH = 1.8
"""Metres of height beyond which more makes it no more like a person."""
_FLAT = 0.022
"""Metres of standard deviation from its best plane below which a group is flat: a trunk is rounder."""
_BROAD = 0.35
"""Metres across from which a flat group is a panel: a limb is flat too, but narrow."""
_HEAD = 0.14
"""Metres below the crown in which nothing but a head is: above the chin."""
_BANDS = np.array([(-1.0, _HEAD), (0.25, 0.35), (0.35, 0.45), (0.45, 0.55)])
"""(4, 2) metres below the crown: the band of the head, and three in which the shoulders may be."""
_HEADLIKE = 0.75
"""Width of a head over that of the shoulders at the most: a panel's is about 1."""
_HEAD_WIDTH = (0.09, 0.45)
"""Metres, the least and the greatest width at a head's height: half hidden, and with hair or a hat."""
_SOLID = 0.43
"""Share of its upright box that an upright person fills at the least: chairs and plants fill less."""
_SPARSE = 0.8
"""Share of its upright box below which a group has limbs that part."""
_BOARD = 0.85
"""Share of its upright box from which a flat group is a panel in spite of a narrow top."""
_ROUND = 0.035
"""Metres of standard deviation from its best plane from which a group with limbs is round as a body is."""
_FREE = 0.6
"""Share of its outline that is free at the least: a person stands before something, a wall does not."""
_HIDDEN = 0.2
"""Share of the outline behind something nearer up to which a crown counts as seen."""
_MOSTLY_HIDDEN = 0.6
"""Share of the outline behind something nearer from which the rest does not tell what stands free."""
_BORDER = 0.03
"""Share of the outline at the image's border up to which a crown counts as seen."""
_CUT = 0.08
"""Share of the outline at the image's border from which a group is cut by it."""
_SAMPLES = 1500
"""Points of a group on which its shape is measured, about: the cost grows with them."""
_WALL_BEHIND = 1.0
"""Metres by which the pixels of a wall behind a group are put back: any group then stands free before it."""


@dataclass(frozen=True)
class BlobShape:
    """The size and the shape of a group of pixels.

    Attributes:
        area: square metres that are seen, towards the sensor.
        size: metres of its height, at most a person's; 0 where its extents are not a person's.
        crown: metres of its top above the floor.
        thickness: metres, the standard deviation from its best plane.
        wide: metres across, the larger of its two horizontal extents.
        head: the filled width at the head's height over that at the shoulders'; about 1 for a panel.
        head_width: metres of the filled width at the head's height.
        fill: the share of its upright box that it fills.
        free: the share of its outline, sideways and above, beyond which the sensor sees farther: a person
            stands before something, a piece of a wall ends at the next thing or at the image's border.
        behind: the share of its outline at which something nearer begins, that may hide more of it.
        border: the share of its outline that is the image's border.
        cut: whether it runs out of the image below.
    """

    area: float
    size: float
    crown: float
    thickness: float
    wide: float
    head: float
    head_width: float
    fill: float
    free: float
    behind: float
    border: float
    cut: bool

    @property
    def likeness(self) -> float:
        """How much it is like a person by its size alone, square metres times metres; 0 where it is none."""
        return min(self.area, _MUCH) * self.size if SMALLEST_AREA < self.area < LARGEST_AREA else 0.0

    @property
    def possible(self) -> bool:
        """Whether it may be a person in any posture: of a person's size, no panel, and free on its sides."""
        flat = self.thickness < _FLAT and self.wide > _BROAD
        panel = flat and not (self._headed and self.fill < _BOARD)
        return self.likeness > 0 and not panel and self.crown < _TALLEST and self._free > _FREE

    @property
    def upright(self) -> bool:
        """Whether it is shaped as a standing or sitting person: a head above shoulders."""
        return self.possible and self._headed and self.fill > _SOLID

    @property
    def _free(self) -> float:
        """The free share of the outline that nothing hides: in a crowd others may hide much of a person."""
        return self.free / max(1e-6, 1.0 - self.behind) if self.behind < _MOSTLY_HIDDEN else 0.0

    @property
    def _headed(self) -> bool:
        """Whether its top is as wide as a head, and wider below."""
        low, high = _HEAD_WIDTH
        return self.head < _HEADLIKE and low < self.head_width < high

    @property
    def human(self) -> bool:
        """Whether it has the shape of most people: upright, cut by the image, or with limbs that part."""
        limbs = self.fill < _SPARSE and self.thickness > _ROUND
        return self.upright or (self.possible and (self.cut or limbs or self.border > _CUT))

    @property
    def whole(self) -> bool:
        """Whether all of its upper end is seen, so that the crown is the person's."""
        return self.behind < _HIDDEN and self.border < _BORDER


def shape_of(view: FrameView, mask: Bool, area: float, walls: Bool | None = None) -> BlobShape:
    """The shape of the (h, w) masked pixels, which cover ``area`` square metres towards the sensor.

    Args:
        walls: (h, w) pixels of a wall behind the mask, however near it is.
    """
    z = view.z if walls is None else view.z + _WALL_BEHIND * walls
    pixels = pixels_of(mask)
    free, behind, border, cut = outline_of_pixels(z, mask, pixels)
    points = samples(view.points, pixels, _SAMPLES)
    thickness, along = _flattened(points)
    ordered = np.sort(points, axis=1)
    wide, tall, deep, crown, head, head_width, fill = _built(points, along, ordered, np.sort(along), _BANDS)
    size = min(tall, _HIGH) if tall >= _SHORTEST and wide <= _WIDEST and deep <= _DEEPEST else 0.0
    wide = max(wide, deep)
    return BlobShape(area, size, crown, thickness, wide, head, head_width, fill, free, behind, border, cut)


@njit(cache=True, nogil=True)
def _spread(ordered, low, high):
    """How far apart two quantiles of (N,) rising values are."""
    return quantile(ordered, high) - quantile(ordered, low)


@njit(cache=True, nogil=True)
def _flattened(points):
    """Returns of (3, M) points: metres, the standard deviation from their best plane; (M,) metres along them.

    The second is measured from the points' mean along their longest horizontal direction.
    """
    count, middle = points.shape[1], (points[0].mean(), points[1].mean(), points[2].mean())
    xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        x, y, z = points[0, i] - middle[0], points[1, i] - middle[1], points[2, i] - middle[2]
        xx, yy, zz = xx + x * x, yy + y * y, zz + z * z
        xy, xz, yz = xy + x * y, xz + x * z, yz + y * z
    xx, yy, zz, xy, xz, yz = xx / count, yy / count, zz / count, xy / count, xz / count, yz / count
    x, z = _longest(xx, zz, xz)
    along = np.empty(count)
    for i in range(count):
        along[i] = x * (points[0, i] - middle[0]) + z * (points[2, i] - middle[2])
    return np.sqrt(max(0.0, least_eigenvalue(xx, yy, zz, xy, xz, yz))), along


@njit(cache=True, nogil=True)
def _longest(xx, zz, xz):
    """The eigenvector (x, z) of the larger eigenvalue of a symmetric matrix, as LAPACK directs it."""
    apart = xx - zz
    root = np.sqrt(apart * apart + 4.0 * xz * xz)
    x, z = (-apart - root, -2.0 * xz) if apart >= 0.0 else (2.0 * xz, root - apart)
    length = np.sqrt(x * x + z * z)
    return (x / length, z / length) if length > 0.0 else (0.0, 1.0)


@njit(cache=True, nogil=True)
def _built(points, along, ordered, ordered_along, bands):
    """Metres that (3, M) points are wide, tall, deep; crown, head, head_width, fill as of :class:`BlobShape`.

    Args:
        along: (M,) metres along the longest horizontal direction.
        ordered, ordered_along: both with each row's values rising.
        bands: (4, 2) as of ``widths_at``: the head's, and three in which the shoulders may be.
    """
    wide, tall = _spread(ordered[0], 0.03, 0.97), _spread(ordered[1], 0.03, 0.97)
    deep = _spread(ordered[2], 0.03, 0.97)
    crown = quantile(ordered[1], 0.99)
    widths = widths_at(along, points[1], crown, bands)
    box = _spread(ordered_along, 0.01, 0.99) * _spread(ordered[1], 0.01, 0.99)
    fill = filled_cells(along, points[1]) * GRID**2 / max(1e-6, box)
    return wide, tall, deep, crown, widths[0] / max(widths[1:].max(), BIN), widths[0], fill


@njit(cache=True, nogil=True)
def samples(points, pixels, most):
    """(3, M) every k-th of the (h, w, 3) points at (N,) places, in reading order; M < 2 ``most``."""
    step = max(1, len(pixels) // most)
    out, points = np.empty((3, (len(pixels) + step - 1) // step)), points.reshape(-1, 3)
    for i in range(out.shape[1]):
        for a in range(3):
            out[a, i] = points[pixels[i * step], a]
    return out
