"""Arducam's time-of-flight camera on a Raspberry Pi, read with ArducamDepthCamera.

The library cannot play a file, and its frames cannot be created without a camera. A rehearsal therefore
replaces the one call that reads a frame. All code after it is the same as with a camera.
"""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from enliven.arrays import Float32, UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.kernels import njit
from enliven_edge.sensors.attached_cameras import import_library
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.drivers.driver_replay import DriverReplay
from enliven_edge.sensors.drivers.lens import choose_intrinsics, depth_limits

_PROFILE = "arducam-tof"
_MODES = {2: 2000, 4: 4000}
"""Value of the range control in millimetres, by the requested range in metres."""
_INTRINSICS_SCALE = 100.0
"""Divisor of the intrinsics, because the library reports them in hundredths of a pixel."""
_REASONS = {
    "ArducamNoPermission": (
        "your user may not open the camera",
        "Type: sudo usermod -aG video $USER, and log in again.",
    ),
    "ArducamUnkownDevice": (
        "the camera at this port is not an Arducam ToF camera",
        "Check --set device=NUMBER.",
    ),
    "ArducamNoCache": (
        "the camera is in use, or its library has no memory left",
        "Close other programs that use the camera.",
    ),
}
"""Meaning and remedy of the library's error codes. Other codes are reported as a missing camera."""
_NONE_FOUND = (
    "no Arducam ToF camera was found",
    "Connect the camera to the camera port, add dtoverlay=arducam-pivariety to /boot/firmware/config.txt, "
    "restart, and type: enliven doctor",
)


@dataclass(frozen=True)
class _FrameContent:
    """The content of the library's frames, for a rehearsal."""

    depth_data: Float32
    confidence_data: Float32
    time_ns: int
    number: int
    lens: Intrinsics


class TofSensor(Sensor):
    """Arducam's camera at a Raspberry Pi's camera port, or the images of a recording instead.

    The arguments that all drivers share are described in :mod:`enliven_edge.sensors.drivers`.

    Args:
        device: the number of the port, 0 or 1.
        range: measured range in metres, 2 (finer) or 4.
        confidence: minimum confidence of a depth, 0 to 255. Depths below it count as unknown.
        near, far: range of valid depth in metres. 0 selects 0.2 m for ``near``, and ``range`` for ``far``.
    """

    isolated = True

    def __init__(
        self,
        device: int = 0,
        range: int = 4,
        confidence: float = 30.0,
        near: float = 0.0,
        far: float = 0.0,
        rehearse: str = "",
    ) -> None:
        if range not in _MODES:
            raise InputError(
                f"the range cannot be {range} m", where="sensor tof", remedy="Set range to 2 or 4."
            )
        self.name, self.fps = f"tof {device}", 30.0
        self._confidence = float(confidence)
        self._limits = depth_limits(
            (near, far or (0.0 if rehearse else float(range))), _PROFILE, bool(rehearse)
        )
        self._number = 0
        self._camera: Any = None
        self._driver_replay: DriverReplay | None = None
        if rehearse:
            self._played: queue.SimpleQueue[_FrameContent] = queue.SimpleQueue()
            self._driver_replay = DriverReplay(rehearse, self._send_recorded, paced=True)
            self._lens, self._calibrated = self._driver_replay.first.intrinsics, True
            self.name, self.fps = "tof rehearsal", self._driver_replay.fps
        else:
            self._open(device, range)

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next depth image. Its time is the arrival at this machine. Returns None at the end of a
        rehearsal.

        Raises:
            TimeoutError: if no image arrived in time.
        """
        is_over = self._driver_replay is not None and self._driver_replay.is_over()
        frame = self._request_frame(timeout or 0.0)
        if frame is None:
            if is_over:
                return None
            raise TimeoutError(f"no image of {self.name} yet")
        # Use this machine's clock, because the library does not document the unit and the clock of its times.
        time_ns, number = time.monotonic_ns(), self._number
        if self._driver_replay is not None:
            self._lens, number = frame.lens, frame.number
            time_ns = self._driver_replay.record_taken(frame.time_ns)
        try:
            depth = self.filter_depth(frame.depth_data, frame.confidence_data)
        finally:
            self._release_frame(frame)
        self._number = number + 1
        return DepthFrame(depth, self._lens, time_ns, self.name, sequence=number)

    def condition(self) -> Condition:
        """Returns the link, which is the camera port, and whether the camera reports its intrinsics."""
        if self._driver_replay is not None and (condition := self._driver_replay.condition()):
            return condition
        return Condition("CSI" if self._camera is not None else "", calibrated=self._calibrated)

    def close(self) -> None:
        """Stops and closes the camera. A second call does nothing."""
        if self._driver_replay:
            self._driver_replay.stop()
        camera, self._camera = self._camera, None
        if camera is not None:
            camera.stop()
            camera.close()

    def _open(self, device: int, metres: int) -> None:
        """Opens and starts the camera. Any call to a camera that did not open crashes the library."""
        self._ac = ac = import_library("ArducamDepthCamera", "tof", "--no-deps ArducamDepthCamera")
        camera = ac.ArducamCamera()
        code = camera.open(ac.Connection.CSI, device)
        if code != ac.TofErrorCode.ArducamSuccess:
            problem, remedy = _REASONS.get(code.name, _NONE_FOUND)
            raise ResourceError(
                f"{problem} ({code.name.removeprefix('Arducam')})", where=self.name, remedy=remedy
            )
        code = camera.start(ac.FrameType.DEPTH)
        if code != ac.TofErrorCode.ArducamSuccess:
            camera.close()
            problem = f"the camera does not start ({code.name.removeprefix('Arducam')})"
            raise ResourceError(
                problem,
                where=self.name,
                remedy="Close other programs that use the camera, or restart the Pi.",
            )
        self._camera = camera
        try:
            camera.setControl(ac.Control.RANGE, _MODES[metres])
            info, control = camera.getCameraInfo(), ac.Control
            option = (control.INTRINSIC_FX, control.INTRINSIC_FY, control.INTRINSIC_CX, control.INTRINSIC_CY)
            fx, fy, cx, cy = (camera.getControl(control_id) / _INTRINSICS_SCALE for control_id in option)
            self._lens, self._calibrated = choose_intrinsics(
                info.width, info.height, (fx, fy, cx, cy), _PROFILE, self.name
            )
        except BaseException:
            self.close()
            raise

    def _request_frame(self, timeout: float) -> Any:
        """Returns the next frame of the library or of a rehearsal. Returns None if no frame arrived in
        time.
        """
        if self._driver_replay is not None:
            try:
                return self._played.get(timeout=max(timeout, 1e-3))
            except queue.Empty:
                return None
        frame = self._camera.requestFrame(max(round(1e3 * timeout), 1))
        if isinstance(frame, self._ac.DepthData):
            return frame
        self._release_frame(frame)
        return None

    def _release_frame(self, frame: Any) -> None:
        """Gives a frame of the library back to it."""
        if self._camera is not None and frame is not None:
            self._camera.releaseFrame(frame)

    def filter_depth(self, depth: Float32, confidence: Float32) -> UInt16:
        """Returns (H, W) uint16 millimetres, 0 for pixels with low confidence or out of range."""
        lens: Intrinsics = self._lens
        if depth.shape != (lens.height, lens.width) or confidence.shape != depth.shape:
            problem = f"depth and confidence have the shapes {depth.shape} and {confidence.shape}"
            raise InputError(
                problem, where=self.name, remedy=f"Both must have the shape {(lens.height, lens.width)}."
            )
        trusted = np.empty(depth.shape, np.uint16)
        _keep_trusted_depth(depth, confidence, self._confidence, *self._limits, trusted)
        return trusted

    def _send_recorded(self, frame: DepthFrame, number: int) -> None:
        """Queues an image of a recording as the library would measure it. Unknown depth has confidence 0."""
        depth = frame.depth.astype(np.float32)
        sure = np.where(frame.depth > 0, np.float32(255.0), np.float32(0.0))
        self._queue_frame(_FrameContent(depth, sure, frame.time_ns, number, frame.intrinsics))

    def _queue_frame(self, measured: _FrameContent) -> None:
        """Queues an image instead of the library. A paced rehearsal ensures that few images wait."""
        self._played.put(measured)


@njit(cache=True, nogil=True)
def _keep_trusted_depth(depth: Any, confidence: Any, least: float, low: int, high: int, trusted: Any) -> None:
    """Writes depths in rounded millimetres (H, W) into ``trusted``, and 0 for pixels outside the limits or
    with low confidence.
    """
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            millimetres = np.rint(depth[i, j])
            # If depth or confidence is NaN, every comparison fails, so the pixel counts as unknown.
            is_valid = confidence[i, j] >= least and low <= millimetres <= high
            trusted[i, j] = np.uint16(millimetres) if is_valid else np.uint16(0)
