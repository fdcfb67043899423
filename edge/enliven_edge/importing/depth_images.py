"""Reads depth images with OpenCV camera files, and depth images of a Kinect v1 without camera files."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.files import read_file
from enliven.frames import DepthFrame
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    ImportOptions,
    Reader,
    natural_order,
    read_head,
    read_text,
)
from enliven_edge.importing.depth_sequences import (
    detect_unit,
    find_depth_series,
    list_timed_images,
    read_millimetres,
)
from enliven_edge.importing.images import (
    KINECT1,
    find_usual_camera,
    is_depth_png,
    read_colour,
)

_SUFFIX = "_depth.png"


class OpenCvDepthReader(Reader):
    """16-bit PNG in millimetres, with one camera file of OpenCV's FileStorage for each image.

    The camera files may contain a rotation and a translation, too. They are not used, because in registered
    scans of a turning person they describe the motion of the body and not of the sensor.
    """

    name = "opencv-depth"
    description = "depth PNG sequence with OpenCV camera files (*_depth.png, *_camera.xml, colour *.jpg)"
    note = (
        "the files contain no times, so frames are evenly spaced; the poses in the camera files are not used"
    )

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if a depth PNG has this suffix, and the first image has a camera file of OpenCV."""
        depth = [path for path in paths if path.name.endswith(_SUFFIX)]
        return any(is_depth_png(path) for path in depth) and b"<opencv_storage>" in read_head(
            _camera_file(depth[0])
        )

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the images in the order of their names, with the colour image of the same name if it exists.

        Raises:
            InputError: if a depth image or its camera file is missing or cannot be read.
        """
        images = sorted((path for path in paths if path.name.endswith(_SUFFIX)), key=natural_order)
        if not images:
            raise InputError(f"no file name ends in {_SUFFIX}", where=str(paths[0]))
        unit = detect_unit(images[0], options)
        for path, time_ns in list_timed_images(images, options):
            depth = read_millimetres(path, unit)
            camera = read_camera(_camera_file(path), depth.shape[1], depth.shape[0])
            colour = read_colour(path.with_name(path.name.removesuffix(_SUFFIX) + ".jpg"))
            yield DepthFrame(depth, camera, time_ns, options.device or "kinect1", colour)


def read_camera(path: Path, width: int, height: int) -> Intrinsics:
    """Reads the pinhole camera from an OpenCV FileStorage XML (matrix ``intrinsic``).

    Raises:
        InputError: if the file or the matrix is missing or damaged.
    """
    try:
        text = ElementTree.fromstring(read_text(path)).findtext("intrinsic/data") or ""
        numbers = [float(word) for word in text.split()]
    except (ElementTree.ParseError, ValueError):
        remedy = "Copy the file again, or export it as XML of OpenCV's FileStorage."
        raise InputError("the camera file is damaged", where=str(path), remedy=remedy) from None
    if len(numbers) != 9:
        raise InputError(
            f"the matrix `intrinsic` has {len(numbers)} numbers, expected 9",
            where=str(path),
            remedy="Write the matrix as a 3x3 matrix of OpenCV's FileStorage.",
        )
    return Intrinsics(width, height, numbers[0], numbers[4], numbers[2], numbers[5])


def _camera_file(depth: Path) -> Path:
    return depth.with_name(depth.name.removesuffix(_SUFFIX) + "_camera.xml")


_BYTES = KINECT1.width * KINECT1.height * 2
"""Bytes of a file: two for each pixel."""
_MAX_DEPTH_MM = 10_000
"""Maximum valid depth of a Kinect v1, in millimetres. Larger values are not distances."""


class RawKinectReader(Reader):
    """Reads files of exactly 614,400 bytes with plausible distances of a Kinect v1."""

    name = "raw-kinect1"
    description = "headerless Kinect v1 depth images (640x480 uint16 millimetres)"
    note = (
        "the files contain no camera, so a Kinect v1 (525 pixels) is assumed unless --lens is given; the "
        "files contain no times, so frames are evenly spaced"
    )

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if files have the right size and the first one contains plausible distances."""
        images = _read_raw_images(paths)
        return bool(images) and _are_distances(np.frombuffer(read_file(images[0]), "<u2"))

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields one frame for each raw file, by default at 30 frames per second."""
        images = _read_raw_images(paths) or list(paths)
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            name, camera = _choose_camera(path, KINECT1.width, KINECT1.height, options)
            yield DepthFrame(_read_raw(path), camera, time_ns, name)


def _read_raw_images(paths: Sequence[Path]) -> list[Path]:
    sized_paths = (path for path in paths if path.is_file() and path.stat().st_size == _BYTES)
    return sorted(sized_paths, key=natural_order)


def _are_distances(values: UInt16) -> bool:
    """Returns True if the values look like distances: some are near enough, and hardly any are too far."""
    measured_values = values[values > 0]
    return measured_values.size > 100 and float(np.mean(measured_values > _MAX_DEPTH_MM)) < 0.001


def _read_raw(path: Path) -> UInt16:
    data = read_file(path)
    if len(data) != _BYTES:
        raise InputError(
            f"the file has {len(data)} bytes, but a depth image of 640x480 pixels has {_BYTES}",
            where=str(path),
            remedy="Copy the file again. It may be cut off.",
        )
    values = np.frombuffer(data, "<u2")
    return values.astype(np.uint16).reshape(KINECT1.height, KINECT1.width)


class PlainDepthReader(Reader):
    """16-bit PNG without a camera file.

    If the user gives no camera, a common one with this image size is assumed.
    """

    name = "plain-depth"
    description = "16-bit depth PNG without a camera file (image size of a Kinect, or with --lens)"
    note = (
        "the files contain no camera, so a Kinect with this image size is assumed unless --lens is given; "
        "the files contain no times, so frames are evenly spaced"
    )

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if at least one file is a 16-bit PNG with one channel."""
        return bool(paths) and any(is_depth_png(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the depth images of the series, with the given or assumed camera.

        Raises:
            InputError: if an image cannot be read.
        """
        images = find_depth_series(paths) or list(paths)
        unit = detect_unit(images[0], options)
        for path, time_ns in list_timed_images(images, options):
            depth = read_millimetres(path, unit)
            name, camera = _choose_camera(path, depth.shape[1], depth.shape[0], options)
            yield DepthFrame(depth, camera, time_ns, name)


def _choose_camera(path: Path, width: int, height: int, options: ImportOptions) -> tuple[str, Intrinsics]:
    """Returns the sensor's name and camera for an image without a camera file.

    The camera is given by the user, or a common one.

    Raises:
        InputError: if none is given, and no usual sensor has images of this shape.
    """
    if options.lens is not None:
        return options.device or "depth", Intrinsics(width, height, *options.lens)
    usual_camera = find_usual_camera(width, height)
    if usual_camera is None:
        raise InputError(
            f"the image has {width}x{height} pixels, and no file describes its camera",
            where=str(path),
            remedy="Pass focal lengths and principal point in pixels, --lens FX,FY,CX,CY. Or put a camera "
            "file next to the image: NAME_camera.xml for NAME_depth.png.",
        )
    return options.device or usual_camera[0], usual_camera[1]
