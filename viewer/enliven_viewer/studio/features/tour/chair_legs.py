"""Finds the leg of a chair in the image, a stroke that cuts it off, and a path to drag it to
another place.
"""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Float32, Int
from enliven.document import GraphCharacter
from enliven.meshes import Mesh
from enliven_viewer.studio.app.targets import Rectangle, Target
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.overlay import Point

Stroke = tuple[Point, Point]
"""Both ends of a stroke, in pixels of the image."""

_SEARCH_HEIGHTS = np.linspace(0.05, 0.4, 15)
"""Heights below which legs are searched, as fractions of the chair's height. Seats are higher."""
_MAX_FLOOR_GAP = 0.02
"""Maximum height of a leg's lowest point above the floor, as a fraction of the chair's height."""
_MIN_VERTICES = 12
"""Minimum number of vertices of a leg. Smaller parts are only fragments."""
_CUT_HEIGHTS = (0.72, 0.6, 0.5, 0.4, 0.3)
"""Possible cutting heights as fractions of a leg's height. The highest cut that crosses nothing
else is used.
"""
_BAND_COUNT = 8
"""Number of height bands into which a leg's vertices are sorted. The band at the cut gives the leg's width
there.
"""
_LEG_MARGIN_PX = 10.0
"""Margin in pixels around a leg."""
_STROKE_OVERHANG_PX = 14.0
"""Length in pixels of the stroke beyond each side of the leg, so that it cuts the whole leg."""
_MIN_LENGTH_PX = 4.0
"""Minimum projected length in pixels of a leg, between the centres of its halves. A leg with a shorter
projection points at the camera.
"""
_STROKE_MARGIN_PX = 2 * _STROKE_OVERHANG_PX
"""Margin in pixels around a leg's box that contains its stroke, including the ends beyond both sides."""
_FREE_DISTANCE_PX = 3.0
"""Distance in pixels on both sides of a stroke that must be free of other parts, because people do not draw
straight.
"""
_ATTACH_HEIGHT = 0.35
"""The part is attached above this fraction of the chair's height, that is, above the seat."""
_MAX_DEPTH_DIFFERENCE = 0.03
"""Maximum depth difference between the part and its new position, as a fraction of the chair's height, so
that part and chair touch.
"""
# The legs of the last surfaces are cached, because they are needed in every frame.
_LEG_CACHE: list[tuple[Mesh, tuple[Int, ...]]] = []
_MAX_CACHED_SURFACES = 4
"""Number of cached surfaces: those of the chair and of parts that were cut off."""


def find_legs(mesh: Mesh) -> tuple[Int, ...]:
    """Returns the vertices of each leg: the connected parts below the height that separates most parts.

    If a mesh has no such parts, its lowest fifth counts as one leg.
    """
    for cached_mesh, legs in _LEG_CACHE:
        if cached_mesh is mesh:
            return legs
    _LEG_CACHE.append((mesh, _search_legs(mesh)))
    del _LEG_CACHE[:-_MAX_CACHED_SURFACES]
    return _LEG_CACHE[-1][1]


def _search_legs(mesh: Mesh) -> tuple[Int, ...]:
    heights = mesh.vertices[:, 1] - mesh.vertices[:, 1].min()
    height = max(float(heights.max()), 1e-6)
    best_parts: tuple[Int, ...] = ()
    for fraction in _SEARCH_HEIGHTS:
        parts = [
            leg
            for leg in _find_parts(mesh, heights < fraction * height)
            if heights[leg].min() < _MAX_FLOOR_GAP * height
        ]
        if len(parts) >= max(len(best_parts), 2):
            # Heights are tried from low to high. If two heights give the same number of legs, take the
            # greater height.
            best_parts = tuple(parts)
    if best_parts:
        return best_parts
    return (np.flatnonzero(heights <= 0.2 * height),)


def _find_parts(mesh: Mesh, low: np.ndarray) -> tuple[Int, ...]:
    """Returns the vertices of each connected part of the faces that lie completely in the low region."""
    faces = mesh.faces[low[mesh.faces].all(1)]
    count = len(mesh.vertices)
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = scipy.sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    labels = scipy.sparse.csgraph.connected_components(links, directed=False)[1]
    used = np.unique(faces)
    parts = [used[labels[used] == label] for label in np.unique(labels[used])]
    return tuple(part for part in parts if len(part) >= _MIN_VERTICES)


def find_leg_to_cut(editor: Editor, chair: GraphCharacter) -> Target:
    """Returns a leg in the image, and a stroke across it that crosses nothing else.

    The leg nearest to the camera is tried first. A stroke cuts everything that it crosses in the image. So no
    stroke is returned if every leg has other parts of the chair behind it. A dancing chair soon moves. If the
    chair is still, the user can turn the view.
    """
    rest, chair_pixels = chair.mesh.vertices, _find_pixels(editor, chair)
    legs = sorted(find_legs(chair.mesh), key=lambda leg: float((rest[leg] @ editor.lens.forward).mean()))
    for leg in legs:
        box, others = (
            _add_margin(_find_box(chair_pixels[leg])),
            _find_other_triangles(chair.mesh, leg, chair_pixels),
        )
        for fraction in _CUT_HEIGHTS:
            path = _make_stroke(rest[leg, 1], chair_pixels[leg], fraction)
            if path is not None and _is_in_image(path, editor.size) and not _crosses_any(path, others):
                return Target(box=box, path=path)
    return Target(box=_add_margin(_find_box(chair_pixels[legs[0]])))


def _find_other_triangles(mesh: Mesh, leg: Int, pixels: Float) -> Float:
    """Returns (M, 3, 2) pixels of the triangles near a leg that do not belong to it.

    The values are NaN behind the camera.
    """
    inside = np.zeros(len(mesh.vertices), bool)
    inside[leg] = True
    near = ~(inside[mesh.faces[:, 0]] & inside[mesh.faces[:, 1]] & inside[mesh.faces[:, 2]])
    low, high = pixels[leg].min(0) - _STROKE_MARGIN_PX, pixels[leg].max(0) + _STROKE_MARGIN_PX
    for axis in (0, 1):
        # Process the three corners separately, because NumPy's reductions over three elements take ten times
        # as long.
        first, second, third = (pixels[mesh.faces[:, corner], axis] for corner in range(3))
        near &= np.maximum(np.maximum(first, second), third) > low[axis]
        near &= np.minimum(np.minimum(first, second), third) < high[axis]
    return pixels[mesh.faces[near]]


def _make_stroke(heights: Float | Float32, pixels: Float, fraction: float) -> Stroke | None:
    """Returns the ends of a stroke perpendicular to a leg, or None if the leg is seen end-on.

    Args:
        heights: (N,) rest heights of the leg's vertices in metres.
        pixels: (N, 2) positions of the vertices in the image.
        fraction: fraction of the leg's height at which it is cut.
    """
    heights = (heights - heights.min()) / max(float(np.ptp(heights)), 1e-6)
    upper, lower = heights > 0.5, heights <= 0.5
    band = pixels[np.argsort(np.abs(heights - fraction))[: max(len(heights) // _BAND_COUNT, 3)]]
    if not np.isfinite(pixels).all() or not upper.any():
        return None
    leg_vector = pixels[upper].mean(0) - pixels[lower].mean(0)
    length = float(np.linalg.norm(leg_vector))
    if length < _MIN_LENGTH_PX:
        return None
    across = np.array([-leg_vector[1], leg_vector[0]]) / length
    distance_along, width = float((band @ leg_vector).mean()) / length, band @ across
    ends = [
        distance_along * leg_vector / length + offset * across
        for offset in (width.min() - _STROKE_OVERHANG_PX, width.max() + _STROKE_OVERHANG_PX)
    ]
    left, right = sorted((float(x), float(y)) for x, y in ends)
    return left, right


def _is_in_image(path: Stroke, size: tuple[float, float]) -> bool:
    return all(0.0 <= x < size[0] and 0.0 <= y < size[1] for x, y in path)


def _crosses_any(path: Stroke, triangles: Float) -> bool:
    """Returns True if a stroke crosses triangles (M, 3, 2) of the image, or comes within a few pixels of one.

    Triangles on one side of the stroke's line, or beyond one of its ends, are not crossed.
    """
    start, end = np.asarray(path[0]), np.asarray(path[1])
    direction = (end - start) / np.linalg.norm(end - start)
    distance_along = (triangles - start) @ direction
    distance_aside = (triangles - start) @ np.array([-direction[1], direction[0]])
    is_beyond_end = (distance_along.max(1) < 0.0) | (distance_along.min(1) > np.linalg.norm(end - start))
    is_on_one_side = (distance_aside.max(1) < -_FREE_DISTANCE_PX) | (
        distance_aside.min(1) > _FREE_DISTANCE_PX
    )
    return bool((~is_beyond_end & ~is_on_one_side).any())


def find_piece_to_carry(editor: Editor, piece: GraphCharacter, chair: GraphCharacter) -> Target:
    """Returns the cut-off part, and the drag path from it to a high point of the chair at the same depth. A
    drag keeps the depth, so the part touches the chair only at such a point.
    """
    piece_pixels, distance = editor.lens.project(editor.stage_character(piece.id).vertices)
    chair_pixels, distances = editor.lens.project(editor.stage_character(chair.id).vertices)
    heights = chair.mesh.vertices[:, 1] - chair.mesh.vertices[:, 1].min()
    has_similar_depth = np.abs(distances - distance.mean()) < _MAX_DEPTH_DIFFERENCE * heights.max()
    is_high = heights > _ATTACH_HEIGHT * heights.max()
    end = int(
        np.argmax(
            np.where(is_high & has_similar_depth, heights, -1.0)
            if (is_high & has_similar_depth).any()
            else heights
        )
    )
    # The path must start on the surface, so take the vertex nearest to the mean.
    start = piece_pixels[np.argmin(np.linalg.norm(piece_pixels - piece_pixels.mean(0), axis=1))]
    path = tuple((float(x), float(y)) for x, y in (start, chair_pixels[end]))
    return Target(box=_add_margin(_find_box(piece_pixels)), path=path)


def find_chair_in_image(editor: Editor, extent: Float | Float32 | None) -> Target:
    """Returns the bounding box in the image of a chair's points (N, 3) in metres.

    Returns an empty target without a chair.
    """
    if extent is None or not len(extent):
        return Target()
    pixels = editor.lens.project(np.asarray(extent, float))[0]
    return Target(box=_add_margin(_find_box(pixels))) if np.isfinite(pixels).all() else Target()


def _find_pixels(editor: Editor, shape: GraphCharacter) -> Float:
    """Returns the (V, 2) pixels of a shape's vertices in the image."""
    return editor.lens.project(editor.stage_character(shape.id).vertices)[0]


def _find_box(pixels: Float) -> Rectangle:
    (left, top), (right, bottom) = pixels.min(0).tolist(), pixels.max(0).tolist()
    return left, top, right, bottom


def _add_margin(box: Rectangle) -> Rectangle:
    left, top, right, bottom = box
    return left - _LEG_MARGIN_PX, top - _LEG_MARGIN_PX, right + _LEG_MARGIN_PX, bottom + _LEG_MARGIN_PX
