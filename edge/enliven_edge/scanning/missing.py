"""The next best view: from where most of what a scan still lacks would be seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.scanning import Ground

_NEAR = 0.75
"""Metres about the point that was looked at within which a gap counts; a floor ends beyond it anyway."""
_AROUND = 16
"""Directions about the thing that are compared, each also from two heights."""
_RAISED = (0.3, 0.9)
"""Radians above the horizon: as a person carries a camera, and from above."""
_REACH = 0.04
"""Metres that the surface would go on beyond a gap's rim, to tell how much is missing: a few cells."""
_LOW = 0.05
"""Metres above the floor below which a rim is the floor's own."""
_ENOUGH = 0.1
"""Share that may be missing where nothing more is asked for."""


@dataclass(frozen=True)
class NextView:
    """What is missing.

    Attributes:
        missing: share of the surface near the focus that was not seen, 0..1.
        eye: (3,) from where most of it would be seen, metres, the scan's world; None where little is missing.
    """

    missing: float
    eye: Float | None


def next_view(mesh: Mesh, ground: Ground, focus: Float, away: float) -> NextView:
    """Returns the next best view of a scan.

    A surface that ends in the middle of nothing goes on there: it bends away from where it was seen, and is
    seen from the side to which its rim points.

    Args:
        mesh: the surface so far, coarse, metres, the scan's world.
        focus: (3,) what was looked at.
        away: metres from which it is looked at.
    """
    middles, outward, lengths = _rims(mesh)
    heights = ground.heights(middles) if len(middles) else np.empty(0)
    near = np.exp(-np.square(np.linalg.norm(middles - focus, axis=1) / _NEAR)) if len(middles) else heights
    # The rim of the floor about the thing is its shadow: what hides it is looked at from behind.
    worth = lengths * near * np.where(heights > _LOW, 1.0, 0.5)
    faces = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(mesh.face_vectors(), axis=1) / 2
    about = np.exp(-np.square(np.linalg.norm(faces.mean(1) - focus, axis=1) / _NEAR))
    seen = float((areas * about).sum())
    lacking = float(worth.sum()) * _REACH
    missing = lacking / max(lacking + seen, 1e-9)
    if missing < _ENOUGH or not len(middles):
        return NextView(missing, None)
    ways = _ways(ground.normal)
    gains = (np.maximum(ways @ outward.T, 0.0) * worth).sum(1)
    return NextView(missing, focus + away * ways[int(gains.argmax())])


def _rims(mesh: Mesh) -> tuple[Float, Float, Float]:
    """Returns (E, 3) the middles of sides with one face, (E, 3) unit vectors out of it, (E,) lengths."""
    faces = mesh.faces.astype(np.int64)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    across = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    key, back = sides[:, 0] << 32 | sides[:, 1], sides[:, 1] << 32 | sides[:, 0]
    alone = ~np.isin(key, back)
    ends, third = mesh.vertices[sides[alone]], mesh.vertices[across[alone]]
    middles, along = ends.mean(1), ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    out = middles - third
    unit = along / np.maximum(lengths, 1e-12)[:, None]
    out -= (out * unit).sum(1)[:, None] * unit
    return middles, out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None], lengths


def _ways(up: Float) -> Float:
    """Returns (W, 3) unit vectors from the thing to where a camera may be."""
    upright = rotation.to_matrix(rotation.swing(np.array([0.0, 1.0, 0.0]), up))
    found = [
        [math.cos(high) * math.sin(a), math.sin(high), math.cos(high) * math.cos(a)]
        for high in _RAISED
        for a in np.arange(_AROUND) * (2 * math.pi / _AROUND)
    ]
    return np.asarray(found @ upright.T)
