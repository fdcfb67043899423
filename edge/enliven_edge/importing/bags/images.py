"""Reads depth images of ROS and RealSense recordings, and converts them to millimetres and undistorted
pixels.
"""

from __future__ import annotations

import io
import math

import numpy as np
from PIL import Image

from enliven.arrays import Int, UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import TIME_LIMIT_NS
from enliven_edge.importing.bags.ros1 import Fields

_MAX_IMAGE_SIDE_PX = 8192
"""Maximum side of an image in pixels. The largest images of the manufacturers have 1,600."""
_PNG_OFFSET = 12
"""Number of bytes that ROS writes before the PNG of a compressed depth image."""
_DEPTHS = ("mono16", "16uc1", "z16")
"""Names of image encodings with 16-bit distances."""


def read_image(fields: Fields) -> UInt16:
    """Returns the pixels (H, W) of a ``sensor_msgs/Image``, read after its header.

    Raises:
        InputError: if it is not a depth image, or its size differs from the declared one.
    """
    height, width = fields.count(), fields.count()
    encoding = fields.text().lower()
    byte_order, step = fields.number("B"), fields.count()
    pixels = fields.block()
    if encoding not in _DEPTHS:
        problem = f"the depth images have the unsupported encoding {encoding!r}"
        raise InputError(problem, where=fields.where, remedy="Record again with 16-bit depth (Y16).")
    shape = 0 < width <= _MAX_IMAGE_SIDE_PX and 0 < height <= _MAX_IMAGE_SIDE_PX
    if not shape or step < 2 * width or len(pixels) != step * height:
        raise fields.make_damage_error()
    rows = np.frombuffer(pixels, ">u2" if byte_order else "<u2")[: height * (step // 2)]
    if step % 2:
        raise fields.make_damage_error()
    return rows.reshape(height, step // 2)[:, :width].astype(np.uint16)


def read_compressed_image(fields: Fields) -> UInt16:
    """Returns the pixels (H, W) of a ``sensor_msgs/CompressedImage``, read after its header.

    Raises:
        InputError: if it is not a depth image.
    """
    fields.text()
    is_compressed_depth = fields.block()[_PNG_OFFSET:]
    try:
        with Image.open(io.BytesIO(is_compressed_depth), formats=["PNG"]) as image:
            if max(image.size) > _MAX_IMAGE_SIDE_PX or not image.mode.startswith("I"):
                raise fields.make_damage_error()
            return np.asarray(image).astype(np.uint16)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        raise fields.make_damage_error() from None


def convert_to_millimetres(depth: UInt16, millimetres: float) -> UInt16:
    """Converts depths in steps of ``millimetres`` to millimetres, rounded."""
    if millimetres == 1.0:
        return depth
    return np.rint(depth * millimetres).clip(0, 65535).astype(np.uint16)


def check_step(millimetres: float, where: str) -> float:
    """Returns a plausible depth step, rounded to the seven digits of float32.

    Raises:
        InputError: if it is implausible.
    """
    if not (math.isfinite(millimetres) and 0.0 < millimetres <= 1000.0):
        raise InputError(
            f"the depth unit of {millimetres} mm is impossible", where=where, remedy="Record again."
        )
    return float(f"{millimetres:.6g}")


def check_time(time_ns: int, where: str) -> int:
    """Returns a plausible time of a recording in nanoseconds.

    Raises:
        InputError: if the time is not a possible date.
    """
    if abs(time_ns) >= TIME_LIMIT_NS:
        raise InputError(
            f"an image has the impossible time {time_ns} ns", where=where, remedy="Copy the recording again."
        )
    return time_ns


def intrinsics_from_lens(
    size: tuple[int, int], lens: tuple[float, ...], model: str, distortion: tuple[float, ...], where: str
) -> Intrinsics:
    """Returns the camera of a recording.

    Args:
        lens: (fx, fy, cx, cy) pixels.
        model: the maker's name of the distortion model.
        distortion: distortion coefficients k1, k2, p1, p2, k3.

    Raises:
        InputError: for an unsupported distortion model.
    """
    if not any(distortion):
        distortion = (0.0,) * 5
    elif model.lower().replace("_", " ") not in ("brown conrady", "plumb bob"):
        remedy = "Record rectified depth images."
        raise InputError(
            f"the distortion model {model!r} of the images is not supported", where=where, remedy=remedy
        )
    (width, height), (fx, fy, cx, cy), (k1, k2, p1, p2, k3) = size, lens, distortion
    return Intrinsics(width, height, fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def undistortion_map(camera: Intrinsics, distortion: tuple[float, ...]) -> Int:
    """Returns the pixel (H*W,) of a distorted image (OpenCV's rational model) for each undistorted pixel.

    The nearest pixel is used, because depths must not be averaged. The value H*W means that there is no
    source pixel.

    Args:
        camera: the intrinsics without distortion.
        distortion: k1, k2, p1, p2, k3, k4, k5, k6.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = distortion
    v, u = np.mgrid[: camera.height, : camera.width]
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    with np.errstate(all="ignore"):
        r2 = x * x + y * y
        radial_factor = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        distorted_x = x * radial_factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        distorted_y = y * radial_factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        column, row = (
            np.rint(distorted_x * camera.fx + camera.cx),
            np.rint(distorted_y * camera.fy + camera.cy),
        )
        is_inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    source_pixels = np.full(is_inside.shape, is_inside.size, np.int64)
    source_pixels[is_inside] = (row[is_inside] * camera.width + column[is_inside]).astype(np.int64)
    return source_pixels.ravel()
