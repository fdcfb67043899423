"""Sample points of a surface, and a grid that finds the nearest one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from enliven.arrays import Float, Int32
from enliven.meshes import Mesh


@dataclass(frozen=True)
class SurfacePoints:
    """Points spread evenly on a surface.

    Attributes:
        points: (N, 3) metres, the positions.
        normals: (N, 3) unit, outward.
    """

    points: Float
    normals: Float

    def transform(self, pose: Float) -> SurfacePoints:
        """Returns the points after a rigid transform (4, 4)."""
        rotation_matrix = pose[:3, :3].T
        return SurfacePoints(self.points @ rotation_matrix + pose[:3, 3], self.normals @ rotation_matrix)

    def take_first(self, count: int) -> SurfacePoints:
        """Returns the first ``count`` points. They are also evenly spread, because the points are in random
        order.
        """
        return SurfacePoints(self.points[:count], self.normals[:count])


def sample_surface(mesh: Mesh, count: int, seed: int = 0) -> SurfacePoints:
    """Returns ``count`` random points of a mesh, evenly by area, in random order."""
    random, areas = np.random.default_rng(seed), np.linalg.norm(mesh.face_vectors(), axis=1)
    face = random.choice(len(areas), count, p=areas / areas.sum())
    root, random_share = np.sqrt(random.random((count, 1))), random.random((count, 1))
    barycentric = np.concatenate([1 - root, root * (1 - random_share), root * random_share], 1)
    points = (mesh.vertices[mesh.faces[face]] * barycentric[..., None]).sum(1)
    return SurfacePoints(points, mesh.face_normals()[face])


class NearestGrid(NamedTuple):
    """A lookup grid: for each cell of a box, the nearest point of a surface.

    Attributes:
        origin: (3,) metres, the corner of the first cell.
        cell: metres.
        nearest: (X, Y, Z) int32 index of the nearest point.
        points, normals: (N, 3) surface points and their normals.
    """

    origin: Float
    cell: float
    nearest: Int32
    points: Float
    normals: Float


def make_nearest_grid(surface: SurfacePoints, cell: float, margin: float) -> NearestGrid:
    """Returns the grid around a surface. It is computed by an exact distance transform of the cells that
    contain points.

    Args:
        cell: metres; one point represents all points of a cell.
        margin: metres around the surface that the grid covers.
    """
    low = surface.points.min(0) - margin
    size = np.ceil((surface.points.max(0) + margin - low) / cell).astype(int) + 1
    number = np.full(size, -1, np.int32)
    cells = np.floor((surface.points - low) / cell).astype(int)
    number[cells[:, 0], cells[:, 1], cells[:, 2]] = np.arange(len(cells))
    x, y, z = distance_transform_edt(number < 0, return_distances=False, return_indices=True)
    return NearestGrid(low, cell, number[x, y, z], surface.points, surface.normals)
