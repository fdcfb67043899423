"""The space that an object occupies, and the image points inside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from enliven.arrays import Bool, Float
from enliven.meshes import Mesh
from enliven.scanning.depth_view import DepthView
from enliven.scanning.ground_plane import GroundPlane
from enliven.scanning.objects.surface_points import sample_surface

_CELL_M = 0.01
"""Cell size of a region, metres. It is half of the usual clearance above the floor."""
_SURFACE_POINTS = 60_000
"""Number of sample points that mark the cells of a surface: more than one per cell for objects as large as a
chair."""


@dataclass(frozen=True)
class ObjectRegion:
    """The space near a surface, above the ground.

    Attributes:
        origin: (3,) metres, corner of the first cell.
        near: (X, Y, Z) True for each cell near the surface.
        ground: the plane that the object stands on.
        clearance: height above the ground, metres, below which no point belongs to the object.
    """

    origin: Float
    near: Bool
    ground: GroundPlane
    clearance: float

    def contains_points(self, points: Float) -> Bool:
        """Returns a mask (...) of the points (..., 3) that lie in the region."""
        cells = np.floor((points - self.origin) / _CELL_M).astype(int)
        inside: Bool = np.asarray(((cells >= 0) & (cells < self.near.shape)).all(-1))
        x, y, z = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
        return np.asarray(inside & self.near[x, y, z] & (self.ground.heights(points) > self.clearance))


def create_region(mesh: Mesh, ground: GroundPlane, clearance: float, width: float) -> ObjectRegion:
    """Returns the region of all points within ``width`` metres of a surface."""
    points = sample_surface(mesh, _SURFACE_POINTS).points
    origin = points.min(0) - width - _CELL_M
    shape = np.ceil((points.max(0) + width + _CELL_M - origin) / _CELL_M).astype(int) + 1
    empty = np.ones(shape, bool)
    empty[tuple(np.floor((points - origin) / _CELL_M).astype(int).T)] = False
    is_near = np.asarray(distance_transform_edt(empty)) * _CELL_M <= width
    return ObjectRegion(origin, is_near, ground, clearance)


def points_in_region(region: ObjectRegion, view: DepthView, world_from_camera: Float) -> Bool:
    """Returns (h, w) True for each point of a view that lies in a region."""
    world = view.points @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]
    return np.asarray((view.worth > 0) & region.contains_points(world))
