"""Background fill: the likely depth of never-seen background, behind people or beyond the sensor's range."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit

_PATCH_SIDE_PX = 31
"""Side in pixels of the square window in which known pixels around a pixel are counted."""
_MIN_PATCH_FRACTION = 0.12
"""Minimum fraction of known pixels in the window. A few known pixels may belong to a foot that the person's
mask missed."""
_FAR = 1e9
"""A distance in pixels that is larger than any image."""
_MIN_SINE = 1e-3
"""Minimum sine of a ray's angle below the horizon for it to meet the floor."""


def background_fill(z: Float, ray: Float, world_from_camera: Float, floor_band: float) -> Float:
    """Returns the background's depth (h, w) in metres, with values filled in at pixels that were never seen.

    The depth is 0 if nothing is known at all.

    The fill is the depth of the nearest known patch of several pixels. If the nearest patch belongs to the
    floor, the fill continues the floor plane, because its depth changes with the direction.

    Args:
        z: (h, w) metres along the optical axis; 0 where the background is not known.
        ray: (h, w, 2) x/z and y/z of the pixels.
        world_from_camera: (4, 4) the camera's pose.
        floor_band: metres above y = 0 up to which a point belongs to the floor.
    """
    pose = np.ascontiguousarray(world_from_camera)
    return np.asarray(_with_floor(z, fill_from_nearest(_patches(z, ray, pose, floor_band)), ray, pose))


@njit(cache=True, nogil=True, error_model="numpy")
def _patches(z, ray, pose, floor_band):
    """Returns (h, w) the depth at pixels with enough known neighbours, negated if they belong to the floor.
    Other pixels are 0.
    """
    height, width = z.shape
    out, enough = np.empty((height, width)), _MIN_PATCH_FRACTION * _PATCH_SIDE_PX * _PATCH_SIDE_PX
    around = _known_around(z)
    for v in range(height):
        for u in range(width):
            rise = ray[v, u, 0] * pose[1, 0] + ray[v, u, 1] * pose[1, 1] + pose[1, 2]
            value = -z[v, u] if rise * z[v, u] + pose[1, 3] < floor_band else z[v, u]
            out[v, u] = value if around[v, u] > enough else 0.0
    return out


@njit(cache=True, nogil=True)
def _known_around(z):
    """Returns (h, w) the number of known pixels in the window around each pixel, as a box filter.

    Beyond its border the image is mirrored.
    """
    height, width = z.shape
    columns, out = np.zeros(width, np.int32), np.empty((height, width), np.int32)
    rows, places = _mirrored_indices(height), _mirrored_indices(width)
    for v in range(_PATCH_SIDE_PX - 1):
        _add_row(columns, z[rows[v]], 1)
    for v in range(height):
        _add_row(columns, z[rows[v + _PATCH_SIDE_PX - 1]], 1)
        total = 0
        for u in range(_PATCH_SIDE_PX - 1):
            total += columns[places[u]]
        for u in range(width):
            total += columns[places[u + _PATCH_SIDE_PX - 1]]
            out[v, u] = total
            total -= columns[places[u]]
        _add_row(columns, z[rows[v]], -1)
    return out


@njit(cache=True, nogil=True)
def _mirrored_indices(size):
    """Returns the indices of a row of ``size`` that is extended by half a window at both ends, mirrored at
    its borders.
    """
    places = np.arange(-(_PATCH_SIDE_PX // 2), size + _PATCH_SIDE_PX // 2) % (2 * size)
    return np.minimum(places, 2 * size - 1 - places).astype(np.uint64)


@njit(cache=True, nogil=True)
def _add_row(columns, row, sign):
    """Adds ``sign`` to the count of each column that has a known pixel in the row."""
    for u in range(len(row)):
        columns[u] += sign if row[u] > 0.0 else 0


@njit(cache=True, nogil=True, error_model="numpy")
def _with_floor(z, fill, ray, pose):
    """Returns (h, w) the known depth, else the filled-in depth, else the floor plane if the fill is
    negative.
    """
    height, width = z.shape
    out = np.empty((height, width))
    for v in range(height):
        for u in range(width):
            rise = ray[v, u, 0] * pose[1, 0] + ray[v, u, 1] * pose[1, 1] + pose[1, 2]
            floor = max(-pose[1, 3] / min(rise, -_MIN_SINE), 0.0) if rise < -_MIN_SINE else 0.0
            likely = floor if fill[v, u] < 0.0 else fill[v, u]
            out[v, u] = z[v, u] if z[v, u] > 0.0 else likely
    return out


@njit(cache=True, nogil=True)
def fill_from_nearest(z):
    """Returns (h, w) the depth. Unknown pixels get the depth of the nearest known pixel.

    All depths are 0 if none is known.

    A forward and a backward chamfer pass propagate the value of the nearest known pixel. A border of one
    pixel with an infinite distance makes a test for the image's edges unnecessary.
    """
    height, width = z.shape
    out, far = np.zeros((height + 2, width + 2)), np.full((height + 2, width + 2), _FAR)
    for v in range(height):
        for u in range(width):
            if z[v, u] != 0.0:
                out[v + 1, u + 1], far[v + 1, u + 1] = z[v, u], 0.0
    for v in range(1, height + 1):
        for u in range(1, width + 1):
            if far[v, u] > 0.0:
                best = _nearer((far[v, u], out[v, u]), far[v, u - 1] + 1.0, out[v, u - 1])
                best = _nearer(best, far[v - 1, u] + 1.0, out[v - 1, u])
                best = _nearer(best, far[v - 1, u - 1] + 1.414, out[v - 1, u - 1])
                far[v, u], out[v, u] = _nearer(best, far[v - 1, u + 1] + 1.414, out[v - 1, u + 1])
    for v in range(height, 0, -1):
        for u in range(width, 0, -1):
            if far[v, u] > 0.0:
                best = _nearer((far[v, u], out[v, u]), far[v, u + 1] + 1.0, out[v, u + 1])
                best = _nearer(best, far[v + 1, u] + 1.0, out[v + 1, u])
                best = _nearer(best, far[v + 1, u + 1] + 1.414, out[v + 1, u + 1])
                far[v, u], out[v, u] = _nearer(best, far[v + 1, u - 1] + 1.414, out[v + 1, u - 1])
    return out[1:-1, 1:-1].copy()


@njit(cache=True, nogil=True)
def _nearer(best, away, value):
    """Returns the nearer of two (distance, value) pairs."""
    return (away, value) if away < best[0] else best
