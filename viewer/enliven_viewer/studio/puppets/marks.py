"""What the puppet tool draws over the picture, and which control point or suggestion is under the pointer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.render.overlay.tubes import tube_rows
from enliven_viewer.render.skinned import linear
from enliven_viewer.studio.puppets.mesh_cache import normals_of
from enliven_viewer.studio.puppets.mirrored import partner_vertex
from enliven_viewer.studio.puppets.stage import Standing
from enliven_viewer.studio.viewport.overlay import Disc, Fill, Line, Point, Words
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.theme import ACCENT, INK, QUIET, Colour, point_colour

if TYPE_CHECKING:
    from enliven_viewer.studio.tools.puppet import PuppetTool

_GHOST, _RADIUS = 7.0, 5.2
"""Pixels: of a suggestion's ring, of a control point."""
_WHITE: Colour = (1.0, 1.0, 1.0, 0.9)
Mark = Line | Disc | Fill | Words


def point_at(standing: Standing, lens: Lens, at: Point, reach: float) -> int | None:
    """The control point nearest to a pixel within ``reach`` pixels; of two as near, the one before."""
    if not len(standing.points):
        return None
    pixels, depth = lens.project(standing.points)
    away = np.linalg.norm(pixels - at, axis=1)
    near = [int(k) for k in np.flatnonzero(away <= reach)]
    return min(near, key=lambda k: (round(float(away[k]) / 3), float(depth[k])), default=None)


def ghost_at(standing: Standing, suggested: tuple[int, ...], lens: Lens, at: Point) -> int | None:
    """The suggested vertex whose ring is under a pixel."""
    if not suggested:
        return None
    away = np.linalg.norm(lens.project(standing.vertices[list(suggested)])[0] - at, axis=1)
    away = np.where(np.isfinite(away), away, np.inf)
    nearest = int(away.argmin())
    return suggested[nearest] if away[nearest] <= _GHOST + 2 else None


def point_rows(standing: Standing, lens: Lens, chosen: int | None, hovered: int | None) -> Float32:
    """(P, 12) of :class:`~enliven_viewer.render.overlay.tubes.Tubes`: the control points as balls."""
    points = standing.points
    depth = np.maximum((points - lens.view.eye) @ lens.forward, 0.05)
    pixel = 2 * depth / (lens.view.clip_from_camera[1, 1] * lens.size[1])
    tints = np.array([point_colour(k) for k in range(len(points))], float).reshape(-1, 3)
    radii = np.full(len(points), _RADIUS)
    for number, grown in ((hovered, 1.25), (chosen, 1.35)):
        if number is not None and number < len(points):
            radii[number] = _RADIUS * grown
    return tube_rows(points, points, radii * pixel, linear(tints))


def marks_of(tool: PuppetTool, standing: Standing, lens: Lens) -> tuple[Mark, ...]:
    """Suggestions, where a click would put a control point, names, the manipulator's squares."""
    found: list[Mark] = []
    if tool.held is None:
        found += _suggestions(tool, standing, lens)
        found += _next_point(tool, standing, lens)
    found += _names(tool, standing, lens)
    manipulator = tool.manipulator()
    if manipulator is not None:
        part = tool.held.part if tool.held is not None else ""
        found += manipulator.marks(part or tool.over, part)
    return tuple(found)


def _suggestions(tool: PuppetTool, standing: Standing, lens: Lens) -> list[Mark]:
    """Rings at the ends of limbs; only before key poses are made, then they are in the way."""
    if standing.puppet.poses or tool.desk.posing:
        return []
    found: list[Mark] = []
    for vertex in tool.suggested.of(standing.puppet):
        place = standing.vertices[vertex]
        # At the far side it is fainter.
        seen = standing.way_into(lens.view.eye - place) @ normals_of(standing.puppet.mesh)[vertex] > 0.0
        white, dark = ((1.0, 1.0, 1.0, 0.8), 0.35) if seen else ((1.0, 1.0, 1.0, 0.3), 0.12)
        for pixel in _pixels(lens, place[None]):
            found.append(Disc(pixel, _GHOST, (0.0, 0.0, 0.0, dark), 3.5))
            found.append(Disc(pixel, _GHOST, white, 1.5))
            found.append(Disc(pixel, 1.6, white))
    return found


def _next_point(tool: PuppetTool, standing: Standing, lens: Lens) -> list[Mark]:
    """A ring where a click would put a control point, and at its mirror image."""
    if tool.over_vertex is None:
        return []
    wanted = [tool.over_vertex]
    if tool.desk.symmetric:
        other = partner_vertex(standing.puppet, tool.over_vertex)
        wanted += [other] if other is not None and other != tool.over_vertex else []
    found: list[Mark] = []
    for pixel in _pixels(lens, standing.vertices[wanted]):
        found.append(Disc(pixel, 6.5, ACCENT, 2.0))
        found.append(Disc(pixel, 2.0, ACCENT))
    return found


def _names(tool: PuppetTool, standing: Standing, lens: Lens) -> list[Mark]:
    """The names of the chosen control point and of the one under the pointer; a ring around the chosen."""
    found: list[Mark] = []
    chosen, points = tool.desk.point, standing.puppet.points
    for number in dict.fromkeys([chosen, tool.over_point]):
        if number is None or number >= len(points):
            continue
        for pixel in _pixels(lens, standing.points[[number]]):
            if number == chosen:
                found.append(Disc(pixel, _RADIUS * 1.35 + 2.5, _WHITE, 1.5))
            point = points[number]
            at = (pixel[0] + 16, pixel[1] + 24)
            found.append(Words(at, point.name, INK))
            if point.joint:
                found.append(Words((at[0], at[1] + 16), point.joint, QUIET))
    return found


def _pixels(lens: Lens, points: Float) -> list[Point]:
    """The pixels of places (N, 3) that are before the eye."""
    if not len(points):
        return []
    return [(float(x), float(y)) for x, y in lens.project(points)[0] if np.isfinite(x) and np.isfinite(y)]
