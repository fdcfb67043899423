"""Collects bodies for a calibration: each sensor's people in one level frame from its first frame on."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven_edge.fusion.calibration.tracks import BodyStream, stream_of
from enliven_edge.fusion.live import PATIENCE, SensorThread, in_world
from enliven_edge.fusion.placement import inverse
from enliven_edge.sensors import Sensor, SensorFault
from enliven_edge.tracking import Tracker

log = logging.getLogger(__name__)


class Collector(SensorThread):
    """Tracks one sensor in a thread and keeps its bodies.

    Args:
        name: the sensor's identity.
        seconds: of the sensor's clock after which it is enough; None for as long as frames come.

    Attributes:
        frames: how many were tracked.
    """

    def __init__(self, name: str, sensor: Sensor, tracker: Tracker, seconds: float | None = None) -> None:
        super().__init__(name, sensor)
        self.frames = 0
        self._tracker, self._seconds = tracker, seconds
        self._kept: list[tuple[BodyFrame, Float | None]] = []

    @property
    def level_from_camera(self) -> Float | None:
        """(4, 4) where a depth sensor's camera stands in its own level frame; None for a sensor of bodies."""
        return next((mount for _, mount in reversed(self._kept) if mount is not None), None)

    def stream(self) -> BodyStream:
        """Returns all bodies so far, in the level frame as it is known now.

        A sensor may find its floor only after some frames, or know it better later; what it said before is
        put right.
        """
        return stream_of(self.name, self.frames_in_level())

    def frames_in_level(self) -> list[BodyFrame]:
        """Returns the same as frames."""
        kept = list(self._kept)
        final = self.level_from_camera
        return [_put_right(frame, mount, final) for frame, mount in kept]

    def _read(self) -> None:
        first: int | None = None
        while not self._stopped.is_set():
            try:
                frame = self.sensor.read(PATIENCE)
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
                told = BodyFrame(bodies, frame.time_ns, self.name)
                self._kept.append((told, None if mount is None else mount.copy()))
            else:
                self._kept.append((frame, None))
            self.frames += 1


def _put_right(frame: BodyFrame, mount: Float | None, final: Float | None) -> BodyFrame:
    """Returns the bodies as if the sensor's final mounting had been known from the start."""
    if mount is None or final is None or not frame.bodies or np.array_equal(mount, final):
        return frame
    return dataclasses.replace(frame, bodies=in_world(frame.bodies, final @ inverse(mount)))
