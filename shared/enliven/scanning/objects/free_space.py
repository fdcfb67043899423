"""Free-space test: no surface can lie at points that a camera saw through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32
from enliven.camera import Intrinsics
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import invert_pose

_SUBSAMPLING = 4
"""Subsampling factor from half-size pixels to the stored image."""
_MIN_SENSOR_DISTANCE_M = 0.2
"""Minimum distance, metres, at which a camera can measure a surface."""
_MIN_IMAGES = 2
"""Minimum number of images that must see through a point, because a single image may be wrong."""


@dataclass(frozen=True)
class SeenDepth:
    """A reduced depth image.

    Attributes:
        depth: (h, w) float32 metres, the nearest around each pixel; 0 if unknown.
        intrinsics: intrinsics of the full image. A pixel of the reduced image is ``scale`` full pixels wide.
        frame_from_camera: (4, 4) pose of the camera.
    """

    depth: Float32
    intrinsics: Intrinsics
    scale: float
    frame_from_camera: Float


def seen_depth(view: DepthView, frame_from_camera: Float) -> SeenDepth:
    """Returns the reduced depth of a view. It includes all surfaces, even hands, because the space in front
    of a hand is also free.
    """
    z = np.where(view.worth > 0, view.points[..., 2], 0.0)
    height, width = (side // _SUBSAMPLING for side in z.shape)
    tiles = z[: height * _SUBSAMPLING, : width * _SUBSAMPLING].reshape(
        height, _SUBSAMPLING, width, _SUBSAMPLING
    )
    # Use the nearest depth of each tile. If any pixel of a tile is unknown, the tile is unknown, because it
    # contains an edge.
    nearest = np.where((tiles > 0).all((1, 3)), tiles.min((1, 3)), 0.0).astype(np.float32)
    return SeenDepth(nearest, view.intrinsics, 2.0 * _SUBSAMPLING, frame_from_camera)


def seen_through(points: Float, views: Sequence[SeenDepth], clearance: float) -> Bool:
    """Returns (N,) True for points that lie at least ``clearance`` metres in front of the observed depth in
    at least two images.
    """
    count = np.zeros(len(points), int)
    for view in views:
        camera_from_frame = invert_pose(view.frame_from_camera)
        local = points @ camera_from_frame[:3, :3].T + camera_from_frame[:3, 3]
        in_front = np.flatnonzero(local[:, 2] > _MIN_SENSOR_DISTANCE_M)
        x, y, z = local[in_front].T
        lens = view.intrinsics
        column = np.floor((lens.fx * x / z + lens.cx + 0.5) / view.scale).astype(int)
        row = np.floor((lens.fy * y / z + lens.cy + 0.5) / view.scale).astype(int)
        inside = (column >= 0) & (row >= 0) & (row < view.depth.shape[0]) & (column < view.depth.shape[1])
        depths = view.depth[row[inside], column[inside]]
        count[in_front[inside][(depths > 0) & (z[inside] < depths - clearance)]] += 1
    return np.asarray(count >= _MIN_IMAGES)
