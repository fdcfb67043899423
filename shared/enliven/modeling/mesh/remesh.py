"""Remeshing of closed surfaces: flips edges to a Delaunay triangulation, and smooths vertices (Taubin)."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.kernels import njit
from enliven.meshes.flips import adjacent_triangles, flip, slot

_SMOOTHING_FACTOR = 0.5
"""Taubin's smoothing factor lambda ("A signal processing approach to fair surface design", 1995)."""
_UNSHRINKING_FACTOR = -0.53
"""Taubin's factor mu. This negative step, slightly larger than the smoothing step, prevents shrinking."""


def flip_to_delaunay(vertices: Float, faces: Int32) -> Int32:
    """Returns faces (F, 3) in which an edge is flipped if its two opposite angles add up to more than 180
    degrees."""
    out = faces.astype(np.int64)
    _flip_all(np.ascontiguousarray(vertices), out, adjacent_triangles(out, len(vertices)))
    return out.astype(np.int32)


def flip_within(vertices: Float, faces: Int, seam: Bool) -> Int:
    """Returns the faces (F, 3) of a patch after flips to a Delaunay triangulation. Edges between two vertices
    of the seam (mask (V,)) are not flipped."""
    out = faces.copy()
    beside = adjacent_triangles(out, len(vertices))
    ends = out[:, [[1, 2], [2, 0], [0, 1]]]
    beside[seam[ends].all(2)] = -1
    _flip_all(np.ascontiguousarray(vertices), out, beside)
    return out


def smooth_taubin(vertices: Float, faces: Int32, times: int) -> Float:
    """Smooths vertices (V, 3) by ``times`` Taubin passes. This removes noise, keeps low frequencies, and
    makes triangles more regular."""
    count = len(vertices)
    out = np.ascontiguousarray(vertices).copy()
    for _ in range(times):
        out += _SMOOTHING_FACTOR * _vectors_to_neighbours(out, faces, count)
        out += _UNSHRINKING_FACTOR * _vectors_to_neighbours(out, faces, count)
    return out


@njit(cache=True, nogil=True)
def _vectors_to_neighbours(vertices, faces, count):
    """Returns (V, 3) vectors from each vertex to the mean of its neighbours."""
    total, counts = np.zeros((count, 3)), np.zeros(count)
    for f in range(faces.shape[0]):
        for k in range(3):
            i, j = faces[f, k], faces[f, (k + 1) % 3]
            for a in range(3):
                total[i, a] += vertices[j, a]
            counts[i] += 1.0
    for i in range(count):
        for a in range(3):
            total[i, a] = total[i, a] / counts[i] - vertices[i, a] if counts[i] > 0.0 else 0.0
    return total


@njit(cache=True, nogil=True)
def _triangle_normal(p, q, r):
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    return np.array([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])


@njit(cache=True, nogil=True)
def _corner_cotangent(tip, p, q):
    ux, uy, uz = p[0] - tip[0], p[1] - tip[1], p[2] - tip[2]
    vx, vy, vz = q[0] - tip[0], q[1] - tip[1], q[2] - tip[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return (ux * vx + uy * vy + uz * vz) / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)


@njit(cache=True, nogil=True)
def _share_an_edge(faces, beside, t, a, d):
    """Returns True if vertex a of face t shares an edge with vertex d. Visits the faces around a."""
    f = t
    for _ in range(64):
        k = slot(faces[f], a)
        if faces[f, (k + 1) % 3] == d or faces[f, (k + 2) % 3] == d:
            return True
        f = beside[f, (k + 1) % 3]
        if f < 0 or f == t:
            return f < 0
    return True


@njit(cache=True, nogil=True)
def _flip_all(vertices, faces, beside):
    """Flips edges until no flip improves the triangulation. Skips flips that would fold the surface or
    duplicate an edge."""
    for _ in range(20):
        done = 0
        for t in range(faces.shape[0]):
            for k in range(3):
                u = beside[t, k]
                if u < 0:
                    continue
                a, b, c = faces[t, k], faces[t, (k + 1) % 3], faces[t, (k + 2) % 3]
                m = slot(beside[u], t)
                d = faces[u, m]
                cotangent = _corner_cotangent(vertices[a], vertices[b], vertices[c])
                if cotangent + _corner_cotangent(vertices[d], vertices[b], vertices[c]) >= -1e-9:
                    continue
                old_normal = _triangle_normal(vertices[a], vertices[b], vertices[c])
                old_normal += _triangle_normal(vertices[d], vertices[c], vertices[b])
                first = _triangle_normal(vertices[a], vertices[b], vertices[d])
                second = _triangle_normal(vertices[a], vertices[d], vertices[c])
                if (first * old_normal).sum() <= 0.0 or (second * old_normal).sum() <= 0.0:
                    continue
                if _share_an_edge(faces, beside, t, a, d):
                    continue
                flip(faces, beside, t, k)
                done += 1
        if done == 0:
            return
