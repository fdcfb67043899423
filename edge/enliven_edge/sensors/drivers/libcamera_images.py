"""Images of cameras that libcamera supports, read with libcamera's Python binding."""

from __future__ import annotations

import contextlib
import mmap
import select
import time
from typing import Any

import numpy as np

from enliven.arrays import UInt8
from enliven.errors import InputError, ResourceError
from enliven_edge.sensors.drivers.libcamera_library import COLOUR, GREY, Layout, copy_image, libcamera_library
from enliven_edge.sensors.stereo.pairing import CameraImage

_BUFFERS = 4
"""Number of image buffers of a camera: one is being filled, one is being read, and two are queued."""
_SERVER = 1
"""Value of the Raspberry Pi's control SyncMode for the first camera, which provides the clock."""
_CLIENT = 2
"""Value of the control SyncMode for the other cameras, which follow the clock."""


class LibcameraImages:
    """One or two running cameras.

    Args:
        cameras: for each a number, counted from 0 in libcamera's order, or a part of its id.
        size: (width, height) of the images.
        fps: images per second, if the camera supports setting it.
        colour: whether to deliver colour instead of grey.
        exposure_us: microseconds of exposure; 0 for automatic exposure.
        gain: gain of the sensor, if the exposure is given.
        tuning: a tuning file for the Raspberry Pi's image processor. If empty, uses the file of the image
            sensor.

    Attributes:
        name: the cameras' ids.
        sizes: (width, height) of each camera's images, which may differ from the requested size.

    Raises:
        InputError: for a camera or tuning file that cannot be used.
        ResourceError: if the library or a camera is missing, or a camera is in use.
    """

    def __init__(
        self,
        cameras: list[str],
        size: tuple[int, int],
        fps: float = 30.0,
        colour: bool = False,
        exposure_us: int = 0,
        gain: float = 1.0,
        tuning: str = "",
    ) -> None:
        self._lib = libcamera_library(tuning)
        self._manager = self._lib.CameraManager.singleton()
        self._formats = COLOUR if colour else GREY
        self._open_cameras: list[_OpenCamera] = []
        self._ready: list[Any] = []
        self._celsius: float | None = None
        devices = self._find_cameras(cameras)
        self.name = f"libcamera {', '.join(_short_id(camera.id) for camera in devices)}"
        try:
            for camera in devices:
                self._open_cameras.append(
                    _OpenCamera(self._lib, camera, len(self._open_cameras), size, self._formats)
                )
            controls = _initial_controls(fps, exposure_us, gain)
            # Start the followers first, because they wait for the clock of the leader.
            for eye in reversed(self._open_cameras):
                beat = {} if len(devices) == 1 else {"SyncMode": _CLIENT if eye.number else _SERVER}
                eye.start({**controls, **beat})
        except BaseException:
            self.close()
            raise
        self.sizes = [eye.size for eye in self._open_cameras]

    def read(self, timeout: float | None = None) -> CameraImage | None:
        """Returns the next image of any of the cameras, copied out of the camera's memory.

        Raises:
            TimeoutError: if none arrived in time.
            InputError: for an image that the camera reports as damaged.
            ResourceError: if a camera was lost.
        """
        deadline = time.monotonic() + (timeout or 0.0)
        while not self._ready:
            wait = None if timeout is None else max(deadline - time.monotonic(), 0.0)
            if not select.select([self._manager.event_fd], [], [], wait)[0]:
                raise TimeoutError(f"no image of {self.name} yet")
            self._ready += self._manager.get_ready_requests()
        request = self._ready.pop(0)
        camera = self._open_cameras[request.cookie // _MAX_BUFFERS]
        picture = camera.picture(request)
        self._celsius = camera.celsius if camera.celsius is not None else self._celsius
        return picture

    def temperature(self) -> float | None:
        """Returns the temperature of the image sensor in degrees Celsius, or None if it is not reported."""
        return self._celsius

    def close(self) -> None:
        """Releases the cameras. A second call does nothing."""
        cameras, self._open_cameras = self._open_cameras, []
        for camera in cameras:
            camera.close()
        self._ready = []

    def _find_cameras(self, requested_names: list[str]) -> list[Any]:
        """Returns the requested cameras."""
        connected = list(self._manager.cameras)
        if not connected:
            remedy = (
                "Turn the power off, and check the ribbon cable. List the cameras: rpicam-hello "
                "--list-cameras"
            )
            raise ResourceError("libcamera finds no camera", where="sensor libcamera", remedy=remedy)
        listed = ", ".join(f"{number} {camera.id}" for number, camera in enumerate(connected))
        devices = []
        for identity in requested_names:
            matching = [c for n, c in enumerate(connected) if identity in (str(n), c.id)]
            matching = matching or [c for c in connected if not identity.isdigit() and identity in c.id]
            if not matching:
                raise ResourceError(
                    f"the camera {identity!r} was not found",
                    where="sensor libcamera",
                    remedy=f"Connected: {listed}.",
                )
            devices.append(matching[0])
        if len({camera.id for camera in devices}) < len(devices):
            remedy = f"Set left and right to two different cameras. Connected: {listed}."
            raise InputError("left and right are the same camera", where="sensor libcamera", remedy=remedy)
        return devices


_MAX_BUFFERS = 64
"""Maximum number of buffers of a camera. A request's id is the camera's number times this value, plus the
buffer's number."""


class _OpenCamera:
    """One camera, its buffers and its requests."""

    def __init__(
        self, lib: Any, camera: Any, number: int, size: tuple[int, int], formats: dict[str, Layout]
    ) -> None:
        self._lib, self._camera, self.number = lib, camera, number
        self.celsius: float | None = None
        self._running = False
        self._maps: list[mmap.mmap] = []
        try:
            camera.acquire()
        except (RuntimeError, OSError) as error:
            raise ResourceError(
                f"the camera cannot be opened ({error})",
                where=camera.id,
                remedy="Close other programs that use the camera.",
            ) from None
        try:
            self._configure(size, formats)
            self._make_requests()
        except BaseException:
            self.close()
            raise

    def start(self, settings: dict[str, Any]) -> None:
        """Starts the image stream. Settings that the camera does not support are ignored."""
        controls = {control.name: control for control in self._camera.controls}
        self._camera.start({controls[name]: value for name, value in settings.items() if name in controls})
        self._running = True
        for request in self._requests:
            self._camera.queue_request(request)

    def picture(self, request: Any) -> CameraImage:
        """Returns the image of a completed request, and queues the request again."""
        if request.status != self._lib.Request.Status.Complete:
            raise ResourceError(
                "the camera was lost", where=self._camera.id, remedy="Check the cable of the camera."
            )
        number = request.cookie % _MAX_BUFFERS
        buffer_info = self._buffers[number].metadata
        metadata = {control.name: value for control, value in request.metadata.items()}
        self.celsius = metadata.get("SensorTemperature", self.celsius)
        time_ns, sequence = (
            int(metadata.get("SensorTimestamp", buffer_info.timestamp)),
            int(buffer_info.sequence),
        )
        # The virtual cameras of libcamera 0.4 leave the status of good images uninitialised. So reject only
        # images with the status Error.
        is_sound = buffer_info.status != self._lib.FrameMetadata.Status.Error
        image = copy_image(self._views[number], self.size, self._stride, self._layout) if is_sound else None
        request.reuse()
        self._camera.queue_request(request)
        if image is None:
            raise InputError("the camera reports a damaged image", where=self._camera.id)
        return CameraImage(self.number, image, time_ns, sequence)

    def close(self) -> None:
        """Releases the camera."""
        if self._running:
            self._running = False
            with contextlib.suppress(RuntimeError, OSError):
                self._camera.stop()
        self._views: list[UInt8] = []
        self._requests: list[Any] = []
        for allocation in self._maps:
            with contextlib.suppress(BufferError):
                allocation.close()
        self._maps = []
        with contextlib.suppress(RuntimeError, OSError):
            self._camera.release()

    def _configure(self, size: tuple[int, int], formats: dict[str, Layout]) -> None:
        """Chooses the format and the size."""
        config = self._camera.generate_configuration([self._lib.StreamRole.VideoRecording])
        stream = config.at(0)
        offered = [str(pixel_format) for pixel_format in stream.formats.pixel_formats]
        chosen = next((pixel_format for pixel_format in formats if pixel_format in offered), None)
        if chosen is None:
            problem = f"the camera has none of the formats {', '.join(formats)}, only {', '.join(offered)}"
            raise InputError(problem, where=self._camera.id, remedy="Use another camera.")
        stream.pixel_format = self._lib.PixelFormat(chosen)
        stream.size = self._lib.Size(*size)
        stream.buffer_count = _BUFFERS
        if config.validate() == self._lib.CameraConfiguration.Status.Invalid:
            raise InputError(
                f"the camera has no images of {size[0]} x {size[1]} pixels", where=self._camera.id
            )
        self._camera.configure(config)
        if str(stream.pixel_format) not in formats:
            raise InputError(
                f"the camera sends only images in the format {stream.pixel_format}", where=self._camera.id
            )
        self._layout = formats[str(stream.pixel_format)]
        self.size = (stream.size.width, stream.size.height)
        self._stride, self._stream = stream.stride, stream.stream
        self._config = config

    def _make_requests(self) -> None:
        """Creates a request for each buffer, and maps each buffer's first plane as an array."""
        self._allocator = self._lib.FrameBufferAllocator(self._camera)
        self._allocator.allocate(self._stream)
        self._buffers = self._allocator.buffers(self._stream)[:_MAX_BUFFERS]
        self._views, self._requests = [], []
        for number, buffer in enumerate(self._buffers):
            plane = buffer.planes[0]
            end = plane.offset + plane.length
            mapped = mmap.mmap(plane.fd, end, mmap.MAP_SHARED, mmap.PROT_READ)
            self._maps.append(mapped)
            self._views.append(np.frombuffer(mapped, np.uint8)[plane.offset : end])
            request = self._camera.create_request(self.number * _MAX_BUFFERS + number)
            request.add_buffer(self._stream, buffer)
            self._requests.append(request)


def _initial_controls(fps: float, exposure_us: int, gain: float) -> dict[str, Any]:
    """Returns the initial settings of the cameras, by the names of libcamera's controls."""
    step = round(1e6 / fps)
    controls: dict[str, Any] = {"FrameDurationLimits": (step, step)}
    if exposure_us > 0:
        controls |= {"AeEnable": False, "ExposureTime": exposure_us, "AnalogueGain": float(gain)}
    return controls


def _short_id(camera: str) -> str:
    """Returns the part of an id that distinguishes cameras: the bus and the sensor."""
    return "/".join(camera.split("/")[-2:]) or camera
