"""Stereo rectification with OpenCV, an optional library: warps two images to parallel cameras."""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import UInt8
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven_edge.sensors.attached_cameras import import_library
from enliven_edge.sensors.stereo.calibration import StereoCalibration


def import_opencv() -> Any:
    """Imports the module cv2.

    Raises:
        ResourceError: if it is not installed.
    """
    return import_library("cv2", "libcamera")


class Rectification:
    """The maps from pixels of the rectified images to pixels of the cameras. They are computed once.

    Attributes:
        intrinsics: intrinsics of both rectified cameras.
        baseline: distance in metres between the cameras.
        rotations: two (3, 3) rotations, rectified_from_camera, of the left and the right camera.

    Raises:
        ResourceError: if OpenCV is missing.
    """

    def __init__(self, calibration: StereoCalibration) -> None:
        cv = self._cv = import_opencv()
        size = (calibration.width, calibration.height)
        lenses = [
            (eye_lens.matrix(), np.array(eye_lens.distortion))
            for eye_lens in (calibration.left, calibration.right)
        ]
        turn, shift = np.array(calibration.right_from_left), np.array(calibration.translation)
        *rotations, left, right = cv.stereoRectify(
            *lenses[0], *lenses[1], size, turn, shift[:, None], flags=cv.CALIB_ZERO_DISPARITY, alpha=0
        )[:4]
        self.rotations = (rotations[0], rotations[1])
        self.intrinsics = Intrinsics(*size, left[0, 0], left[1, 1], left[0, 2], left[1, 2])
        self.baseline = float(-right[0, 3] / right[0, 0])
        self._maps = [
            cv.initUndistortRectifyMap(*lens, rotation, projection[:3, :3], size, cv.CV_16SC2)
            for lens, rotation, projection in zip(lenses, rotations, (left, right), strict=True)
        ]

    def rectify(self, left: UInt8, right: UInt8) -> tuple[UInt8, UInt8]:
        """Returns the rectified (H, W) images of a pair.

        Raises:
            InputError: for images with another size than the calibrated one.
        """
        shape = (self.intrinsics.height, self.intrinsics.width)
        for image in (left, right):
            if image.shape[:2] != shape:
                image_size, expected_size = (f"{size[1]} x {size[0]}" for size in (image.shape, shape))
                raise InputError(
                    f"an image has {image_size} pixels, but the calibration is for {expected_size}",
                    where="stereo",
                    remedy="Calibrate again with the size of the images: enliven calibrate-stereo.",
                )
        remap, linear = self._cv.remap, self._cv.INTER_LINEAR
        rectified_left, rectified_right = (
            remap(i, *m, linear) for i, m in zip((left, right), self._maps, strict=True)
        )
        return rectified_left, rectified_right
