"""The bodies of one sensor in one level frame, as tracks of people who are interpolated between frames."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven.space.rigid_transform import invert
from enliven_edge.fusion.live.merge import transform_bodies
from enliven_edge.fusion.live.sensor_thread import READ_TIMEOUT_S, SensorThread
from enliven_edge.sensors import Sensor, SensorFault
from enliven_edge.tracking.tracker import Tracker

_MAX_INTERPOLATION_GAP_S = 0.35
"""Maximum frame interval in seconds at which linear interpolation of a walking person is valid."""


@dataclass(frozen=True)
class BodyTrack:
    """The track of one person by one sensor.

    Attributes:
        id: the sensor's number of the person.
        times: (F,) seconds of the stream, ascending.
        joints: (F, 20, 3) metres, the sensor's own level frame.
        confidence: (F, 20) in [0, 1].
    """

    id: int
    times: Float
    joints: Float
    confidence: Float

    def interpolate(self, times: Float, longest_gap: float) -> tuple[Float, Float, Float]:
        """Returns joints (N, 20, 3), velocities (N, 20, 3) m/s and confidence (N, 20) at times (N,).

        It interpolates linearly between neighbouring frames. The confidence is 0 if these frames are farther
        apart than ``longest_gap`` seconds (or the usual interval of a slow sensor). It is also 0 before the
        first and after the last frame.
        """
        longest_gap = max(longest_gap, min(1.6 * self.step, _MAX_INTERPOLATION_GAP_S))
        if len(self.times) < 2:
            zeros = np.zeros((len(times), 20, 3))
            return zeros, zeros, zeros[..., 0]
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self.times) - 1)
        previous = after - 1
        step = self.times[after] - self.times[previous]
        fraction = (times - self.times[previous]) / step
        is_between = (fraction >= -1e-9) & (fraction <= 1 + 1e-9) & (step <= longest_gap)
        fraction = np.clip(fraction, 0.0, 1.0)[:, None, None]
        start, change = self.joints[previous], self.joints[after] - self.joints[previous]
        confidence = np.minimum(self.confidence[previous], self.confidence[after]) * is_between[:, None]
        return start + fraction * change, self._velocities[previous], confidence

    @cached_property
    def step(self) -> float:
        """Returns the median interval between two frames in seconds."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0

    @cached_property
    def _velocities(self) -> Float:
        """Returns (F - 1, 20, 3) velocities in m/s between consecutive frames, from the frames around each
        pair.

        The difference of the two frames of a pair would contain the noise of the interpolated joints. A clock
        fit with such velocities would converge to halfway between frames, where interpolation suppresses most
        noise.
        """
        previous = np.arange(len(self.times) - 1)
        early, late = np.maximum(previous - 1, 0), np.minimum(previous + 2, len(self.times) - 1)
        seconds = self.times[late] - self.times[early]
        return np.asarray((self.joints[late] - self.joints[early]) / seconds[:, None, None])


@dataclass(frozen=True)
class BodyStream:
    """The tracks of all people by one sensor.

    Attributes:
        sensor: its identity.
        first_ns: the sensor's clock at time 0 of the tracks.
        tracks: one track per person, the longest first.
    """

    sensor: str
    first_ns: int
    tracks: tuple[BodyTrack, ...]

    @property
    def duration(self) -> float:
        """Returns the seconds from the first body to the last."""
        return max((float(t.times[-1]) for t in self.tracks), default=0.0)


def stream_from_frames(sensor: str, frames: Iterable[BodyFrame]) -> BodyStream:
    """Returns the tracks of a sensor's body frames, without frames out of order or with equal times."""
    ordered_frames: list[BodyFrame] = []
    for frame in frames:
        if not ordered_frames or frame.time_ns > ordered_frames[-1].time_ns:
            ordered_frames.append(frame)
    first_ns = ordered_frames[0].time_ns if ordered_frames else 0
    people: dict[int, list[tuple[float, AnyArray, AnyArray]]] = {}
    for frame in ordered_frames:
        seconds = (frame.time_ns - first_ns) * 1e-9
        for body in frame.bodies:
            people.setdefault(body.id, []).append((seconds, body.joints, body.confidence))
    tracks = [
        BodyTrack(person, *(np.array(column, float) for column in zip(*rows, strict=True)))
        for person, rows in people.items()
    ]
    return BodyStream(sensor, first_ns, tuple(sorted(tracks, key=lambda t: -len(t.times))))


log = logging.getLogger(__name__)


class Collector(SensorThread):
    """Tracks one sensor in a thread and keeps its bodies.

    Args:
        name: the sensor's identity.
        sensor: the sensor.
        tracker: its tracker.
        seconds: time by the sensor's clock after which it stops. If None, it continues until the frames end.

    Attributes:
        frames: number of tracked frames.
    """

    def __init__(self, name: str, sensor: Sensor, tracker: Tracker, seconds: float | None = None) -> None:
        super().__init__(name, sensor)
        self.frames = 0
        self._tracker, self._seconds = tracker, seconds
        self._kept: list[tuple[BodyFrame, Float | None]] = []

    @property
    def level_from_camera(self) -> Float | None:
        """Returns the pose (4, 4) of a depth sensor's camera in its own level frame.

        It is None for a sensor that tracks bodies itself.
        """
        return next((mount for _, mount in reversed(self._kept) if mount is not None), None)

    def stream(self) -> BodyStream:
        """Returns all bodies up to now, in the current estimate of the level frame.

        A sensor may detect its floor only after some frames, or refine it later. Earlier bodies are then
        corrected.
        """
        return stream_from_frames(self.name, self.frames_in_level())

    def frames_in_level(self) -> list[BodyFrame]:
        """Returns the bodies of :meth:`stream` as body frames."""
        recorded_frames = list(self._kept)
        final_mount = self.level_from_camera
        return [_correct_mounting(frame, mount, final_mount) for frame, mount in recorded_frames]

    def _read(self) -> None:
        first: int | None = None
        while not self._stopped.is_set():
            try:
                frame = self.sensor.read(READ_TIMEOUT_S)
            except TimeoutError:
                continue
            except (SensorFault, InputError) as error:
                log.warning("%s", error)
                continue
            if frame is None:
                return
            first = frame.time_ns if first is None else first
            if self._seconds is not None and frame.time_ns - first > self._seconds * 1e9:
                return
            if isinstance(frame, DepthFrame):
                bodies = self._tracker.track(frame)
                mount = self._tracker.world_from_camera
                body_frame = BodyFrame(bodies, frame.time_ns, self.name)
                self._kept.append((body_frame, None if mount is None else mount.copy()))
            else:
                self._kept.append((frame, None))
            self.frames += 1


def _correct_mounting(frame: BodyFrame, mount: Float | None, final: Float | None) -> BodyFrame:
    """Returns the bodies as if the sensor's final mounting had been known from the start."""
    if mount is None or final is None or not frame.bodies or np.array_equal(mount, final):
        return frame
    return dataclasses.replace(frame, bodies=transform_bodies(frame.bodies, final @ invert(mount)))
