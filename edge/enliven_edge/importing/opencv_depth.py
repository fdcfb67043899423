"""Depth images with OpenCV camera files: NAME_depth.png, NAME_camera.xml, sometimes NAME.jpg."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    ImportOptions,
    Reader,
    head_of,
    natural_order,
    text_of,
)
from enliven_edge.importing.images import is_depth_png, read_colour, read_depth_png

_SUFFIX = "_depth.png"


class OpenCvDepthReader(Reader):
    """16-bit PNG in millimetres, one camera file of OpenCV's FileStorage for each image.

    The camera files may hold a rotation and a translation too: where a turning person was registered, these
    are the body's motion and not the sensor's, so they are not used.
    """

    name = "opencv-depth"
    description = "depth PNG sequence with OpenCV camera files (*_depth.png, *_camera.xml, colour *.jpg)"
    note = "no times in the files: evenly spaced; the poses in the camera files are not used"

    def can_read(self, paths: Sequence[Path]) -> bool:
        depth = [path for path in paths if path.name.endswith(_SUFFIX)]
        return (
            bool(depth) and is_depth_png(depth[0]) and b"<opencv_storage>" in head_of(_camera_file(depth[0]))
        )

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        images = sorted((path for path in paths if path.name.endswith(_SUFFIX)), key=natural_order)
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            depth = read_depth_png(path)
            camera = read_camera(_camera_file(path), depth.shape[1], depth.shape[0])
            colour = read_colour(path.with_name(path.name.removesuffix(_SUFFIX) + ".jpg"))
            yield DepthFrame(depth, camera, time_ns, options.device or "kinect1", colour)


def read_camera(path: Path, width: int, height: int) -> Intrinsics:
    """The pinhole camera in an OpenCV FileStorage XML (matrix ``intrinsic``).

    Raises:
        InputError: where the file or the matrix is missing or damaged.
    """
    try:
        text = ElementTree.fromstring(text_of(path)).findtext("intrinsic/data") or ""
        numbers = [float(word) for word in text.split()]
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"the camera file is damaged ({error})", where=str(path)) from None
    if len(numbers) != 9:
        raise InputError(
            f"the matrix `intrinsic` has {len(numbers)} numbers, expected 9",
            where=str(path),
            mend="Write it as a 3x3 matrix of OpenCV's FileStorage.",
        )
    return Intrinsics(width, height, numbers[0], numbers[4], numbers[2], numbers[5])


def _camera_file(depth: Path) -> Path:
    return depth.with_name(depth.name.removesuffix(_SUFFIX) + "_camera.xml")
