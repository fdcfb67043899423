"""Closes any triangle mesh to an oriented 2-manifold: separates touching sheets, caps holes, and removes
leaves (open sheets).

Two faces are connected across an edge if only these two share it, with opposite directions. If more than two
faces share an edge (such as the edge of two touching boxes), they are connected in pairs: first the two faces
with the thinnest wedge of solid between them, then the others. The remaining holes are capped if their area
is small. Parts with larger holes are leaves (open sheets such as cloth or a feather), which do not enclose a
volume.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from enliven.arrays import Bool, Float, Int
from enliven.meshes import Mesh, face_areas
from enliven.modeling.mesh.caps import flatten_loop, triangulate_cap

_MAX_CAP_FRACTION = 0.25
"""Maximum area of the caps of a mesh or connected part, as a fraction of its surface area. A part with larger
holes is a leaf."""

Interpolation = Callable[[Float], Float]
"""A function that interpolates (I, K) values at new points, given (R, K) values at the points that they
depend on."""


@dataclass(frozen=True)
class ClosedSurface:
    """An oriented 2-manifold without border.

    Attributes:
        vertices: (V', 3) metres, the given vertices, then the vertices that were added to close the surface.
        faces: (F', 3) the given faces without leaves, then the caps. The corners of given faces keep their
            positions.
        label: (V',) the manifold vertex that each vertex belongs to. Vertices with equal labels are the same
            point.
        made: one pair for each group of new vertices, in order: the vertices that the group depends on, and
            the function that interpolates values at the group's vertices.
        caps: number of holes that were capped.
        leaf: (F,) True for given faces that belong to leaves.
    """

    vertices: Float
    faces: Int
    label: Int
    made: tuple[tuple[Int, Interpolation], ...]
    caps: int
    leaf: Bool


def close_surface(mesh: Mesh, of: Int) -> ClosedSurface:
    """Returns the closed surface of a mesh.

    Args:
        mesh: any triangles with three different corners, without duplicates.
        of: (V,) the welded vertex of each vertex.
    """
    welded_faces = of[mesh.faces]
    mates = _find_opposite_half_edges(welded_faces, mesh)
    corner = _corner_fans(mates).reshape(-1, 3)
    work, leaf = _SurfaceInProgress(mesh, corner), np.zeros(len(welded_faces), bool)
    loops = _border_loops(mates, corner)
    if loops:
        part = connected_components(_face_adjacency(mates // 3, len(welded_faces)), directed=False)[1]
        caps = [work.cap(loop) for loop in loops]
        area = np.bincount(part, face_areas(mesh.vertices, mesh.faces))
        loop_parts = part[[loop[0] // 3 for loop in loops]]
        missing = np.bincount(loop_parts, [cap.area for cap in caps], len(area))
        open_parts = (missing > _MAX_CAP_FRACTION * area) & (missing.sum() > _MAX_CAP_FRACTION * area.sum())
        for number, cap in zip(loop_parts, caps, strict=True):
            if not open_parts[number]:
                work.close(cap)
        leaf = open_parts[part]
    faces = np.concatenate([work.corners[~leaf], *work.caps])
    return ClosedSurface(work.vertices, faces, work.label, tuple(work.made), len(work.caps), leaf)


def _face_adjacency(mates: Int, count: int) -> coo_matrix:
    """Returns the adjacency matrix (F, F) of the faces. ``mates`` (3F,) contains for each half-edge the face
    on the other side, or a number below 0 for none.
    """
    joined = np.flatnonzero(mates >= 0)
    return coo_matrix((np.ones(len(joined)), (joined // 3, mates[joined])), (count, count))


def _find_opposite_half_edges(faces: Int, mesh: Mesh) -> Int:
    """Returns the opposite half-edge of each half-edge, (3F,): 3 face + corner, or -1 at a border."""
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, 1).ravel().astype(np.int64)
    count = int(faces.max(initial=-1)) + 1
    edge = np.minimum(starts, ends) * count + np.maximum(starts, ends)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    size = np.diff(first, append=len(order))
    mates = np.full(len(edge), -1, np.int64)
    first_half, second_half = order[first[size == 2]], order[first[size == 2] + 1]
    is_opposed = starts[first_half] != starts[second_half]
    mates[first_half[is_opposed]], mates[second_half[is_opposed]] = (
        second_half[is_opposed],
        first_half[is_opposed],
    )
    for begin, group_size in zip(first[size > 2], size[size > 2], strict=True):
        _pair_edge_faces(order[begin : begin + group_size], starts, mesh, mates)
    return mates


def _pair_edge_faces(halves: Int, starts: Int, mesh: Mesh, mates: Int) -> None:
    """Connects the faces around one non-manifold edge in pairs, starting with the thinnest wedge of solid."""
    corners = mesh.vertices[mesh.faces[halves // 3]]
    rows, k = np.arange(len(halves)), halves % 3
    forward = starts[halves] == starts[halves[0]]
    a, b = corners[0, k[0]], corners[0, (k[0] + 1) % 3]
    axis = (b - a) / max(float(np.linalg.norm(b - a)), 1e-300)
    away = corners[rows, (k + 2) % 3] - a
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    angle = np.arctan2(away @ np.cross(axis, across), away @ across)
    # ``wedge[i, j]`` is the angle of solid between face i with a forward half-edge and face j with a backward
    # half-edge. At a face with a forward half-edge, the solid is on the side of smaller angles.
    wedge = np.where(forward[:, None] & ~forward, (angle[:, None] - angle) % (2 * np.pi), np.inf)
    while np.isfinite(wedge).any():
        row, column = np.unravel_index(int(wedge.argmin()), wedge.shape)
        mates[halves[row]], mates[halves[column]] = halves[column], halves[row]
        wedge[row], wedge[:, column] = np.inf, np.inf


def _corner_fans(mates: Int) -> Int:
    """Returns the number of the fan that contains each corner of a face, (3F,). A fan is a group of connected
    faces around a vertex.
    """
    joined = np.flatnonzero(mates >= 0)
    other = mates[joined]
    after = other - other % 3 + (other + 1) % 3
    adjacency = coo_matrix((np.ones(len(joined)), (joined, after)), (len(mates), len(mates)))
    return np.asarray(connected_components(adjacency, directed=False)[1], np.int64)


def _border_loops(mates: Int, corner: Int) -> list[Int]:
    """Returns the half-edges (R,) of each border, in the order of the cap's rim. This order is opposite to
    the direction of the faces."""
    border_edges = np.flatnonzero(mates < 0)
    flat = corner.ravel()
    after = border_edges - border_edges % 3 + (border_edges + 1) % 3
    into = dict(zip(flat[after].tolist(), border_edges.tolist(), strict=True))
    loops, remaining = list[Int](), set(border_edges.tolist())
    for start in border_edges.tolist():
        loop, vertex = list[int](), start
        while vertex in remaining:
            remaining.remove(vertex)
            loop.append(vertex)
            vertex = into[int(flat[vertex])]
        if loop:
            loops.append(np.array(loop))
    return loops


class _Rim(NamedTuple):
    """A border of a surface, and the cap that would close it.

    Attributes:
        around: (R,) the vertices of the rim.
        faces: (T, 3) indices into the rim and then the I inner points.
        points: (I, 3) metres, the inner points.
        how: function that interpolates values at the inner points from values on the rim.
        area: area of the cap in square metres.
    """

    around: Int
    faces: Int
    points: Float
    how: Interpolation
    area: float


class _SurfaceInProgress:
    """A surface that is being closed: its current vertices, corners, labels and caps."""

    def __init__(self, mesh: Mesh, corner: Int) -> None:
        count = len(mesh.vertices)
        both = np.stack([mesh.faces.ravel(), corner.ravel()], 1)
        pairs, number = np.unique(both, axis=0, return_inverse=True)
        vertex, label = pairs.T
        repeated = np.flatnonzero(np.diff(vertex, prepend=-1) == 0)
        place = vertex.astype(np.int64)
        place[repeated] = count + np.arange(len(repeated))
        self.corners = place[number.reshape(-1)].reshape(-1, 3)
        self.vertices = mesh.vertices
        self.label = np.full(count, -1, np.int64)
        self.made, self.caps = list[tuple[Int, Interpolation]](), list[Int]()
        self._add_vertices(
            mesh.vertices[vertex[repeated]], vertex[repeated], _keep_values, np.full(len(repeated), -1)
        )
        self.label[place] = label

    def cap(self, loop: Int) -> _Rim:
        """Returns the cap that would close a border, given as half-edges ``loop`` in order."""
        rim = self.corners.ravel()[loop]
        cap = triangulate_cap([np.arange(len(rim))], flatten_loop(self.vertices[rim]))
        order, faces = rim[cap.rim], cap.faces
        how: Interpolation = cap.inner_points
        if len(faces) != len(rim) - 2 + 2 * cap.inner_points.count:
            # A border that is a straight line, or that crosses itself, cannot be triangulated. So close it
            # with a fan of triangles around its mean.
            turn = np.arange(len(rim))
            order, how = rim, _mean_row
            faces = np.stack([turn, np.roll(turn, -1), np.full(len(rim), len(rim))], 1)
        around = self.vertices[order]
        inside = how(around)
        area = float(face_areas(np.concatenate([around, inside]), faces).sum())
        return _Rim(order, faces, inside, how, area)

    def close(self, cap: _Rim) -> None:
        """Adds the vertices and faces of a cap to the surface."""
        numbers = np.concatenate([cap.around, len(self.vertices) + np.arange(len(cap.points))])
        labels = int(self.label.max()) + 1 + np.arange(len(cap.points))
        self._add_vertices(cap.points, cap.around, cap.how, labels)
        self.caps.append(numbers[cap.faces])

    def _add_vertices(self, points: Float, of: Int, how: Interpolation, labels: Int) -> None:
        self.vertices = np.concatenate([self.vertices, points])
        self.label = np.concatenate([self.label, labels])
        self.made.append((of, how))


def _keep_values(values: Float) -> Float:
    return values


def _mean_row(values: Float) -> Float:
    return np.asarray(values.mean(0, keepdims=True))
