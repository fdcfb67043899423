"""A mesh as it is drawn: vertices doubled along creases, so that boards look flat and seats look round."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from enliven.arrays import AnyArray, Float, Float32, Int, Int32


@dataclass(frozen=True)
class Surface:
    """Vertices as the GPU wants them.

    Attributes:
        source: (N,) the vertex of the character that each drawn vertex is a copy of.
        normals: (N, 3) float32, unit, at rest.
        faces: (F, 3) int32 into the N.
        groups: (F, 3) the smoothing group of each corner.
        angles: (F, 3) radians of the corners at rest, by which faces count in their groups' normals.
        group: (N,) the smoothing group of each drawn vertex.
    """

    source: Int
    normals: Float32
    faces: Int32
    groups: Int
    angles: Float
    group: Int


def split_creases(vertices: Float32, faces: Int32, crease: float = math.radians(45)) -> Surface:
    """Smooth normals that break where two faces meet at more than ``crease`` radians.

    Two faces share a normal at a vertex when a fan of faces with milder edges joins them. Vertices at the
    same place count as one for this, so that a file with unshared vertices is smooth as well.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3).
    """
    place = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)[faces]
    normals, weights = _corner_normals(vertices.astype(np.float64), faces)
    group = _smooth_groups(place, normals, math.cos(crease))
    summed = np.zeros((group.max() + 1, 3))
    np.add.at(summed, group, (normals[:, None] * weights[..., None]).reshape(-1, 3))
    keys, first, corner = np.unique(
        np.stack([group, faces.reshape(-1)]), axis=1, return_index=True, return_inverse=True
    )
    drawn = summed[group[first]]
    length = np.linalg.norm(drawn, axis=1, keepdims=True)
    unit = np.where(length > 1e-12, drawn / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])
    return Surface(
        keys[1].astype(np.int64),
        unit.astype(np.float32),
        corner.reshape(-1, 3).astype(np.int32),
        group.reshape(-1, 3),
        weights,
        group[first],
    )


def _corner_normals(vertices: Float, faces: Int32) -> tuple[Float, Float]:
    """(F, 3) unit normals (zero for a face without area) and (F, 3) angles at the corners."""
    corners = vertices[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, area, out=np.zeros_like(normal), where=area > 1e-14)
    length = np.linalg.norm(edges, axis=2)
    dots = -np.einsum("fij,fij->fi", edges, np.roll(edges, 1, axis=1))
    size = np.maximum(length * np.roll(length, 1, axis=1), 1e-14)
    return normal, np.arccos(np.clip(dots / size, -1, 1))


def _smooth_groups(place: AnyArray, normals: Float, cosine: float) -> Int:
    """(3 F,) the smoothing group of every corner of every face, by union over mild edges."""
    count = len(place)
    corner = np.arange(3 * count).reshape(count, 3)
    ends = np.stack([place, np.roll(place, -1, axis=1)], -1).reshape(-1, 2)
    holders = np.stack([corner, np.roll(corner, -1, axis=1)], -1).reshape(-1, 2)
    flip = ends[:, 0] > ends[:, 1]
    ends[flip], holders[flip] = ends[flip][:, ::-1], holders[flip][:, ::-1]
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, holders, face = ends[order], holders[order], order // 3
    same = (ends[1:] == ends[:-1]).all(axis=1)
    mild = same & (np.einsum("ij,ij->i", normals[face[1:]], normals[face[:-1]]) >= cosine)
    before, after = holders[:-1][mild].reshape(-1), holders[1:][mild].reshape(-1)
    links = coo_matrix((np.ones(len(before)), (before, after)), shape=(3 * count, 3 * count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def is_closed(vertices: Float32, faces: Int32) -> bool:
    """Whether the mesh has an inside, and its faces turn outwards: then their backs are never seen."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2).astype(np.int64)
    forth, back = ends[:, 0] * len(vertices) + ends[:, 1], ends[:, 1] * len(vertices) + ends[:, 0]
    forth.sort()
    back.sort()
    if len(np.unique(forth)) != len(forth) or not np.array_equal(forth, back):
        return False
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    return bool(np.einsum("ij,ij->", a, np.cross(b, c)) > 0)


def longest_edge(vertices: Float32, faces: Int32) -> float:
    """Metres."""
    corners = vertices[faces]
    return float(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max())


def clustered_faces(vertices: Float32, faces: Int32, cell: float) -> Int32:
    """(G, 3) fewer faces over the same vertices: those of a cube of ``cell`` metres stand for one another."""
    key = np.floor(vertices / cell).astype(np.int64)
    _, first, cluster = np.unique(key, axis=0, return_index=True, return_inverse=True)
    coarse = first[cluster.reshape(-1)][faces]
    a, b, c = coarse.T
    kept = coarse[(a != b) & (b != c) & (c != a)]
    return np.ascontiguousarray(kept if len(kept) else faces, dtype=np.int32)
