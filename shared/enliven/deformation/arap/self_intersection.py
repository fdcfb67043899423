"""Finds the faces of a deformed surface that intersect other faces.

The search uses a bounding volume hierarchy: a tree of boxes over the faces, which are sorted along a
space-filling curve at rest. The tree is built once for a mesh. For each pose, only the boxes are updated,
from the leaves up. Faces that share a vertex, or a position, are neighbours and never cross. Faces that only
touch, or are coplanar, do not cross either.

    crossing = SelfIntersection(mesh)
    faces = crossing.newly_crossing(surface)       # (K,) faces that cross now and did not at rest
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit
from enliven.meshes import Mesh, first_of_position, space_curve


class SelfIntersection:
    """A test for intersecting faces of a mesh in any pose.

    Args:
        mesh: the mesh at rest. Its crossings at rest are computed at the first query.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._order = space_curve(mesh.vertices[mesh.faces].sum(1))
        first = first_of_position(np.ascontiguousarray(mesh.vertices + 0.0))
        self._corners = np.ascontiguousarray(first[mesh.faces[self._order]], np.int32)
        self._rest: Int | None = None

    def find_crossing_faces(self, vertices: Float) -> Int:
        """Returns the faces (K,) that intersect other faces in a pose (V, 3), ascending."""
        moved = np.array(vertices, np.float64, order="C")
        return np.sort(
            self._order[_crossing_faces(moved, self._corners, *_bounding_boxes(moved, self._corners))]
        )

    def find_new_crossing_faces(self, vertices: Float) -> Int:
        """Returns the faces (K,) that intersect other faces in a pose (V, 3), but not at rest."""
        if self._rest is None:
            self._rest = self.find_crossing_faces(self._mesh.vertices)
        return find_new_intersections(self._rest, self.find_crossing_faces(vertices))


def find_new_intersections(rest_crossings: Int, crossings: Int) -> Int:
    """Returns the faces (K,) that cross now and did not cross at rest.

    A mesh with parts that overlap has crossings at rest.
    """
    return np.setdiff1d(crossings, rest_crossings)


@njit(cache=True, nogil=True)
def _bounding_boxes(vertices, corners):
    """Computes bounding boxes of the faces (F, 6), and of the nodes (2 L, 6) of a full binary tree over the
    faces.

    Node 1 is the root. The L leaves come last, and each has four faces.
    """
    count = corners.shape[0]
    leaves = 1
    while leaves * 4 < count:
        leaves *= 2
    of_face, boxes = np.empty((count, 6)), np.empty((2 * leaves, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for f in range(count):
        node, (i, j, k) = leaves + f // 4, (corners[f, 0], corners[f, 1], corners[f, 2])
        for c in range(3):
            x, y, z = vertices[i, c], vertices[j, c], vertices[k, c]
            of_face[f, c], of_face[f, 3 + c] = min(x, y, z), max(x, y, z)
            boxes[node, c] = min(boxes[node, c], of_face[f, c])
            boxes[node, 3 + c] = max(boxes[node, 3 + c], of_face[f, 3 + c])
    for node in range(leaves - 1, 0, -1):
        for c in range(3):
            boxes[node, c] = min(boxes[2 * node, c], boxes[2 * node + 1, c])
            boxes[node, 3 + c] = max(boxes[2 * node, 3 + c], boxes[2 * node + 1, 3 + c])
    return of_face, boxes


@njit(cache=True, nogil=True)
def _are_boxes_disjoint(boxes, a, b):
    """Returns True if the boxes ``a`` and ``b`` of ``boxes`` (B, 6) are disjoint."""
    return (
        boxes[a, 0] > boxes[b, 3]
        or boxes[b, 0] > boxes[a, 3]
        or boxes[a, 1] > boxes[b, 4]
        or boxes[b, 1] > boxes[a, 4]
        or boxes[a, 2] > boxes[b, 5]
        or boxes[b, 2] > boxes[a, 5]
    )


@njit(cache=True, nogil=True)
def _crossing_faces(vertices, corners, of_face, boxes):
    """Returns (K,) the rows of ``corners`` (F, 3) with faces that cross other faces."""
    count, leaves = corners.shape[0], boxes.shape[0] // 2
    hit = np.zeros(count, np.bool_)
    stack = np.empty((128, 2), np.int64)
    stack[0, 0], stack[0, 1] = 1, 1
    size = 1
    # Compare the tree with itself: start with the pair (root, root), and split each pair of overlapping nodes
    # until both nodes are leaves.
    while size > 0:
        size -= 1
        a, b = stack[size]
        if a != b and _are_boxes_disjoint(boxes, a, b):
            continue
        if a >= leaves:
            _mark_crossing_leaves(vertices, corners, of_face, 4 * (a - leaves), 4 * (b - leaves), hit)
        elif a == b:
            for i in range(2):
                for j in range(i, 2):
                    stack[size, 0], stack[size, 1] = 2 * a + i, 2 * a + j
                    size += 1
        else:
            for i in range(2):
                for j in range(2):
                    stack[size, 0], stack[size, 1] = 2 * a + i, 2 * b + j
                    size += 1
    return np.flatnonzero(hit)


@njit(cache=True, nogil=True)
def _mark_crossing_leaves(vertices, corners, of_face, a, b, hit):
    """Marks in ``hit`` (F,) the crossing faces of two leaves, which consist of up to four faces from ``a``
    and ``b`` on."""
    count = corners.shape[0]
    for f in range(a, min(a + 4, count)):
        for g in range(f + 1 if a == b else b, min(b + 4, count)):
            if hit[f] and hit[g]:
                continue
            if _are_boxes_disjoint(of_face, f, g) or _share_position(corners, f, g):
                continue
            if _edge_pierces_face(vertices, corners, f, g) or _edge_pierces_face(vertices, corners, g, f):
                hit[f] = hit[g] = True


@njit(cache=True, nogil=True)
def _share_position(corners, f, g):
    """Returns True if the faces f and g share a corner. ``corners`` (F, 3) are numbers of welded vertices."""
    for i in range(3):
        for j in range(3):
            if corners[f, i] == corners[g, j]:
                return True
    return False


@njit(cache=True, nogil=True)
def _signed_side(vertices, a, b, c, d):
    """Returns six times the signed volume of the tetrahedron of the vertices a, b, c, d. Its sign shows on
    which side of the plane a, b, c the vertex d is.
    """
    x, y, z = vertices[d, 0], vertices[d, 1], vertices[d, 2]
    ax, ay, az = vertices[a, 0] - x, vertices[a, 1] - y, vertices[a, 2] - z
    bx, by, bz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
    cx, cy, cz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)


@njit(cache=True, nogil=True)
def _edge_pierces_face(vertices, corners, f, g):
    """Returns True if an edge of face ``f`` passes through the inside of face ``g``."""
    a, b, c = corners[g, 0], corners[g, 1], corners[g, 2]
    p, q, r = corners[f, 0], corners[f, 1], corners[f, 2]
    sp, sq, sr = (
        _signed_side(vertices, a, b, c, p),
        _signed_side(vertices, a, b, c, q),
        _signed_side(vertices, a, b, c, r),
    )
    return (
        (sp * sq < 0.0 and _line_meets_face(vertices, a, b, c, p, q))
        or (sq * sr < 0.0 and _line_meets_face(vertices, a, b, c, q, r))
        or (sr * sp < 0.0 and _line_meets_face(vertices, a, b, c, r, p))
    )


@njit(cache=True, nogil=True)
def _line_meets_face(vertices, a, b, c, p, q):
    """Returns True if the line through the vertices p and q passes through the inside of the face a, b, c."""
    u, v, w = (
        _signed_side(vertices, p, q, a, b),
        _signed_side(vertices, p, q, b, c),
        _signed_side(vertices, p, q, c, a),
    )
    return (u > 0.0 and v > 0.0 and w > 0.0) or (u < 0.0 and v < 0.0 and w < 0.0)
