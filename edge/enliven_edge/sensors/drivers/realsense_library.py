"""librealsense, its depth streams and its lenses."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven_edge.sensors.drivers.lens import known_or_typical
from enliven_edge.sensors.extras import library

_MODES_SHOWN = 8
"""Modes that are named where the wanted one is none."""


def realsense_library() -> Any:
    """pyrealsense2, which needs libusb: that of the wheel libusb-package where the system has none."""
    usb = library("libusb_package", "realsense")
    ctypes.CDLL(str(usb.get_library_path()), ctypes.RTLD_GLOBAL)
    return library("pyrealsense2", "realsense")


def depth_mode(rs: Any, sensor: Any, mode: tuple[int, int, int], name: str) -> Any:
    """The depth stream of a width, height and rate.

    Raises:
        InputError: where there is none, naming the nearest.
    """
    modes = {}
    for each in sensor.get_stream_profiles():
        if each.stream_type() == rs.stream.depth and each.format() == rs.format.z16:
            video = each.as_video_stream_profile()
            modes[video.width(), video.height(), each.fps()] = video
    if mode not in modes:
        near = sorted(modes, key=lambda m: sum(abs(a - b) for a, b in zip(m, mode, strict=True)))
        known = ", ".join(f"{w}x{h} at {fps}" for w, h, fps in near[:_MODES_SHOWN])
        raise InputError(
            f"it has no depth of {mode[0]}x{mode[1]} at {mode[2]} images a second on this port",
            where=name,
            mend=f"It has: {known}. On USB 2 there are fewer.",
        )
    return modes[mode]


def intrinsics(lens: Any, rs: Any, kind: str, name: str, rehearsed: bool) -> tuple[Intrinsics, bool]:
    """The camera as the library describes it, or as its kind's profile does, and whether the library did.

    Raises:
        InputError: for a distortion of another model: the fields of the inverse one are none of ours.
    """
    known = (rs.distortion.none, rs.distortion.brown_conrady)
    if lens.model not in known and any(lens.coeffs):
        raise InputError(
            f"its images have the distortion model {lens.model}",
            where=name,
            mend="Choose a depth mode, which is rectified.",
        )
    k1, k2, p1, p2, k3 = lens.coeffs
    said = (lens.fx, lens.fy, lens.ppx, lens.ppy)
    camera, told = known_or_typical(lens.width, lens.height, said, kind, name, rehearsed)
    return (replace(camera, distortion=(k1, k2, p1, p2, k3)) if told else camera), told


def whole(millimetres: float) -> float:
    """Millimetres a step of the depth, 1 exactly where it is but for its float32."""
    return 1.0 if abs(millimetres - 1.0) < 1e-6 else millimetres
