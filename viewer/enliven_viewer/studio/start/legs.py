"""Finds the leg of a chair in the picture: where to cut it, and where to put it then."""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Float32, Int
from enliven.document import GraphShape
from enliven.meshes import Mesh
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.start.target import Rectangle, Target

_HEIGHTS = np.linspace(0.05, 0.4, 15)
"""Shares of the height of a chair below which its legs are looked for: seats are higher."""
_STANDS = 0.02
"""Share of the height of a chair within which a leg begins over the floor."""
_LEAST_VERTICES = 12
"""Fewer are a splinter, not a leg."""
_BELOW = 0.72
"""Height of the cut over that up to which the legs are apart: nothing else is cut through there."""
_AIR = 10.0
"""Pixels of air around a leg, and as far as the stroke begins beside it: well outside of it."""
_REACH = 24.0
"""Pixels by which the stroke begins and ends beside the leg: the next leg is farther away."""
_HIGH = 0.35
"""Share of the height of a chair above which a part is put: over the seat."""
_AS_FAR = 0.03
"""Share of the height of a chair by which the place may be nearer or farther: the two still meet."""
_KNOWN: list[tuple[Mesh, tuple[Int, ...]]] = []  # the legs of the last surfaces: asked for in every picture
_KEPT = 4
"""Surfaces of which the legs are kept: the chair, and what is cut off it."""


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
    """The vertices of each connected part of the faces that lie low altogether."""
    faces = mesh.faces[low[mesh.faces].all(1)]
    count = len(mesh.vertices)
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = scipy.sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    labels = scipy.sparse.csgraph.connected_components(links, directed=False)[1]
    used = np.unique(faces)
    found = [used[labels[used] == label] for label in np.unique(labels[used])]
    return tuple(one for one in found if len(one) >= _LEAST_VERTICES)


def leg_to_cut(editor: Editor, chair: GraphShape) -> Target:
    """Returns the leg that is nearest to the eye while the chair stands still, and the stroke across it."""
    rest, now, legs = chair.mesh.vertices, _pixels(editor, chair), legs_of(chair.mesh)
    leg = min(legs, key=lambda one: float((rest[one] @ editor.lens.forward).mean()))
    heights = rest[leg, 1] - rest[:, 1].min()
    cut = leg[heights <= _BELOW * heights.max()]
    edge = now[cut[np.argsort(-rest[cut, 1])[: max(len(cut) // 6, 3)]]]
    low, high = edge.min(0), edge.max(0)
    y = float((low[1] + high[1]) / 2)
    path = ((float(low[0]) - _REACH, y), (float(high[0]) + _REACH, y))
    return Target(box=_aired(_box(now[cut])), path=path)


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
    """(V, 2) pixels of the picture."""
    return editor.lens.project(editor.posed(one.id).vertices)[0]


def _box(pixels: Float) -> Rectangle:
    (left, top), (right, bottom) = pixels.min(0).tolist(), pixels.max(0).tolist()
    return left, top, right, bottom


def _aired(box: Rectangle) -> Rectangle:
    left, top, right, bottom = box
    return left - _AIR, top - _AIR, right + _AIR, bottom + _AIR
