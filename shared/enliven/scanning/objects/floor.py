"""Measures the floor plane in each image. Any part of the scene that moves relative to the floor is the
object.
"""

from __future__ import annotations

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float
from enliven.scanning.depth_view import DepthView
from enliven.scanning.ground_plane import GroundPlane

_FLOOR_BAND_M = 0.05
"""Points within this height of the known floor, metres, count as floor. It allows for misaligned images."""
_MIN_NORMAL_COSINE = 0.96
"""Minimum cosine (16 degrees) between a floor point's normal and the floor's."""
_FLOOR_RADIUS_M = 1.2
"""Radius around the object, metres, in which the floor is examined. Depth is noisy farther away."""
_MIN_FLOOR_POINTS = 200
"""Minimum number of floor points for estimating the floor."""
_PIXEL_STRIDE = 2
"""Every second half-size pixel is used, in each direction."""


def floor_plane(
    view: DepthView, world_from_camera: Float, ground: GroundPlane, middle: Float, object_pixels: Bool
) -> Float | None:
    """Fits the floor in an image relative to the known ground. Returns (3,): the height above the ground at
    ``middle``, metres, and two slopes. None if too little of the floor is visible.

    Args:
        middle: (3,) the point, world: the object's centre.
        object_pixels: (h, w) the object's pixels, which are not floor even if the object lies flat.
    """
    rotation_matrix = world_from_camera[:3, :3]
    subsample = (slice(None, None, _PIXEL_STRIDE), slice(None, None, _PIXEL_STRIDE))
    points = view.points[subsample] @ rotation_matrix.T + world_from_camera[:3, 3]
    heights = points @ ground.normal - ground.offset
    offsets = points - middle
    level = offsets - (offsets @ ground.normal)[..., None] * ground.normal
    floor = (
        (view.worth[subsample] > 0)
        & ~object_pixels[subsample]
        & (np.abs(heights) < _FLOOR_BAND_M)
        & (view.normals[subsample] @ rotation_matrix.T @ ground.normal > _MIN_NORMAL_COSINE)
        & (np.square(level).sum(-1) < _FLOOR_RADIUS_M**2)
    )
    if np.count_nonzero(floor) < _MIN_FLOOR_POINTS:
        return None
    tangent = rotation.unit(np.cross(ground.normal, np.eye(3)[np.abs(ground.normal).argmin()]))
    columns = np.stack(
        [np.ones(floor.sum()), level[floor] @ tangent, level[floor] @ np.cross(ground.normal, tangent)], 1
    )
    root = np.sqrt(view.worth[subsample][floor])[:, None]
    return np.asarray(np.linalg.lstsq(columns * root, heights[floor] * root[:, 0], rcond=None)[0])
