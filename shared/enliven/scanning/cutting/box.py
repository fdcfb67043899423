"""A box in the upright frame of a scan, and the part of the scan inside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.errors import InputError
from enliven.meshes import Mesh, extract_submesh
from enliven.scanning.cutting.parts import CutOut, place_on_floor
from enliven.scanning.ground_plane import GroundPlane, cut_above_plane
from enliven.scanning.settings import CutOutSettings

_BELOW_FLOOR_M = 0.02
"""Minimum depth (metres) of a box below the floor at which the cut-out object includes the floor."""


def upright_frame(ground: GroundPlane, focus: Float) -> Float:
    """Returns the transform (4, 4) from a scan's world to its upright frame.

    +y is up, y = 0 is the floor, and the origin lies below ``focus`` (3,), the point that the cameras look
    at. The frame is not rotated about +y relative to the world.
    """
    rotation_matrix = np.asarray(rotation.to_matrix(rotation.swing(ground.normal, np.array([0.0, 1.0, 0.0]))))
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation_matrix, -(rotation_matrix @ focus)
    frame[1, 3] = -ground.offset
    return frame


@dataclass(frozen=True)
class CutBox:
    """A box with horizontal and vertical sides.

    Attributes:
        low, high: (3,) metres, its corners in the upright frame.
        upright_from_world: (4, 4) transform from the scan's world to the upright frame.
    """

    low: Float
    high: Float
    upright_from_world: Float

    def __post_init__(self) -> None:
        if (
            not (np.isfinite(self.low).all() and np.isfinite(self.high).all())
            or (self.low >= self.high).any()
        ):
            problem = "a box needs two corners, and each coordinate of the first corner must be smaller"
            raise InputError(
                problem,
                where="box",
                remedy="Write the box as x0,y0,z0,x1,y1,z1 with x0 < x1, y0 < y1, z0 < z1.",
            )

    def planes(self) -> list[tuple[Float, float]]:
        """Returns the six (normal (3,), offset) in the world; a point is inside if normal . x > offset for
        all six.
        """
        rotation_matrix, translation = self.upright_from_world[:3, :3], self.upright_from_world[:3, 3]
        planes = []
        for axis in range(3):
            planes.append((rotation_matrix[axis], float(self.low[axis] - translation[axis])))
            planes.append((-rotation_matrix[axis], float(translation[axis] - self.high[axis])))
        return planes


def cut_by_box(mesh: Mesh, box: CutBox, settings: CutOutSettings | None = None) -> CutOut:
    """Returns the part of a scan inside a box, without the floor unless the box reaches 2 cm below it.

    The part is closed at its base, along the lower side of the box. Along the other sides it stays open.

    Args:
        mesh: the scan, in its world frame.

    Raises:
        InputError: if no surface lies in the box; the message gives the extent of the surface.
    """
    s = settings or CutOutSettings()
    cut_low = box.low.copy()
    if -_BELOW_FLOOR_M < cut_low[1] < s.clearance:
        cut_low[1] = s.clearance
    if cut_low[1] >= box.high[1]:
        problem = f"a box up to {box.high[1]:.3f} m contains only the floor"
        raise InputError(problem, where="box", remedy="Make the box higher.")
    part = _faces_near_box(mesh, box)
    for normal, offset in CutBox(cut_low, box.high, box.upright_from_world).planes():
        part = cut_above_plane(part, normal, offset)
    if part.area < s.least_area:
        level_vertices = mesh.vertices @ box.upright_from_world[:3, :3].T + box.upright_from_world[:3, 3]
        problem = "no surface was scanned in the box"
        extent_text = " to ".join(
            ",".join(f"{x:.2f}" for x in corner) for corner in (level_vertices.min(0), level_vertices.max(0))
        )
        raise InputError(problem, where="box", remedy=f"The scanned surface extends from {extent_text}.")
    return place_on_floor(part, box.upright_from_world, float(cut_low[1]), s)


def _faces_near_box(mesh: Mesh, box: CutBox) -> Mesh:
    """Returns only the faces that may intersect a box. So cutting a box out of a whole room is fast."""
    points = mesh.vertices @ box.upright_from_world[:3, :3].T + box.upright_from_world[:3, 3]
    corners = points[mesh.faces]
    may_intersect = (corners.max(1) >= box.low).all(1) & (corners.min(1) <= box.high).all(1)
    return extract_submesh(mesh, may_intersect)
