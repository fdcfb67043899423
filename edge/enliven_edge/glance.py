"""What viewers are told of the camera: where it stands, and a small picture of the distances before it."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, UInt16
from enliven.frames import DepthFrame, Frame
from enliven.wire import CameraMessage

_EVERY_NS = 200_000_000
"""Nanoseconds of the sensor's clock between two pictures: movement is followed, for 30 kB/s."""
_HIGH = 72
"""Pixels of the picture's height at most: a person is recognised in it."""
_NEAR = 400.0
"""Millimetres that are as light as it gets: nearer, depth cameras see nothing."""
_FAR = 6000.0
"""Millimetres that are as dark as it gets: performers stand nearer."""
_USUAL_LENS = [0.9, 0.9, 0.6, 0.5]
"""Of a sensor that tracks people itself: 58 degrees high."""


class Glance:
    """Makes a message of a frame now and then."""

    def __init__(self) -> None:
        self._told_ns: int | None = None

    def of(self, frame: Frame, place: Float | None, *, mirrored: bool = False) -> CameraMessage | None:
        """Returns what is to be told of a frame; None for one that comes too soon, or from nowhere known.

        Args:
            place: (4, 4) world_from_camera; None where it is not known.
            mirrored: whether performers are mirrored, and the picture with them.
        """
        if place is None:
            return None
        if self._told_ns is not None and 0 <= frame.time_ns - self._told_ns < _EVERY_NS:
            return None
        self._told_ns = frame.time_ns
        rows = place[:3].ravel().tolist()
        if not isinstance(frame, DepthFrame):
            return CameraMessage(rows, _USUAL_LENS)
        lens, small = frame.intrinsics, nearness(frame.depth)
        across = (lens.width - 1 - lens.cx if mirrored else lens.cx) / lens.height
        told = [lens.fx / lens.height, lens.fy / lens.height, across, lens.cy / lens.height]
        small = small[:, ::-1] if mirrored else small
        return CameraMessage(rows, told, small.shape[1], small.shape[0], small.tobytes())


def nearness(depth: UInt16) -> np.ndarray:
    """(h, w) uint8 of every so many pixels of a depth image: 255 near, 1 far, 0 unknown."""
    step = max(-(-depth.shape[0] // _HIGH), -(-depth.shape[1] // (2 * _HIGH - 16)))
    some = depth[::step, ::step]
    near = np.clip((_FAR - some) / (_FAR - _NEAR), 0.0, 1.0)
    known = (some > 0) & (some < 65535)
    return np.where(known, 1 + np.round(254 * near), 0).astype(np.uint8)
