"""Depth cameras of Orbbec (Gemini, Astra 2, Femto Mega, Femto Bolt), read with OrbbecSDK 2."""

from __future__ import annotations

import contextlib
from collections import deque
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.drivers.lens import choose_intrinsics, create_range_filter, profile_from_name
from enliven_edge.sensors.drivers.orbbec_library import depth_mode, open_device, orbbec_library
from enliven_edge.sensors.drivers.playback import playbacks
from enliven_edge.sensors.drivers.refusals import convert_error

_GRAVITY_READINGS = 100
"""Number of accelerometer readings: one second at 100 Hz. Their mean is used as gravity."""
SYNC_MODES = ("free_run", "standalone", "primary", "secondary", "secondary_synced", "hardware_triggering")
"""Modes of OBMultiDeviceSyncMode that synchronise several cameras with only a cable."""
KINDS = {
    r"Gemini (2|210|215)\b": "orbbec-gemini2",
    r"Gemini (3\d\d|435)": "orbbec-gemini335",
    "Astra 2": "orbbec-astra2",
    "Femto": "orbbec-femto-mega",
}
"""The profile of a camera, by a regular expression for its name."""


class OrbbecSensor(Sensor):
    """A depth camera of Orbbec, or a recording that is played through the same library.

    The arguments that all drivers share are described in :mod:`enliven_edge.sensors.drivers`.

    Args:
        device: its serial number, name, USB path or network address; empty for the only camera.
        width, height: pixels of the depth image; 0 for the camera's default.
        fps: images per second; 0 for the camera's default.
        near, far: range of valid depth in metres; 0 for the range that the manufacturer specifies.
        preset: the name of one of the camera's own presets, such as "High Accuracy"; empty to leave it
            unchanged.
        sync: synchronisation of several cameras, such as "primary" and "secondary"; empty to leave it
            unchanged.
        rehearse: a recording of enliven or Orbbec (.bag) that is played through the library instead of a
            camera.
    """

    isolated = True

    def __init__(
        self,
        device: str = "",
        width: int = 0,
        height: int = 0,
        fps: int = 0,
        near: float = 0.0,
        far: float = 0.0,
        preset: str = "",
        sync: str = "",
        rehearse: str = "",
        before: str = "",
    ) -> None:
        if sync and sync not in SYNC_MODES:
            raise InputError(
                f"the sync mode {sync!r} does not exist",
                where="sensor orbbec",
                remedy=f"Use one of these modes: {', '.join(SYNC_MODES)}.",
            )
        self._ob = orbbec_library()
        self._pipeline: Any = None
        self._accelerometer: Any = None
        self._context: Any = None
        self.name = "sensor orbbec"
        self._accelerations: deque[tuple[float, float, float]] = deque(maxlen=_GRAVITY_READINGS)
        self._is_unplugged = self._started = False
        self._shift_ns, self._rehearsed = 0, bool(rehearse)
        self._left: list[tuple[Any, int]] = []
        self._part = self._played_parts = 0
        self._settings = (width, height, fps), (near, far), str(preset), sync
        try:
            if rehearse:
                self.name, self._left = "orbbec rehearsal", playbacks(self._ob, rehearse)
                self._play_next()
            else:
                self._device = self._open_device(str(device), before)
                self._prepare(*self._settings)
                self._start()
        except self._ob.OBError as error:
            self.close()
            raise convert_error("orbbec", error, self.name, self._rehearsed) from None
        except BaseException:
            self.close()
            raise

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next depth image. The first call starts the stream. Returns None at the end of a
        rehearsal.

        Raises:
            TimeoutError: if no image arrived in time.
            ResourceError: if the camera was unplugged or its driver reports an error.
        """
        try:
            self._start()
            is_over = self._rehearsed and self._played_parts == self._part
            frames = self._pipeline.wait_for_frames(max(round(1e3 * (timeout or 0.0)), 1))
            image = frames.get_depth_frame() if frames is not None else None
            if image is not None:
                return self._convert_frame(image)
            if is_over and not self._left:
                return None
            if is_over:
                self._play_next()
            if self._is_unplugged:
                raise ResourceError(
                    "the camera was unplugged", where=self.name, remedy="Plug the camera in again."
                )
            raise TimeoutError(f"no image of {self.name} yet")
        except self._ob.OBError as error:
            raise convert_error("orbbec", error, self.name, self._rehearsed) from None

    def condition(self) -> Condition:
        """Returns the link, the temperature, and gravity if there is an accelerometer.

        No temperature limit is published.
        """
        slow, usb = self._link.startswith("USB2"), self._link.replace("USB", "USB ")
        return Condition(usb, slow, self._celsius(), None, self._measure_gravity(), self._calibrated)

    def close(self) -> None:
        """Stops the stream, and releases the device and the remaining parts of a rehearsal."""
        self._stop()
        self._device = self._context = None
        self._left = []

    def _open_device(self, requested_name: str, last_serial: str) -> Any:
        """Opens the camera. The library reports when it is unplugged."""
        self._context = self._ob.Context()
        device = open_device(self._ob, self._context, requested_name, last_serial)
        device_info = device.get_device_info()
        serial, self._uid = device_info.get_serial_number(), device_info.get_uid()
        self.name, self.again = f"orbbec {serial}", {"before": serial}
        self._context.set_device_changed_callback(self._handle_changed_devices)
        return device

    def _handle_changed_devices(self, removed: Any, _added: Any) -> None:
        """Records that this camera was unplugged. Called by the library on its own thread."""
        removed_ids = [removed.get_device_uid_by_index(i) for i in range(len(removed))]
        self._is_unplugged = self._is_unplugged or self._uid in removed_ids

    def _play_next(self) -> None:
        """Uses the next part of a recording as the camera."""
        self._stop()
        self._device, self._shift_ns = self._left.pop(0)
        self._part += 1
        self._device.set_playback_status_change_callback(partial(self._handle_ended_part, self._part))
        self._prepare(*self._settings)

    def _handle_ended_part(self, part: int, status: Any) -> None:
        """Records that a part has ended. Called by the library on its own thread."""
        if status == self._ob.OBPlaybackStatus.STOPPED:
            self._played_parts = part

    def _prepare(
        self, mode: tuple[int, int, int], reach: tuple[float, float], preset: str, sync: str
    ) -> None:
        """Configures the camera before it starts."""
        ob, device_info = self._ob, self._device.get_device_info()
        self._link = device_info.get_connection_type()
        self._kind = profile_from_name(device_info.get_name(), KINDS, "orbbec-gemini335")
        self._reach = create_range_filter(reach, self._kind, self._rehearsed)
        self._configure(preset, sync)
        self._pipeline = ob.Pipeline(self._device)
        requested_mode = (0, 0, 0) if self._rehearsed else mode
        profile = depth_mode(ob, self._pipeline, requested_mode, self.name)
        self.fps, self._stream = float(profile.get_fps()), profile
        self._straighten = self._lens(profile)
        self._config = ob.Config()
        self._config.enable_stream(profile)

    def _configure(self, preset: str, sync: str) -> None:
        """Sets the camera's preset and its synchronisation mode. A recording has both already."""
        if preset:
            listed = self._device.get_available_preset_list()
            presets = [listed.get_name_by_index(i) for i in range(len(listed))]
            if preset not in presets:
                remedy = f"Presets of this camera: {', '.join(presets)}."
                raise InputError(f"the preset {preset!r} does not exist", where=self.name, remedy=remedy)
            self._device.load_preset(preset)
        if sync and not self._rehearsed:
            config = self._device.get_multi_device_sync_config()
            config.mode = getattr(self._ob.OBMultiDeviceSyncMode, sync.upper())
            self._device.set_multi_device_sync_config(config)

    def _start(self) -> None:
        """Starts the stream. A recording starts with the first call of ``read``, so that no image is lost."""
        if self._started:
            return
        self._started = True
        self._accelerations.clear()
        self._pipeline.start(self._config)
        ob, listed = self._ob, self._device.get_sensor_list()
        kinds = [listed.get_sensor_by_index(i).get_type() for i in range(len(listed))]
        if ob.OBSensorType.ACCEL_SENSOR in kinds:
            sensor = self._device.get_sensor(ob.OBSensorType.ACCEL_SENSOR)
            profile = sensor.get_stream_profile_list()[0]
            level = profile.get_extrinsic_to(self._stream)
            self._level = np.array(level.rot, dtype=float).reshape(3, 3)
            sensor.start(profile, self._handle_acceleration)
            self._accelerometer = sensor

    def _stop(self) -> None:
        for part in (self._accelerometer, self._pipeline):
            if part is not None and self._started:
                with contextlib.suppress(self._ob.OBError):
                    part.stop()
        self._accelerometer = self._pipeline = None
        self._started = False

    def _handle_acceleration(self, frame: Any) -> None:
        """Stores a reading of the accelerometer. Called by the library on its own thread."""
        acceleration = frame.as_accel_frame()
        self._accelerations.append((acceleration.get_x(), acceleration.get_y(), acceleration.get_z()))

    def _measure_gravity(self) -> tuple[float, float, float] | None:
        """Returns gravity's direction in the depth camera's frame.

        It is opposite to the acceleration that a resting accelerometer measures.
        """
        acceleration = list(self._accelerations)
        if not acceleration:
            return None
        x, y, z = (-self._level @ np.mean(acceleration, axis=0)).tolist()
        return x, y, z

    def _celsius(self) -> float | None:
        """Returns the temperature of the hottest part that the camera reports."""
        try:
            all_parts = self._device.get_temperature()
        except self._ob.OBError:
            return None
        names = [name for name in dir(all_parts) if name.endswith("_temperature")]
        return max((float(getattr(all_parts, name)) for name in names), default=None)

    def _lens(self, profile: Any) -> Any:
        """Reads the camera's intrinsics.

        Returns the library's undistortion filter for models that enliven does not support.
        """
        ob, bent = self._ob, profile.get_distortion()
        intrinsics = profile.get_intrinsic()
        lens = (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy)
        size = profile.get_width(), profile.get_height()
        self._camera, self._calibrated = choose_intrinsics(
            *size, lens, self._kind, self.name, self._rehearsed
        )
        model, models = bent.model, ob.OBCameraDistortionModel
        if not self._calibrated or model == models.NONE or not any(_distortion_coefficients(bent)):
            return None
        plain = model == models.BROWN_CONRADY or (
            model == models.BROWN_CONRADY_K6 and not any((bent.k4, bent.k5, bent.k6))
        )
        if not plain:
            return ob.UnDistortionFilter(ob.OBStreamType.DEPTH_STREAM)
        distortion = (bent.k1, bent.k2, bent.p1, bent.p2, bent.k3)
        self._camera = replace(self._camera, distortion=distortion)
        return None

    def _convert_frame(self, image: Any) -> DepthFrame:
        time_ns, number = 1000 * image.get_timestamp_us() + self._shift_ns, image.get_index()
        if self._straighten is not None:
            image = self._straighten.process(image).as_depth_frame()
        camera = self._camera
        millimetres = image.get_depth_scale()
        depth: UInt16 = np.frombuffer(image.get_data(), np.uint16)
        if depth.size != camera.width * camera.height:
            raise InputError(
                f"an image has {depth.size} pixels, not {_describe_size(camera)}", where=self.name
            )
        depth = depth.reshape(camera.height, camera.width)
        if abs(millimetres - 1.0) > 1e-6:
            depth = np.rint(depth * millimetres).clip(0, 65535).astype(np.uint16)
        return DepthFrame(self._reach(depth), camera, time_ns, self.name, sequence=number)


def _distortion_coefficients(bent: Any) -> tuple[float, ...]:
    return bent.k1, bent.k2, bent.k3, bent.k4, bent.k5, bent.k6, bent.p1, bent.p2


def _describe_size(camera: Intrinsics) -> str:
    return f"those of {camera.width}x{camera.height}"
