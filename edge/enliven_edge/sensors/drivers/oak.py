"""OAK depth cameras of Luxonis, read with depthai 3."""

from __future__ import annotations

import logging
import os
from datetime import timedelta
from typing import Any

import numpy as np

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven_edge.sensors import crash_reports
from enliven_edge.sensors.attached_cameras import import_library
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.drivers.driver_replay import MAX_WAITING_IMAGES, DriverReplay
from enliven_edge.sensors.drivers.lens import choose_intrinsics, profile_from_name
from enliven_edge.sensors.drivers.oak_colour import create_aligned_outputs, create_image_message, synchronise
from enliven_edge.sensors.drivers.refusals import choose_device, convert_error

log = logging.getLogger(__name__)

_SEARCH_MS = "1500"
"""Milliseconds for which the library searches for a camera (its default is 10 s). It can be short, because a
connected camera answers immediately."""
_NOT_FOUND_MESSAGES = ("No available devices", "Cannot find any device with given deviceInfo")
"""The library's messages if it finds no camera at all, or not the requested one."""
_ACCELEROMETER_HZ = 100
"""Readings of the accelerometer per second. The mean over one second is used as gravity."""
KINDS = {"LITE": "oak-d-lite"}
"""The profile of a camera, by a part of its product name. Other cameras have the stereo pair of the OAK-D."""
_MAX_TEMPERATURE_C = 105.0
"""Chip temperature in degrees Celsius at which the chip throttles and then stops (RVC2 data sheet)."""


class OakSensor(Sensor):
    """An OAK with a stereo pair, or the images of a recording that pass through the same library.

    The arguments that all drivers share are described in :mod:`enliven_edge.sensors.drivers`.

    Args:
        device: its id, USB port or network address; empty for the only camera.
        preset: "default", "accuracy", "density", "robotics", "high_detail" or "face".
        subpixel: finer depth steps, at the cost of some speed.
        left_right_check: remove pixels that only one of the two cameras sees.
        colour: adds the colour camera's image. Depth is then registered to that camera.
    """

    isolated = True

    def __init__(
        self,
        device: str = "",
        width: int = 640,
        height: int = 400,
        fps: float = 30.0,
        preset: str = "robotics",
        subpixel: bool = True,
        left_right_check: bool = True,
        colour: bool = False,
        rehearse: str = "",
        before: str = "",
    ) -> None:
        os.environ.setdefault("DEPTHAI_SEARCH_TIMEOUT", _SEARCH_MS)
        # Store crash dumps of the firmware here. They must not be sent to the manufacturer without consent.
        os.environ.setdefault("DEPTHAI_CRASHDUMP", str(crash_reports.reports_folder()))
        os.environ.setdefault("DEPTHAI_DISABLE_CRASHDUMP_COLLECTION", "1")
        self._dai = import_library("depthai", "oak")
        self._device: Any = None
        self._accelerometer: Any = None
        self._level: Any = None
        self._gravity: list[np.ndarray] = []
        self._camera: Intrinsics | None = None
        self._matrix: Any = None
        self._calibrated, self._kind = True, "oak-d"
        self._driver_replay: DriverReplay | None = None
        self._before = before
        self._images: Any = None
        if rehearse:
            depth, seen = self._open_rehearsal(rehearse, colour)
        else:
            depth, seen = self._open_pipeline(
                str(device), (width, height), fps, preset, (subpixel, left_right_check), colour
            )
        self._coloured = seen is not None
        both = (
            synchronise(self._dai, self._pipeline, depth, seen, self.fps or fps) if self._coloured else depth
        )
        self._images = both.createOutputQueue(MAX_WAITING_IMAGES, False)
        try:
            self._pipeline.start()
        except RuntimeError as error:
            raise convert_error("oak", error, self.name, bool(rehearse)) from None

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next depth image. Returns None at the end of a rehearsal.

        Raises:
            TimeoutError: if no image arrived in time.
            ResourceError: if the firmware crashed or the connection was lost.
        """
        is_over = self._driver_replay is not None and self._driver_replay.is_over()
        try:
            image = self._images.get(timeout=timedelta(seconds=timeout or 0.0))
        except RuntimeError as error:
            raise convert_error("oak", error, self.name, self._driver_replay is not None) from None
        if image is None:
            if is_over:
                return None
            if self._device is not None and self._device.hasCrashed():
                raise ResourceError("the firmware of the camera crashed", where=self.name)
            raise TimeoutError(f"no image of {self.name} yet")
        return self._frame(image)

    def condition(self) -> Condition:
        """Returns the link, the chip's temperature, and gravity if it has an accelerometer."""
        if self._driver_replay is not None:
            return self._driver_replay.condition() or Condition(calibrated=self._calibrated)
        speed, speeds = self._device.getUsbSpeed(), self._dai.UsbSpeed
        slow = speed in (speeds.LOW, speeds.FULL, speeds.HIGH)
        link = "PoE" if speed == speeds.UNKNOWN else "USB 2" if slow else "USB 3"
        celsius = float(self._device.getChipTemperature().average)
        return Condition(link, slow, celsius, _MAX_TEMPERATURE_C, self._measure_gravity(), self._calibrated)

    def close(self) -> None:
        """Stops the pipeline and closes the device. A second call does nothing."""
        if self._driver_replay:
            self._driver_replay.stop()
        if self._images is not None:
            self._images = None
            self._pipeline.stop()
            if self._device is not None:
                self._device.close()

    def _open_pipeline(
        self,
        device: str,
        size: tuple[int, int],
        fps: float,
        preset: str,
        checks: tuple[bool, bool],
        colour: bool,
    ) -> tuple[Any, Any]:
        """Opens the device and builds the DepthAI pipeline.

        Starts the accelerometer, if the device has one. Returns the pipeline's depth output, and the output
        of the colour camera for the alignment (None without colour).

        Args:
            checks: subpixel, and left-right check.
        """
        dai = self._dai
        presets = {name.lower(): mode for name, mode in dai.node.StereoDepth.PresetMode.__members__.items()}
        if preset not in presets:
            raise InputError(
                f"the preset {preset!r} does not exist",
                where="sensor oak",
                remedy=f"Use one of these presets: {', '.join(presets)}.",
            )
        self._device = self._open_device(device)
        store_crash_dump(self._device)
        name = self._device.getDeviceId()
        self.name, self.fps, self.again = f"oak {name}", fps, {"before": name}
        self._kind = profile_from_name(self._device.getProductName(), KINDS, self._kind)
        self._pipeline = dai.Pipeline(self._device)
        try:
            stereo = self._pipeline.create(dai.node.StereoDepth).build(
                autoCreateCameras=True, presetMode=presets[preset], size=size, fps=fps
            )
        except RuntimeError as error:
            raise convert_error("oak", error, self.name) from None
        stereo.setSubpixel(checks[0])
        stereo.setLeftRightCheck(checks[1])
        sockets = dai.CameraBoardSocket
        depth, camera_features = stereo.depth, None
        if colour:
            depth, camera_features = create_aligned_outputs(dai, self._pipeline, stereo, size, fps)
        if self._device.getConnectedIMU() not in ("", "NONE"):
            imu = self._pipeline.create(dai.node.IMU)
            imu.enableIMUSensor(dai.IMUSensor.ACCELEROMETER_RAW, _ACCELEROMETER_HZ)
            imu.setBatchReportThreshold(_ACCELEROMETER_HZ // 10)
            imu.setMaxBatchReports(_ACCELEROMETER_HZ)
            self._accelerometer = imu.out.createOutputQueue(MAX_WAITING_IMAGES, False)
            calibration = self._device.readCalibration()
            features = sockets.CAM_A if colour else sockets.CAM_C
            self._level = np.array(calibration.getImuToCameraExtrinsics(features))[:3, :3]
        return depth, camera_features

    def _open_device(self, requested_name: str) -> Any:
        """Opens the camera. If none is visible yet, the library searches for a while."""
        dai = self._dai
        cameras = {info.getDeviceId(): info for info in dai.Device.getAllAvailableDevices()}

        def choose() -> Any:
            return choose_device("oak", "an OAK", cameras, requested_name, "device", self._before)

        try:
            if requested_name:
                return dai.Device(cameras.get(requested_name) or dai.DeviceInfo(requested_name))
            return dai.Device(choose()) if cameras else dai.Device()
        except RuntimeError as error:
            if str(error) in _NOT_FOUND_MESSAGES and requested_name not in cameras:
                choose()
            raise convert_error("oak", error) from None

    def _frame(self, image: Any) -> DepthFrame:
        """Converts an image to a frame."""
        colour = None
        try:
            if self._coloured:
                image, colour = image["depth"], image["colour"].getFrame()
            time_ns = image.getTimestamp() // timedelta(microseconds=1) * 1000
            depth, number = image.getFrame(), image.getSequenceNum()
            transformation = image.getTransformation()
        except (RuntimeError, AttributeError, ValueError) as error:
            raise InputError(f"an image of the camera is invalid ({error})", where=self.name) from None
        camera = self._intrinsics(transformation, *depth.shape[1::-1])
        if self._driver_replay is not None:
            time_ns = self._driver_replay.record_taken(time_ns)
        return DepthFrame(depth, camera, time_ns, self.name, colour, sequence=number)

    def _intrinsics(self, transformation: Any, width: int, height: int) -> Intrinsics:
        """Returns the intrinsics of an image. Its depth is rectified, so it has no distortion."""
        matrix = transformation.getIntrinsicMatrix()
        if self._camera is None or matrix != self._matrix:
            (fx, _, cx), (_, fy, cy), _ = matrix
            lens = (fx, fy, cx, cy)
            arguments = width, height, lens, self._kind, self.name, self._driver_replay is not None
            self._camera, self._calibrated = choose_intrinsics(*arguments)
            self._matrix = matrix
        return self._camera

    def _measure_gravity(self) -> tuple[float, float, float] | None:
        """Returns gravity's direction in the depth camera's frame.

        It is opposite to the acceleration that a resting accelerometer measures.
        """
        if self._accelerometer is None:
            return None
        while (data := self._accelerometer.tryGet()) is not None:
            for packet in data.packets:
                acceleration = packet.acceleroMeter
                self._gravity.append(np.array([acceleration.x, acceleration.y, acceleration.z]))
        self._gravity = self._gravity[-_ACCELEROMETER_HZ:]
        if not self._gravity:
            return None
        x, y, z = (-self._level @ np.mean(self._gravity, axis=0)).tolist()
        return x, y, z

    def _open_rehearsal(self, path: str, colour: bool) -> tuple[Any, Any]:
        """Returns the output of a node that replaces the camera's stereo node and sends the images of a
        recording.

        Returns:
            the depth output, and the colour output or None.
        """
        dai = self._dai

        class Recorded(dai.node.ThreadedHostNode):  # type: ignore[misc, name-defined]
            """Passes on the images that the rehearsal sends."""

            def __init__(self) -> None:
                super().__init__()
                self.out, self.colour = self.createOutput(), self.createOutput()

            def run(self) -> None:
                """Does nothing, because the rehearsal has its own thread."""

        self._pipeline = dai.Pipeline(createImplicitDevice=False)
        self._node = self._pipeline.create(Recorded)
        self._driver_replay = DriverReplay(path, self._send, paced=True)
        if any(self._driver_replay.first.intrinsics.distortion):
            remedy = "An OAK camera sends rectified images. Use another recording, or --sensor realsense."
            raise InputError("the images of the recording are not rectified", where=path, remedy=remedy)
        self.name, self.fps = "oak rehearsal", self._driver_replay.fps
        self._last_colour = self._driver_replay.first.colour
        if colour and self._last_colour is None:
            raise InputError(
                "the recording has no colour images", where=path, remedy="Rehearse without colour=true."
            )
        return self._node.out, self._node.colour if colour else None

    def _send(self, frame: DepthFrame, number: int) -> None:
        """Sends a depth image of the recording, and its colour, in the same form as a camera's stereo
        node.
        """
        dai, camera = self._dai, frame.intrinsics
        self._last_colour = self._last_colour if frame.colour is None else frame.colour
        if self._coloured and self._last_colour is not None:
            colour_image = create_image_message(
                dai, self._last_colour, dai.ImgFrame.Type.RGB888i, number, frame.time_ns
            )
            self._node.colour.send(colour_image)
        image = create_image_message(dai, frame.depth, dai.ImgFrame.Type.RAW16, number, frame.time_ns)
        lens = [[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]]
        image.setTransformation(dai.ImgTransformation(camera.width, camera.height, lens))
        self._node.out.send(image)


def store_crash_dump(device: Any) -> None:
    """Stores a camera's dump of a firmware crash, and clears it on the camera."""
    try:
        crash_reports.reports_folder().mkdir(parents=True, exist_ok=True)
        crash_reports.remove_old_reports()
        if device.hasCrashDump():
            dump = device.getCrashDump()
            crash_reports.keep_dump(dump.deviceId or device.getDeviceId(), lambda path: dump.toTar(str(path)))
    except (RuntimeError, OSError) as error:
        log.warning("the camera's crash dump cannot be read: %s", error)
