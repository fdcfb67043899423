"""Whether a frame is one that the tracker can use: its type, time, sizes and numbers."""

from __future__ import annotations

import math

import numpy as np

from enliven.frames import TIME_LIMIT_NS, BodyFrame, DepthFrame, Frame
from enliven.health import HealthKind
from enliven.person import J

_NEW_SIZE_FRAMES = 5
"""Frames in a row of another size after which the sensor is taken to have changed its mode: a driver that
restarts lets through one or two of the old or of a half mode."""
_SMALLEST = 16
"""Pixels of an image's side at the least: a smaller image shows no person."""
_LARGEST = 8192
"""Pixels of an image's side at the most: no depth camera has more."""
Flaw = tuple[HealthKind, str]
"""What kind of trouble, and why, without the full stop."""


class FrameCheck:
    """Says why a frame cannot be used; remembers the size of the frames before."""

    def __init__(self) -> None:
        self._size: tuple[int, int] | None = None
        self._other: tuple[int, int] | None = None
        self._count = 0

    def flaw(self, frame: Frame) -> Flaw | None:
        """Why the frame cannot be used, or None."""
        why = flaw_of(frame)
        if why:
            return HealthKind.BAD_FRAME, why
        return self._resized(frame) if isinstance(frame, DepthFrame) else None

    def _resized(self, frame: DepthFrame) -> Flaw | None:
        """The flaw of a frame with another size than those before; a size that stays is accepted."""
        height, width = frame.depth.shape
        size = (width, height)
        if self._size is None or size == self._size:
            self._size, self._count = size, 0
            return None
        self._count = self._count + 1 if size == self._other else 1
        self._other = size
        before = self._size
        if self._count >= _NEW_SIZE_FRAMES:
            self._size, self._count = size, 0
            return None
        return HealthKind.RESIZED, f"{width}x{height} pixels instead of {before[0]}x{before[1]}"


def flaw_of(frame: Frame) -> str:
    """What is wrong with a frame by itself, or an empty string."""
    if not isinstance(frame, DepthFrame | BodyFrame):
        return f"it is of type {type(frame).__name__}"
    if type(frame.time_ns) is not int or abs(frame.time_ns) >= TIME_LIMIT_NS:
        return f"its time is {frame.time_ns!r}, not a possible number of nanoseconds"
    return _depth_flaw(frame) if isinstance(frame, DepthFrame) else _body_flaw(frame)


def _depth_flaw(frame: DepthFrame) -> str:
    camera, depth, colour, stand = frame.intrinsics, frame.depth, frame.colour, frame.world_from_camera
    if depth.dtype != np.uint16 or depth.shape != (camera.height, camera.width):
        return f"its depth is {depth.dtype} {depth.shape}, the camera's is {camera.height}x{camera.width}"
    if not all(_SMALLEST <= side <= _LARGEST for side in depth.shape):
        return f"its image is {camera.width}x{camera.height} pixels"
    if not all(math.isfinite(f) and f > 0 for f in (camera.fx, camera.fy)):
        return f"its focal length is ({camera.fx}, {camera.fy}) pixels"
    if not all(math.isfinite(c) for c in (camera.cx, camera.cy, *camera.distortion)):
        return "its principal point or distortion is not a finite number"
    if colour is not None and (colour.dtype != np.uint8 or colour.ndim != 3 or colour.shape[2] != 3):
        return f"its colour image is {colour.dtype} {colour.shape}"
    if stand is not None and (np.shape(stand) != (4, 4) or not np.isfinite(stand).all()):
        return "where it says to stand is no transform"
    return ""


def _body_flaw(frame: BodyFrame) -> str:
    for body in frame.bodies:
        if np.shape(body.joints) != (J, 3) or np.shape(body.confidence) != (J,):
            return f"a body of it has joints of shape {np.shape(body.joints)}"
    return ""
