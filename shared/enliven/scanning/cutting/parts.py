"""Post-processing of an object that was cut out of a scan: removes small noise parts (specks), and places the
object on y = 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.meshes import Mesh, extract_submesh, shells
from enliven.scanning.holes import close_holes
from enliven.scanning.settings import CutOutSettings

_MAX_SPECK_FRACTION = 0.02
"""A part with less than this fraction of the largest part's surface area is noise floating in space."""
_ON_PLANE_M = 1e-9
"""Maximum distance, metres, of a vertex that counts as lying on a plane. It allows for the rounding error of
a cut."""


@dataclass(frozen=True)
class CutOut:
    """An object that was cut out.

    Attributes:
        mesh: upright, metres, standing on y = 0, its box centred on x and z.
        parts: number of connected components of the surface.
        area: square metres of scanned surface, without filled holes.
    """

    mesh: Mesh
    parts: int
    area: float


def remove_specks(mesh: Mesh) -> tuple[Mesh, int]:
    """Removes parts that are noise. Returns the mesh and the number of remaining parts."""
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    areas = np.bincount(label, np.linalg.norm(mesh.face_vectors(), axis=1))
    large = areas > _MAX_SPECK_FRACTION * areas.max()
    return extract_submesh(mesh, large[label]), int(np.count_nonzero(large))


def place_on_floor(mesh: Mesh, level_from_world: Float, cut_at: float, settings: CutOutSettings) -> CutOut:
    """Turns a mesh that was cut along a horizontal plane into a standing object with a closed base.

    Args:
        mesh: the cut mesh, in the scan's world.
        level_from_world: (4, 4) to a frame with +y up and the supporting plane at y = 0.
        cut_at: metres above y = 0 of the cut. The lowest vertices are extended down again by this height.
    """
    cleaned, part_count = remove_specks(mesh)
    area = cleaned.area
    vertices = cleaned.vertices @ level_from_world[:3, :3].T + level_from_world[:3, 3]
    feet = vertices[:, 1] < cut_at + _ON_PLANE_M
    if 0.0 < cut_at < settings.clearance + _ON_PLANE_M:
        vertices[feet, 1] = 0.0
    low, high = vertices.min(0), vertices.max(0)
    # If the floor is kept, leave it at y = 0.
    vertices -= [(low[0] + high[0]) / 2, low[1] if cut_at > 0.0 else 0.0, (low[2] + high[2]) / 2]
    return CutOut(close_holes(replace(cleaned, vertices=vertices), feet, settings), part_count, area)
