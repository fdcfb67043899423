"""Free space of images: where a camera saw through, no surface can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32
from enliven.camera import Intrinsics
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import inverse

_THIN = 4
"""Half-size pixels to one that is kept."""
_NEAREST = 0.2
"""Metres before a camera, nearer than which it sees nothing."""
_LOOKS = 2
"""Images that must see through a place: one may have been wrong."""


@dataclass(frozen=True)
class SeenDepth:
    """How far a camera saw, small.

    Attributes:
        depth: (h, w) float32 metres, the nearest about each pixel; 0 where it is not known.
        intrinsics: of the full image, of which a pixel here is ``scale`` wide.
        frame_from_camera: (4, 4).
    """

    depth: Float32
    intrinsics: Intrinsics
    scale: float
    frame_from_camera: Float


def seen_depth(view: DepthView, frame_from_camera: Float) -> SeenDepth:
    """Returns how far a view saw; before a hand there is nothing, either."""
    z = np.where(view.worth > 0, view.points[..., 2], 0.0)
    height, width = (side // _THIN for side in z.shape)
    tiles = z[: height * _THIN, : width * _THIN].reshape(height, _THIN, width, _THIN)
    # The nearest of a tile; not known where some of it is not: an edge runs through it.
    nearest = np.where((tiles > 0).all((1, 3)), tiles.min((1, 3)), 0.0).astype(np.float32)
    return SeenDepth(nearest, view.intrinsics, 2.0 * _THIN, frame_from_camera)


def seen_through(points: Float, views: Sequence[SeenDepth], clearance: float) -> Bool:
    """Returns (N,) which points lie at least ``clearance`` metres before what two of the images saw there."""
    count = np.zeros(len(points), int)
    for view in views:
        back = inverse(view.frame_from_camera)
        local = points @ back[:3, :3].T + back[:3, 3]
        ahead = np.flatnonzero(local[:, 2] > _NEAREST)
        x, y, z = local[ahead].T
        lens = view.intrinsics
        column = np.floor((lens.fx * x / z + lens.cx + 0.5) / view.scale).astype(int)
        row = np.floor((lens.fy * y / z + lens.cy + 0.5) / view.scale).astype(int)
        inside = (column >= 0) & (row >= 0) & (row < view.depth.shape[0]) & (column < view.depth.shape[1])
        seen = view.depth[row[inside], column[inside]]
        count[ahead[inside][(seen > 0) & (z[inside] < seen - clearance)]] += 1
    return np.asarray(count >= _LOOKS)
