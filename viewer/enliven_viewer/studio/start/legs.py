"""Finds the leg of a chair in the picture: where to cut it, and where to put it then."""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Float32, Int
from enliven.document import GraphShape
from enliven.meshes import Mesh
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.start.target import Rectangle, Target
from enliven_viewer.studio.viewport import Point

Stroke = tuple[Point, Point]
"""Both ends, in pixels of the picture."""

_HEIGHTS = np.linspace(0.05, 0.4, 15)
"""Shares of the height of a chair below which its legs are looked for: seats are higher."""
_STANDS = 0.02
"""Share of the height of a chair within which a leg begins over the floor."""
_LEAST_VERTICES = 12
"""Fewer are a splinter, not a leg."""
_CUTS = (0.72, 0.6, 0.5, 0.4, 0.3)
"""Shares of a leg's height at which it may be cut: as much as can be, with nothing else cut through."""
_BANDS = 8
"""Parts of a leg's vertices; those of one part, around the cut, say how wide the leg is there."""
_AIR = 10.0
"""Pixels of air around a leg."""
_REACH = 14.0
"""Pixels by which the stroke reaches over both sides of the leg, so that it cuts all of it."""
_SEEN = 4.0
"""Pixels between the middles of a leg's halves: where it seems shorter, it points at the eye."""
_BEYOND = 2 * _REACH
"""Pixels around a leg's box in which a stroke may lie: it reaches as far over both sides."""
_BESIDE = 3.0
"""Pixels on both sides of a stroke that must be free of other parts: a hand does not draw straight."""
_HIGH = 0.35
"""Share of the height of a chair above which a part is put: over the seat."""
_AS_FAR = 0.03
"""Share of a chair's height by which the place may be nearer or farther: the two still meet."""
_KNOWN: list[tuple[Mesh, tuple[Int, ...]]] = []  # the legs of the last surfaces: asked for in every picture
_KEPT = 4
"""Number of surfaces with known legs: the chair, and parts that are cut off it."""


def legs_of(mesh: Mesh) -> tuple[Int, ...]:
    """Returns the vertices of each leg: the parts that are apart below some height, of the most parts.

    A mesh that has none in this sense is one leg: its lowest fifth.
    """
    for known, legs in _KNOWN:
        if known is mesh:
            return legs
    _KNOWN.append((mesh, _legs(mesh)))
    del _KNOWN[:-_KEPT]
    return _KNOWN[-1][1]


def _legs(mesh: Mesh) -> tuple[Int, ...]:
    heights = mesh.vertices[:, 1] - mesh.vertices[:, 1].min()
    tall = max(float(heights.max()), 1e-6)
    best: tuple[Int, ...] = ()
    for share in _HEIGHTS:
        parts = [one for one in _parts(mesh, heights < share * tall) if heights[one].min() < _STANDS * tall]
        if len(parts) >= max(len(best), 2):  # the highest of equally many
            best = tuple(parts)
    if best:
        return best
    return (np.flatnonzero(heights <= 0.2 * tall),)


def _parts(mesh: Mesh, low: np.ndarray) -> tuple[Int, ...]:
    """Returns the vertices of each connected part of the faces that lie low altogether."""
    faces = mesh.faces[low[mesh.faces].all(1)]
    count = len(mesh.vertices)
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = scipy.sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    labels = scipy.sparse.csgraph.connected_components(links, directed=False)[1]
    used = np.unique(faces)
    found = [used[labels[used] == label] for label in np.unique(labels[used])]
    return tuple(one for one in found if len(one) >= _LEAST_VERTICES)


def leg_to_cut(editor: Editor, chair: GraphShape) -> Target:
    """Returns a leg in the picture, and a stroke across it that passes through nothing else.

    The leg that is nearest to the eye is tried first. A stroke cuts all that it passes over in the picture.
    Where other parts of the chair are behind every leg there is therefore no stroke: a dancing chair soon
    moves on, and of one that stands still the view can be turned.
    """
    rest, now = chair.mesh.vertices, _pixels(editor, chair)
    legs = sorted(legs_of(chair.mesh), key=lambda one: float((rest[one] @ editor.lens.forward).mean()))
    for leg in legs:
        box, others = _aired(_box(now[leg])), _others(chair.mesh, leg, now)
        for share in _CUTS:
            path = _stroke_across(rest[leg, 1], now[leg], share)
            if path is not None and _in_picture(path, editor.size) and not _meets(path, others):
                return Target(box=box, path=path)
    return Target(box=_aired(_box(now[legs[0]])))


def _others(mesh: Mesh, leg: Int, pixels: Float) -> Float:
    """Returns (M, 3, 2) pixels of the triangles near a leg that do not belong to it; NaN behind the eye."""
    inside = np.zeros(len(mesh.vertices), bool)
    inside[leg] = True
    near = ~(inside[mesh.faces[:, 0]] & inside[mesh.faces[:, 1]] & inside[mesh.faces[:, 2]])
    low, high = pixels[leg].min(0) - _BEYOND, pixels[leg].max(0) + _BEYOND
    for axis in (0, 1):  # corner by corner: reductions over three elements take ten times as long
        one, two, three = (pixels[mesh.faces[:, corner], axis] for corner in range(3))
        near &= np.maximum(np.maximum(one, two), three) > low[axis]
        near &= np.minimum(np.minimum(one, two), three) < high[axis]
    return pixels[mesh.faces[near]]


def _stroke_across(heights: Float | Float32, pixels: Float, share: float) -> Stroke | None:
    """Returns the ends of a stroke across a leg, at right angles to it; None if the leg is seen from its end.

    Args:
        heights: (N,) of its vertices at rest, metres.
        pixels: (N, 2) where they are in the picture.
        share: of the leg's height, where it is cut.
    """
    heights = (heights - heights.min()) / max(float(np.ptp(heights)), 1e-6)
    upper, lower = heights > 0.5, heights <= 0.5
    band = pixels[np.argsort(np.abs(heights - share))[: max(len(heights) // _BANDS, 3)]]
    if not np.isfinite(pixels).all() or not upper.any():
        return None
    way = pixels[upper].mean(0) - pixels[lower].mean(0)
    length = float(np.linalg.norm(way))
    if length < _SEEN:
        return None
    across = np.array([-way[1], way[0]]) / length
    along, wide = float((band @ way).mean()) / length, band @ across
    ends = [along * way / length + at * across for at in (wide.min() - _REACH, wide.max() + _REACH)]
    left, right = sorted((float(x), float(y)) for x, y in ends)
    return left, right


def _in_picture(path: Stroke, size: tuple[float, float]) -> bool:
    return all(0.0 <= x < size[0] and 0.0 <= y < size[1] for x, y in path)


def _meets(path: Stroke, triangles: Float) -> bool:
    """Returns whether a stroke passes over triangles (M, 3, 2) of the picture, or within some pixels of one.

    It meets none that lies on one side of the stroke's line, or beyond one of its ends.
    """
    start, end = np.asarray(path[0]), np.asarray(path[1])
    way = (end - start) / np.linalg.norm(end - start)
    along = (triangles - start) @ way
    aside = (triangles - start) @ np.array([-way[1], way[0]])
    beyond = (along.max(1) < 0.0) | (along.min(1) > np.linalg.norm(end - start))
    beside = (aside.max(1) < -_BESIDE) | (aside.min(1) > _BESIDE)
    return bool((~beyond & ~beside).any())


def piece_to_carry(editor: Editor, piece: GraphShape, chair: GraphShape) -> Target:
    """Returns the part that was cut off, and the way from it to a high place of the chair as far away.

    A drag keeps the distance from the eye, so that only at such a place the two meet.
    """
    own, distance = editor.lens.project(editor.posed(piece.id).vertices)
    there, distances = editor.lens.project(editor.posed(chair.id).vertices)
    heights = chair.mesh.vertices[:, 1] - chair.mesh.vertices[:, 1].min()
    near = np.abs(distances - distance.mean()) < _AS_FAR * heights.max()
    high = heights > _HIGH * heights.max()
    end = int(np.argmax(np.where(high & near, heights, -1.0) if (high & near).any() else heights))
    start = own[np.argmin(np.linalg.norm(own - own.mean(0), axis=1))]  # on its surface
    path = tuple((float(x), float(y)) for x, y in (start, there[end]))
    return Target(box=_aired(_box(own)), path=path)


def chair_in_picture(editor: Editor, extent: Float | Float32 | None) -> Target:
    """Returns the box in the picture around the places (N, 3) of a chair, metres; nothing without one."""
    if extent is None or not len(extent):
        return Target()
    pixels = editor.lens.project(np.asarray(extent, float))[0]
    return Target(box=_aired(_box(pixels))) if np.isfinite(pixels).all() else Target()


def _pixels(editor: Editor, one: GraphShape) -> Float:
    """Returns (V, 2) pixels of the picture."""
    return editor.lens.project(editor.posed(one.id).vertices)[0]


def _box(pixels: Float) -> Rectangle:
    (left, top), (right, bottom) = pixels.min(0).tolist(), pixels.max(0).tolist()
    return left, top, right, bottom


def _aired(box: Rectangle) -> Rectangle:
    left, top, right, bottom = box
    return left - _AIR, top - _AIR, right + _AIR, bottom + _AIR
