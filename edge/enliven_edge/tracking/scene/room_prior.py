"""The likely depth of the room where it was never seen: behind people, beyond what is measured."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit

_PATCH = 31
"""Pixels of the side of a square around a pixel, which shows whether the room is known there."""
_PATCHED = 0.12
"""Share of the square that must be known: a few pixels may be the tip of a foot left out of a person."""
_FAR = 1e9
"""Pixels: farther than any two pixels of an image are apart."""
_LEVEL = 1e-3
"""Sine below the horizon from which a ray meets the floor."""


def background_fill(z: Float, ray: Float, world_from_camera: Float, floor_band: float) -> Float:
    """(h, w) metres: the room's depth, filled in where it was never seen; 0 where nothing is known at all.

    The fill is the depth of the nearest known patch. A patch of the floor is continued as the floor's plane,
    because it says nothing of what stands on it. A few known pixels are no patch.

    Args:
        z: (h, w) metres along the optical axis; 0 where the room is not known.
        ray: (h, w, 2) x/z and y/z of the pixels.
        floor_band: metres above y = 0 up to which a point belongs to the floor.
    """
    pose = np.ascontiguousarray(world_from_camera)
    return np.asarray(_with_floor(z, filled(_patches(z, ray, pose, floor_band)), ray, pose))


@njit(cache=True, nogil=True, error_model="numpy")
def _patches(z, ray, pose, floor_band):
    """(h, w) the depth where enough is known around a pixel, less than 0 on the floor; 0 elsewhere."""
    height, width = z.shape
    out, enough = np.empty((height, width)), _PATCHED * _PATCH * _PATCH
    around = _known_around(z)
    for v in range(height):
        for u in range(width):
            rise = ray[v, u, 0] * pose[1, 0] + ray[v, u, 1] * pose[1, 1] + pose[1, 2]
            value = -z[v, u] if rise * z[v, u] + pose[1, 3] < floor_band else z[v, u]
            out[v, u] = value if around[v, u] > enough else 0.0
    return out


@njit(cache=True, nogil=True)
def _known_around(z):
    """(h, w) the known pixels of the square around each; beyond its border the image is mirrored."""
    height, width = z.shape
    columns, out = np.zeros(width, np.int32), np.empty((height, width), np.int32)
    rows, places = _mirrored(height), _mirrored(width)
    for v in range(_PATCH - 1):
        _count(columns, z[rows[v]], 1)
    for v in range(height):
        _count(columns, z[rows[v + _PATCH - 1]], 1)
        total = 0
        for u in range(_PATCH - 1):
            total += columns[places[u]]
        for u in range(width):
            total += columns[places[u + _PATCH - 1]]
            out[v, u] = total
            total -= columns[places[u]]
        _count(columns, z[rows[v]], -1)
    return out


@njit(cache=True, nogil=True)
def _mirrored(size):
    """The mirrored place of each, from half a patch before the first of so many to half a patch after."""
    places = np.arange(-(_PATCH // 2), size + _PATCH // 2) % (2 * size)
    return np.minimum(places, 2 * size - 1 - places).astype(np.uint64)


@njit(cache=True, nogil=True)
def _count(columns, row, sign):
    """Adds the known pixels of a row to the numbers of each column, or takes them away."""
    for u in range(len(row)):
        columns[u] += sign if row[u] > 0.0 else 0


@njit(cache=True, nogil=True, error_model="numpy")
def _with_floor(z, made, ray, pose):
    """(h, w) the known depth, else the filled one, else the floor's where the filled one is less than 0."""
    height, width = z.shape
    out = np.empty((height, width))
    for v in range(height):
        for u in range(width):
            rise = ray[v, u, 0] * pose[1, 0] + ray[v, u, 1] * pose[1, 1] + pose[1, 2]
            floor = max(-pose[1, 3] / min(rise, -_LEVEL), 0.0) if rise < -_LEVEL else 0.0
            likely = floor if made[v, u] < 0.0 else made[v, u]
            out[v, u] = z[v, u] if z[v, u] > 0.0 else likely
    return out


@njit(cache=True, nogil=True)
def filled(z):
    """(h, w) the depth, and where it is not known that of the nearest known pixel; all 0 where none is known.

    A forward and a backward chamfer pass hand on the value of the nearest known pixel. A border of one
    pixel, from which everything is far, spares the passes a test for the edges.
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
    """The nearer of two, each a distance and the value there."""
    return (away, value) if away < best[0] else best
