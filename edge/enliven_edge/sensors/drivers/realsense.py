"""Intel and RealSense depth cameras, read with pyrealsense2."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.drivers.driver_replay import MAX_WAITING_IMAGES, DriverReplay
from enliven_edge.sensors.drivers.lens import profile_from_name
from enliven_edge.sensors.drivers.realsense_library import (
    AlignedColour,
    ReplayedColour,
    depth_mode,
    find_colour_mode,
    intrinsics,
    lens_from_intrinsics,
    realsense_library,
    round_depth_step,
)
from enliven_edge.sensors.drivers.refusals import choose_device, convert_error

_GRAVITY_READINGS = 100
"""Number of accelerometer readings: half a second at 200 Hz. Their mean is used as gravity."""
_MAX_TEMPERATURE_C = 90.0
"""Maximum temperature of the vision processor in degrees Celsius, from the data sheet of the D400 family."""
KINDS = {"D41": "realsense-d415", "D45": "realsense-d455", "D405": "realsense-d405"}
"""The profile of a camera, by a part of its name. Other cameras have the stereo pair of the D435."""


class RealSenseSensor(Sensor):
    """A depth camera of the D400 family, or the images of a recording that pass through the same library.

    The arguments that all drivers share are described in :mod:`enliven_edge.sensors.drivers`.

    Args:
        serial: the serial number; empty for the only camera.
        preset: "default", "high_accuracy", "high_density", "medium_density" or "hand".
        laser: True turns the pattern projector on.
        colour: adds colour, registered to the depth. Pixels without depth have no colour.
    """

    isolated = True

    def __init__(
        self,
        serial: str = "",
        width: int = 640,
        height: int = 480,
        fps: int = 30,
        preset: str = "default",
        laser: bool = True,
        colour: bool = False,
        rehearse: str = "",
        before: str = "",
    ) -> None:
        self._rs = realsense_library()
        self._colour: AlignedColour | None = None
        self._sent_colour: ReplayedColour | None = None
        self._driver_replay = DriverReplay(rehearse, self._send, paced=True) if rehearse else None
        self._device = (
            self._open_rehearsal(rehearse, colour)
            if self._driver_replay
            else self._open_device(str(serial), before)
        )
        self._streams: list[Any] = []
        self._images, self._accelerations = (
            self._rs.frame_queue(MAX_WAITING_IMAGES),
            self._rs.frame_queue(_GRAVITY_READINGS),
        )
        self._gravity: list[np.ndarray] = []
        try:
            self._start((width, height, fps), preset, laser, colour)
        except BaseException:
            self.close()
            raise

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next depth image. Returns None at the end of a rehearsal.

        Raises:
            TimeoutError: if no image arrived in time.
        """
        is_over = self._driver_replay is not None and self._driver_replay.is_over()
        has_image, frame = self._images.try_wait_for_frame(round(1e3 * (timeout or 0.0)))
        if not has_image:
            if is_over:
                return None
            raise TimeoutError(f"no image of {self.name} yet")
        return self._frame(frame.as_depth_frame())

    def condition(self) -> Condition:
        """Returns the link, the vision processor's temperature, and gravity if it has an accelerometer."""
        if self._driver_replay is not None and (condition := self._driver_replay.condition()):
            return condition
        rs, info = self._rs, self._rs.camera_info.usb_type_descriptor
        usb = self._device.get_info(info) if self._device.supports(info) else ""
        hot = self._depth.supports(rs.option.asic_temperature)
        celsius = self._depth.get_option(rs.option.asic_temperature) if hot else None
        slow = usb.startswith("2")
        return Condition(
            f"USB {usb}" if usb else "",
            slow,
            celsius,
            _MAX_TEMPERATURE_C,
            self._measure_gravity(),
            self._calibrated,
        )

    def close(self) -> None:
        """Stops and closes all streams of the device. A second call does nothing."""
        if self._driver_replay:
            self._driver_replay.stop()
        streams, self._streams = self._streams, []
        for stream in streams:
            stream.stop()
            stream.close()

    def _open_device(self, serial: str, last_serial: str) -> Any:
        """Returns the camera with this serial number, or the only one."""
        rs = self._rs
        try:
            devices = list(rs.context().query_devices())
            devices_by_serial = {device.get_info(rs.camera_info.serial_number): device for device in devices}
        except RuntimeError as error:
            raise convert_error("realsense", error) from None
        return choose_device(
            "realsense", "a RealSense camera", devices_by_serial, serial, "serial", last_serial
        )

    def _start(self, mode: tuple[int, int, int], preset: str, laser: bool, colour: bool) -> None:
        """Starts the depth images, the colour if requested, and the accelerometer if there is one."""
        rs, info = self._rs, self._rs.camera_info
        device = self._device.supports(info.serial_number)
        serial = self._device.get_info(info.serial_number) if device else "rehearsal"
        self.name, self.again = f"realsense {serial}", {"before": serial} if device else {}
        name = self._device.get_info(info.name) if self._device.supports(info.name) else ""
        self._kind = profile_from_name(name, KINDS, "realsense-d435")
        self._depth = self._device.first_depth_sensor()
        self._set_option("visual_preset", preset, getattr(rs.rs400_visual_preset, preset, None))
        self._set_option("emitter_enabled", laser, float(laser))
        if self._driver_replay:
            camera = self._driver_replay.first.intrinsics
            mode = (camera.width, camera.height, round(self._driver_replay.fps))
        profile = depth_mode(self._rs, self._depth, mode, self.name)
        self.fps = float(profile.fps())
        self._read_intrinsics(profile)
        self._scale = round_depth_step(1e3 * self._depth.get_option(rs.option.depth_units))
        if colour:
            self._colour = AlignedColour(rs, 1e3 / self.fps)
            sensor, stream = find_colour_mode(rs, self._device, mode[:2], self.fps, self.name)
            self._open(sensor, stream, self._colour.queue)
        self._open(self._depth, profile, self._images)
        motion = [sensor for sensor in self._device.query_sensors() if sensor.is_motion_sensor()]
        rates = [p for sensor in motion[:1] for p in sensor.profiles if p.stream_type() == rs.stream.accel]
        if rates:
            self._open(motion[0], min(rates, key=lambda p: p.fps()), self._accelerations)

    def _open(self, sensor: Any, profile: Any, queue: Any) -> None:
        try:
            sensor.open(profile)
            sensor.start(queue)
        except RuntimeError as error:
            raise convert_error("realsense", error, self.name, self._driver_replay is not None) from None
        self._streams.append(sensor)

    def _set_option(self, option: str, word: Any, value: float | None) -> None:
        if value is None:
            raise InputError(
                f"the preset {word!r} does not exist",
                where="sensor realsense",
                remedy="Use default, high_accuracy, high_density, medium_density or hand.",
            )
        key = getattr(self._rs.option, option)
        if self._depth.supports(key) and not self._depth.is_option_read_only(key):
            self._depth.set_option(key, float(value))

    def _frame(self, image: Any) -> DepthFrame:
        """Converts an image to a frame. The library does not check that all its bytes are present."""
        self._held, seconds = image, 1e-3 * image.get_timestamp()
        size = width, height = image.get_width(), image.get_height()
        # A software device does not report the size of its data.
        byte_count = image.get_data_size() or 2 * width * height
        if image.get_stride_in_bytes() != 2 * width or byte_count < 2 * width * height:
            raise InputError(f"an image has fewer than {width}x{height} pixels", where=self.name)
        if not math.isfinite(seconds):
            raise InputError(f"the camera sent an image with the invalid time {seconds}", where=self.name)
        if size != (self._camera.width, self._camera.height):
            self._read_intrinsics(image.get_profile().as_video_stream_profile())
        depth: UInt16 = np.asanyarray(image.get_data())
        if self._scale != 1.0:
            depth = np.rint(depth * self._scale).clip(0, 65535).astype(np.uint16)
        time_ns, number = round(1e9 * seconds), image.get_frame_number()
        if self._driver_replay is not None:
            time_ns = self._driver_replay.record_taken(time_ns)
        colour = None if self._colour is None else self._colour.align_to(image)
        return DepthFrame(depth, self._camera, time_ns, self.name, colour, sequence=number)

    def _read_intrinsics(self, profile: Any) -> None:
        """Reads the intrinsics of a stream, or the typical ones if the device does not report them."""
        try:
            lens = profile.get_intrinsics()
        except RuntimeError:
            lens = self._rs.intrinsics()
            lens.width, lens.height = profile.width(), profile.height()
        self._camera, self._calibrated = intrinsics(
            lens, self._rs, self._kind, self.name, self._driver_replay is not None
        )

    def _measure_gravity(self) -> tuple[float, float, float] | None:
        """Returns gravity's direction, the mean of the last readings.

        It is opposite to the acceleration that a resting accelerometer measures.
        """
        while (frame := self._accelerations.poll_for_frame()) and len(self._gravity) < 4 * _GRAVITY_READINGS:
            acceleration = frame.as_motion_frame().get_motion_data()
            self._gravity.append(np.array([acceleration.x, acceleration.y, acceleration.z]))
        self._gravity = self._gravity[-_GRAVITY_READINGS:]
        if not self._gravity:
            return None
        x, y, z = (-np.mean(self._gravity, axis=0)).tolist()
        return x, y, z

    def _open_rehearsal(self, path: str, colour: bool) -> Any:
        """Returns a software device with the camera of the recording."""
        assert self._driver_replay is not None
        rs, camera = self._rs, self._driver_replay.first.intrinsics
        device = rs.software_device()
        self._sensor = device.add_sensor("Depth")
        self._stream = self._rehearsed_stream(camera)
        self._sensor.add_read_only_option(rs.option.depth_units, 0.001)
        if colour:
            first, fps = self._driver_replay.first, round(self._driver_replay.fps)
            self._sent_colour = ReplayedColour(rs, device, self._stream, first, fps, path)
        return device

    def _rehearsed_stream(self, camera: Intrinsics) -> Any:
        """Returns a stream of the software device for images of this camera."""
        assert self._driver_replay is not None
        rs, stream = self._rs, self._rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 0, rs.format.z16
        stream.width, stream.height, stream.bpp = camera.width, camera.height, 2
        stream.fps = round(self._driver_replay.fps)
        stream.intrinsics = lens_from_intrinsics(rs, camera, camera.width, camera.height)
        return self._sensor.add_video_stream(stream).as_video_stream_profile()

    def _send(self, frame: DepthFrame, number: int) -> None:
        """Passes an image of the recording to the library as a camera would."""
        if self._sent_colour is not None:
            self._sent_colour.send(frame, number)
        camera = frame.intrinsics
        if (camera.width, camera.height) != (self._stream.width(), self._stream.height()):
            self._stream = self._rehearsed_stream(camera)
        video_frame = self._rs.software_video_frame()
        video_frame.pixels, video_frame.bpp = np.ascontiguousarray(frame.depth), 2
        video_frame.stride = 2 * camera.width
        video_frame.timestamp, video_frame.frame_number = 1e-6 * frame.time_ns, number
        video_frame.domain = self._rs.timestamp_domain.hardware_clock
        video_frame.profile, video_frame.depth_units = self._stream, 0.001
        self._sensor.on_video_frame(video_frame)
