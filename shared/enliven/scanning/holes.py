"""Hole filling for a cut-out mesh: closes holes with short rims and holes at the base, and finds the lowest
rims, which are extended to the floor.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Bool, Float, Int, Int32
from enliven.kernels import njit
from enliven.meshes import Mesh
from enliven.meshes.planar import triangulate_loops
from enliven.scanning.settings import CutOutSettings

_MIN_DOWN_COSINE = 0.0
"""Minimum cosine between down and the outward direction of a rim that faces down. The limit is low because
rims are jagged."""
_CLEAR_RADIUS_M = 0.02
"""Horizontal radius around a rim vertex, metres. For the lowest rims, no part of the mesh lies below the
vertex within it."""
_MIN_HEIGHT_BELOW_M = 0.03
"""Minimum height difference, metres, for a vertex to lie below another vertex. It is larger than the
roughness of a rim."""


def find_lowest_rims(mesh: Mesh, low: float) -> Bool:
    """Returns (V,) a mask of the vertices on rims that face down and have no part of the mesh below them.

    Args:
        mesh: upright, on y = 0.
        low: maximum height above the floor, metres, of rims that count.
    """
    vertices, faces = mesh.vertices, mesh.faces
    lowest = np.zeros(len(vertices), bool)
    face, corner = np.nonzero(find_open_sides(faces, len(vertices)))
    start, end, inside = (faces[face, (corner + k) % 3] for k in range(3))
    is_low = (vertices[start, 1] < low) & (vertices[end, 1] < low)
    if not is_low.any():
        return lowest
    start, end, inside = start[is_low], end[is_low], inside[is_low]
    side, outward = vertices[end] - vertices[start], vertices[start] - vertices[inside]
    length = np.maximum(np.square(side).sum(1), 1e-18)
    outward = outward - side * ((outward * side).sum(1) / length)[:, None]
    faces_down = -outward[:, 1] > _MIN_DOWN_COSINE * np.linalg.norm(outward, axis=1)
    rim_vertices = np.unique(np.concatenate([start[faces_down], end[faces_down]]))
    low_vertices = np.flatnonzero(vertices[:, 1] < low)
    close = cKDTree(vertices[low_vertices][:, [0, 2]]).query_ball_point(
        vertices[rim_vertices][:, [0, 2]], _CLEAR_RADIUS_M
    )
    free = [
        vertices[low_vertices[neighbours], 1].min() > vertices[v, 1] - _MIN_HEIGHT_BELOW_M
        for v, neighbours in zip(rim_vertices, close, strict=True)
    ]
    lowest[rim_vertices[free]] = True
    return lowest


def close_holes(mesh: Mesh, feet: Bool, s: CutOutSettings) -> Mesh:
    """Fills two kinds of holes: those with a short rim, and those with a rim that lies entirely in the mask
    ``feet`` (V,).
    """
    rims = find_rims(mesh)
    soles = [rim for rim in rims if feet[rim].all()]
    vertices, faces = [mesh.vertices], [mesh.faces.astype(np.int64)]
    if soles:
        flat = mesh.vertices[:, [0, 2]]
        # Triangulate as seen from below, with x to the right and z up.
        base_faces = triangulate_loops(np.ascontiguousarray(flat), [rim[::-1] for rim in soles])
        faces.append(_orient_down(base_faces, mesh.vertices))
    count, colours = len(mesh.vertices), [] if mesh.colours is None else [mesh.colours]
    for rim in rims:
        length = np.linalg.norm(np.roll(mesh.vertices[rim], -1, 0) - mesh.vertices[rim], axis=1).sum()
        if feet[rim].all() or length > s.hole:
            continue
        vertices.append(mesh.vertices[rim].mean(0, keepdims=True))
        faces.append(np.stack([np.roll(rim, -1), rim, np.full(len(rim), count)], 1))
        if mesh.colours is not None:
            colours.append(np.rint(mesh.colours[rim].mean(0, keepdims=True)).astype(np.uint8))
        count += 1
    all_faces: Int32 = np.concatenate(faces).astype(np.int32)
    return Mesh(np.concatenate(vertices), all_faces, mesh.name, np.concatenate(colours) if colours else None)


def _orient_down(faces: Int, vertices: Float) -> Int:
    """Returns the faces (F, 3), with reversed corner order for each face that faces up."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    faces_up = np.cross(b - a, c - a)[:, 1] > 0
    faces[faces_up] = faces[faces_up, ::-1]
    return faces


def find_rims(mesh: Mesh) -> list[Int]:
    """Returns the boundary loops (rims of holes) of a mesh, each as a list of vertices."""
    faces = mesh.faces
    face, corner = np.nonzero(find_open_sides(faces, len(mesh.vertices)))
    next_vertex: dict[int, list[int]] = {}
    for a, b in zip(faces[face, corner].tolist(), faces[face, (corner + 1) % 3].tolist(), strict=True):
        next_vertex.setdefault(a, []).append(b)
    rims = []
    for start in list(next_vertex):
        while next_vertex.get(start):
            rim = [start]
            while rim[-1] != start or len(rim) == 1:
                if not next_vertex.get(rim[-1]):
                    break
                rim.append(next_vertex[rim[-1]].pop())
            if rim[-1] == start and len(rim) > 3:
                rims.append(np.array(rim[:-1]))
    return rims


def find_open_sides(faces: Int32, count: int) -> Bool:
    """Returns (F, 3) a mask of the boundary sides. A side is a boundary if no face has the same side in the
    opposite direction.

    Args:
        count: number of vertices.
    """
    list_starts = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(faces.reshape(-1), minlength=count), out=list_starts[1:])
    return np.asarray(
        _open_sides(faces, list_starts, np.empty(faces.size, np.int32), list_starts[:-1].copy())
    )


@njit(cache=True, nogil=True)
def _open_sides(faces, first, ends, free):
    """Returns the boundary sides from an adjacency list of the sides that leave each vertex.

    Args:
        first: (V + 1,) where each vertex's list begins.
        ends: (3 F,) the end vertices of the sides; written.
        free: (V,) the next free entry for each vertex; begins as ``first``, written.
    """
    for f in range(len(faces)):
        for k in range(3):
            a = faces[f, k]
            ends[free[a]] = faces[f, (k + 1) % 3]
            free[a] += 1
    is_open = np.ones((len(faces), 3), np.bool_)
    for f in range(len(faces)):
        for k in range(3):
            a, b = faces[f, k], faces[f, (k + 1) % 3]
            for i in range(first[b], first[b + 1]):
                if ends[i] == a:
                    is_open[f, k] = False
                    break
    return is_open
