"""Finds the non-empty regions of the image, the shadow maps and the floor. Only these are drawn."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Props
from enliven_viewer.render.gl.region import Region, full_region
from enliven_viewer.render.overlay.marks import CUE_RADIUS
from enliven_viewer.render.scene import Scene, find_corners

REGION_MARGIN_PX = 6
"""Margin in pixels around projected points. It covers marks with a minimum pixel size, and rounding."""
_MIN_DISTANCE = 1e-3
"""Minimum distance in metres in front of the camera. Points that are nearer have no bounded projection."""
_UNIT_CORNERS = find_corners((np.full(3, -1.0), np.ones(3)))
_SQRT3 = math.sqrt(3.0)


def find_ball_corners(middles: Float | Float32, radii: Float | Float32 | float) -> Float:
    """Returns the corners (8 N, 3) in metres of boxes around balls.

    The balls have (N, 3) centres, and radii (N,) or a common radius.
    """
    sizes = np.broadcast_to(np.asarray(radii, np.float64), len(middles))
    return np.asarray((middles[:, None] + sizes[:, None, None] * _UNIT_CORNERS).reshape(-1, 3), np.float64)


def find_shadow_casters(scene: Scene, capsules: Float32, surfaces: list[Float]) -> Float:
    """Returns (N, 3) points in metres with a convex hull that contains all shadow casters of a scene.

    Args:
        capsules: (C, 12) rows of the bodies.
        surfaces: (K, 3) for each mesh, from :meth:`~enliven_viewer.render.skinned_mesh.SkinnedMesh.hull`.
    """
    bodies = [
        find_ball_corners(capsules[:, 0:3], capsules[:, 3]),
        find_ball_corners(capsules[:, 4:7], capsules[:, 7]),
    ]
    return np.concatenate([*surfaces, *bodies, _find_prop_corners(scene.props)])


def find_mark_points(scene: Scene) -> Float:
    """Returns (N, 3) points in metres with a convex hull that contains the marks of a scene."""
    if scene.style.cues <= 0 and scene.style.graph <= 0:
        return np.zeros((0, 3))
    return np.concatenate(
        [np.zeros((0, 3)), *(find_ball_corners(a.pose.positions, CUE_RADIUS) for a in scene.actors)]
    )


def find_visible_region(
    points: Float, clip_from_world: Float, size: tuple[int, int], margin: int = REGION_MARGIN_PX
) -> Region:
    """Returns the pixel region that contains the convex hull of (N, 3) points.

    Returns the whole image if a point is next to or behind the camera.

    Args:
        margin: margin in pixels.
    """
    if not len(points):
        return 0, 0, 0, 0
    if not np.isfinite(points).all():
        return full_region(size)
    clip = points @ clip_from_world[:, :3].T + clip_from_world[:, 3]
    if clip[:, 3].min() <= _MIN_DISTANCE:
        return full_region(size)
    pixels = (clip[:, :2] / clip[:, 3:] + 1) / 2 * size
    low = np.clip(np.floor(pixels.min(0)) - margin, 0, size)
    high = np.clip(np.ceil(pixels.max(0)) + margin, low, size)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def find_shadow_bounds(points: Float, to_key: Float, margin: float) -> tuple[Float, Float]:
    """Returns the lowest and highest (x, z), (2,) each, of the floor area below (N, 3) points and below the
    shadow of their hull.

    Args:
        to_key: (3,) unit direction towards the light.
        margin: margin in metres.
    """
    if not len(points):
        return np.zeros(2), np.zeros(2)
    if not np.isfinite(points).all():
        return np.full(2, -np.inf), np.full(2, np.inf)
    shadow_points = points - np.maximum(points[:, 1:2], 0.0) / to_key[1] * to_key
    floor_points = np.concatenate([points, shadow_points])[:, [0, 2]]
    return floor_points.min(0) - margin, floor_points.max(0) + margin


def _find_prop_corners(props: Props | None) -> Float:
    """Returns the corners (N, 3) in metres of boxes around the props."""
    if props is None:
        return np.zeros((0, 3))
    is_valid = np.isfinite(props.positions).all(1)
    return find_ball_corners(
        props.positions[is_valid], _SQRT3 * np.asarray(props.sizes[is_valid]).max(1, initial=0.0)
    )
