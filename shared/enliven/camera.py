"""A pinhole camera: intrinsics, lens distortion, and conversion between pixels and metres.

A camera's coordinate frame follows OpenCV: +X right, +Y down, +Z forward, metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import InputError

LEVEL_WORLD_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
"""(4, 4) transform from camera to world of a level camera at the world's origin, which looks along -Z."""


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera with Brown-Conrady distortion (OpenCV's k1, k2, p1, p2, k3).

    Focal lengths and the principal point are in pixels of an image of ``width`` x ``height``.

    Raises:
        InputError: if a focal length or the size is not positive and finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise InputError(
                f"the image size {self.width}x{self.height} is not valid",
                where="camera intrinsics",
                remedy="Pass the width and height of the depth image in pixels.",
            )
        if not all(math.isfinite(f) and f > 0 for f in (self.fx, self.fy)):
            raise InputError(
                f"the focal lengths ({self.fx}, {self.fy}) in pixels are not finite and above 0",
                where="camera intrinsics",
                remedy="Calibrate the sensor, or use a sensor profile in firmware_configs/sensors.",
            )
        if not all(math.isfinite(c) for c in (self.cx, self.cy, *self.distortion)):
            raise InputError(
                "the principal point or the distortion is not a finite number",
                where="camera intrinsics",
                remedy="Calibrate the sensor again.",
            )

    def scale(self, factor: float) -> Intrinsics:
        """Returns the same camera with an image ``factor`` times as large (0.5 halves both sides)."""
        return Intrinsics(
            round(self.width * factor),
            round(self.height * factor),
            self.fx * factor,
            self.fy * factor,
            (self.cx + 0.5) * factor - 0.5,
            (self.cy + 0.5) * factor - 0.5,
            self.distortion,
        )


def pixel_rays(intrinsics: Intrinsics) -> Float:
    """Returns the undistorted ray (H, W, 2) of every pixel, as x/z and y/z in the camera frame.

    The distortion is inverted by fixed-point iteration, which converges for the mild lenses of depth cameras.
    Compute the rays once per camera, and reuse the result.
    """
    distorted: Float = np.empty((intrinsics.height, intrinsics.width, 2))
    distorted[..., 0] = (np.arange(intrinsics.width) - intrinsics.cx) / intrinsics.fx
    distorted[..., 1] = (np.arange(intrinsics.height)[:, None] - intrinsics.cy) / intrinsics.fy
    if not any(intrinsics.distortion):
        return distorted
    ideal = distorted.copy()
    for _ in range(12):
        ideal += distorted - _apply_lens_distortion(ideal, intrinsics)
    return ideal


def unproject_depth(depth_mm: AnyArray, ray: Float) -> Float:
    """Converts depth (H, W) in millimetres to points (H, W, 3) in metres in the camera frame.

    Pixels of 0 mm (unknown) become the origin.

    Args:
        depth_mm: (H, W) depth along the optical axis, 0 if unknown.
        ray: (H, W, 2) the rays from :func:`pixel_rays`.
    """
    z = depth_mm.astype(np.float64) * 1e-3
    return np.stack([ray[..., 0] * z, ray[..., 1] * z, z], -1)


def project(points: Float, intrinsics: Intrinsics) -> Float:
    """Projects points (..., 3) in the camera frame with z > 0 to pixel coordinates (..., 2)."""
    ideal = points[..., :2] / points[..., 2:]
    distorted = _apply_lens_distortion(ideal, intrinsics) if any(intrinsics.distortion) else ideal
    focal = np.array([intrinsics.fx, intrinsics.fy])
    centre = np.array([intrinsics.cx, intrinsics.cy])
    return np.asarray(distorted * focal + centre)


def _apply_lens_distortion(ideal: Float, intrinsics: Intrinsics) -> Float:
    """Applies Brown-Conrady distortion to undistorted normalised coordinates (..., 2)."""
    k1, k2, p1, p2, k3 = intrinsics.distortion
    x, y = ideal[..., 0], ideal[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        -1,
    )


def world_from_level_camera(height: float, tilt: float = 0.0, roll: float = 0.0) -> Float:
    """Returns the transform (4, 4) from camera to world of a sensor ``height`` metres above the floor.

    Args:
        height: height of the optical centre above the floor, metres.
        tilt: angle of the optical axis below the horizontal, radians.
        roll: rotation of the image about the optical axis, radians. pi means that the camera is mounted
            upside down.
    """
    ct, st, cr, sr = math.cos(tilt), math.sin(tilt), math.cos(roll), math.sin(roll)
    level_from_tilted = np.array([[1, 0, 0], [0, ct, st], [0, -st, ct]])
    tilted_from_camera = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = LEVEL_WORLD_FROM_CAMERA[:3, :3] @ level_from_tilted @ tilted_from_camera
    world_from_camera[1, 3] = height
    return world_from_camera
