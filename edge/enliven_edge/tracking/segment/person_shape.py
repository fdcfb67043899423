"""Decides by size and shape alone whether a blob of pixels may be a person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.segment.shape_kernels import (
    BIN,
    GRID,
    filled_cells,
    least_eigenvalue,
    outline_of_pixels,
    widths_at,
)

MIN_AREA_M2 = 0.06
"""Minimum visible area of a person in square metres: a head and a shoulder. Smaller blobs are noise or
objects."""
MAX_AREA_M2 = 1.6
"""Maximum visible area of a person in square metres: three times the usual."""
_MIN_RISE_M = 0.3
"""Minimum vertical extent of a person in metres, lying down."""
_MAX_WIDTH_M = 2.4
"""Maximum width of a person in metres, with arms spread or lying."""
_MAX_DEPTH_M = 1.6
"""Maximum depth extent of a person in metres, with arms or legs held forward."""
_MAX_CROWN_M = 2.6
"""Maximum crown height above the floor in metres: a tall person's raised hands."""
_FULL_AREA_M2 = 0.7
"""Upper limit in square metres to which the area is clipped when the likeness to a person is computed."""
_FULL_HEIGHT_M = 1.8
"""Upper limit in metres to which the height is clipped when the likeness to a person is computed."""
_FLAT_DEVIATION_M = 0.022
"""Standard deviation from the best plane, in metres, below which a blob is flat. A trunk is rounder."""
_MIN_PANEL_WIDTH_M = 0.35
"""Minimum width in metres of a flat blob that is a panel. A limb is flat, too, but narrower."""
_HEAD_BAND_M = 0.14
"""Depth in metres below the crown of the band that contains only the head: above the chin."""
_BANDS = np.array([(-1.0, _HEAD_BAND_M), (0.25, 0.35), (0.35, 0.45), (0.45, 0.55)])
"""(4, 2) start and end in metres below the crown of four bands: the head, and three bands that may contain
the shoulders.
"""
_MAX_HEAD_RATIO = 0.75
"""Maximum ratio of the head's width to that of the shoulders. A panel's is about 1."""
_HEAD_WIDTH = (0.09, 0.45)
"""Minimum and maximum width in metres at the height of the head: half hidden, and with hair or a hat."""
_MIN_BOX_FILL = 0.43
"""Minimum fraction of its upright bounding box that an upright person fills. Chairs and plants fill less."""
_SPREAD_BOX_FILL = 0.8
"""Maximum filled fraction of the upright bounding box of a blob with spread limbs."""
_PANEL_BOX_FILL = 0.85
"""If a flat blob fills more than this fraction of its upright bounding box, it is a panel even if its top is
narrow.
"""
_MIN_ROUND_DEVIATION_M = 0.035
"""Minimum standard deviation in metres from its best plane for a blob with spread limbs to be as round as a
body."""
_MIN_FREE_OUTLINE = 0.6
"""Minimum free fraction of the outline. A person stands in front of other surfaces, a wall does not."""
_MAX_OCCLUDED = 0.2
"""Maximum occluded fraction of the outline at which the crown counts as visible."""
_UNDECIDED_OCCLUSION = 0.6
"""If more than this fraction of the outline is occluded, the rest does not show whether the blob stands
free.
"""
_MAX_AT_BORDER = 0.03
"""Maximum fraction of the outline at the image border at which the crown counts as visible."""
_MIN_CUT_OUTLINE = 0.08
"""Minimum fraction of the outline at the image border for a blob that the image border cuts off."""
_SHAPE_SAMPLES = 1500
"""Approximate number of points for measuring a blob's shape. The cost grows with their number."""
_WALL_OFFSET_M = 1.0
"""Distance in metres added to the depth of a wall behind a blob, so that any blob stands free in front of
it."""


@dataclass(frozen=True)
class BlobShape:
    """The size and shape of a blob of pixels.

    Attributes:
        area: visible area in square metres, towards the sensor.
        size: height in metres, clipped to that of a person; 0 if its extents are not those of a person.
        crown: height of its top above the floor in metres.
        thickness: standard deviation from its best plane in metres.
        width: the larger of its two horizontal extents in metres.
        head_ratio: ratio of the filled width at the head's height to that at the shoulders' height; about 1
            for a panel.
        head_width: filled width at the head's height in metres.
        box_fill: filled fraction of its upright bounding box.
        free_fraction: fraction of its outline, at the sides and the top, beyond which the sensor sees
            farther. A person stands in front of other surfaces. A patch of a wall ends at the next object or
            at the image border.
        occluded_fraction: fraction of its outline that borders on a nearer object, which may hide more of the
            blob.
        border_fraction: fraction of its outline that is the image border.
        is_cut_off: whether it extends beyond the lower image border.
    """

    area: float
    size: float
    crown: float
    thickness: float
    width: float
    head_ratio: float
    head_width: float
    box_fill: float
    free_fraction: float
    occluded_fraction: float
    border_fraction: float
    is_cut_off: bool

    @property
    def likeness(self) -> float:
        """Returns the likeness to a person by size alone: area times height in cubic metres.

        It is 0 if the size is not a person's.
        """
        return min(self.area, _FULL_AREA_M2) * self.size if MIN_AREA_M2 < self.area < MAX_AREA_M2 else 0.0

    @property
    def may_be_person(self) -> bool:
        """Returns True if the blob may be a person in any posture.

        It has a person's size, is not a flat panel, and stands free at its sides.
        """
        flat = self.thickness < _FLAT_DEVIATION_M and self.width > _MIN_PANEL_WIDTH_M
        panel = flat and not (self._has_head and self.box_fill < _PANEL_BOX_FILL)
        return (
            self.likeness > 0
            and not panel
            and self.crown < _MAX_CROWN_M
            and self._free_outline_fraction > _MIN_FREE_OUTLINE
        )

    @property
    def is_upright(self) -> bool:
        """Returns True if the blob has the shape of a standing or sitting person, which has a head above
        shoulders.
        """
        return self.may_be_person and self._has_head and self.box_fill > _MIN_BOX_FILL

    @property
    def _free_outline_fraction(self) -> float:
        """Returns the free fraction of the unoccluded outline.

        Occluded parts are excluded, because others may hide much of a person in a crowd.
        """
        return (
            self.free_fraction / max(1e-6, 1.0 - self.occluded_fraction)
            if self.occluded_fraction < _UNDECIDED_OCCLUSION
            else 0.0
        )

    @property
    def _has_head(self) -> bool:
        """Returns True if the blob's top is as wide as a head, and the blob is wider below."""
        low, high = _HEAD_WIDTH
        return self.head_ratio < _MAX_HEAD_RATIO and low < self.head_width < high

    @property
    def has_person_shape(self) -> bool:
        """Returns True for the shape of most people: upright, cut off by the image, or with spread limbs."""
        limbs = self.box_fill < _SPREAD_BOX_FILL and self.thickness > _MIN_ROUND_DEVIATION_M
        return self.is_upright or (
            self.may_be_person and (self.is_cut_off or limbs or self.border_fraction > _MIN_CUT_OUTLINE)
        )

    @property
    def shows_crown(self) -> bool:
        """Returns True if the blob's whole upper end is visible, so that its crown is the person's crown."""
        return self.occluded_fraction < _MAX_OCCLUDED and self.border_fraction < _MAX_AT_BORDER


def measure_shape(view: FrameView, mask: Bool, area: float, walls: Bool | None = None) -> BlobShape:
    """Returns the shape of the (h, w) masked pixels, which cover ``area`` square metres towards the sensor.

    Args:
        view: the frame.
        mask: (h, w) the blob.
        area: visible area in square metres.
        walls: (h, w) pixels of a wall that counts as far behind the mask, even if it is near.
    """
    z = view.z if walls is None else view.z + _WALL_OFFSET_M * walls
    pixels = pixels_of(mask)
    free, behind, border, cut = outline_of_pixels(z, mask, pixels)
    points = samples(view.points, pixels, _SHAPE_SAMPLES)
    thickness, along = measure_plane_deviation(points)
    ordered = np.sort(points, axis=1)
    wide, tall, deep, crown, head, head_width, fill = _shape_measures(
        points, along, ordered, np.sort(along), _BANDS
    )
    size = (
        min(tall, _FULL_HEIGHT_M)
        if tall >= _MIN_RISE_M and wide <= _MAX_WIDTH_M and deep <= _MAX_DEPTH_M
        else 0.0
    )
    wide = max(wide, deep)
    return BlobShape(area, size, crown, thickness, wide, head, head_width, fill, free, behind, border, cut)


@njit(cache=True, nogil=True)
def _spread(ordered, low, high):
    """Returns the distance between two quantiles of (N,) ascending values."""
    return quantile(ordered, high) - quantile(ordered, low)


@njit(cache=True, nogil=True)
def measure_plane_deviation(points):
    """Returns the standard deviation of (3, M) points from their best plane, and (M,) coordinates, in metres.

    The coordinates are measured from the points' mean along their longest horizontal direction.
    """
    count, middle = points.shape[1], (points[0].mean(), points[1].mean(), points[2].mean())
    xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        x, y, z = points[0, i] - middle[0], points[1, i] - middle[1], points[2, i] - middle[2]
        xx, yy, zz = xx + x * x, yy + y * y, zz + z * z
        xy, xz, yz = xy + x * y, xz + x * z, yz + y * z
    xx, yy, zz, xy, xz, yz = xx / count, yy / count, zz / count, xy / count, xz / count, yz / count
    x, z = _principal_axis(xx, zz, xz)
    along = np.empty(count)
    for i in range(count):
        along[i] = x * (points[0, i] - middle[0]) + z * (points[2, i] - middle[2])
    return np.sqrt(max(0.0, least_eigenvalue(xx, yy, zz, xy, xz, yz))), along


@njit(cache=True, nogil=True)
def _principal_axis(xx, zz, xz):
    """Returns the eigenvector (x, z) of the larger eigenvalue of a symmetric matrix, with LAPACK's sign."""
    apart = xx - zz
    root = np.sqrt(apart * apart + 4.0 * xz * xz)
    x, z = (-apart - root, -2.0 * xz) if apart >= 0.0 else (2.0 * xz, root - apart)
    length = np.sqrt(x * x + z * z)
    return (x / length, z / length) if length > 0.0 else (0.0, 1.0)


@njit(cache=True, nogil=True)
def _shape_measures(points, along, ordered, ordered_along, bands):
    """Returns width, height and depth of (3, M) points in metres, and crown, head, head_width and fill.

    The last four are defined in :class:`BlobShape`.

    Args:
        points: (3, M) metres, world frame.
        along: (M,) coordinates in metres along the longest horizontal direction.
        ordered, ordered_along: both with each row's values ascending.
        bands: (4, 2) in the form of ``widths_at``: the head's, and three that may contain the shoulders.
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
    """Returns (3, M) every k-th of the (h, w, 3) points at (N,) flat indices, in reading order.

    M is less than ``2 * most``.
    """
    step = max(1, len(pixels) // most)
    out, points = np.empty((3, (len(pixels) + step - 1) // step)), points.reshape(-1, 3)
    for i in range(out.shape[1]):
        for a in range(3):
            out[a, i] = points[pixels[i * step], a]
    return out
