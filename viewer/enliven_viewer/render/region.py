"""Where in the picture anything stands before the floor: only there are edges that need several samples."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float, Float32
from enliven.props import Props
from enliven_viewer.camera import View
from enliven_viewer.render.marks import CUE_RADIUS
from enliven_viewer.render.scene import Scene, corners

Region = tuple[int, int, int, int]
"""Left, lower, width and height in pixels, from the lower left of the picture."""

_ROOM = 6
"""Pixels around what was projected: for marks that are never smaller than some pixels, and for rounding."""
_NEAREST = 1e-3
"""Metres before the eye; what comes closer may be anywhere in the picture."""
_UNIT = corners((np.full(3, -1.0), np.ones(3)))
_SQRT3 = math.sqrt(3.0)


def whole(size: tuple[int, int]) -> Region:
    """All of a picture of this size."""
    return 0, 0, *size


def around(middles: Float, radii: Float | float) -> Float:
    """(8 N, 3) the corners of boxes around balls: (N, 3) middles, radii (N,) or one, metres."""
    sizes = np.broadcast_to(np.asarray(radii, np.float64), len(middles))
    return (middles[:, None] + sizes[:, None, None] * _UNIT).reshape(-1, 3)


def filled_by(scene: Scene, capsules: Float32, surfaces: list[Float]) -> Float:
    """(N, 3) metres, points that hold between them whatever of a scene stands before the floor.

    Args:
        capsules: (C, 12) rows of the bodies.
        surfaces: (K, 3) of each mesh, as :meth:`~enliven_viewer.render.skinned.SkinnedMesh.hull` says.
    """
    points = [*surfaces, around(capsules[:, 0:3], capsules[:, 3]), around(capsules[:, 4:7], capsules[:, 7])]
    if scene.look.cues > 0 or scene.look.graph > 0:
        points += [around(actor.pose.positions, CUE_RADIUS) for actor in scene.actors]
    return np.concatenate([*points, _filled_by_props(scene.props)])


def seen_in(points: Float, view: View, size: tuple[int, int]) -> Region:
    """The pixels that hold the hull of (N, 3) points; all where one is beside or behind the eye."""
    if not len(points):
        return 0, 0, 0, 0
    clip = points @ view.clip_from_world[:, :3].T + view.clip_from_world[:, 3]
    if not (np.isfinite(clip).all() and clip[:, 3].min() > _NEAREST):
        return whole(size)
    pixels = (clip[:, :2] / clip[:, 3:] + 1) / 2 * size
    low = np.clip(np.floor(pixels.min(0)) - _ROOM, 0, size)
    high = np.clip(np.ceil(pixels.max(0)) + _ROOM, low, size)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def beside(region: Region, size: tuple[int, int]) -> list[Region]:
    """What of a picture is not in a region: at most four others."""
    x, y, width, height = region
    right, top = x + width, y + height
    rest = [
        (0, 0, size[0], y),
        (0, top, size[0], size[1] - top),
        (0, y, x, height),
        (right, y, size[0] - right, height),
    ]
    return [one for one in rest if one[2] > 0 and one[3] > 0]


def _filled_by_props(props: Props | None) -> Float:
    """(N, 3) the corners around what is loose."""
    if props is None:
        return np.zeros((0, 3))
    shown = np.isfinite(props.positions).all(1)
    return around(props.positions[shown], _SQRT3 * np.asarray(props.sizes[shown]).max(1, initial=0.0))
