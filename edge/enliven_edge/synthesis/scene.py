"""The empty room behind the performer: planes and boxes, cast analytically once per camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, UInt8
from enliven.camera import Intrinsics, rays

ORDINARY, DARK, MIRROR = 0, 1, 2
"""Materials: diffuse, swallowing most of the light, or sending it away from the sensor."""


@dataclass(frozen=True)
class Box:
    """An axis-aligned box between two corners, metres, world."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    material: int = ORDINARY


def _table(x: float, z: float, top: float) -> tuple[Box, ...]:
    """A table of 0.7 x 0.6 m whose corner is at (x, z): a top and four legs."""
    legs = tuple(
        Box((x + dx, 0.0, z + dz), (x + dx + 0.05, top - 0.03, z + dz + 0.05))
        for dx in (0.0, 0.65)
        for dz in (0.0, 0.55)
    )
    return (Box((x, top - 0.03, z), (x + 0.70, top, z + 0.60)), *legs)


ROOM: tuple[Box, ...] = (
    Box((-2.9, -0.2, -6.2), (2.9, 0.0, 1.5)),  # floor
    Box((-2.9, 0.0, -4.2), (0.52, 2.7, -3.88)),  # back wall, on both sides of an open door
    Box((1.32, 0.0, -4.2), (2.9, 2.7, -3.88)),
    Box((0.52, 2.02, -4.2), (1.32, 2.7, -3.88)),
    Box((-2.9, 0.0, -4.2), (-1.75, 2.7, 1.5)),  # wall on the left of the image
    Box((-1.75, 0.0, -3.88), (-1.62, 2.7, -3.74)),  # a pipe's casing in the corner
    Box((0.42, 0.0, -3.88), (0.52, 2.12, -3.80)),  # door frame
    Box((1.32, 0.0, -3.88), (1.42, 2.12, -3.80)),
    Box((0.42, 2.02, -3.88), (1.42, 2.12, -3.80)),
    Box((-2.9, 0.0, -6.2), (2.9, 2.7, -5.9)),  # the corridor behind it, too far for many sensors
    Box((-1.50, 1.18, -3.88), (-0.46, 1.78, -3.83), MIRROR),  # a screen on the wall
    Box((-1.75, 0.0, -3.2), (-1.42, 1.05, -2.35)),  # a low cupboard
    Box((-1.70, 1.05, -2.75), (-1.55, 1.28, -2.55), DARK),  # and something black on it
    *_table(1.30, -3.55, 0.72),
    Box((1.50, 0.72, -3.40), (1.78, 0.92, -3.15)),  # a carton on the table
)
"""Where the shipped recording takes place."""


def cast_room(
    intrinsics: Intrinsics, world_from_camera: Float, room: tuple[Box, ...] = ROOM
) -> tuple[Float, UInt8]:
    """(H, W) float64 depth in metres along the optical axis (inf where the room ends), (H, W) material.

    Args:
        world_from_camera: (4, 4) where the camera stands.
    """
    ray = rays(intrinsics)
    across, down = np.ascontiguousarray(ray[..., 0]), np.ascontiguousarray(ray[..., 1])
    direction = [across * r[0] + down * r[1] + r[2] for r in world_from_camera[:3, :3]]
    depth = np.full(across.shape, np.inf)
    material = np.zeros(across.shape, np.uint8)
    for box in room:
        hit = _box_entry(world_from_camera[:3, 3], direction, box)
        nearer = hit < depth
        depth[nearer] = hit[nearer]
        material[nearer] = box.material
    return depth, material


def _box_entry(origin: Float, direction: list[Float], box: Box) -> AnyArray:
    """(H, W) the multiple of ``direction``, (H, W) by axis, at which it enters a box; inf where it misses."""
    enter, leave = np.full(direction[0].shape, np.nan), np.full(direction[0].shape, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, along in enumerate(direction):
            low, high = ((side[axis] - origin[axis]) / along for side in (box.low, box.high))
            # A ray that lies in a side is NaN there: that side does not count.
            np.fmax(enter, np.minimum(low, high), out=enter)
            np.fmin(leave, np.maximum(low, high), out=leave)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)
