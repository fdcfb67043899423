"""Keyframes: small depth images with their poses, for relocalization of a lost camera."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import pose_difference

_ROWS = 15
"""Cells down a small image. A hand-sized shift of the camera changes only a few of them much."""
_COLUMNS = 20
"""Cells across a small image."""
_MIN_KEYFRAME_DISTANCE_M = 0.15
"""Minimum distance between neighbouring keyframes, metres. Tracking can recover the pose from a keyframe at a
smaller distance."""
_MIN_KEYFRAME_ROTATION = 0.2
"""Minimum rotation between neighbouring keyframes, radians (11 degrees): a sixth of a camera's field of
view."""
_MIN_SHARED_CELLS = 0.3
"""Minimum fraction of cells that must be known in both images for a comparison."""


class Keyframes:
    """Past camera poses that are found again by the similarity of their depth images."""

    def __init__(self) -> None:
        self._small: list[Float32] = []
        self._poses: list[Float] = []

    def __len__(self) -> int:
        return len(self._poses)

    def offer(self, view: DepthView, world_from_camera: Float) -> bool:
        """Stores an image if no keyframe is near its pose. Returns whether it was stored."""
        for pose in self._poses:
            move, turn = pose_difference(pose, world_from_camera)
            if move < _MIN_KEYFRAME_DISTANCE_M and turn < _MIN_KEYFRAME_ROTATION:
                return False
        self._small.append(reduce_view(view))
        self._poses.append(world_from_camera.copy())
        return True

    def nearest(self, view: DepthView, count: int) -> list[Float]:
        """Returns the (4, 4) poses of the most similar images, most similar first."""
        small = reduce_view(view)
        unlike = image_differences(small, self._small)
        order = np.argsort(unlike, kind="stable")[:count]
        return [self._poses[n] for n in order if np.isfinite(unlike[n])]


def image_differences(small: Float32, others: list[Float32]) -> Float:
    """Returns (N,) differences of reduced images from one, 1/m; inf if they have too few known cells in
    common.
    """
    unlike = []
    for other in others:
        both = (small > 0) & (other > 0)
        share = both.mean()
        unlike.append(np.abs(small - other)[both].mean() / share if share > _MIN_SHARED_CELLS else np.inf)
    return np.array(unlike)


def reduce_view(view: DepthView) -> Float32:
    """Returns (15, 20) means of the inverse depth of a view's points; 0 for a cell with too few points."""
    depth = view.points[..., 2]
    height, width = depth.shape
    rows = np.arange(height) * _ROWS // height
    columns = np.arange(width) * _COLUMNS // width
    cell = (rows[:, None] * _COLUMNS + columns).reshape(-1)
    is_known = depth.reshape(-1) > 0
    inverse = np.where(is_known, 1.0 / np.where(is_known, depth.reshape(-1), 1.0), 0.0)
    total = np.bincount(cell, inverse, _ROWS * _COLUMNS)
    counts = np.bincount(cell, is_known, _ROWS * _COLUMNS)
    enough = counts * 4 > np.bincount(cell, minlength=_ROWS * _COLUMNS)
    return np.where(enough, total / np.maximum(counts, 1), 0.0).astype(np.float32).reshape(_ROWS, _COLUMNS)
