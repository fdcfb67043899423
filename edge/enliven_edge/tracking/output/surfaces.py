"""The visible surface of each performer, for meshes that follow it without a skeleton."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int16
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.kernels import njit
from enliven_edge.tracking.frame.observation import FrameView, sample_pixels, surface_samples


def collect_visible_surfaces(
    view: FrameView, owner: Int16, ids: Int, points: int = 1200
) -> dict[int, ObservedPoints]:
    """Returns points and normals of each performer's visible surface, by id, in the world frame.

    Args:
        view: the frame.
        owner: (h, w) the person at each pixel, an index into ``ids``; -1 without a person.
        ids: (K,) ids of people; negative for a person who is not a performer.
        points: maximum number of points per performer.
    """
    surfaces = {}
    for index, person in enumerate(ids.tolist()):
        mask = pixels_with_normal(view.z, owner, index)
        if person >= 0 and mask.any():
            samples, normals = surface_samples(view.points, view.z, sample_pixels(mask, points), view.eye)
            surfaces[person] = ObservedPoints(samples, normals)
    return surfaces


def mirror_surfaces(
    surfaces: dict[int, ObservedPoints], point: Float, normal: Float
) -> dict[int, ObservedPoints]:
    """Mirrors the surfaces at the plane through ``point`` (3,) with the unit ``normal`` (3,)."""
    flip = np.eye(3) - 2 * np.outer(normal, normal)
    return {
        person: ObservedPoints((surface.points - point) @ flip + point, surface.normals @ flip)
        for person, surface in surfaces.items()
    }


@njit(cache=True, nogil=True)
def pixels_with_normal(z, owner, index):
    """Returns the (h, w) pixels of a person who have a measurable normal.

    All their neighbours belong to the person and have a similar depth. At a silhouette the normal is not
    measurable, and a mesh that follows wrong normals drifts away from the person.
    """
    height, width = z.shape
    out = np.zeros((height, width), np.bool_)
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            if owner[v, u] != index or z[v, u] <= 0.0:
                continue
            low, high, own = z[v, u], z[v, u], True
            for dv in range(-1, 2):
                for du in range(-1, 2):
                    own = own and owner[v + dv, u + du] == index
                    low, high = min(low, z[v + dv, u + du]), max(high, z[v + dv, u + du])
            out[v, u] = own and low > 0.0 and high - low < 0.03 + 0.02 * low
    return out
