"""Removes slivers (very thin triangles) along a seam, so that the seam can be smoothed. Short edges are
contracted, and other edges are flipped.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.modeling.mesh.remesh import flip_within

_MIN_EDGE_RATIO = 0.5
"""Minimum length of the seam's edges, as a fraction of the median edge length nearby. Shorter edges are
contracted."""
_KEPT_VERTEX_FACTOR = 0.5
"""Factor on this limit for an edge with one fixed vertex. The limit is lower, because contracting the edge
pulls the seam to that vertex."""


def remove_slivers(vertices: Float, faces: Int32, new: Bool) -> tuple[Float, Int32, Bool, Bool]:
    """Removes slivers at the new vertices of a surface.

    Args:
        vertices: (V, 3) metres, the surface's vertices.
        faces: (F, 3), closed.
        new: (V,) True for vertices that may be moved or removed.

    Returns:
        (V, 3) vertices, with only new vertices moved; (G, 3) faces, starting with the unchanged faces without
        a new vertex; (V,) True for remaining vertices; and (V,) True for vertices that absorbed other
        vertices.
    """
    touching: Bool = np.asarray(new[faces].any(1))
    near = faces[touching]
    # Also include the neighbours of these faces, because a contraction checks the neighbours of both ends.
    around = np.isin(faces, np.unique(near)).any(1)
    patch = _Patch(vertices.copy(), faces[around].astype(np.int64), new)
    patch.contract(_MIN_EDGE_RATIO * _measure_nearby_edge_length(vertices, faces[around], new))
    mine = np.flatnonzero(touching[around])
    remaining = [face for face in (patch.faces[number] for number in mine) if face is not None]
    inner = flip_within(patch.vertices, np.array(remaining, np.int64).reshape(-1, 3), new)
    is_kept = np.ones(len(vertices), bool)
    is_kept[list(patch.gone)] = False
    all_faces = np.concatenate([faces[~touching], inner.astype(np.int32)])
    drawn = np.zeros(len(vertices), bool)
    drawn[list(patch.drawn)] = True
    return patch.vertices, all_faces, is_kept, drawn


def _measure_nearby_edge_length(vertices: Float, faces: Int32, new: Bool) -> float:
    """Returns the median length in metres of edges between old vertices near the new vertices."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ends = ends[~new[ends].any(1)]
    if len(ends) == 0:
        return 0.0
    return float(np.median(np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)))


class _Patch:
    """A small part of a surface with its adjacency, for contracting edges one at a time."""

    def __init__(self, vertices: Float, faces: Int, new: Bool) -> None:
        self.vertices, self.new = vertices, new
        self.faces: list[list[int] | None] = [list(face) for face in faces.tolist()]
        self.gone: set[int] = set()
        self.drawn: set[int] = set()
        self.of: dict[int, set[int]] = {}
        for number, face in enumerate(faces.tolist()):
            for v in face:
                self.of.setdefault(v, set()).add(number)

    def contract(self, short: float) -> None:
        """Contracts edges shorter than ``short`` metres, the shortest first."""
        ends = {
            (min(a, b), max(a, b))
            for face in self.faces
            if face is not None
            for a, b in zip(face, [*face[1:], face[0]], strict=True)
            if self.new[a] or self.new[b]
        }
        order = sorted(ends, key=lambda pair: float(np.linalg.norm(self._edge_vector(*pair))))
        for a, b in order:
            limit = short if self.new[a] and self.new[b] else _KEPT_VERTEX_FACTOR * short
            if a in self.gone or b in self.gone or float(np.linalg.norm(self._edge_vector(a, b))) > limit:
                continue
            if not self.new[a]:
                a, b = b, a
            # Remove vertex a. If both vertices are new, move the remaining vertex to the middle. Otherwise b
            # keeps its position.
            place = (self.vertices[a] + self.vertices[b]) / 2 if self.new[b] else self.vertices[b]
            if self._can_contract(a, b, place):
                self._contract(a, b, place)

    def _edge_vector(self, a: int, b: int) -> Float:
        return np.asarray(self.vertices[a] - self.vertices[b])

    def _neighbours(self, v: int) -> set[int]:
        return {w for f in self.of[v] for w in self.faces[f] or () if w != v}

    def _can_contract(self, a: int, b: int, place: Float) -> bool:
        """Returns True if the contraction keeps the surface manifold, and no face flips or degenerates."""
        both = self.of[a] & self.of[b]
        if len(both) != 2 or len(self._neighbours(a) & self._neighbours(b)) != 2:
            return False
        moved = (self.of[a] | self.of[b]) - both
        if not moved:
            return False
        old_corners = np.array([self.vertices[self.faces[f]] for f in moved])
        after = np.array(
            [[place if v in (a, b) else self.vertices[v] for v in self.faces[f] or ()] for f in moved]
        )
        normals_before, normals_after = (
            np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (old_corners, after)
        )
        sizes = np.linalg.norm(normals_before, axis=1) * np.linalg.norm(normals_after, axis=1)
        return bool(
            ((normals_before * normals_after).sum(1) > 0.5 * sizes).all()
            and (np.linalg.norm(normals_after, axis=1) > 0).all()
        )

    def _contract(self, a: int, b: int, place: Float) -> None:
        for f in self.of[a] & self.of[b]:
            for v in self.faces[f] or ():
                if v not in (a, b):
                    self.of[v].discard(f)
            self.of[b].discard(f)
            self.faces[f] = None
        for f in self.of.pop(a):
            face = self.faces[f]
            if face is not None:
                self.faces[f] = [b if v == a else v for v in face]
                self.of[b].add(f)
        self.vertices[b] = place
        self.gone.add(a)
        self.drawn.add(b)
