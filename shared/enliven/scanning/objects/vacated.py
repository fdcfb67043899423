"""Detects a surface that has moved away: a new image sees through its former position."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter

from enliven.arrays import Float
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import invert_pose

_MIN_SENSOR_DISTANCE_M = 0.2
"""Minimum distance, metres, at which a camera can measure a surface."""
_DEPTH_WINDOW_PX = 3
"""Side of the window around a pixel, in half-size pixels, over which the minimum depth is taken. At an edge,
a point may be projected to a neighbouring pixel."""
_MIN_POINTS = 50
"""Minimum number of visible points for a decision."""


def compute_vacated_fraction(
    points: Float, view: DepthView, world_from_camera: Float, clearance: float
) -> float:
    """Returns the fraction, 0 to 1, of the visible points (N, 3) that an image saw through.

    Occluded points (behind the observed depth) are ignored, as are points at pixels with unknown depth.

    Args:
        clearance: minimum distance of a seen-through point in front of the observed depth, metres.
    """
    camera_from_world = invert_pose(world_from_camera)
    local = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    x, y, z = local[local[:, 2] > _MIN_SENSOR_DISTANCE_M].T
    # Set unknown depth to 1e9, so that the minimum around a pixel considers only known depth.
    depth = np.where(view.worth > 0, view.points[..., 2], np.float32(1e9))
    nearest = minimum_filter(depth, _DEPTH_WINDOW_PX, mode="nearest")
    lens = view.intrinsics
    column = np.floor((lens.fx * x / z + lens.cx + 0.5) / 2).astype(int)
    row = np.floor((lens.fy * y / z + lens.cy + 0.5) / 2).astype(int)
    inside = (column >= 0) & (row >= 0) & (row < depth.shape[0]) & (column < depth.shape[1])
    measured, z = nearest[row[inside], column[inside]], z[inside]
    is_visible = (measured < 1e8) & (z < measured + clearance)
    count = int(np.count_nonzero(is_visible))
    return (
        float(np.count_nonzero(is_visible & (z < measured - clearance))) / count
        if count >= _MIN_POINTS
        else 0.0
    )
