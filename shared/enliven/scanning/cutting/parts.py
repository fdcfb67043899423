"""What was cut out of a scan, in parts: specks are dropped, and the rest stands on y = 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.meshes import Mesh, shells, submesh
from enliven.scanning.rims import close_holes
from enliven.scanning.settings import CutOutSettings

_SPECK = 0.02
"""Share of the largest part's surface below which another part is noise that floats about."""
_LEVEL = 1e-9
"""Metres from a plane within which a vertex lies on it: what the arithmetic of a cut is off by."""


@dataclass(frozen=True)
class CutOut:
    """A thing that was cut out.

    Attributes:
        mesh: upright, metres, standing on y = 0, its box centred on x and z.
        parts: how many pieces of surface it has that do not hang together.
        area: square metres of it that were scanned, without what was closed.
    """

    mesh: Mesh
    parts: int
    area: float


def without_specks(mesh: Mesh) -> tuple[Mesh, int]:
    """Returns the mesh without parts that are noise, and how many parts are left."""
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    areas = np.bincount(label, np.linalg.norm(mesh.face_vectors(), axis=1))
    large = areas > _SPECK * areas.max()
    return submesh(mesh, large[label]), int(np.count_nonzero(large))


def set_down(mesh: Mesh, level_from_world: Float, cut_at: float, settings: CutOutSettings) -> CutOut:
    """Returns a mesh that was cut along a level plane as a thing that stands, closed where it stood.

    Args:
        mesh: in the scan's world.
        level_from_world: (4, 4) to where +y is up, and y = 0 is what the thing stood on.
        cut_at: metres above that at which it was cut: what the cut took off its feet is given back to them.
    """
    kept, parts = without_specks(mesh)
    area = kept.area
    vertices = kept.vertices @ level_from_world[:3, :3].T + level_from_world[:3, 3]
    feet = vertices[:, 1] < cut_at + _LEVEL
    if 0.0 < cut_at < settings.clearance + _LEVEL:
        vertices[feet, 1] = 0.0
    low, high = vertices.min(0), vertices.max(0)
    # Where the floor is kept, it stays y = 0.
    vertices -= [(low[0] + high[0]) / 2, low[1] if cut_at > 0.0 else 0.0, (low[2] + high[2]) / 2]
    return CutOut(close_holes(replace(kept, vertices=vertices), feet, settings), parts, area)
