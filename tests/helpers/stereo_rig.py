"""A stereo rig: two lenses for rendering, and the calibration that describes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from stereo_scene import Lens

from enliven_edge.sensors.stereo.calibration import StereoCalibration, StereoLens
from enliven_edge.sensors.stereo.rectification import Rectification

FOCAL = 457.0
"""Focal length in pixels for a width of 640: 70 degrees from left to right."""


def create_lenses(
    width: int = 640, height: int = 400, baseline: float = 0.1, crooked: float = 1.0, bent: float = 1.0
):
    """Returns (left, right) lenses that differ slightly and are rotated relative to each other by about a
    degree.

    Args:
        crooked: factor on the relative rotation of one degree.
        bent: factor on the lens distortion.
    """
    scale = width / 640
    turn = Rotation.from_euler("xyz", crooked * np.array([0.4, -0.8, 0.3]), degrees=True).as_matrix()
    shift = -turn @ (baseline * np.array([0.99975, -0.01, -0.02]))
    lens = Lens(width, height, (FOCAL * scale, (FOCAL + 1) * scale), (0.503 * width, 0.49 * height))
    left = replace(lens, distortion=tuple(bent * np.array([-0.12, 0.08, 0.0005, -0.0003, -0.01])))
    right = Lens(
        width,
        height,
        ((FOCAL + 3) * scale, (FOCAL + 2) * scale),
        (0.494 * width, 0.51 * height),
        tuple(bent * np.array([-0.11, 0.07, -0.0003, 0.0004, -0.01])),
        turn,
        shift,
    )
    return left, right


def calibration_of(left: Lens, right: Lens) -> StereoCalibration:
    """Returns the exact calibration of two lenses."""
    return StereoCalibration(
        width=left.width,
        height=left.height,
        left=StereoLens(*left.focal, *left.centre, tuple(map(float, left.distortion))),
        right=StereoLens(*right.focal, *right.centre, tuple(map(float, right.distortion))),
        right_from_left=tuple(tuple(row) for row in right.turn.tolist()),
        translation=tuple(right.shift.tolist()),
        baseline=float(np.linalg.norm(right.shift)),
        reprojection=0.0,
        epipolar=0.0,
    )


def rectified_left(rectification: Rectification) -> Lens:
    """Returns the rectified left camera as a lens for rendering."""
    camera = rectification.intrinsics
    return Lens(
        camera.width,
        camera.height,
        (camera.fx, camera.fy),
        (camera.cx, camera.cy),
        turn=np.asarray(rectification.rotations[0]),
    )
