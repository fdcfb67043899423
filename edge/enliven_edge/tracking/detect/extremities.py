"""Geodesic extremities of a person's surface: hands, feet and head are farthest along it from the trunk.

The method follows Plagemann et al. 2010. The first extremity has the greatest geodesic distance from the
middle of the surface. The next one is farthest from the middle and the first extremity, and so on. A path may
cross a depth edge at a cost. So a forearm in front of the chest is geodesically far from the chest, although
both are close in the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.heap import pop, push
from enliven.kernels import njit
from enliven_edge.tracking.frame.observation import world_points

_NODES = 1200
"""Approximate number of pixels to which the surface is thinned: 2 to 3 cm apart on a person, enough to find a
hand."""
DEPTH_EDGE_COST_M = 1.0
"""Additional cost in metres of a path across a depth edge. It is longer than the path along an arm that is
held in front of the chest."""


@dataclass(frozen=True)
class Extremities:
    """The extremities of a surface, the farthest first.

    Attributes:
        points: (K, 3) metres, world frame, on the surface.
        surface_distances: (K,) geodesic distance in metres to the middle or the nearest earlier extremity,
            whichever is nearer.
    """

    points: Float
    surface_distances: Float


def find_extremities(
    z: Float, mask: Bool, camera: Float, pose: Float, count: int = 6, nearest: float = 0.25
) -> Extremities:
    """Finds at most ``count`` extremities, each more than ``nearest`` metres from all previous ones.

    Args:
        z: (h, w) metres along the optical axis.
        mask: (h, w) the person's pixels.
        camera: (4,) fx, fy, cx, cy in pixels of this image.
        pose: (4, 4) world_from_camera.
        count: maximum number of extremities.
        nearest: metres along the surface.
    """
    step = max(1, int(np.sqrt(np.count_nonzero(mask) / _NODES)))
    depth = np.ascontiguousarray(z[::step, ::step])
    # Use one memory layout for all steps. Numba compiles or loads a kernel again for each layout.
    thinned = _solid_pixels(depth, np.ascontiguousarray(mask[::step, ::step]), step)
    if not thinned.any():
        return Extremities(np.zeros((0, 3)), np.zeros(0))
    points = _pixel_points(depth, step, camera, pose)
    body_points = points[thinned]
    middle = np.median(body_points, axis=0)
    source = int(np.flatnonzero(thinned)[np.argmin(np.linalg.norm(body_points - middle, axis=1))])
    cell = np.empty(count, np.int64)
    far = np.empty(count)
    distance = np.full(thinned.shape, np.inf)
    extend_distances(points, depth, thinned, step, source, distance)
    kept_count = 0
    for k in range(count):
        reached = np.where(np.isfinite(distance), distance, -1.0)
        cell[k] = int(np.argmax(reached))
        far[k] = reached.flat[cell[k]]
        if far[k] < nearest:
            break
        kept_count += 1
        extend_distances(points, depth, thinned, step, cell[k], distance)
    return Extremities(points.reshape(-1, 3)[cell[:kept_count]], far[:kept_count])


def _pixel_points(z: Float, step: int, camera: Float, pose: Float) -> Float:
    """Returns (h, w, 3) world-frame points of every ``step``-th pixel."""
    fx, fy, cx, cy = camera
    ray = np.empty((*z.shape, 2))
    ray[..., 0] = (np.arange(z.shape[1]) * float(step) - cx) / fx
    ray[..., 1] = ((np.arange(z.shape[0]) * float(step) - cy) / fy)[:, None]
    return world_points(z, ray, pose)


@njit(cache=True, nogil=True, inline="always")
def _is_depth_edge(here, there, step):
    """Returns True if two depths in metres, ``step`` pixels apart, are not on one surface."""
    return abs(there - here) > step * (0.02 + 0.008 * here * here)


@njit(cache=True, nogil=True)
def _solid_pixels(z, mask, step):
    """Returns (h, w) the masked pixels with three neighbours on the same surface.

    The condition removes stray depth at edges.
    """
    height, width = mask.shape
    out = np.zeros((height, width), np.bool_)
    for v in range(height):
        for u in range(width):
            beside = -1
            for q in range(max(0, v - 1), min(height, v + 2)):
                for p in range(max(0, u - 1), min(width, u + 2)):
                    if mask[q, p] and mask[v, u] and not _is_depth_edge(z[v, u], z[q, p], step):
                        beside += 1
            out[v, u] = beside >= 3
    return out


@njit(cache=True, nogil=True)
def extend_distances(points, z, mask, step, source, distance):
    """Runs Dijkstra's algorithm from one more source: lowers ``distance`` where the new path is shorter.

    Args:
        points: (h, w, 3) metres.
        z: (h, w) metres.
        mask: (h, w) the surface.
        step: distance between neighbouring pixels, in pixels of the original image, for detecting depth
            edges.
        source: row * w + column.
        distance: (h, w) metres, updated.
    """
    height, width = mask.shape
    heap_key, heap_cell = np.empty(9 * height * width), np.empty(9 * height * width, np.int64)
    distance.flat[source] = 0.0
    size = push(heap_key, heap_cell, 0, 0.0, source)
    while size > 0:
        key, cell = heap_key[0], heap_cell[0]
        size = pop(heap_key, heap_cell, size)
        v, u = cell // width, cell % width
        if key > distance[v, u]:
            continue
        for q in range(max(0, v - 1), min(height, v + 2)):
            for p in range(max(0, u - 1), min(width, u + 2)):
                if not mask[q, p]:
                    continue
                square = 0.0
                for a in range(3):
                    square += (points[q, p, a] - points[v, u, a]) ** 2
                cost = np.sqrt(square)
                if _is_depth_edge(z[v, u], z[q, p], step):
                    cost += DEPTH_EDGE_COST_M
                if key + cost < distance[q, p] - 1e-9:
                    distance[q, p] = key + cost
                    size = push(heap_key, heap_cell, size, key + cost, q * width + p)
