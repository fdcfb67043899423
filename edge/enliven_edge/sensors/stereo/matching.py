"""Depth from two cameras: rectification, stereo matching, left-right check, speckle removal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from enliven.arrays import UInt8, UInt16
from enliven.errors import InputError
from enliven_edge.sensors.stereo.rectification import Rectification, import_opencv

STEPS = 16
"""Subpixel steps per pixel of the matcher's disparity."""
_BLOCK_SIDE_PX = 5
"""Side in pixels of the window that is compared."""
_SMALL_STEP_PENALTY = 6
"""Penalty of a one-pixel disparity step between neighbours (OpenCV's P1), per pixel of the window. For its
value see ``_LARGE_STEP_PENALTY``."""
_LARGE_STEP_PENALTY = 20
"""Penalty of a larger disparity step (OpenCV's P2), per pixel of the window. With OpenCV's suggestion of 8
and 32, 50 % more pixels next to a person get the person's depth."""
_MAX_GRADIENT = 63
"""Maximum grey value gradient, at which larger gradients are clipped. It is the highest value that OpenCV
accepts."""
_UNIQUENESS_PERCENT = 10
"""Minimum margin of the best disparity over the second best, in percent."""
_MAX_LEFT_RIGHT_PX = 1
"""Maximum distance in pixels between the match from the right image and that from the left image (left-right
check)."""
_MIN_ISLAND_PX = 150
"""Minimum area in pixels of an island: connected pixels of similar depth. Smaller islands are noise. A hand
at 3 m has 400 pixels in an image of 640 x 400."""
_MAX_ISLAND_STEP_PX = 1
"""Maximum disparity difference in pixels between neighbours of one island."""
_MAX_DISPARITIES = 256
"""Maximum search range in pixels. With a larger range the matcher takes longer than a frame."""


class StereoMatcher:
    """Converts image pairs to depth images, on one core.

    Args:
        rectification: rectification of the pair.
        near, far: range of valid depth in metres. A small ``near`` takes more time.

    Raises:
        InputError: for a range that cannot be measured.
        ResourceError: if OpenCV is missing.
    """

    def __init__(self, rectification: Rectification, near: float = 0.7, far: float = 8.0) -> None:
        if not 0.05 <= near < far <= 65.0:
            raise InputError(
                f"the depth range is {near} to {far} m",
                where="stereo",
                remedy="Set near below far, both from 0.05 to 65 m.",
            )
        self._cv: Any = import_opencv()
        self._rectification = rectification
        focal_baseline = rectification.intrinsics.fx * rectification.baseline
        self._lowest = math.floor(focal_baseline / far)
        self._count = 16 * math.ceil((focal_baseline / near + 1 - self._lowest) / 16)
        if self._count > _MAX_DISPARITIES:
            nearest = focal_baseline / (_MAX_DISPARITIES + self._lowest)
            raise InputError(
                f"near={near} needs {self._count} disparities, but at most {_MAX_DISPARITIES} are possible",
                where="stereo",
                remedy=f"Set near to {math.ceil(100 * nearest) / 100} or more, or use smaller images.",
            )
        self._matcher = self._cv.StereoSGBM_create(
            minDisparity=self._lowest,
            numDisparities=self._count,
            blockSize=_BLOCK_SIDE_PX,
            P1=_SMALL_STEP_PENALTY * _BLOCK_SIDE_PX**2,
            P2=_LARGE_STEP_PENALTY * _BLOCK_SIDE_PX**2,
            disp12MaxDiff=_MAX_LEFT_RIGHT_PX,
            preFilterCap=_MAX_GRADIENT,
            uniquenessRatio=_UNIQUENESS_PERCENT,
            speckleWindowSize=_MIN_ISLAND_PX,
            speckleRange=_MAX_ISLAND_STEP_PX,
            mode=self._cv.STEREO_SGBM_MODE_SGBM_3WAY,
        )
        self._margin = self._lowest + self._count
        self._millimetres = depth_table(focal_baseline, near, far, self._margin)

    def depth(self, left: UInt8, right: UInt8) -> UInt16:
        """Returns (H, W) uint16 millimetres along the rectified left camera's axis, with 0 for unknown depth.

        Args:
            left, right: (H, W) unrectified grey images.
        """
        cv = self._cv
        pair = self._rectification.rectify(left, right)
        # StereoSGBM returns no disparity for the leftmost numDisparities columns, so the images are padded by
        # that many.
        wide = [cv.copyMakeBorder(image, 0, 0, self._margin, 0, cv.BORDER_REPLICATE) for image in pair]
        disparity = self._matcher.compute(*wide)[:, self._margin :]
        return self._millimetres[np.maximum(disparity, 0)]


def depth_table(focal_baseline: float, near: float, far: float, disparities: int) -> UInt16:
    """Returns (disparities * 16 + 1,) uint16 depths in millimetres for disparities in steps of 1/16 pixel.

    Depths outside the range are 0.

    Args:
        focal_baseline: focal length in pixels times baseline in metres.
    """
    steps = np.arange(disparities * STEPS + 1)
    with np.errstate(divide="ignore"):
        metres = focal_baseline * STEPS / steps
    return np.where((metres >= near) & (metres <= far), np.rint(1e3 * metres), 0).astype(np.uint16)
