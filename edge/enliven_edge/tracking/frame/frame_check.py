"""Checks whether the tracker can use a frame, and whether frames arrive in order and often enough."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from enliven.frames import TIME_LIMIT_NS, BodyFrame, DepthFrame, Frame
from enliven.health import HealthKind
from enliven.person import J

_WINDOW_NS = 1_500_000_000
"""Length in nanoseconds of the window over which frame rate and loss are measured. A change shows within two
seconds."""
_MIN_INTERVALS = 6
"""Minimum number of frame intervals for an estimate of frame rate and loss. For a slow sensor, this number of
intervals is kept even if they are older than the window."""
_CLOCK_RESET_FRAMES = 3
"""If this number of consecutive frames have old but increasing times, the sensor's clock was set back. Fewer
are late frames."""
_MAX_STEP_NS = 2_000_000_000
"""Maximum interval between frames in nanoseconds. A longer interval is a pause of the stream, not lost
frames."""


class FrameTiming:
    """Checks the order of frames by their times, and measures the frame rate and the share of missing frames.

    Attributes:
        late: number of frames that arrived out of order; the caller drops them.
        repeated: number of consecutive frames with the same time.
    """

    def __init__(self) -> None:
        self.late = 0
        self.repeated = 0
        self._newest: int | None = None
        self._late_times: deque[int] = deque(maxlen=_CLOCK_RESET_FRAMES)
        self._intervals: deque[int] = deque()
        self._rate: float | None = None
        self._lost = 0.0

    def admit(self, time_ns: int) -> bool:
        """Returns True if a frame is newer than all previous ones, or if the sensor's clock was set back."""
        newest = self._newest
        if newest is not None and time_ns == newest:
            self.repeated += 1
            return False
        if newest is not None and time_ns < newest and not self._is_set_back(time_ns):
            self.late += 1
            return False
        if newest is None or not 0 < time_ns - newest < _MAX_STEP_NS:
            self._intervals.clear()
        else:
            self._intervals.append(time_ns - newest)
        self.repeated = 0
        self._late_times.clear()
        self._newest = time_ns
        self._measure_rate()
        return True

    @property
    def rate(self) -> float | None:
        """Returns frames per second by the sensor's own clock over the last 1.5 s.

        Returns None until there are enough frames.
        """
        return self._rate

    @property
    def lost_fraction(self) -> float:
        """Returns the estimated share of frames that are missing between the received ones."""
        return self._lost

    def _is_set_back(self, time_ns: int) -> bool:
        """Returns True if the clock has restarted: several old frames arrived in increasing order."""
        if self._late_times and time_ns <= self._late_times[-1]:
            self._late_times.clear()
        self._late_times.append(time_ns)
        return len(self._late_times) == _CLOCK_RESET_FRAMES

    def _measure_rate(self) -> None:
        """Updates rate and loss from the last frame intervals."""
        while len(self._intervals) > _MIN_INTERVALS and sum(self._intervals) > _WINDOW_NS:
            self._intervals.popleft()
        count = len(self._intervals)
        if count < _MIN_INTERVALS:
            self._rate, self._lost = None, 0.0
            return
        ordered = sorted(self._intervals)
        self._rate = 1e9 * count / sum(ordered)
        # Estimate the period as the 12.5 % quantile of the intervals. Lost frames lengthen intervals, so
        # short ones are close to the true period. Clock jitter may shorten the very shortest.
        period = ordered[count // 8]
        expected_count = sum(round(step / period) for step in self._intervals)
        self._lost = 1.0 - count / max(count, expected_count)


_NEW_SIZE_FRAMES = 5
"""After this number of consecutive frames with another image size, that size is accepted as the sensor's new
mode. A restarting driver sends one or two frames of the old or of an incomplete mode."""
_MIN_IMAGE_SIDE_PX = 16
"""Minimum side of an image in pixels. A smaller image shows no person."""
_MAX_IMAGE_SIDE_PX = 8192
"""Maximum side of an image in pixels. No depth camera has more."""
Flaw = tuple[HealthKind, str]
"""The kind of problem and its reason, without a full stop."""


class FrameCheck:
    """Checks whether frames are usable. Keeps the image size of the previous frames for comparison."""

    def __init__(self) -> None:
        self._size: tuple[int, int] | None = None
        self._other: tuple[int, int] | None = None
        self._count = 0

    def check(self, frame: Frame) -> Flaw | None:
        """Returns why the frame cannot be used, or None if it can be used."""
        reason = find_flaw(frame)
        if reason:
            return HealthKind.BAD_FRAME, reason
        return self._check_size(frame) if isinstance(frame, DepthFrame) else None

    def _check_size(self, frame: DepthFrame) -> Flaw | None:
        """Returns the flaw of a frame with a new image size, or None. Accepts a size after several frames."""
        height, width = frame.depth.shape
        size = (width, height)
        if self._size is None or size == self._size:
            self._size, self._count = size, 0
            return None
        self._count = self._count + 1 if size == self._other else 1
        self._other = size
        previous_size = self._size
        if self._count >= _NEW_SIZE_FRAMES:
            self._size, self._count = size, 0
            return None
        return HealthKind.RESIZED, f"{width}x{height} pixels instead of {previous_size[0]}x{previous_size[1]}"


def find_flaw(frame: Frame) -> str:
    """Returns the fault of a single frame, or an empty string."""
    if not isinstance(frame, DepthFrame | BodyFrame):
        return "the frame is neither a depth image nor a list of bodies"
    if type(frame.time_ns) is not int or abs(frame.time_ns) >= TIME_LIMIT_NS:
        return f"the time {frame.time_ns!r} is not a possible number of nanoseconds"
    return _depth_flaw(frame) if isinstance(frame, DepthFrame) else _body_flaw(frame)


def _depth_flaw(frame: DepthFrame) -> str:
    camera, depth, colour, pose = frame.intrinsics, frame.depth, frame.colour, frame.world_from_camera
    if depth.dtype != np.uint16 or depth.shape != (camera.height, camera.width):
        return f"the depth is {depth.dtype} {depth.shape}, but the camera has {camera.height}x{camera.width}"
    if not all(_MIN_IMAGE_SIDE_PX <= side <= _MAX_IMAGE_SIDE_PX for side in depth.shape):
        return f"the image size is {camera.width}x{camera.height} pixels"
    if not all(math.isfinite(f) and f > 0 for f in (camera.fx, camera.fy)):
        return f"the focal length is ({camera.fx}, {camera.fy}) pixels"
    if not all(math.isfinite(c) for c in (camera.cx, camera.cy, *camera.distortion)):
        return "the principal point or distortion is not a finite number"
    if colour is not None and (colour.dtype != np.uint8 or colour.ndim != 3 or colour.shape[2] != 3):
        return f"the colour image is {colour.dtype} {colour.shape}"
    if pose is not None and (np.shape(pose) != (4, 4) or not np.isfinite(pose).all()):
        return "the camera pose is not a finite 4x4 transform"
    return ""


def _body_flaw(frame: BodyFrame) -> str:
    for body in frame.bodies:
        if np.shape(body.joints) != (J, 3) or np.shape(body.confidence) != (J,):
            return f"a body has joints of shape {np.shape(body.joints)}"
    return ""
