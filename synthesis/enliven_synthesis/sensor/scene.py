"""The empty room behind the performer. It consists of boxes. Their depth is computed once per camera by ray
casting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, UInt8
from enliven.camera import Intrinsics, pixel_rays
from enliven.kernels import njit

ORDINARY = 0
"""Material of a diffuse surface."""
DARK = 1
"""Material of a surface that absorbs most of the light."""
MIRROR = 2
"""Material of a surface that reflects the light away from the sensor."""


@dataclass(frozen=True)
class Box:
    """An axis-aligned box between two corners in metres, world frame."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    material: int = ORDINARY


def _make_table(x: float, z: float, top: float) -> tuple[Box, ...]:
    """Makes a table of 0.7 x 0.6 m with a corner at (x, z): a top and four legs."""
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
    Box((-2.9, 0.0, -6.2), (2.9, 2.7, -5.9)),  # the corridor behind the door, too far for many sensors
    Box((-1.50, 1.18, -3.88), (-0.46, 1.78, -3.83), MIRROR),  # a screen on the wall
    Box((-1.75, 0.0, -3.2), (-1.42, 1.05, -2.35)),  # a low cupboard
    Box((-1.70, 1.05, -2.75), (-1.55, 1.28, -2.55), DARK),  # a black object on the cupboard
    *_make_table(1.30, -3.55, 0.72),
    Box((1.50, 0.72, -3.40), (1.78, 0.92, -3.15)),  # a carton on the table
)
"""The room of the shipped recording."""


def cast_room(
    intrinsics: Intrinsics, world_from_camera: Float, room: tuple[Box, ...] = ROOM
) -> tuple[Float, UInt8]:
    """Returns (H, W) float64 depth in metres along the optical axis, and (H, W) material.

    Outside the room the depth is infinite.

    Args:
        world_from_camera: (4, 4) pose of the camera.
    """
    corners = np.array([[box.low, box.high] for box in room]).reshape(-1, 2, 3)
    stuff = np.array([box.material for box in room], np.uint8)
    ray = pixel_rays(intrinsics)
    depth, material = np.full(ray.shape[:2], np.inf), np.zeros(ray.shape[:2], np.uint8)
    _cast_rays(ray, np.asarray(world_from_camera, np.float64), corners, stuff, depth, material)
    return depth, material


@njit(cache=True, nogil=True, error_model="numpy")
def _cast_rays(
    ray: Float, world_from_camera: Float, corners: Float, stuff: UInt8, depth: Float, material: UInt8
) -> None:
    """Writes the depth and material of the nearest box along every ray (H, W, 2).

    ``corners`` is (B, 2, 3).
    """
    along = np.empty(3)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            for axis in range(3):
                x, y, z = world_from_camera[axis, 0], world_from_camera[axis, 1], world_from_camera[axis, 2]
                along[axis] = ray[v, u, 0] * x + ray[v, u, 1] * y + z
            for b in range(len(corners)):
                hit = _box_entry(world_from_camera, along, corners, b, depth[v, u])
                if hit < depth[v, u]:
                    depth[v, u], material[v, u] = hit, stuff[b]


@njit(cache=True, nogil=True, error_model="numpy")
def _box_entry(world_from_camera: Float, along: Float, corners: Float, b: int, nearest: float) -> float:
    """Returns the ray parameter at which a ray from the camera enters a box (slab method).

    ``along`` is the (3,) direction. The result is infinite if the ray misses the box.

    It is also infinite beyond ``nearest``, the nearest earlier hit. If a ray lies in a side of the box, the
    parameters of this slab are NaN and ignored.
    """
    enter, leave = -np.inf, nearest
    for axis in range(3):
        first = (corners[b, 0, axis] - world_from_camera[axis, 3]) / along[axis]
        second = (corners[b, 1, axis] - world_from_camera[axis, 3]) / along[axis]
        if np.isnan(first) or np.isnan(second):
            continue
        enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
        if enter > leave:
            return np.inf
    return enter if enter > 0.0 else np.inf
