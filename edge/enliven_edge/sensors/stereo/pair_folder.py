"""A folder of image pairs, such as NAMEleft.png and NAMEright.png."""

from __future__ import annotations

import io
import re
import time
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from enliven.arrays import UInt8
from enliven.errors import InputError
from enliven.files import read_file
from enliven_edge.sensors.stereo.pairing import CameraImage

_SUFFIXES = (".png", ".jpg", ".jpeg")
_MAX_PAIRS = 10_000
"""Maximum number of pairs in a folder: more than five minutes at 30 per second."""
_MAX_PIXELS = 1 << 26
"""Maximum pixels of one image, 8192 x 8192. A limit is needed, because a file of a few kilobytes can declare
any size."""


def image_pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Returns the (left, right) files of image pairs, sorted by name.

    They are in ``folder``, or in its subfolders ``left`` and ``right``.

    Raises:
        InputError: if the folder is missing or has no pair, or a file has no partner.
    """
    where = str(folder)
    if not folder.is_dir():
        raise InputError("the folder does not exist", where=where, remedy="Choose a folder with image pairs.")
    files = [file for file in sorted(folder.rglob("*")) if file.suffix.lower() in _SUFFIXES]
    sides: dict[str, dict[str, Path]] = {"left": {}, "right": {}}
    for file in files[: 2 * _MAX_PAIRS + 1]:
        name = str(file.relative_to(folder))
        side = re.search("left|right", name, re.IGNORECASE)
        if side:
            sides[side[0].lower()][re.sub("left|right", "*", name, flags=re.IGNORECASE)] = file
    left, right = sides["left"], sides["right"]
    if not left or not right or len(files) > 2 * _MAX_PAIRS:
        wrong = (
            "the folder contains no image pairs"
            if len(files) <= 2 * _MAX_PAIRS
            else "the folder contains too many images"
        )
        raise InputError(wrong, where=where, remedy="Name the images left-01.png, right-01.png, and so on.")
    for name in left.keys() ^ right.keys():
        lonely = left.get(name) or right[name]
        raise InputError(
            "the other camera's image is missing", where=str(lonely), remedy="Remove this image."
        )
    return [(left[name], right[name]) for name in sorted(left)]


def read_grey(path: Path) -> UInt8:
    """Reads an image file as (H, W) uint8 grey.

    Raises:
        InputError: if it is damaged or too large.
    """
    try:
        with Image.open(io.BytesIO(read_file(path)), formats=("PNG", "JPEG")) as image:
            if image.width * image.height > _MAX_PIXELS:
                problem = f"the image has {image.width} x {image.height} pixels, which is too large"
                raise InputError(problem, where=str(path), remedy="Remove the pair.")
            return np.asarray(image.convert("L"))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError):
        raise InputError("the image is damaged", where=str(path), remedy="Remove the pair.") from None


class RecordedPairs:
    """Plays the image pairs of a folder at a camera's frame rate, instead of two cameras.

    Raises:
        InputError: if the folder has no pairs.
    """

    def __init__(self, folder: Path, fps: float) -> None:
        self._pairs = image_pairs(folder)
        self.name, self._step_ns = "libcamera rehearsal", round(1e9 / fps)
        self._next, self._start_ns = 0, 0

    def read(self, timeout: float | None = None) -> CameraImage | None:
        """Returns the next image, alternately left and right, or None after the last.

        Raises:
            TimeoutError: if it is not due in time.
            InputError: for an image that cannot be read. The next call reads the next image.
        """
        number, eye = divmod(self._next, 2)
        if number >= len(self._pairs):
            return None
        if self._next == 0:
            self._start_ns = time.monotonic_ns()
        wait = 1e-9 * (self._start_ns + number * self._step_ns - time.monotonic_ns())
        if timeout is not None and wait > timeout:
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"no image of {self.name} yet")
        time.sleep(max(wait, 0.0))
        self._next += 1
        return CameraImage(eye, read_grey(self._pairs[number][eye]), number * self._step_ns, number)

    def temperature(self) -> float | None:
        """Returns None, because files have no temperature."""
        return None

    def close(self) -> None:
        """Does nothing."""
