"""Functions around librealsense: its depth streams and intrinsics, and the colour that it registers to the
depth.
"""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import UInt8
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.sensors.attached_cameras import import_library
from enliven_edge.sensors.drivers.driver_replay import MAX_WAITING_IMAGES
from enliven_edge.sensors.drivers.lens import choose_intrinsics

_MODES_SHOWN = 8
"""Maximum number of modes that an error message lists."""


def realsense_library() -> Any:
    """Imports pyrealsense2, which needs libusb.

    If the system has no libusb, the wheel libusb-package provides it.
    """
    usb = import_library("libusb_package", "realsense")
    ctypes.CDLL(str(usb.get_library_path()), ctypes.RTLD_GLOBAL)
    return import_library("pyrealsense2", "realsense")


def depth_mode(rs: Any, sensor: Any, mode: tuple[int, int, int], name: str) -> Any:
    """Returns the depth stream of a width, height and rate.

    Raises:
        InputError: if no such mode exists. The message lists the nearest ones.
    """
    modes = {}
    for profile in sensor.get_stream_profiles():
        if profile.stream_type() == rs.stream.depth and profile.format() == rs.format.z16:
            video = profile.as_video_stream_profile()
            modes[video.width(), video.height(), profile.fps()] = video
    if mode not in modes:
        near = sorted(modes, key=lambda m: sum(abs(a - b) for a, b in zip(m, mode, strict=True)))
        alternatives = ", ".join(f"{w}x{h} at {fps}" for w, h, fps in near[:_MODES_SHOWN])
        raise InputError(
            f"the camera has no depth of {mode[0]}x{mode[1]} at {mode[2]} images a second on this port",
            where=name,
            remedy=f"Modes on this port: {alternatives}. USB 3 offers more modes than USB 2.",
        )
    return modes[mode]


def intrinsics(lens: Any, rs: Any, kind: str, name: str, rehearsed: bool) -> tuple[Intrinsics, bool]:
    """Returns the intrinsics from the library or the model's profile, and whether the library had them.

    Raises:
        InputError: for an unsupported distortion model, such as the inverse model. Its coefficients have
            another meaning.
    """
    supported = (rs.distortion.none, rs.distortion.brown_conrady)
    if lens.model not in supported and any(lens.coeffs):
        raise InputError(
            f"the distortion model {lens.model} of the images is not supported",
            where=name,
            remedy="Choose a mode with rectified depth images.",
        )
    k1, k2, p1, p2, k3 = lens.coeffs
    parameters = (lens.fx, lens.fy, lens.ppx, lens.ppy)
    camera, is_reported = choose_intrinsics(lens.width, lens.height, parameters, kind, name, rehearsed)
    return (replace(camera, distortion=(k1, k2, p1, p2, k3)) if is_reported else camera), is_reported


def round_depth_step(millimetres: float) -> float:
    """Returns millimetres per depth step.

    A value that differs from 1 only by float32 rounding becomes exactly 1.
    """
    return 1.0 if abs(millimetres - 1.0) < 1e-6 else millimetres


_MAX_COLOUR_WAIT_MS = 15
"""Maximum milliseconds that a depth image waits for its colour image: half a frame interval at 30 frames per
second."""
_MAX_ALIGNMENT_MS = 10_000
"""Maximum milliseconds that the library takes to combine or align two available images."""


class AlignedColour:
    """Pairs colour images with depth images by their times, and registers them to the depth.

    Depth stays unchanged. A pixel without depth has no colour, because its position in the colour image is
    unknown.

    Args:
        rs: the library.
        step: milliseconds between two depth images.
    """

    def __init__(self, rs: Any, step: float) -> None:
        self.queue = rs.frame_queue(MAX_WAITING_IMAGES)
        self._step = step
        self._waiting: Any = None
        self._pair: list[Any] = []
        self._join, self._joined = rs.processing_block(self._joining), rs.frame_queue(1)
        self._join.start(self._joined)
        self._align = rs.align(rs.stream.depth)

    def align_to(self, depth: Any) -> UInt8 | None:
        """Returns the colour (H, W, 3) of one of the library's depth images, registered to it.

        Returns None if no colour image belongs to it.
        """
        colour = self._colour_at(depth.get_timestamp())
        if colour is None:
            return None
        self._pair = [depth, colour]
        self._join.invoke(depth)
        both = self._align.process(self._joined.wait_for_frame(_MAX_ALIGNMENT_MS).as_frameset())
        return np.array(both.get_color_frame().get_data())

    def _colour_at(self, time: float) -> Any:
        """Returns the colour image at a time in milliseconds. A newer image waits for its depth."""
        while True:
            if self._waiting is None:
                has_frame, self._waiting = self.queue.try_wait_for_frame(_MAX_COLOUR_WAIT_MS)
                if not has_frame:
                    self._waiting = None
                    return None
            apart = self._waiting.get_timestamp() - time
            if apart > self._step / 2:
                return None
            colour, self._waiting = self._waiting, None
            if apart >= -self._step / 2:
                return colour

    def _joining(self, _frame: Any, source: Any) -> None:
        source.frame_ready(source.allocate_composite_frame(self._pair))


def find_colour_mode(rs: Any, device: Any, size: tuple[int, int], fps: float, name: str) -> tuple[Any, Any]:
    """Returns the colour sensor of a device, and its stream profile of the nearest size at this frame rate.

    Raises:
        InputError: if the device has no such profile.
    """
    candidates = []
    for sensor in device.query_sensors():
        for profile in sensor.get_stream_profiles():
            if profile.stream_type() == rs.stream.color and profile.format() == rs.format.rgb8:
                video = profile.as_video_stream_profile()
                if round(video.fps()) == round(fps) and not sensor.is_depth_sensor():
                    difference = abs(video.width() - size[0]) + abs(video.height() - size[1])
                    candidates.append((difference, sensor, video))
    if not candidates:
        raise InputError(
            f"the camera cannot send colour at {fps:g} images a second together with depth",
            where=name,
            remedy="Leave out colour=true, or set fps=30.",
        )
    return min(candidates, key=lambda each: each[0])[1:]


class ReplayedColour:
    """The colour stream of a software device, with the camera of a recording.

    Raises:
        InputError: if the recording has no colour.
    """

    def __init__(self, rs: Any, device: Any, depth: Any, first: DepthFrame, fps: int, path: str) -> None:
        if first.colour is None:
            raise InputError(
                "the recording has no colour images", where=path, remedy="Rehearse without colour=true."
            )
        self._rs, self._last = rs, first.colour
        height, width = first.colour.shape[:2]
        self._sensor = device.add_sensor("Color")
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = rs.stream.color, 0, 1, rs.format.rgb8
        stream.width, stream.height, stream.bpp, stream.fps = width, height, 3, fps
        stream.intrinsics = lens_from_intrinsics(rs, first.intrinsics, width, height)
        self._stream = self._sensor.add_video_stream(stream)
        same = rs.extrinsics()
        same.rotation, same.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0]
        depth.register_extrinsics_to(self._stream, same)

    def send(self, frame: DepthFrame, number: int) -> None:
        """Sends the colour of an image, or the last colour before it."""
        self._last = self._last if frame.colour is None else frame.colour
        image = self._rs.software_video_frame()
        image.pixels, image.bpp, image.stride = np.ascontiguousarray(self._last), 3, 3 * self._last.shape[1]
        image.timestamp, image.frame_number = 1e-6 * frame.time_ns, number
        image.domain = self._rs.timestamp_domain.hardware_clock
        image.profile = self._stream.as_video_stream_profile()
        self._sensor.on_video_frame(image)


def lens_from_intrinsics(rs: Any, camera: Intrinsics, width: int, height: int) -> Any:
    """Returns the library's description of a camera, scaled to images of this size."""
    x, y = width / camera.width, height / camera.height
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy = width, height, camera.fx * x, camera.fy * y
    lens.ppx, lens.ppy = (camera.cx + 0.5) * x - 0.5, (camera.cy + 0.5) * y - 0.5
    lens.coeffs = list(camera.distortion)
    lens.model = rs.distortion.brown_conrady if any(camera.distortion) else rs.distortion.none
    return lens
