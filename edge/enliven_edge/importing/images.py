"""Depth and colour images of foreign recordings."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from enliven.arrays import UInt8, UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.files import read_file
from enliven_edge.importing.base import read_head

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
KINECT1 = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
"""The intrinsics of a Kinect v1 that drivers assume without a calibration."""
KINECT2 = Intrinsics(512, 424, 365.0, 365.0, 255.5, 211.5)
"""The usual intrinsics of a Kinect v2's depth camera. Individual devices differ by about 1 %."""
AZURE = Intrinsics(640, 576, 504.0, 504.0, 320.0, 333.0)
"""The usual intrinsics of an Azure Kinect's depth camera, narrow mode without binning. Devices differ by
about 1 %."""
_KNOWN_SENSORS = {"kinect1": KINECT1, "kinect2": KINECT2, "azure-kinect": AZURE}
"""Sensors by name. They are recognised by the size of their images."""
_COLOUR_FORMATS = ("PNG", "JPEG")
"""Image formats that are accepted. Other decoders of Pillow start programs, or are not safe with malicious
files."""
_MAX_PIXELS = 1 << 26
"""Maximum pixels of one image, 8192 x 8192. A limit is needed, because a file of a few kilobytes can declare
any size."""


def is_depth_png(path: Path) -> bool:
    """Returns True if a file is a PNG of one 16-bit channel, judged by its header."""
    head = read_head(path, 33)
    return head.startswith(PNG_MAGIC) and len(head) == 33 and head[24] == 16 and head[25] == 0


def png_size(path: Path) -> tuple[int, int]:
    """Returns width and height from the header of a PNG file."""
    head = read_head(path, 33)
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def find_usual_camera(width: int, height: int) -> tuple[str, Intrinsics] | None:
    """Returns the name and the camera of the sensor with depth images of this size, or None if there is
    none.
    """
    for name, camera in _KNOWN_SENSORS.items():
        scaled_camera = camera.scale(width / camera.width)
        if (scaled_camera.width, scaled_camera.height) == (width, height):
            return name, scaled_camera
    return None


def describe_colour_image(path: Path) -> str | None:
    """Returns the kind of an image without depth, such as "a JPEG image in colour".

    Returns None if the file is not such an image.
    """
    try:
        with _open_image(path, _COLOUR_FORMATS) as image:
            if image.mode.startswith("I") or image.format is None:
                return None
            grey = image.mode in ("1", "L", "LA")
            return f"a {image.format} image {'with 256 greys' if grey else 'in colour'}"
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def read_depth_png(path: Path) -> UInt16:
    """Reads (H, W) uint16 millimetres from a 16-bit PNG.

    Raises:
        InputError: if the file is missing or damaged, or does not have one 16-bit channel.
    """
    if path.exists() and not is_depth_png(path):
        raise InputError(
            "the file is not a PNG with one 16-bit channel",
            where=str(path),
            remedy="Choose the depth images in millimetres.",
        )
    try:
        with _open_image(path, ("PNG",)) as image:
            return np.asarray(image).astype(np.uint16)
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path), remedy="Check the path.") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        remedy = "Copy the image again from its source."
        raise InputError("the image is damaged", where=str(path), remedy=remedy) from None


def read_colour(path: Path) -> UInt8 | None:
    """Reads an (h, w, 3) uint8 sRGB image. Returns None if the file does not exist.

    Raises:
        InputError: if the image is damaged.
    """
    if not path.exists():
        return None
    try:
        with _open_image(path, _COLOUR_FORMATS) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError):
        remedy = "Copy the image again, or remove it."
        raise InputError("the image is damaged", where=str(path), remedy=remedy) from None


def _open_image(path: Path, formats: tuple[str, ...]) -> Image.Image:
    """Opens an image without decoding it, and checks its declared size.

    Raises:
        InputError: if it declares more pixels than any sensor has.
    """
    image = Image.open(io.BytesIO(read_file(path)), formats=formats)
    if image.width * image.height > _MAX_PIXELS:
        image.close()
        problem = f"the image has {image.width} x {image.height} pixels, which is too large"
        raise InputError(problem, where=str(path), remedy="Use a smaller image.")
    return image
