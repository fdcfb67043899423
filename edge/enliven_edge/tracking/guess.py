"""How deep the room is likely to be where it was never seen: behind people, beyond what is measured."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import ndimage

from enliven.arrays import Float

_PATCH, _PATCHED = 31, 0.12
"""Pixels of a square, and the share of it that must be known to say something of the room about it."""
_FAR = 1e9
"""Pixels: farther than anything in an image is from what is known."""
_LEVEL = 1e-3
"""Sine below the horizon from which a ray meets the floor."""


def guessed(z: Float, ray: Float, world_from_camera: Float, floor_band: float) -> Float:
    """(h, w) the room's depth, and where it was never seen what it is likely to be; 0 where nothing says so.

    As deep as the nearest patch that is known; but by the floor only the floor is known, not what stands on
    it. A few pixels say nothing: the tip of a foot that was left out of somebody.

    Args:
        z: (h, w) metres along the optical axis; 0 where nothing is known.
        ray: (h, w, 2) x/z and y/z of the pixels.
        floor_band: metres above the floor below which something belongs to it.
    """
    rise = ray @ world_from_camera[1, :2] + world_from_camera[1, 2]
    height = world_from_camera[1, 3]
    patches = ndimage.uniform_filter((z > 0).astype(np.float32), _PATCH) > _PATCHED
    made = filled(np.where(patches, np.where(rise * z + height < floor_band, -z, z), 0.0))
    made = np.where(z > 0, z, made)
    floor = np.where(rise < -_LEVEL, -height / np.minimum(rise, -_LEVEL), 0.0)
    return np.asarray(np.where(made < 0.0, np.maximum(floor, 0.0), made))


def filled(z: Float) -> Float:
    """(h, w) the depth, and where it is not known that of the nearest known pixel (two chamfer passes).

    All 0 where nothing is known.
    """
    return np.asarray(_filled(z))


@njit(cache=True, nogil=True)
def _filled(z):  # type: ignore[no-untyped-def]
    """A forward and a backward pass that hand on the value of the nearest known pixel.

    Within a border of one pixel from which everything is far: it spares the passes their looks at the edges.
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
def _nearer(best, away, value):  # type: ignore[no-untyped-def]
    """The nearer of two, each a distance and the value there."""
    return (away, value) if away < best[0] else best
