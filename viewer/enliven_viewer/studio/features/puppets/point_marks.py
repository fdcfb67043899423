"""Hit testing and drawing of a puppet's control points and suggested control points."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float32
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.studio.puppets.puppet_stage import StagePuppet
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import get_point_colour

GHOST_RADIUS = 7.0
"""Radius in pixels of a suggested point's ring. It is larger than a control point."""
POINT_RADIUS = 5.2
"""Radius in pixels of a control point on the mesh."""


def find_suggestion_at(
    standing: StagePuppet, suggested: tuple[int, ...], lens: Lens, pixel: Point
) -> int | None:
    """Returns the suggested vertex with its ring under a pixel, or None."""
    if not suggested:
        return None
    distances = np.linalg.norm(lens.project(standing.vertices[list(suggested)])[0] - pixel, axis=1)
    distances = np.where(np.isfinite(distances), distances, np.inf)
    nearest = int(distances.argmin())
    return suggested[nearest] if distances[nearest] <= GHOST_RADIUS + 2 else None


def make_point_rows(standing: StagePuppet, lens: Lens, chosen: int | None, hovered: int | None) -> Float32:
    """Returns the control points as balls.

    They are (P, 12) rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes`.
    """
    points = standing.handles
    tints = np.array([get_point_colour(k) for k in range(len(points))], float).reshape(-1, 3)
    radii = np.full(len(points), POINT_RADIUS)
    for number, grown in ((hovered, 1.25), (chosen, 1.35)):
        if number is not None and number < len(points):
            radii[number] = POINT_RADIUS * grown
    return make_tube_rows(points, points, radii * lens.pixel_sizes(points), linear_from_srgb(tints))
