"""Shared parts of the soft constraints: points of a mesh, their current positions, and the union of sets of
planes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int, Int32
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.document import Character
from enliven.kernels import njit


@dataclass(frozen=True)
class ConstrainedPoints:
    """Points of a mesh at rest, and the nodes that move them.

    Attributes:
        at: (P, 3) metres, the points in the rest space.
        nodes: (P, 4) int32, the nodes that move each point.
        weights: (P, 4) weights of these nodes, which sum to one.
        pivots: (N, 3) metres, the positions of the nodes at rest.
    """

    at: Float
    nodes: Int32
    weights: Float
    pivots: Float

    @staticmethod
    def from_vertices(character: Character, vertices: Int) -> ConstrainedPoints:
        """Returns the vertices of a character with the indices ``vertices`` as points."""
        return ConstrainedPoints(
            character.vertices[vertices].astype(np.float64),
            character.skin.indices[vertices].astype(np.int32),
            character.skin.weights[vertices].astype(np.float64),
            character.pivots.astype(np.float64),
        )

    def __len__(self) -> int:
        return len(self.at)

    def deform_points(self, linear: Float, positions: Float) -> Float:
        """Returns the positions (P, 3) in metres of the points for nodes at ``linear`` (N, 3, 3),
        ``positions`` (N, 3).
        """
        linear, positions = np.ascontiguousarray(linear), np.ascontiguousarray(positions)
        return np.asarray(_deformed_points(self.at, self.nodes, self.weights, self.pivots, linear, positions))

    def create_planes(
        self,
        which: Int | Bool,
        normals: Float,
        offsets: Float | float,
        weights: Float | float,
        one_sided: bool,
    ) -> PlaneConstraints:
        """Returns one plane for each selected point. ``which`` contains the indices (M,) of the points, or is
        a mask (P,)."""
        count = len(normals)
        return PlaneConstraints(
            self.at[which],
            self.nodes[which],
            self.weights[which],
            np.ascontiguousarray(normals),
            np.broadcast_to(offsets, count).astype(np.float64),
            np.broadcast_to(weights, count).astype(np.float64),
            np.full(count, one_sided),
        )


def join_planes(sets: Sequence[PlaneConstraints]) -> PlaneConstraints | None:
    """Returns the union of several sets of planes, or None if all are empty."""
    sets = [planes for planes in sets if len(planes)]
    if len(sets) < 2:
        return sets[0] if sets else None
    parts = [part.name for part in fields(PlaneConstraints)]
    return PlaneConstraints(*(np.concatenate([getattr(planes, part) for planes in sets]) for part in parts))


def subsample_on_grid(points: Float | Float32, max_count: int) -> Int:
    """Returns at most ``max_count`` indices of evenly distributed points, out of (P, 3): one point per cell
    of a grid.

    The size of the cells is chosen to return nearly ``max_count`` points.
    """
    if len(points) <= max_count:
        return np.arange(len(points))
    low = points.min(0)
    cell = float(np.linalg.norm(np.ptp(points, axis=0))) / max(max_count, 1) ** 0.5 + 1e-12
    indices = _find_first_point_per_cell(points, low, cell)
    while len(indices) < max_count:
        cell, previous = cell / 1.25, indices
        indices = _find_first_point_per_cell(points, low, cell)
        if len(indices) > max_count:
            return previous
    while len(indices) > max_count:
        cell *= 1.1
        indices = _find_first_point_per_cell(points, low, cell)
    return indices


def _find_first_point_per_cell(points: Float | Float32, low: Float | Float32, cell: float) -> Int:
    """Returns the index (K,) of the first point in each occupied cell of a grid with the corner ``low`` (3,)
    and cells of ``cell`` metres."""
    cells = np.floor((points - low) / cell).astype(np.int64)
    return np.sort(np.unique(cells, axis=0, return_index=True)[1])


@njit(cache=True, nogil=True)
def _deformed_points(at, nodes, weights, pivots, linear, positions):
    """Computes the positions of :meth:`ConstrainedPoints.deform_points`, with the deformation map of
    KinÊtre, eq. 2."""
    out = np.zeros((at.shape[0], 3))
    for i in range(at.shape[0]):
        for k in range(4):
            w, j = weights[i, k], nodes[i, k]
            if w == 0.0:
                continue
            x, y, z = at[i, 0] - pivots[j, 0], at[i, 1] - pivots[j, 1], at[i, 2] - pivots[j, 2]
            for a in range(3):
                m = linear[j, a]
                out[i, a] += w * (positions[j, a] + m[0] * x + m[1] * y + m[2] * z)
    return out
