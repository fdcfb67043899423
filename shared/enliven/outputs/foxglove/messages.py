"""Encodes simple Foxglove messages: depth images, camera calibration, health states and events.

:mod:`enliven.outputs.foxglove.stage_encoders` encodes messages with many numbers.

Source of the messages: https://docs.foxglove.dev/docs/sdk/schemas
"""

from __future__ import annotations

import numpy as np
from foxglove.messages import CameraCalibration, Log, LogLevel, RawImage, Timestamp

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.health import HealthState, Severity
from enliven.outputs.live_frame import PERFORMER, LiveEvent

CAMERA = "camera"
"""Name of the depth camera's frame. It has OpenCV's axes: +X right, +Y down, +Z forward."""
_LEVELS = {
    Severity.NOTE: LogLevel.Info,
    Severity.WARNING: LogLevel.Warning,
    Severity.ERROR: LogLevel.Error,
}


def timestamp(time_ns: int) -> Timestamp:
    """Returns a time in nanoseconds as a Foxglove timestamp."""
    return Timestamp(*divmod(max(time_ns, 0), 1_000_000_000))


def depth_image(depth: DepthFrame, mirrored: bool, time: Timestamp) -> RawImage:
    """Returns the depth image as a message, in millimetres. It is mirrored if the performers are mirrored."""
    image = np.ascontiguousarray(depth.depth[:, ::-1] if mirrored else depth.depth, "<u2")
    height, width = image.shape
    return RawImage(
        timestamp=time,
        frame_id=CAMERA,
        width=width,
        height=height,
        encoding="16UC1",
        step=2 * width,
        data=image.tobytes(),
    )


def calibration(camera: Intrinsics, mirrored: bool, time: Timestamp) -> CameraCalibration:
    """Returns the calibration of the depth camera as a message."""
    k1, k2, p1, p2, k3 = camera.distortion
    centre, p2 = (camera.width - 1 - camera.cx, -p2) if mirrored else (camera.cx, p2)
    matrix = [camera.fx, 0.0, centre, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    return CameraCalibration(
        timestamp=time,
        frame_id=CAMERA,
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        D=[k1, k2, p1, p2, k3],
        K=matrix,
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0],
    )


def health_log(state: HealthState, time: Timestamp, *, ended: bool = False) -> Log:
    """Returns a health state as a log message."""
    if ended:
        text = f"Resolved: {state.what}"
        return Log(timestamp=time, level=LogLevel.Info, name=str(state.kind), message=text)
    return Log(timestamp=time, level=_LEVELS[state.severity], name=str(state.kind), message=str(state))


def event_log(event: LiveEvent, time: Timestamp) -> Log:
    """Returns an event of the stage as a log message."""
    performer = f"{PERFORMER}{event.performer}" if event.performer else "all performers"
    text = " ".join(filter(None, (performer, event.kind, event.character)))
    return Log(timestamp=time, level=LogLevel.Info, name=event.kind, message=text)
