"""Whether a frame is one that the tracker can use, and whether frames come in order and often enough."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from enliven.frames import TIME_LIMIT_NS, BodyFrame, DepthFrame, Frame
from enliven.health import HealthKind
from enliven.person import J

_REMEMBERED_NS = 1_500_000_000
"""Nanoseconds over which rate and loss are measured: a change shows within two seconds."""
_ENOUGH = 6
"""Steps between frames from which rate and loss are told; a slow sensor keeps so many beyond that time."""
_NEW_CLOCK = 3
"""Frames in a row from the past, in order among themselves, that tell of a clock set back: fewer are late."""
_LONGEST_STEP_NS = 2_000_000_000
"""Nanoseconds: a longer step is a pause of the stream, not frames that were lost."""


class FrameTiming:
    """Judges frames by their times: in order or not, at which rate, how many are missing.

    Attributes:
        late: frames that came out of order so far; the caller drops them.
        repeated: frames in a row with the time of the frame before.
    """

    def __init__(self) -> None:
        self.late = 0
        self.repeated = 0
        self._newest: int | None = None
        self._behind: deque[int] = deque(maxlen=_NEW_CLOCK)
        self._steps: deque[int] = deque()
        self._rate: float | None = None
        self._lost = 0.0

    def admit(self, time_ns: int) -> bool:
        """Whether a frame is newer than all before, or the first of a clock that was set back."""
        newest = self._newest
        if newest is not None and time_ns == newest:
            self.repeated += 1
            return False
        if newest is not None and time_ns < newest and not self._set_back(time_ns):
            self.late += 1
            return False
        if newest is None or not 0 < time_ns - newest < _LONGEST_STEP_NS:
            self._steps.clear()
        else:
            self._steps.append(time_ns - newest)
        self.repeated = 0
        self._behind.clear()
        self._newest = time_ns
        self._measure()
        return True

    @property
    def rate(self) -> float | None:
        """Frames a second by the sensor's own clock, over the last 1.5 s; None before there are enough."""
        return self._rate

    @property
    def lost(self) -> float:
        """The share of the frames that seem to be missing between those that came."""
        return self._lost

    def _set_back(self, time_ns: int) -> bool:
        """Whether the clock starts anew: several frames from the past, one after the other."""
        if self._behind and time_ns <= self._behind[-1]:
            self._behind.clear()
        self._behind.append(time_ns)
        return len(self._behind) == _NEW_CLOCK

    def _measure(self) -> None:
        """Rate and loss over the last frames."""
        while len(self._steps) > _ENOUGH and sum(self._steps) > _REMEMBERED_NS:
            self._steps.popleft()
        count = len(self._steps)
        if count < _ENOUGH:
            self._rate, self._lost = None, 0.0
            return
        ordered = sorted(self._steps)
        self._rate = 1e9 * count / sum(ordered)
        # A frame on time follows after the shortest step, were it not for the jitter of the sensor's clock.
        period = ordered[count // 8]
        due = sum(round(step / period) for step in self._steps)
        self._lost = 1.0 - count / max(count, due)


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
        return "it is neither an image nor a list of bodies"
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
