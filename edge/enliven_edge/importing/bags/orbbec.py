"""Reads recordings of OrbbecSDK 2.4 and later.

Their image messages have a field that is missing in the message definition. So a reader that follows the
definition cannot read them.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from enliven.arrays import Int
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.bags.images import (
    check_step,
    check_time,
    convert_to_millimetres,
    intrinsics_from_lens,
    read_image,
    undistortion_map,
)
from enliven_edge.importing.bags.ros1 import Fields, messages

PREFIX = "/cam/"
_IMAGES, _STREAM, _DEVICE, _PROPERTY = (
    "/cam/sensor_3/frameType_3",
    "/cam/streamProfileType_3",
    "/cam/deviceInfo",
    "/cam/property",
)
_VERSION = 0
"""Orbbec's property number of the file's version."""
_PRECISION = 75
"""Orbbec's property number of the depth step as a level, an index into ``_STEPS``."""
_UNIT = 176
"""Orbbec's property number of the depth step in millimetres."""
_DEPTH_IN_DEVICE = 85
"""Orbbec's property number that states whether the camera itself computed depth from its disparities."""
_STEPS = (1.0, 0.8, 0.4, 0.1, 0.2, 0.5, 0.05)
"""Depth step for each of Orbbec's levels of precision, in millimetres."""
_MODELS = ("none", "modified", "inverse", "brown conrady", "brown conrady", "fisheye")
"""Orbbec's distortion models by their numbers."""
_MEASURES_DEPTH = (0x0669, 0x06C0, 0x066B)
"""USB product ids of Femto Mega and Bolt, which measure by time of flight and have no disparities."""
_DEPTH_COMPUTING_CAMERAS = re.compile(r"Gemini [3-9]\d\d|Astra 2")
"""Cameras that can compute depth from disparities themselves. A property of the recording states whether they
did. Their depth steps are in ``_STEPS``. Orbbec's library plays recordings of a Gemini 2 with a quarter of
the recorded numbers. Older cameras were not tested."""
_PLAY_HINT = "Use Orbbec's library instead: enliven record --sensor orbbec --set rehearse={} -o take.mcap"
_RATIONAL = 4
"""Orbbec's number of the distortion model with six radial coefficients. If only three of them are used, it
equals enliven's model."""
_NONE = (0.0,) * 5
"""Distortion coefficients k1, k2, p1, p2, k3 of an image without distortion."""


@dataclass
class _BagContents:
    """The description of a recording's images, most of it at its end.

    Attributes:
        camera: the intrinsics of the delivered images.
        places: (H*W,) the source pixel of each delivered pixel in the recorded image; None if the image is
            unchanged.
        name, product, serial: the camera's own name, USB product id and serial number.
        properties: the camera's settings as bytes, by Orbbec's property numbers.
    """

    camera: Intrinsics | None = None
    places: Int | None = None
    name: str = ""
    product: int = 0
    serial: str = ""
    properties: dict[int, bytes] = field(default_factory=dict)


def frames(path: Path, device: str | None) -> Iterator[DepthFrame]:
    """Yields the depth images of a recording.

    Args:
        device: the name to give the sensor, or None for a name with its serial number.

    Raises:
        InputError: if it contains no depth images, or has an unsupported format.
    """
    contents = _read_contents(path)
    assert contents.camera is not None
    _check_depth(contents, path)
    step, name = _depth_step_mm(contents, path), device or "-".join(filter(None, ("orbbec", contents.serial)))
    for _, fields in messages(path, lambda topic: topic == _IMAGES):
        fields.numbers("III")
        fields.text()
        depth = read_image(fields)
        _bits, number, time_us = (int(item) for item in fields.numbers("IQQ"))
        if contents.places is not None and depth.size == contents.places.size:
            depth = np.append(depth.ravel(), np.uint16(0))[contents.places].reshape(depth.shape)
        time_ns = check_time(1000 * time_us, fields.where)
        yield DepthFrame(convert_to_millimetres(depth, step), contents.camera, time_ns, name, sequence=number)


def check_playback(path: Path) -> None:
    """Checks that Orbbec's library can play a recording. It hangs on recordings of another version.

    Raises:
        InputError: if the library cannot play it.
    """
    _read_contents(path)


def _read_contents(path: Path) -> _BagContents:
    """Reads the messages that describe the camera and its images."""
    contents = _BagContents()
    for topic, fields in messages(path, lambda topic: topic in (_STREAM, _DEVICE, _PROPERTY)):
        fields.numbers("III")
        fields.text()
        if topic == _STREAM:
            contents.camera, contents.places = _read_camera(fields)
        elif topic == _DEVICE:
            contents.name, contents.product, contents.serial = _read_device(fields)
        else:
            number = fields.count()
            contents.properties[number] = fields.block()
    version = _read_property(contents, _VERSION, "d", 1.0)
    if not 2.0 <= version < 3.0:  # Also false for NaN, which a damaged file may contain.
        remedy = "Record again with OrbbecSDK 2.4 or later."
        raise InputError(
            f"the recording has version {version}, but only version 2 is supported",
            where=str(path),
            remedy=remedy,
        )
    if contents.camera is None:
        problem = (
            "the description of the depth camera is missing: the recording was not closed, or has no depth"
        )
        raise InputError(problem, where=str(path), remedy="Record again with the depth stream on.")
    return contents


def _check_depth(contents: _BagContents, path: Path) -> None:
    """Checks that the images are depth, not disparities."""
    in_device = contents.properties.get(_DEPTH_IN_DEVICE)
    if in_device is not None and not any(in_device):
        problem = "the recording contains disparities instead of depth"
        raise InputError(problem, where=str(path), remedy=_PLAY_HINT.format(path))
    if contents.product not in _MEASURES_DEPTH and (
        in_device is None or not _DEPTH_COMPUTING_CAMERAS.search(contents.name)
    ):
        camera = contents.name or "without a name"
        problem = f"only Orbbec's library can decode the images of this camera ({camera})"
        raise InputError(problem, where=str(path), remedy=_PLAY_HINT.format(path))


def _read_property(contents: _BagContents, number: int, kind: str, default: float) -> float:
    data = contents.properties.get(number, b"")
    size = struct.calcsize(kind)
    return float(struct.unpack("<" + kind, data[:size])[0]) if len(data) >= size else default


def _depth_step_mm(contents: _BagContents, path: Path) -> float:
    """Returns the millimetres of one depth step."""
    level = round(_read_property(contents, _PRECISION, "i", 0.0))
    default = _STEPS[level] if 0 <= level < len(_STEPS) else 1.0
    return check_step(_read_property(contents, _UNIT, "f", default), str(path))


def _read_camera(fields: Fields) -> tuple[Intrinsics, Int | None]:
    """Reads ``custom_msg/OBStreamProfileInfo``.

    Returns the intrinsics, and the undistortion of an unsupported model or None.
    """
    fields.numbers("BB12f")
    width, height, _fps = (int(value) for value in fields.numbers("HHH"))
    fx, fy, cx, cy, k1, k2, k3, k4, k5, k6, p1, p2 = fields.numbers("12f")
    model, lens_values = int(fields.number("B")), (fx, fy, cx, cy)
    if model == _RATIONAL and any((k4, k5, k6)):
        undistorted = intrinsics_from_lens((width, height), lens_values, "none", _NONE, fields.where)
        return undistorted, undistortion_map(undistorted, (k1, k2, p1, p2, k3, k4, k5, k6))
    word = _MODELS[model] if model < len(_MODELS) else str(model)
    distortion = _NONE if model == 0 else (k1, k2, p1, p2, k3)
    return intrinsics_from_lens((width, height), lens_values, word, distortion, fields.where), None


def _read_device(fields: Fields) -> tuple[str, int, str]:
    """Reads ``custom_msg/OBDeviceInfo``: name, product and serial number."""
    name, _full, _chip = fields.text(), fields.text(), fields.text()
    _vendor, product = fields.numbers("HH")
    _place = fields.text()
    return name, int(product), fields.text()
