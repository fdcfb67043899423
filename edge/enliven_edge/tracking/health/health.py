"""The health monitor: reports problems of the sensor, its images, and the positions of the performers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from enliven.arrays import Float
from enliven.camera import Intrinsics
from enliven.errors import EnlivenError, InputError
from enliven.frames import DepthFrame, Frame
from enliven.health import HealthKind, HealthState
from enliven.person import Body
from enliven.settings import parameter, setting
from enliven_edge.sensors import CHECK_IT, Condition
from enliven_edge.tracking.frame.frame_check import FrameCheck, FrameTiming
from enliven_edge.tracking.frame.reduction import DepthSurvey, measure_depth_image
from enliven_edge.tracking.health.alarm import Alarms
from enliven_edge.tracking.health.device_health import check_condition
from enliven_edge.tracking.health.framing import WATCHED, find_cut_off, find_touching

_FROZEN_NS = 700_000_000
"""Nanoseconds with an unchanged image after which a frozen sensor is reported. Noise changes every image."""
_MAX_MISSING_FRACTION = 0.28
"""Missing depth is reported if more than this fraction of the usual depth pixels is missing."""
_LEARNING_S = 2.0
"""While the background model is younger than this, the edge reports that it is still being learnt."""
_MIN_CONFIDENCE = 0.35
"""A performer with a lower mean confidence is reported as unclear."""
_FAR_MARGIN_M = 0.3
"""A performer within this distance of the depth limit is reported as too far."""

_FROZEN_FRAMES = 4
"""A sensor may be frozen after more than this number of consecutive equal images. Fewer may be chance."""
_REPEATED_FRAMES = 8
"""Minimum number of consecutive frames with the same time for a sensor to count as frozen: it sends one frame
repeatedly."""
_USUAL_FALL_S = 60.0
"""Time constant in seconds for lowering the usual amount of depth. So a changed scene is reported only for a
while."""
_USUAL_RISE_WEIGHT = 0.5
"""Weight of a frame with more depth than usual in the usual amount. The usual amount rises within a few
frames.
"""
_SLOW_RATE = 0.6
"""A sensor is slow below this fraction of its promised frame rate."""
_SLOW_CLEARED_RATE = 0.75
"""A sensor is no longer slow above this fraction of its promised frame rate. The gap to ``_SLOW_RATE``
prevents a flickering alarm.
"""
_DROPPED_FRACTION = 0.10
"""Fraction of lost frames above which they are reported."""
_DROPPED_CLEARED_FRACTION = 0.05
"""Fraction of lost frames below which the message disappears. The gap to ``_DROPPED_FRACTION`` prevents a
flickering alarm.
"""
_LATE_SHOWN_NS = 2_000_000_000
"""Nanoseconds for which late frames are reported after the last late frame: long enough to read."""
_MOVED_SHOWN_NS = 3_000_000_000
"""Nanoseconds for which a moved sensor is reported after the last motion: long enough to read."""
_COVERED_DEPTH = 0.04
"""Fraction of usable depth below which the lens is covered. A covered lens still shows some pixels."""
_UNCOVERED_DEPTH = 0.10
"""Fraction of usable depth above which the lens is free again."""
_SPECKLE_FRACTION = 0.09
"""Fraction of small holes in the depth above which missing depth is reported. The cause is sunlight, or
another sensor's infrared pattern.
"""
_SPECKLE_CLEARED_FRACTION = 0.05
"""Fraction of small holes in the depth below which the message about missing depth disappears."""
_DEPTH_MARGIN = 0.1
"""The message about missing depth disappears when the depth exceeds the limit by this fraction of the usual
depth.
"""
_UNCLEAR_MARGIN = 0.1
"""A performer is clear again if its mean confidence exceeds the limit by this margin."""
_PLACE_MARGIN = 0.1
"""A performer is in range again at this distance in metres inside the limit. The margin prevents a flickering
alarm, because bodies sway.
"""


@dataclass(frozen=True)
class HealthSettings:
    """The limits beyond which a problem is reported."""

    REMOVED_SETTINGS: ClassVar = ("missing", "far_margin", "unclear", "learning", "frozen")
    frame_rate: float = setting(
        30.0,
        "Expected frame rate, used if the sensor does not state one. Slower sensors are reported.",
        unit="Hz",
        low=0.1,
    )
    silent: float = parameter(
        1.0, "Time without a frame after which a silent sensor is reported.", unit="s", low=0.05
    )
    near: float = setting(0.9, "A performer nearer than this is reported as too near.", unit="m", low=0.0)


@dataclass(frozen=True)
class TrackerState:
    """The tracker's state after a frame, for the health monitor.

    Attributes:
        floor_known: whether the floor was detected, or is in the settings.
        room_age: age of the background model in seconds.
        moved: whether this frame showed that the sensor was moved.
        joined: the ids of performers who cannot be distinguished.
    """

    floor_known: bool = True
    room_age: float = float("inf")
    moved: bool = False
    joined: tuple[int, ...] = ()


class HealthMonitor:
    """Checks every frame before tracking, and the bodies after tracking.

    Args:
        settings: the limits. If None, uses the defaults.
        fps: frame rate that the sensor promises. If None, uses the settings' value.
        far: metres beyond which depth is not used.
        name: name of the sensor, for edges with several sensors.

    Attributes:
        late_frames: number of frames that arrived out of order and were not admitted.
        fault: the reason why the last frame or read was unusable, one sentence; empty if it was usable or
            late.
    """

    def __init__(
        self,
        settings: HealthSettings | None = None,
        *,
        fps: float | None = None,
        far: float = 4.5,
        name: str = "",
    ) -> None:
        self.settings = settings or HealthSettings()
        self._fps = fps or self.settings.frame_rate
        self._far = far
        self._timing = FrameTiming()
        self._alarms = Alarms(f"Sensor {name}" if name else "The sensor")
        self.fault = ""
        self._check = FrameCheck()
        self._now_ns = 0
        self._mark: int | None = None
        self._same, self._same_ns = 0, 0
        self._normal = 0.0
        self._late_ns: int | None = None
        self._moved_ns: int | None = None

    def follow_device(self, is_device: bool) -> None:
        """Sets whether the sensor is a device.

        Messages about cable, power and lens make sense only for a device.
        """
        self._alarms.is_device = is_device

    @property
    def late_frames(self) -> int:
        """Returns the number of frames that have come out of order."""
        return self._timing.late

    @property
    def states(self) -> list[HealthState]:
        """Returns the current problems, the most severe first."""
        return self._alarms.states

    def admit(self, frame: Frame, fps: float | None = None) -> bool:
        """Checks a frame before the tracker uses it.

        Args:
            frame: the frame.
            fps: frame rate that the sensor promises now; None if unchanged.

        Returns:
            whether the tracker should use it: False for a frame that is out of order, repeated or unusable.
        """
        self._fps = fps or self._fps
        flaw = self._check.check(frame)
        if flaw is not None:
            self._update_faults(*flaw)
            return False
        self._update_faults(None, "")
        is_late = self._timing.late
        is_usable = self._timing.admit(frame.time_ns)
        if is_usable:
            if frame.time_ns < self._now_ns:
                self._forget_times()
            self._now_ns = frame.time_ns
        elif self._timing.late > is_late:
            self._late_ns = self._now_ns
        now = self._now_ns
        self._alarms.update(HealthKind.NO_FRAMES, False, now)
        self._check_frame_rate(now)
        depth_survey = (
            measure_depth_image(frame.depth) if is_usable and isinstance(frame, DepthFrame) else None
        )
        self._check_freeze(depth_survey, now)
        if depth_survey is not None:
            self._check_image(depth_survey, now)
        self._alarms.log_changes()
        return is_usable

    def record_read_error(self, error: Exception) -> None:
        """Records that a read raised ``error`` instead of returning a frame."""
        reason, remedy = str(error) or "the reason is unknown", ""
        if isinstance(error, EnlivenError):
            reason, remedy = error.what, error.remedy
        kind = HealthKind.BAD_FRAME if isinstance(error, InputError) else HealthKind.SENSOR_LOST
        self._update_faults(kind, reason, remedy)

    def record_silence(self, seconds: float) -> None:
        """Records that no frame has arrived for ``seconds``, measured by the wall clock."""
        wrong = seconds >= self.settings.silent
        self._alarms.update(HealthKind.NO_FRAMES, wrong, self._now_ns, seconds=seconds)
        self._alarms.log_changes()

    def check_result(
        self,
        frame: Frame,
        bodies: list[Body],
        world_from_camera: Float | None = None,
        tracker: TrackerState | None = None,
    ) -> None:
        """Checks the tracker's result for a frame.

        Args:
            frame: the frame.
            bodies: the performers, world frame, not mirrored.
            world_from_camera: (4, 4) pose of the sensor. If None, the positions of the performers are not
                checked.
            tracker: the tracker's own report.
        """
        now = frame.time_ns
        if tracker is not None:
            self._check_tracker(tracker, now)
        touching = (tracker.joined if tracker is not None else ()) or find_touching(bodies)
        names = " and ".join(str(i) for i in sorted(touching))
        self._alarms.update(HealthKind.JOINED, len(touching) > 1, now, names=names)
        # Do not check the confidences of fused bodies, or of sensors that track people themselves.
        if isinstance(frame, DepthFrame):
            for body in bodies:
                self._check_body(body, now)
                if world_from_camera is not None:
                    self._check_place(body, frame.intrinsics, world_from_camera, now)
        self._alarms.keep_present({body.id for body in bodies})
        self._alarms.log_changes()

    def check_device(self, condition: Condition | None, world_from_camera: Float, floor_known: bool) -> None:
        """Checks the device's own report with :func:`check_condition`. The report is None if there is
        none.
        """
        if condition is not None:
            check_condition(self._alarms, condition, world_from_camera, floor_known, self._now_ns)

    # --- the sensor ----------------------------------------------------------------------------------------

    def _update_faults(self, kind: HealthKind | None, reason: str, remedy: str = "") -> None:
        """Updates the alarms of unusable frames and reads. ``kind`` is None if the last one was usable."""
        self.fault, do = reason, remedy or CHECK_IT
        for fault_kind in (HealthKind.SENSOR_LOST, HealthKind.BAD_FRAME, HealthKind.RESIZED):
            # A frame of any kind proves that the sensor is connected. If the sensor is lost, the state of its
            # frames is unknown (None).
            wrong = None if kind is HealthKind.SENSOR_LOST and fault_kind is not kind else fault_kind is kind
            self._alarms.update(
                fault_kind, wrong, self._now_ns, why=reason.rstrip("."), remedy=do.rstrip(".")
            )
        self._alarms.log_changes()

    def _check_frame_rate(self, now: int) -> None:
        rate, lost = self._timing.rate, self._timing.lost_fraction
        slow = self._alarms.is_too_low(
            HealthKind.SLOW, rate, _SLOW_CLEARED_RATE * self._fps, _SLOW_RATE * self._fps
        )
        self._alarms.update(HealthKind.SLOW, slow, now, rate=rate or 0.0, promised=self._fps)
        limits = (-_DROPPED_CLEARED_FRACTION, -_DROPPED_FRACTION)
        dropped = None if rate is None else self._alarms.is_too_low(HealthKind.DROPPED, -lost, *limits)
        self._alarms.update(HealthKind.DROPPED, dropped, now, percent=100 * lost)
        is_late = self._late_ns is not None and 0 <= now - self._late_ns < _LATE_SHOWN_NS
        self._alarms.update(HealthKind.OUT_OF_ORDER, is_late, now, count=self._timing.late)

    def _check_freeze(self, depth_survey: DepthSurvey | None, now: int) -> None:
        """Checks whether the sensor repeats the same image or the same time."""
        if depth_survey is not None:
            is_same = depth_survey.image_hash == self._mark and depth_survey.usable_fraction > 0
            self._same, self._same_ns = (self._same + 1, self._same_ns) if is_same else (1, now)
            self._mark = depth_survey.image_hash
        is_still = self._same > _FROZEN_FRAMES and now - self._same_ns >= _FROZEN_NS
        self._alarms.update(HealthKind.FROZEN, is_still or self._timing.repeated >= _REPEATED_FRAMES, now)

    def _check_image(self, depth_survey: DepthSurvey, now: int) -> None:
        covered = self._alarms.is_too_low(
            HealthKind.COVERED, depth_survey.usable_fraction, _UNCOVERED_DEPTH, _COVERED_DEPTH
        )
        self._alarms.update(HealthKind.COVERED, covered, now)
        if covered:
            return
        rate = self._timing.rate or self._fps
        known_fraction = depth_survey.known_fraction
        weight = _USUAL_RISE_WEIGHT if known_fraction > self._normal else 1.0 / (rate * _USUAL_FALL_S)
        self._normal += weight * (known_fraction - self._normal)
        clear_known = 1.0 - _MAX_MISSING_FRACTION
        min_known = self._alarms.is_too_low(
            HealthKind.MISSING_DEPTH,
            depth_survey.known_fraction,
            (clear_known + _DEPTH_MARGIN) * self._normal,
            clear_known * self._normal,
        )
        holes = self._alarms.is_too_low(
            HealthKind.MISSING_DEPTH,
            -depth_survey.speckle_fraction,
            -_SPECKLE_CLEARED_FRACTION,
            -_SPECKLE_FRACTION,
        )
        self._alarms.update(
            HealthKind.MISSING_DEPTH, min_known or holes, now, percent=100 * (1 - depth_survey.known_fraction)
        )

    # --- the tracker and the performers --------------------------------------------------------------------

    def _check_tracker(self, tracker: TrackerState, now: int) -> None:
        if tracker.moved:
            self._moved_ns = now
        moved = self._moved_ns is not None and 0 <= now - self._moved_ns < _MOVED_SHOWN_NS
        self._alarms.update(HealthKind.MOVED, moved, now)
        self._alarms.update(HealthKind.NO_FLOOR, not tracker.floor_known, now)
        self._alarms.update(HealthKind.LEARNING_ROOM, tracker.room_age < _LEARNING_S, now)

    def _check_body(self, body: Body, now: int) -> None:
        confidence = float(body.confidence.mean())
        limit = _MIN_CONFIDENCE
        unclear = self._alarms.is_too_low(
            HealthKind.UNCLEAR, confidence, limit + _UNCLEAR_MARGIN, limit, body.id
        )
        self._alarms.update(HealthKind.UNCLEAR, unclear, now, body.id)

    def _check_place(self, body: Body, camera: Intrinsics, world_from_camera: Float, now: int) -> None:
        """Checks whether a performer is too near, too far, or cut off by the image border."""
        local = (body.joints[WATCHED] - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
        distance = float(local[0, 2])
        near, far = self.settings.near, self._far - _FAR_MARGIN_M
        close = self._alarms.is_too_low(HealthKind.TOO_NEAR, distance, near + _PLACE_MARGIN, near, body.id)
        self._alarms.update(HealthKind.TOO_NEAR, close, now, body.id, metres=distance)
        away = self._alarms.is_too_low(HealthKind.TOO_FAR, -distance, _PLACE_MARGIN - far, -far, body.id)
        self._alarms.update(HealthKind.TOO_FAR, away, now, body.id, metres=distance)
        cut_part, side = find_cut_off(local, camera)
        self._alarms.update(HealthKind.CUT_OFF, bool(cut_part), now, body.id, what=cut_part, side=side)

    def _forget_times(self) -> None:
        """Drops all measurements by the sensor's clock, because it was set back."""
        self._alarms.clear()
        self._late_ns = self._moved_ns = None
        self._same = 0
