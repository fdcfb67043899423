"""Distances of an image's points from a fused surface. They decide which points belong to the surface."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32
from enliven.kernels import njit, run_in_pieces
from enliven.scanning.depth_view import DepthView
from enliven.scanning.icp import interpolate_field
from enliven.scanning.tsdf_volume import TsdfVolume

_ROWS_PER_PIECE = 16
"""Rows of points that a thread processes at a time."""


def surface_distances(volume: TsdfVolume, view: DepthView, world_from_camera: Float) -> Float32:
    """Returns (h, w) signed distances, metres, of a view's points from a volume's surface (positive in front
    of it), NaN if unknown.

    Args:
        world_from_camera: (4, 4) pose of the camera in the volume's world.
    """
    distances = np.full(view.worth.shape, np.nan, np.float32)
    run_in_pieces(
        _fill_distances,
        len(distances),
        _ROWS_PER_PIECE,
        view.point_arrays,
        world_from_camera,
        volume.field,
        distances,
    )
    return distances


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_distances(points, pose, field, found, first, last):
    """Fills the rows ``first`` to ``last`` of (h, w) distances, metres. The distances of points without
    weight stay unchanged."""
    sample, cache = np.empty(4), np.empty(4, np.int64)
    cache[0], cache[1] = -1, np.int64(1) << 40
    for v in range(first, last):
        for u in range(found.shape[1]):
            if points.worth[v, u] == 0.0:
                continue
            px, py, pz = points.places[v, u, 0], points.places[v, u, 1], points.places[v, u, 2]
            x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
            y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
            z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
            if interpolate_field(field, x, y, z, sample, cache):
                found[v, u] = sample[0]
