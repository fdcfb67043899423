"""Self-contact: keeps the limbs of a mesh apart, with balls inside the mesh and one-sided planes between
overlapping balls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Bool, Float
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.deformation.constraints.soft import ConstrainedPoints, subsample_on_grid
from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import Character
from enliven.kernels import njit
from enliven.settings import parameter, setting


@dataclass(frozen=True)
class SelfContactSettings:
    """Settings of self-contact, which keeps limbs from passing through each other."""

    use: bool = setting(
        False, "Turns on self-contact: parts of the mesh that touch each other are pushed apart."
    )
    detour: float = setting(
        3.0,
        "Two parts collide only if their distance along the surface exceeds their thickness "
        "times this factor. Raise it if neighbouring parts push each other.",
        low=1.0,
        high=100.0,
    )
    weight: float = parameter(
        10.0, "Weight of the self-contact constraint, as a factor on embedded.planes.", low=0.0, high=1000.0
    )


class SelfContact:
    """Self-contact of a mesh, with one ball per node inside the mesh.

    It tests pairs of balls that are far apart along the graph and do not overlap at rest.
    """

    def __init__(
        self, character: Character, graph: DeformationGraph, settings: SelfContactSettings | None = None
    ) -> None:
        self.settings = settings or SelfContactSettings()
        surface = character.vertices[subsample_on_grid(character.vertices, 3000)].astype(np.float64)
        ends = graph.positions[graph.edges]
        spacing = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean()) if len(ends) else 0.0
        self.radii = _inner_radii(graph.positions, graph.normals, surface, 2.0 * spacing)
        count = len(graph.positions)
        nodes = np.zeros((count, 4), np.int32)
        nodes[:, 0] = np.arange(count)
        weights = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        centres = graph.positions - self.radii[:, None] * graph.normals
        self._balls = ConstrainedPoints(centres, nodes, weights, graph.positions)
        self.pairs = np.argwhere(np.triu(self._find_possible_contacts(graph, centres, spacing), 1)).astype(
            np.int32
        )
        self._sides = np.zeros((len(self.pairs), 3))

    def _find_possible_contacts(self, graph: DeformationGraph, centres: Float, spacing: float) -> Bool:
        """Returns (N, N) True for pairs of balls that do not overlap at rest, and are far apart along the
        graph."""
        a, b = graph.edges[:, 0], graph.edges[:, 1]
        lengths = np.maximum(np.linalg.norm(graph.positions[a] - graph.positions[b], axis=1), 1e-9)
        count = len(graph.positions)
        path_lengths = scipy.sparse.csgraph.dijkstra(
            scipy.sparse.csr_matrix((lengths, (a, b)), (count, count)), directed=False
        )
        reach = self.radii[:, None] + self.radii[None]
        distances = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        return np.asarray(
            (distances > reach) & (path_lengths > self.settings.detour * np.maximum(reach, spacing))
        )

    def planes(self, linear: Float, positions: Float) -> PlaneConstraints:
        """Returns two planes for each pair of balls that overlap or nearly overlap, one for each ball's
        side."""
        centres = self._balls.deform_points(linear, positions)
        is_near = _near_pairs(centres, self.radii, self.pairs, self._sides)
        first, second = self.pairs[is_near, 0], self.pairs[is_near, 1]
        sides, first_radii, second_radii = self._sides[is_near], self.radii[first], self.radii[second]
        contact_points = (second_radii[:, None] * centres[first] + first_radii[:, None] * centres[second]) / (
            first_radii + second_radii
        )[:, None]
        contact_offsets = np.einsum("pa,pa->p", sides, contact_points)
        return self._balls.create_planes(
            np.concatenate([first, second]),
            np.concatenate([sides, -sides]),
            np.concatenate([contact_offsets + first_radii, -contact_offsets + second_radii]),
            self.settings.weight,
            True,
        )


@njit(cache=True, nogil=True)
def _inner_radii(points, normals, surface, largest):
    """Returns (N,) the radius in metres of the largest ball inside the surface that touches it at each point.

    The method is that of J. Ma et al., "3D medial axis point approximation using nearest neighbors and the
    normal field", 2012: the ball through p and q that is tangent at p has the radius |p - q|^2 / (2 n·(p -
    q)). The smallest of these balls contains no other point. The radius is at most ``largest``.
    """
    out = np.full(points.shape[0], largest)
    for i in range(points.shape[0]):
        for j in range(surface.shape[0]):
            square, deep = 0.0, 0.0
            for a in range(3):
                d = points[i, a] - surface[j, a]
                square += d * d
                deep += normals[i, a] * d
            # Skip points that are far to the side of the normal. They contain little information about the
            # thickness, and depend much on the roughness of the surface.
            if deep > 0.3 * np.sqrt(square) and square < 2.0 * deep * out[i]:
                out[i] = square / (2.0 * deep)
    return out


@njit(cache=True, nogil=True)
def _near_pairs(centres, radii, pairs, sides):
    """Returns (P,) True for pairs of balls that overlap or nearly overlap, and updates their ``sides`` (P,
    3), unit vectors from the second to the first ball.

    While a pair is near, its direction rotates but never flips. If the balls overlap deeply, the direction
    stays constant. So balls that have passed through each other are pushed back to their earlier sides.
    """
    near = np.zeros(pairs.shape[0], np.bool_)
    for p in range(pairs.shape[0]):
        i, j = pairs[p, 0], pairs[p, 1]
        x = centres[i, 0] - centres[j, 0]
        y = centres[i, 1] - centres[j, 1]
        z = centres[i, 2] - centres[j, 2]
        reach = 1.25 * (radii[i] + radii[j])
        square = x * x + y * y + z * z
        along_side = sides[p, 0] * x + sides[p, 1] * y + sides[p, 2] * z
        has_side = sides[p, 0] != 0.0 or sides[p, 1] != 0.0 or sides[p, 2] != 0.0
        if square >= reach * reach:
            sides[p] = 0.0
            continue
        length = np.sqrt(square)
        near[p] = True
        if (has_side and (along_side <= 0.0 or length < 0.5 * reach)) or length < 1e-9:
            continue
        sides[p, 0], sides[p, 1], sides[p, 2] = x / length, y / length, z / length
    return near
