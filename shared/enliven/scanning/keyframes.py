"""Keyframes: small depth images with their poses, for relocalization of a lost camera."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import pose_difference

_ROWS = 15
"""Number of cell rows in a reduced image. If the camera moves by a few centimetres, only a few cells change
much."""
_COLUMNS = 20
"""Number of cell columns in a reduced image."""
_MIN_KEYFRAME_DISTANCE_M = 0.15
"""Minimum distance between neighbouring keyframes, metres. From a smaller distance, tracking can recover the
pose."""
_MIN_KEYFRAME_ROTATION = 0.2
"""Minimum rotation between neighbouring keyframes, radians (11 degrees): a sixth of a camera's field of
view."""
_MIN_SHARED_CELLS = 0.3
"""Minimum fraction of cells that must be known in both images for a comparison."""


class Keyframes:
    """A database of past camera poses, searched by the similarity of their depth images."""

    def __init__(self) -> None:
        self._small: list[Float32] = []
        self._poses: list[Float] = []

    def __len__(self) -> int:
        return len(self._poses)

    def offer(self, view: DepthView, world_from_camera: Float) -> bool:
        """Stores an image if no keyframe is near its pose. Returns True if the image was stored."""
        for pose in self._poses:
            distance, angle = pose_difference(pose, world_from_camera)
            if distance < _MIN_KEYFRAME_DISTANCE_M and angle < _MIN_KEYFRAME_ROTATION:
                return False
        self._small.append(reduce_view(view))
        self._poses.append(world_from_camera.copy())
        return True

    def find_nearest(self, view: DepthView, count: int) -> list[Float]:
        """Returns the (4, 4) poses of the most similar images, most similar first."""
        reduced = reduce_view(view)
        differences = image_differences(reduced, self._small)
        order = np.argsort(differences, kind="stable")[:count]
        return [self._poses[n] for n in order if np.isfinite(differences[n])]


def image_differences(reduced: Float32, others: list[Float32]) -> Float:
    """Returns (N,) mean differences in inverse depth (1/m) between a reduced image and N other reduced
    images. A difference is inf if the two share too few known cells.
    """
    differences = []
    for other_image in others:
        known_in_both = (reduced > 0) & (other_image > 0)
        shared_fraction = known_in_both.mean()
        differences.append(
            np.abs(reduced - other_image)[known_in_both].mean() / shared_fraction
            if shared_fraction > _MIN_SHARED_CELLS
            else np.inf
        )
    return np.array(differences)


def reduce_view(view: DepthView) -> Float32:
    """Returns a view reduced to (15, 20) cells: the mean inverse depth (1/m) of the points in each cell, or 0
    for a cell with too few points.
    """
    depth = view.points[..., 2]
    height, width = depth.shape
    rows = np.arange(height) * _ROWS // height
    columns = np.arange(width) * _COLUMNS // width
    cell = (rows[:, None] * _COLUMNS + columns).reshape(-1)
    is_known = depth.reshape(-1) > 0
    inverse = np.where(is_known, 1.0 / np.where(is_known, depth.reshape(-1), 1.0), 0.0)
    total = np.bincount(cell, inverse, _ROWS * _COLUMNS)
    counts = np.bincount(cell, is_known, _ROWS * _COLUMNS)
    has_enough_pixels = counts * 4 > np.bincount(cell, minlength=_ROWS * _COLUMNS)
    return (
        np.where(has_enough_pixels, total / np.maximum(counts, 1), 0.0)
        .astype(np.float32)
        .reshape(_ROWS, _COLUMNS)
    )
