"""The next best view: the camera position that would see most of the missing surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.scanning import GroundPlane

_FOCUS_RADIUS_M = 0.75
"""Distance from the focus in metres within which gaps count. Gaps farther away are ignored, because the
scanned floor always ends somewhere."""
_DIRECTIONS = 16
"""Number of compared directions around the object, each at two elevations."""
_ELEVATIONS = (0.3, 0.9)
"""Elevation angles above the horizon in radians: a camera at the height of a standing person, and a view from
above."""
_GAP_WIDTH_M = 0.04
"""Assumed width in metres of the missing surface beyond a boundary edge: a few cells. The missing area is
estimated with it."""
_FLOOR_BAND_M = 0.05
"""Height above the floor in metres below which a boundary edge belongs to the floor itself."""
_MIN_MISSING = 0.1
"""Minimum missing fraction. Below it, no further view is suggested."""


@dataclass(frozen=True)
class NextView:
    """The missing part of a scan.

    Attributes:
        missing: fraction of the surface near the focus that was not seen, in [0, 1].
        eye: (3,) camera position in metres, scan's world, that would see most of the missing surface; None if
            little is missing.
    """

    missing: float
    eye: Float | None


def find_next_view(mesh: Mesh, ground: GroundPlane, focus: Float, away: float) -> NextView:
    """Returns the next best view of a scan.

    At an open boundary the real surface continues, but bends away from the cameras that saw it. A camera on
    the side to which the boundary points sees the continuation.

    Args:
        mesh: the current surface at low resolution, metres in the scan's world.
        focus: (3,) the point that the camera looked at.
        away: metres, distance of the suggested camera from the focus.
    """
    midpoints, outward, lengths = _find_boundary(mesh)
    heights = ground.heights(midpoints) if len(midpoints) else np.empty(0)
    is_near = (
        np.exp(-np.square(np.linalg.norm(midpoints - focus, axis=1) / _FOCUS_RADIUS_M))
        if len(midpoints)
        else heights
    )
    # The boundary of the floor around the object is the edge of unseen floor behind the object. It has half
    # the weight, because a view of the object's back side is more useful.
    weights = lengths * is_near * np.where(heights > _FLOOR_BAND_M, 1.0, 0.5)
    faces = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(mesh.face_vectors(), axis=1) / 2
    focus_weights = np.exp(-np.square(np.linalg.norm(faces.mean(1) - focus, axis=1) / _FOCUS_RADIUS_M))
    seen_area = float((areas * focus_weights).sum())
    missing_area = float(weights.sum()) * _GAP_WIDTH_M
    missing = missing_area / max(missing_area + seen_area, 1e-9)
    if missing < _MIN_MISSING or not len(midpoints):
        return NextView(missing, None)
    directions = _view_directions(ground.normal)
    gains = (np.maximum(directions @ outward.T, 0.0) * weights).sum(1)
    return NextView(missing, focus + away * directions[int(gains.argmax())])


def _find_boundary(mesh: Mesh) -> tuple[Float, Float, Float]:
    """Returns midpoints (E, 3) of boundary edges, outward unit vectors (E, 3) and edge lengths (E,)."""
    faces = mesh.faces.astype(np.int64)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    opposite_corners = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    key, back = sides[:, 0] << 32 | sides[:, 1], sides[:, 1] << 32 | sides[:, 0]
    is_boundary = ~np.isin(key, back)
    ends, third = mesh.vertices[sides[is_boundary]], mesh.vertices[opposite_corners[is_boundary]]
    midpoints, edge_vectors = ends.mean(1), ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(edge_vectors, axis=1)
    outward = midpoints - third
    unit = edge_vectors / np.maximum(lengths, 1e-12)[:, None]
    outward -= (outward * unit).sum(1)[:, None] * unit
    return midpoints, outward / np.maximum(np.linalg.norm(outward, axis=1), 1e-12)[:, None], lengths


def _view_directions(up: Float) -> Float:
    """Returns (W, 3) unit vectors from the object to possible camera positions."""
    upright_rotation = rotation.to_matrix(rotation.swing(np.array([0.0, 1.0, 0.0]), up))
    directions = [
        [math.cos(high) * math.sin(a), math.sin(high), math.cos(high) * math.cos(a)]
        for high in _ELEVATIONS
        for a in np.arange(_DIRECTIONS) * (2 * math.pi / _DIRECTIONS)
    ]
    return np.asarray(directions @ upright_rotation.T)
