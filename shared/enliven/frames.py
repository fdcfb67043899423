"""The frames that a sensor delivers. A frame contains a depth image, or bodies if the sensor tracks people
itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, UInt8, UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.person import Body


@dataclass(frozen=True)
class DepthFrame:
    """One depth image.

    Attributes:
        depth: (H, W) uint16, distance along the optical axis in millimetres. 0 and 65535 mean unknown depth.
        intrinsics: the camera's intrinsics, for the same width and height.
        time_ns: the sensor's own clock, integer nanoseconds.
        sensor: the sensor's identity, such as "kinect1-A00362".
        colour: (h, w, 3) uint8 sRGB image, or None.
        world_from_camera: (4, 4) pose of the sensor, or None if it must be estimated from the floor.
        sequence: sequence number of the image, or None if the sensor does not count its images.
        read_ns: monotonic clock when the frame was read, if it was passed on much later. 0 otherwise.
    """

    depth: UInt16
    intrinsics: Intrinsics
    time_ns: int
    sensor: str
    colour: UInt8 | None = None
    world_from_camera: Float | None = None
    sequence: int | None = None
    read_ns: int = 0

    def __post_init__(self) -> None:
        expected = (self.intrinsics.height, self.intrinsics.width)
        if self.depth.dtype != np.uint16 or self.depth.shape != expected:
            raise InputError(
                f"the depth image has the type {self.depth.dtype} and shape {self.depth.shape}, "
                f"expected uint16 and {expected}",
                where=f"frame of {self.sensor}",
                remedy="Pass the intrinsics for the resolution of this depth image.",
            )


@dataclass(frozen=True)
class BodyFrame:
    """The bodies at one time, from one or several sensors or from a skeleton recording.

    Attributes:
        bodies: the bodies, in the world frame.
        time_ns: the sensor's own clock, integer nanoseconds.
        sensor: the sensor's identity.
        world_from_camera: (4, 4) pose of the sensor, or None if it is not known.
        read_ns: monotonic clock when the frame was read, if it was passed on much later. 0 otherwise.
    """

    bodies: list[Body]
    time_ns: int
    sensor: str
    world_from_camera: Float | None = None
    read_ns: int = 0


Frame = DepthFrame | BodyFrame


TIME_LIMIT_NS = 1 << 62
"""Maximum valid time in nanoseconds (146 years). Differences and offsets of valid times fit into 64 bits."""
