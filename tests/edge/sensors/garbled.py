"""Drivers with a real library that occasionally delivers a garbage image, in the form that is typical for
it.
"""

from __future__ import annotations

import math
from datetime import timedelta

import numpy as np

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Sensor
from enliven_edge.sensors.drivers.oak import OakSensor
from enliven_edge.sensors.drivers.realsense import RealSenseSensor
from enliven_edge.sensors.replay import ReplaySensor

EVERY = 10
"""Every tenth image is garbage."""


def is_garbage(number: int) -> bool:
    return number % EVERY == EVERY - 1


class Plain(Sensor):
    """A user's own driver in a helper process, which opens, reads and closes a recording."""

    isolated = True

    def __init__(self, rehearse: str) -> None:
        self._file = ReplaySensor(rehearse)
        self.name, self.fps, self._count = "plain rehearsal", self._file.fps, 0

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        frame = self._file.read(timeout)
        if frame is None:
            return None
        number, self._count = self._count, self._count + 1
        return self._made(frame, number)

    def _made(self, frame: DepthFrame, number: int) -> DepthFrame:
        return DepthFrame(frame.depth, frame.intrinsics, frame.time_ns, self.name, sequence=number)

    def close(self) -> None:
        self._file.close()


class GarbledPlain(Plain):
    """Delivers an image of another type, and one whose size is not that of its camera."""

    def _made(self, frame: DepthFrame, number: int) -> DepthFrame:
        camera, depth = frame.intrinsics, frame.depth
        if is_garbage(number):
            depth = (depth.astype(np.float32) * math.nan, depth[:-1])[number // EVERY % 2]
        return DepthFrame(depth, camera, frame.time_ns, self.name, sequence=number)


class GarbledOak(OakSensor):
    """Delivers too few bytes, no bytes, another type, no size, a NaN lens, and an object that is not an
    image.
    """

    def _send(self, frame: DepthFrame, number: int) -> None:
        if not is_garbage(number):
            return super()._send(frame, number)
        dai, types = self._dai, self._dai.ImgFrame.Type
        width, height = frame.intrinsics.width, frame.intrinsics.height
        kinds = (
            (types.RAW16, 100, width, height, 80.0),
            (types.RAW16, 0, width, height, 80.0),
            (types.GRAY8, width * height, width, height, 80.0),
            (types.BGR888i, 3 * width * height, width, height, 80.0),
            (types.RAW16, 2 * width * height, 0, 0, 80.0),
            (types.RAW16, 2 * width * height, width, height, math.nan),
        )
        turn = number // EVERY % (len(kinds) + 1)
        if turn == len(kinds):
            self._node.out.send(dai.Buffer())
            return None
        kind, size, across, down, focal = kinds[turn]
        image = dai.ImgFrame()
        image.setType(kind)
        image.setWidth(across)
        image.setHeight(down)
        image.setData(np.zeros(size, np.uint8))
        image.setSequenceNum(number)
        image.setTimestamp(timedelta(microseconds=frame.time_ns / 1000))
        lens = [[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]]
        image.setTransformation(dai.ImgTransformation(width, height, lens))
        self._node.out.send(image)
        return None


class GarbledRealSense(RealSenseSensor):
    """Delivers another type, half a row, and NaN times. A RealSense does not report missing rows."""

    def _send(self, frame: DepthFrame, number: int) -> None:
        if not is_garbage(number):
            return super()._send(frame, number)
        camera: Intrinsics = frame.intrinsics
        time_ms = 1e-6 * frame.time_ns
        kinds = (
            (np.uint8, 1, camera.width, time_ms),
            (np.uint16, 2, camera.width, time_ms),
            (np.uint16, 2, 2 * camera.width, math.nan),
            (np.uint16, 2, 2 * camera.width, -math.inf),
        )
        kind, size, stride, time_of_it = kinds[number // EVERY % len(kinds)]
        image = self._rs.software_video_frame()
        image.pixels = np.zeros((camera.height, camera.width), kind)
        image.bpp, image.stride, image.timestamp, image.frame_number = size, stride, time_of_it, number
        image.domain = self._rs.timestamp_domain.hardware_clock
        image.profile, image.depth_units = self._stream, 0.001
        self._sensor.on_video_frame(image)
        return None
