"""Finds the nearest visible bone of each vertex. Occlusion is tested by ray traversal of a grid of faces."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.kernels import njit

_MAX_OUTWARD_COSINE = 0.2
"""Maximum cosine between the outward normal of a vertex and the direction to a bone inside the surface. With
a larger cosine the bone is outside."""
_FADE_EXPONENT = 4
"""If a bone replaces an occluded bone, its heat falls with this power of the distance. Of the tested
exponents, this one gave the weights closest to those that artists painted on ten rigs.
"""
MOST = 6
"""Maximum number of bones tested per vertex, the nearest first."""


@njit(cache=True, nogil=True)
def grid_of(vertices, faces, low, cell, size):
    """Builds a grid in CSR form: offsets (X Y Z + 1,) and the faces with bounding boxes that touch each
    cell."""
    total = size[0] * size[1] * size[2]
    offsets = np.zeros(total + 1, np.int64)
    spans = np.empty((faces.shape[0], 6), np.int64)
    for f in range(faces.shape[0]):
        for a in range(3):
            least = min(vertices[faces[f, 0], a], vertices[faces[f, 1], a], vertices[faces[f, 2], a])
            most = max(vertices[faces[f, 0], a], vertices[faces[f, 1], a], vertices[faces[f, 2], a])
            spans[f, a] = max(0, min(size[a] - 1, int((least - low[a]) / cell)))
            spans[f, 3 + a] = max(0, min(size[a] - 1, int((most - low[a]) / cell)))
        for x in range(spans[f, 0], spans[f, 3] + 1):
            for y in range(spans[f, 1], spans[f, 4] + 1):
                for z in range(spans[f, 2], spans[f, 5] + 1):
                    offsets[(x * size[1] + y) * size[2] + z + 1] += 1
    for c in range(total):
        offsets[c + 1] += offsets[c]
    fill, inside = offsets[:-1].copy(), np.empty(offsets[total], np.int32)
    for f in range(faces.shape[0]):
        for x in range(spans[f, 0], spans[f, 3] + 1):
            for y in range(spans[f, 1], spans[f, 4] + 1):
                for z in range(spans[f, 2], spans[f, 5] + 1):
                    c = (x * size[1] + y) * size[2] + z
                    inside[fill[c]] = f
                    fill[c] += 1
    return offsets, inside


@njit(cache=True, nogil=True)
def _line_triangle_hit(p, d, a, b, c):
    """Returns t where the line p + t d hits the triangle a, b, c, or -1 (T. Moeller and B. Trumbore,
    1997)."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px, py, pz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    det = ux * px + uy * py + uz * pz
    if det == 0.0:
        return -1.0
    sx, sy, sz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    s = (sx * px + sy * py + sz * pz) / det
    if s < 0.0 or s > 1.0:
        return -1.0
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    t = (d[0] * qx + d[1] * qy + d[2] * qz) / det
    if t < 0.0 or s + t > 1.0:
        return -1.0
    return (vx * qx + vy * qy + vz * qz) / det


@njit(cache=True, nogil=True)
def _is_hidden(v, target, vertices, normal, faces, offsets, inside, low, cell, size):
    """Returns True if the point ``target`` (3,) is on the outer side of the surface at vertex v, or if a face
    that does not touch v occludes it."""
    p = vertices[v]
    d = target - p
    if d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2] > _MAX_OUTWARD_COSINE * np.sqrt((d * d).sum()):
        return True
    # Set up the grid traversal of Amanatides and Woo: cell, direction, and next crossing per axis.
    at, step = np.empty(3, np.int64), np.empty(3, np.int64)
    ahead, each = np.empty(3), np.empty(3)
    for a in range(3):
        at[a] = max(0, min(size[a] - 1, int((p[a] - low[a]) / cell)))
        step[a] = 1 if d[a] > 0 else -1
        if d[a] == 0.0:
            ahead[a], each[a] = np.inf, np.inf
        else:
            border = low[a] + (at[a] + (1 if d[a] > 0 else 0)) * cell
            ahead[a], each[a] = (border - p[a]) / d[a], cell / abs(d[a])
    # Test the faces of each cell along the segment, then step to the next cell.
    while True:
        c = (at[0] * size[1] + at[1]) * size[2] + at[2]
        for m in range(offsets[c], offsets[c + 1]):
            i, j, k = faces[inside[m], 0], faces[inside[m], 1], faces[inside[m], 2]
            if i == v or j == v or k == v:
                continue
            t = _line_triangle_hit(p, d, vertices[i], vertices[j], vertices[k])
            if 1e-4 < t < 0.999:
                return True
        a = 0 if ahead[0] < ahead[1] else 1
        if ahead[2] < ahead[a]:
            a = 2
        if ahead[a] >= 1.0:
            return False
        at[a] += step[a]
        ahead[a] += each[a]
        if at[a] < 0 or at[a] >= size[a]:
            return False


@njit(cache=True, nogil=True)
def _nearest_seen_kernel(vertices, normals, faces, segments, offsets, inside, low, cell, size, tie):
    """Finds the segments and distances of :func:`find_nearest_seen` (kernel)."""
    count, some = vertices.shape[0], min(MOST, segments.shape[0])
    chosen = np.full((count, some), -1, np.int32)
    distance = np.full(count, np.inf)
    near, who, points = np.empty(some), np.empty(some, np.int64), np.empty((some, 3))
    for v in range(count):
        # Find the nearest segments: insert each into a short sorted list.
        near_count = 0
        for s in range(segments.shape[0]):
            a, b = segments[s, 0], segments[s, 1]
            along, long = 0.0, 0.0
            for k in range(3):
                along += (vertices[v, k] - a[k]) * (b[k] - a[k])
                long += (b[k] - a[k]) ** 2
            u = min(1.0, max(0.0, along / long)) if long > 0.0 else 0.0
            square = 0.0
            for k in range(3):
                square += (vertices[v, k] - a[k] - u * (b[k] - a[k])) ** 2
            if near_count == some and square >= near[some - 1]:
                continue
            i = near_count if near_count < some else some - 1
            while i > 0 and near[i - 1] > square:
                near[i], who[i] = near[i - 1], who[i - 1]
                for k in range(3):
                    points[i, k] = points[i - 1, k]
                i -= 1
            near[i], who[i] = square, s
            for k in range(3):
                points[i, k] = a[k] + u * (b[k] - a[k])
            near_count = min(near_count + 1, some)
        # Take the nearest visible segment, and other visible segments at nearly the same distance.
        chosen_count = 0
        for i in range(near_count):
            far = np.sqrt(near[i])
            if chosen_count and far > (1.0 + tie) * distance[v]:
                break
            if _is_hidden(v, points[i], vertices, normals[v], faces, offsets, inside, low, cell, size):
                continue
            if chosen_count == 0:
                distance[v] = far
            chosen[v, chosen_count] = who[i]
            chosen_count += 1
        # If nearer segments are occluded, increase the distance. Otherwise the factor is 1.
        if chosen_count:
            distance[v] *= (distance[v] / max(np.sqrt(near[0]), 1e-300)) ** _FADE_EXPONENT
    return chosen, distance


def find_nearest_seen(
    vertices: Float, normals: Float, faces: Int32, segments: Float, tie: float
) -> tuple[Int32, Float]:
    """Finds the nearest visible bones of each vertex.

    If the nearest bone is occluded, a bone that is farther away replaces it, and its distance is increased.

    Args:
        vertices: (V, 3) metres, welded.
        normals: (V, 3) outward normals; zero if bones on both sides are acceptable.
        faces: (F, 3) the faces that can occlude a bone.
        segments: (S, 2, 3) metres, the ends of the bones.
        tie: maximum relative difference in distance of bones that count as equally near.

    Returns:
        (V, K) int32 segments, the nearest and those equally near, then -1; (V,) metres to them, increased to
            d (d / d_0)^4 with d_0 the distance to the nearest bone, even if it is occluded. They are infinite
            if no bone is visible.
    """
    low, high = vertices.min(0), vertices.max(0)
    extent = float((high - low).max()) or 1.0
    edges = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1)
    cell = max(extent / 64, 2.0 * float(edges.mean()) if len(edges) else extent)
    size: Int = np.maximum(1, np.ceil((high - low) / cell + 1e-9)).astype(np.int64)
    offsets, inside = grid_of(vertices, faces, low, cell, size)
    nearest: tuple[Int32, Float] = _nearest_seen_kernel(
        vertices, normals, faces, np.ascontiguousarray(segments), offsets, inside, low, cell, size, tie
    )
    return nearest
