"""Constraints from depth points: a surface follows the observed points directly, without a skeleton.

KinÊtre proposes this as future work ("data could be derived directly from the depth map"). The method is
non-rigid ICP with the deformation graph as its prior. In each frame, every observed point is matched to the
nearest compatible point of the current mesh. The matched point of the mesh is then pulled onto the plane
through the observed point (point-to-plane, Y. Chen and G. Medioni 1992), with a Geman-McClure weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.deformation.constraints.soft import ConstrainedPoints, subsample_on_grid
from enliven.document import Character
from enliven.kernels import njit
from enliven.meshes import Mesh
from enliven.settings import parameter, setting


@dataclass(frozen=True)
class ObservedSettings:
    """Settings for following the observed surface of the performer."""

    farthest: float = parameter(
        0.25,
        "Maximum distance at which an observed point attracts the mesh.",
        unit="m",
        low=0.0,
        high=5.0,
    )
    angle: float = parameter(
        math.pi / 3,
        "Maximum angle between the surface normals at an observed point and at the mesh.",
        unit="rad",
        low=0.0,
        high=math.pi,
    )
    doubt: float = parameter(
        0.08,
        "Width of the robust weight function: a point at this distance has a quarter of the full weight.",
        unit="m",
        low=0.001,
        high=5.0,
    )
    points: int = parameter(
        500, "Maximum number of observed points that are used per frame.", low=10, high=20_000
    )
    surface: int = parameter(
        1500, "Number of sample points on the mesh that observed points can attract.", low=10, high=100_000
    )
    weight: float = setting(
        3.0, "Weight of the observed points, as a factor on embedded.planes.", low=0.0, high=1000.0
    )


@dataclass(frozen=True)
class ObservedPoints:
    """The observed surface of one performer.

    Attributes:
        points: (M, 3) metres, world frame, on the performer's surface.
        normals: (M, 3) outward unit normals.
    """

    points: Float | Float32
    normals: Float | Float32


class ObservedSurface:
    """Sample points of a mesh that are matched with the observed surface and pulled onto it."""

    def __init__(self, character: Character, settings: ObservedSettings | None = None) -> None:
        self.settings = settings or ObservedSettings()
        samples = subsample_on_grid(character.vertices, self.settings.surface)
        self.points = ConstrainedPoints.from_vertices(character, samples)
        mesh = Mesh(character.vertices.astype(np.float64), character.faces, character.id)
        self._tips = ConstrainedPoints(
            self.points.at + _NORMAL_STEP_M * mesh.vertex_normals()[samples],
            self.points.nodes,
            self.points.weights,
            self.points.pivots,
        )

    def planes(
        self, linear: Float, positions: Float, points: Float, normals: Float, metre: float = 1.0
    ) -> PlaneConstraints:
        """Returns the planes that pull the current surface of the mesh onto the observed points.

        Args:
            linear: (N, 3, 3) the nodes' current linear parts.
            positions: (N, 3) metres, the nodes' current positions.
            points: (M, 3) metres, rest space, on the observed surface.
            normals: (M, 3) the outward unit normals at these points.
            metre: length of one metre of the performer in the rest space.
        """
        settings = self.settings
        valid = np.flatnonzero(np.isfinite(points).all(1) & np.isfinite(normals).all(1))
        subset = valid[:: max(1, math.ceil(len(valid) / settings.points))]
        points, normals = np.ascontiguousarray(points[subset], np.float64), normals[subset].astype(np.float64)
        surface = self.points.deform_points(linear, positions)
        surface_normals = self._tips.deform_points(linear, positions) - surface
        surface_normals /= np.maximum(np.linalg.norm(surface_normals, axis=1, keepdims=True), 1e-12)
        max_distance = settings.farthest * metre
        nearest, lengths = find_compatible_surface_points(
            points, normals, surface, surface_normals, max_distance, math.cos(settings.angle)
        )
        is_matched = nearest >= 0
        nearest, points, normals, lengths = (
            nearest[is_matched],
            points[is_matched],
            normals[is_matched],
            lengths[is_matched],
        )
        scaled_distance = np.einsum("ma,ma->m", normals, surface[nearest] - points) / (settings.doubt * metre)
        # Fade the weight to zero at the maximum distance, so that the weight does not jump when a match
        # appears or disappears.
        fade = 1.0 - (lengths / max(max_distance, 1e-12)) ** 2
        weights = settings.weight * fade / (1.0 + scaled_distance * scaled_distance) ** 2
        offsets = np.einsum("ma,ma->m", normals, points)
        return self.points.create_planes(nearest, normals, offsets, weights, False)


_NORMAL_STEP_M = 1e-3
"""Distance along a normal, metres, for measuring its rotation by finite differences."""


@njit(cache=True, nogil=True)
def find_compatible_surface_points(points, normals, surface, facing, farthest, cosine):
    """Returns (M,) the nearest surface point with a compatible normal for each point, or -1 for none, and
    (M,) the distance to it in metres.
    """
    nearest = np.full(points.shape[0], -1, np.int64)
    lengths = np.zeros(points.shape[0])
    for i in range(points.shape[0]):
        best = farthest * farthest
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for j in range(surface.shape[0]):
            dx, dy, dz = surface[j, 0] - x, surface[j, 1] - y, surface[j, 2] - z
            square = dx * dx + dy * dy + dz * dz
            if square >= best:
                continue
            n = normals[i]
            if n[0] * facing[j, 0] + n[1] * facing[j, 1] + n[2] * facing[j, 2] > cosine:
                best, nearest[i] = square, j
        lengths[i] = np.sqrt(best)
    return nearest, lengths
