"""Repairs the winding of faces, so that neighbouring faces are consistent and closed shells face outwards."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.kernels import njit
from enliven.meshes.kernels import face_areas
from enliven.meshes.mesh import Mesh, weld

_MIN_VOLUME_RATIO = 1e-6
"""Minimum ratio of volume to area^1.5 of a shell that counts as enclosing a volume. It is 0.094 for a sphere,
and 0 for two coincident sheets."""


_MAX_NESTED_PARTS = 2048
"""Maximum number of closed parts that are tested for nesting, which takes quadratic time. A model with more
parts is a collection of objects, which rarely has cavities."""
_MAX_SURROUNDING_PARTS = 32
"""Maximum number of possibly enclosing parts that are tested for each part, the largest first."""


class _Edges(NamedTuple):
    """The edges of all faces, sorted so that equal edges are adjacent.

    Attributes:
        faces: (3F,) the face of each edge.
        forward: (3F,) True if the edge runs from the lower vertex number to the higher one.
        starts: (E,) start of each group of equal edges.
        counts: (E,) number of edges in each group.
    """

    faces: Int
    forward: Bool
    starts: Int
    counts: Int


def repair_winding(mesh: Mesh) -> tuple[Mesh, list[str]]:
    """Makes the winding of a mesh consistent. Returns the mesh, and a sentence for each kind of repair.

    If exactly two faces share an edge, they are made consistent. In an open part, the winding of the larger
    area is used. A closed part is flipped if it faces inwards. A part inside another part keeps its
    orientation relative to the enclosing part, so that a cavity stays a cavity. A one-sided part (a Moebius
    strip) is left unchanged.
    """
    if len(mesh.faces) == 0:
        return mesh, []
    welded, _ = weld(mesh)
    vertices, faces = welded.vertices, welded.faces
    edges = _collect_edges(faces, len(vertices))
    pair = np.flatnonzero(edges.counts == 2)
    first_side, second_side = edges.starts[pair], edges.starts[pair] + 1
    agree = edges.forward[first_side] != edges.forward[second_side]
    part, flip, is_twisted = _find_consistent_parts(
        len(faces), edges.faces[first_side], edges.faces[second_side], agree
    )
    areas = face_areas(vertices, faces)
    count = int(part.max()) + 1
    flip &= ~is_twisted[part]
    # If more than half of a part's area would be flipped, flip the rest instead, so that the larger half
    # keeps its winding.
    mostly_flipped = np.bincount(part, areas * flip, count) > 0.5 * np.bincount(part, areas, count)
    flip ^= mostly_flipped[part]
    closed = _find_closed_parts(edges, part, count) & ~is_twisted
    volumes, sizes = _part_volumes(vertices, faces, flip, part, count), np.bincount(part, areas / 2, count)
    inward = closed & (volumes < -_MIN_VOLUME_RATIO * sizes**1.5)
    if inward.any():
        inward = _follow_outer(vertices, faces, part, closed, inward)
    flip ^= inward[part]
    if not flip.any():
        return mesh, []
    is_turned_whole = np.bincount(part, flip, count) == np.bincount(part, minlength=count)
    turned_parts, turned_faces = int(is_turned_whole.sum()), int((flip & ~is_turned_whole[part]).sum())
    notes = list[str]()
    if turned_faces:
        notes.append(
            f"{turned_faces} of {len(faces)} faces had another winding than their neighbours and were flipped"
        )
    if turned_parts:
        subject = "the mesh" if count == 1 else f"{turned_parts} of the {count} parts of the mesh"
        notes.append(f"the faces of {subject} pointed inwards and were flipped")
    return mesh.flip_faces(flip), notes


def _collect_edges(faces: Int32, vertex_count: int) -> _Edges:
    ends = np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2).astype(np.int64)
    key = ends.min(1) * vertex_count + ends.max(1)
    order = np.argsort(key, kind="stable")
    _, starts, counts = np.unique(key[order], return_index=True, return_counts=True)
    forward = ends[:, 0] < ends[:, 1]
    return _Edges(order // 3, forward[order], starts, counts)


@njit(cache=True, nogil=True)
def _orientation_roots(count, ones, twos, agree):
    """Finds connected parts with consistent orientation. Returns (F,) the root face of each face's part, (F,)
    True for faces that are oriented opposite to their root, and the roots of one-sided parts.

    Edge e connects the faces ``ones[e]`` and ``twos[e]``. A union-find tree stores for each face whether its
    winding is opposite to that of its parent.
    """
    parent, against = np.arange(count), np.zeros(count, np.bool_)
    twisted = np.zeros(count, np.bool_)
    for e in range(ones.shape[0]):
        a, b, differs = ones[e], twos[e], not agree[e]
        # Walk up both trees with path halving, and accumulate the orientation relative to the root.
        while parent[a] != a:
            up = parent[a]
            against[a] ^= against[up] if parent[up] != up else False
            parent[a] = parent[up]
            differs ^= against[a]
            a = parent[a]
        while parent[b] != b:
            up = parent[b]
            against[b] ^= against[up] if parent[up] != up else False
            parent[b] = parent[up]
            differs ^= against[b]
            b = parent[b]
        if a == b:
            twisted[a] |= differs
        else:
            low, high = min(a, b), max(a, b)
            parent[high], against[high] = low, differs
            twisted[low] |= twisted[high]
    for f in range(count):
        # A parent has a lower number than its children, so its own root is already known.
        up = parent[f]
        if up != f:
            against[f] ^= against[up]
            parent[f] = parent[up]
    return parent, against, twisted


def _find_consistent_parts(count: int, ones: Int, twos: Int, agree: Bool) -> tuple[Int, Bool, Bool]:
    """Returns (F,) the part of each face, (F,) True for faces that are oriented opposite to the first face of
    their part, and (P,) True for one-sided parts.
    """
    root, against, twisted = _orientation_roots(count, ones, twos, agree)
    roots, part = np.unique(root, return_inverse=True)
    return part.reshape(-1), against, twisted[roots]


def _find_closed_parts(edges: _Edges, part: Int, count: int) -> Bool:
    """Returns (P,) True for closed parts: every edge belongs to exactly two of the part's faces."""
    group = np.repeat(np.arange(len(edges.starts)), edges.counts)
    _, first, uses = np.unique(group * count + part[edges.faces], return_index=True, return_counts=True)
    closed = np.ones(count, bool)
    closed[part[edges.faces[first[uses != 2]]]] = False
    return closed


def _part_volumes(vertices: Float, faces: Int32, flip: Bool, part: Int, count: int) -> Float:
    """Returns the signed volume (P,) of each part, positive if it faces outwards.

    The volume of an open part has no meaning.
    """
    corners = vertices[faces] - vertices.mean(0)
    volume = np.einsum("fa,fa->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    return np.asarray(np.bincount(part, np.where(flip, -volume, volume), count), np.float64)


def _follow_outer(vertices: Float, faces: Int32, part: Int, closed: Bool, inward: Bool) -> Bool:
    """Returns (P,) True for parts to flip: outer parts that face inwards, together with all parts inside
    them."""
    is_flipped, numbers = inward.copy(), np.flatnonzero(closed)
    if len(numbers) > _MAX_NESTED_PARTS:
        return is_flipped
    order = np.argsort(part, kind="stable")
    ends = np.cumsum(np.bincount(part, minlength=len(closed)))
    corners = [vertices[faces[order[ends[n - 1] if n else 0 : ends[n]]]] for n in numbers]
    lows = np.array([part_corners.min((0, 1)) for part_corners in corners])
    highs = np.array([part_corners.max((0, 1)) for part_corners in corners])
    by_size = np.argsort(-np.prod(highs - lows, 1), kind="stable")
    for k in by_size:
        encloses = (lows < lows[k]).all(1) & (highs > highs[k]).all(1)
        # If several parts enclose this part, use the largest, because its winding was determined first.
        for outer in by_size[encloses[by_size]][:_MAX_SURROUNDING_PARTS]:
            if _is_inside(corners[k][0, 0], corners[outer]):
                is_flipped[numbers[k]] = is_flipped[numbers[outer]]
                break
    return is_flipped


def _is_inside(point: Float, corners: Float) -> bool:
    """Returns True if a point is inside a closed surface (F, 3, 3). The test sums the solid angles of the
    faces (winding number).
    """
    a, b, c = (corners[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    above = np.einsum("fa,fa->f", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return bool(abs(2 * np.arctan2(above, below).sum()) > 2 * np.pi)
