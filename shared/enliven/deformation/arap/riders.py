"""Computes the samples that each vertex of a fine surface follows, their weights, and the coarse faces."""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Bool, Float, Float32, Int, Int32
from enliven.kernels import njit
from enliven.meshes import Mesh, shells

_MAX_DUST_SIZE_SPACINGS = 2.0
"""Maximum size, in spacings, of a tiny shell. Tiny shells follow the nearest surface rigidly."""


@njit(cache=True, nogil=True)
def select_followed_samples(points, samples, start, near, way, reach, detour):
    """Returns the samples that each vertex follows, with weights, as CSR.

    ``start``, ``near`` and ``way`` are the samples near each vertex (CSR), and their distances along the
    surface in metres. Samples within ``reach`` metres are followed. A path up to ``detour`` times longer than
    the straight distance counts as straight.
    """
    count = points.shape[0]
    offsets, kept, weights = (
        np.zeros(count + 1, np.int64),
        np.empty_like(near),
        np.empty(len(near), np.float32),
    )
    room = np.empty(len(near))
    size = 0
    for v in range(count):
        begin, total, same = size, 0.0, -1
        for k in range(start[v], start[v + 1]):
            d = 0.0
            for c in range(3):
                d += (points[v, c] - samples[near[k], c]) ** 2
            d = max(np.sqrt(d), way[k] / detour)
            if d < 1e-9 * reach:
                same = near[k]
                break
            if d < reach:
                w = ((reach - d) / (reach * d)) ** 2
                kept[size], room[size] = near[k], w
                total += w
                size += 1
        if same >= 0:
            kept[begin], room[begin], total, size = same, 1.0, 1.0, begin + 1
        for k in range(begin, size):
            weights[k] = room[k] / total
        offsets[v + 1] = size
    return offsets, kept[:size].copy(), weights[:size].copy()


def find_tiny_shells(points: Float, label: Int, awake: Int, spacing: float) -> Bool:
    """Returns (W,) True for vertices of tiny shells (connected parts smaller than
    ``_MAX_DUST_SIZE_SPACINGS``).

    Args:
        points: (W, 3) metres, the vertices of the welded mesh.
        label: (W,) the shell of each vertex.
        awake: shells that never count as tiny.
        spacing: metres between samples.
    """
    count = int(label.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for shell in range(3):
        np.minimum.at(low[:, shell], label, points[:, shell])
        np.maximum.at(high[:, shell], label, points[:, shell])
    size = np.linalg.norm(high - low, axis=1)
    is_small = size < _MAX_DUST_SIZE_SPACINGS * spacing
    is_small[size.argmax()] = False
    is_small[awake] = False
    return np.asarray(is_small[label])


def coarse_faces(faces: Int32, nearest: Int) -> tuple[Int32, Int]:
    """Returns the coarse faces (G, 3), and (L, 2) pairs of neighbouring samples that share no face."""
    corners = nearest[faces]
    corners = corners[((corners != corners[:, [1, 2, 0]]).any(1)) & (corners >= 0).all(1)]
    count = int(nearest.max()) + 1
    is_triangle = corners[(corners != corners[:, [1, 2, 0]]).all(1)]
    low, middle, high = np.sort(is_triangle, 1).T
    coarse = is_triangle[np.unique((low * count + middle) * count + high, return_index=True)[1]]
    pairs = np.setdiff1d(unique_sides(corners, count), unique_sides(coarse, count))
    pairs = np.stack([pairs // count, pairs % count], 1)
    return coarse.astype(np.int32), pairs[pairs[:, 0] != pairs[:, 1]]


def unique_sides(corners: Int, count: int) -> Int:
    """Returns the sides (S,) of faces without duplicates, as lower vertex * count + higher vertex."""
    turned = corners[:, [1, 2, 0]]
    return np.unique(np.minimum(corners, turned) * count + np.maximum(corners, turned))


def add_tiny_shells(
    mesh: Mesh, riding: Bool, start: Int, near: Int32, weights: Float32
) -> tuple[Int, Int32, Float32]:
    """Returns the samples that each vertex follows (CSR), with tiny shells added.

    All vertices of a tiny shell follow the samples of the surface vertex that is nearest to the shell.
    """
    surface_vertices = np.flatnonzero(~riding)
    label = shells(mesh.faces, len(mesh.vertices))[riding]
    number = np.unique(label, return_inverse=True)[1].reshape(-1)
    counts = np.bincount(number).astype(float)
    middle = np.stack([np.bincount(number, mesh.vertices[riding, axis]) / counts for axis in range(3)], 1)
    followed_vertex = np.arange(len(riding))
    followed_vertex[riding] = surface_vertices[
        scipy.spatial.cKDTree(mesh.vertices[surface_vertices]).query(middle)[1]
    ][number]
    return repeat_rows(followed_vertex, start, near, weights)


def repeat_rows(of: Int, start: Int, near: Int32, weights: Float32) -> tuple[Int, Int32, Float32]:
    """Returns a CSR matrix (offsets, samples, weights) in which row v is row ``of[v]`` of the given CSR
    matrix."""
    sizes = np.diff(start)[of]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    rows = np.repeat(start[of] - offsets[:-1], sizes) + np.arange(offsets[-1])
    return offsets, near[rows], weights[rows]
