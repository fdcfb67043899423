"""A saguaro in a flower pot, with two arms and two eyes. A person's skeleton does not fit into this mesh."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, UInt8
from enliven.meshes import Mesh
from sample_meshes.isosurface import surface_of

POT, SOIL, GREEN, WHITE, BLACK, BLOOM, HEART = range(7)
"""The numbers of the parts, which are their rows in ``_COLOURS``."""
_COLOURS = np.array(
    [
        (196, 98, 62),
        (92, 66, 50),
        (72, 134, 84),
        (246, 244, 236),
        (34, 34, 40),
        (236, 92, 138),
        (250, 200, 90),
    ],
    np.float64,
)
"""sRGB of the parts, in the order of their names."""
_THORN_COLOUR = np.array([206, 224, 168], np.float64)
"""sRGB of the thorns."""

TOP = np.array([0.0, 1.30, 0.0])
"""Position of the top of the trunk in metres."""
ELBOW = np.array([0.37, 0.70, 0.0])
"""Position of the outside of the left arm's bend in metres."""
TIP = np.array([0.40, 1.10, 0.0])
"""Position of the end of the left arm in metres."""
FOOT = np.array([0.15, 0.0, 0.0])
"""Position of the left side of the pot in metres."""

_TRUNK_RADIUS = 0.148
"""Radius of the trunk in metres. It suits a saguaro as tall as a child."""
_ARM_RADIUS = 0.078
"""Radius of an arm in metres: about half that of the trunk."""
_RIB_COUNT = 9
"""Number of ribs of the trunk. It was chosen by eye."""
_BLEND_WIDTH = 0.045
"""Width in metres of the smooth blend between trunk and arms. It is wide, so that the arms look grown."""
_FILLET_WIDTH = 0.016
"""Width in metres of the fillet between all other parts. It is smaller than ``_BLEND_WIDTH``."""


def make_cactus(cell: float = 0.018) -> Mesh:
    """Creates a cactus 1.3 m tall that stands on y = 0 and looks along +Z.

    It is symmetric about the plane x = 0.

    The arms leave the trunk sideways at a height of 0.62 m, and bend up. The surface is closed and connected,
    and has vertex colours.

    Args:
        cell: approximate length of an edge in metres.
    """
    low, high = np.array([-0.56, -0.04, -0.28]), np.array([0.56, 1.42, 0.28])
    # The grid is symmetric, so that the mesh is also symmetric.
    low[0] = -cell * (np.ceil(0.56 / cell) + 0.5)
    vertices, faces = surface_of(lambda points: _compute_parts(points)[0], low, high, cell)
    part = _compute_parts(vertices)[1]
    return Mesh(
        vertices - [0.0, vertices[:, 1].min(), 0.0], faces, "cactus", _compute_vertex_colours(vertices, part)
    )


def _compute_parts(points: Float) -> tuple[Float, Int]:
    """Returns (N,) the signed distance of points (N, 3) in metres, and (N,) the nearest part."""
    mirrored = np.abs(points) * [1.0, 0.0, 0.0] + points * [0.0, 1.0, 1.0]
    green = _compute_green_distance(mirrored)
    eye = np.linalg.norm(mirrored - [0.055, 1.08, 0.138], axis=1) - 0.036
    pupil = np.linalg.norm(mirrored - [0.053, 1.082, 0.166], axis=1) - 0.016
    distances = np.stack(
        [_compute_pot_distance(points), _compute_soil_distance(points), green, eye, pupil, *_bloom(points)]
    )
    # The fillets prevent crevices that are narrower than a cell.
    whole = distances[0]
    for distance in distances[1:]:
        whole = _smooth_union(whole, distance, _FILLET_WIDTH)
    return whole, distances.argmin(0)


def _compute_green_distance(points: Float) -> Float:
    """Returns the distance to trunk and left arm. The right arm is the mirror image of the left arm."""
    trunk = _compute_capsule_distance(
        points, np.array([0.0, 0.22, 0.0]), TOP - [0.0, _TRUNK_RADIUS, 0.0], _TRUNK_RADIUS
    )
    trunk = trunk + 0.009 * _compute_rib_depth(points, _RIB_COUNT, _TRUNK_RADIUS)
    shoulder, bend = np.array([0.08, 0.62, 0.0]), np.array([0.30, 0.66, 0.0])
    out = _compute_capsule_distance(points, shoulder, bend, _ARM_RADIUS)
    up = _compute_capsule_distance(
        points, np.array([0.365, 0.74, 0.0]), TIP - [0.0, _ARM_RADIUS, 0.0], _ARM_RADIUS
    )
    corner = _compute_capsule_distance(points, bend, np.array([0.365, 0.74, 0.0]), _ARM_RADIUS)
    up = up + 0.006 * _compute_rib_depth(points - [0.385, 0.0, 0.0], 7, _ARM_RADIUS)
    arm = _smooth_union(_smooth_union(out, corner, 0.03), up, 0.03)
    return _smooth_union(trunk, arm, _BLEND_WIDTH)


def _compute_rib_depth(points: Float, count: int, radius: float) -> Float:
    """Returns the depth of the grooves between ribs around the vertical axis.

    It is 0 on the ribs, 2 between them, and 0 on the axis.
    """
    ring, away = np.arctan2(points[:, 2], points[:, 0]), np.hypot(points[:, 0], points[:, 2])
    between = 1.0 - np.cos(count * (ring + np.pi / 2))
    return np.asarray(between * np.minimum(away / (0.6 * radius), 1.0) ** 2)


def _compute_pot_distance(points: Float) -> Float:
    """Returns the distance to the pot: a cone that opens upwards, with a rim."""
    away, height = np.hypot(points[:, 0], points[:, 2]), points[:, 1]
    wall = (away - (0.155 + 0.19 * height)) * 0.98
    body = np.maximum(wall, np.abs(height - 0.115) - 0.115)
    rim = _make_rounded_rectangle(away - 0.185, height - 0.225, 0.030, 0.026, 0.014)
    rim = np.maximum(rim, -(0.16 - away))
    disc = _make_rounded_rectangle(away, height - 0.225, 0.215, 0.026, 0.014)
    return np.asarray(np.minimum(body, np.minimum(rim, disc)))


def _compute_soil_distance(points: Float) -> Float:
    """Returns the distance to the soil: a low mound in the pot."""
    squeezed = (points - [0.0, 0.235, 0.0]) * [1.0, 4.0, 1.0]
    return np.asarray((np.linalg.norm(squeezed, axis=1) - 0.182) / 2.0)


def _bloom(points: Float) -> tuple[Float, Float]:
    """Returns the distances to the flower on the top: six petals, and their centre."""
    at = points - TOP - [0.0, 0.004, 0.0]
    ring = np.arctan2(at[:, 2], at[:, 0])
    nearest = np.round((ring - np.pi / 2) / (np.pi / 3)) * (np.pi / 3) + np.pi / 2
    centre = 0.045 * np.stack([np.cos(nearest), np.full(len(at), 0.35), np.sin(nearest)], 1)
    petal = np.linalg.norm((at - centre) * [1.0, 1.6, 1.0], axis=1) - 0.030
    heart = np.linalg.norm(at - [0.0, 0.022, 0.0], axis=1) - 0.026
    return petal, heart


def _compute_capsule_distance(points: Float, start: Float, end: Float, radius: float) -> Float:
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * way, axis=1) - radius)


def _make_rounded_rectangle(across: Float, up: Float, wide: float, tall: float, corner: float) -> Float:
    """Returns the distance to a rectangle with round corners that is rotated about the vertical axis."""
    out = np.stack([np.abs(across) - wide + corner, np.abs(up) - tall + corner])
    return np.asarray(np.hypot(*np.maximum(out, 0.0)) + np.minimum(out.max(0), 0.0) - corner)


def _smooth_union(a: Float, b: Float, blend: float) -> Float:
    """Returns the union of two distances with a fillet (I. Quilez's polynomial smooth minimum)."""
    share = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(np.minimum(a, b) - share * share * blend / 4.0)


def _compute_vertex_colours(vertices: Float, part: Int) -> UInt8:
    """Returns (V, 3) the colours of the parts.

    The trunk is darker between the ribs, and has thorns on the ribs.
    """
    colours = _COLOURS[part]
    ring = np.arctan2(vertices[:, 2], vertices[:, 0])
    rib = 0.5 + 0.5 * np.cos(_RIB_COUNT * (ring + np.pi / 2))
    trunk = (part == GREEN) & (np.abs(vertices[:, 0]) < 0.16)
    shade = np.where(part == GREEN, 0.90 + 0.16 * np.where(trunk, rib, 0.7), 1.0)
    colours = colours * shade[:, None]
    thorn = trunk & (rib > 0.93) & (np.cos(2 * np.pi * vertices[:, 1] / 0.085) > 0.75)
    colours[thorn] = _THORN_COLOUR
    return np.asarray(np.clip(colours, 0, 255), np.uint8)
