"""Headerless depth images of a Kinect v1: 640x480 little-endian uint16 millimetres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import UInt16
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, natural_order
from enliven_edge.importing.images import KINECT1

_BYTES = KINECT1.width * KINECT1.height * 2
"""Bytes of a file: two for each pixel."""
_FARTHEST = 10_000
"""Millimetres: farther values are no distances of a Kinect v1."""


class RawKinectReader(Reader):
    """Reads files of exactly 614,400 bytes that hold possible distances of a Kinect v1."""

    name = "raw-kinect1"
    description = "headerless Kinect v1 depth images (640x480 uint16 millimetres)"
    note = "no camera in the files: the usual Kinect v1 (525 pixels) is assumed; no times: evenly spaced"

    def can_read(self, paths: Sequence[Path]) -> bool:
        images = _images(paths)
        return bool(images) and _plausible(np.fromfile(images[0], "<u2"))

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        images = _images(paths) or list(paths)
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            yield DepthFrame(_read(path), KINECT1, time_ns, options.device or "kinect1")


def _images(paths: Sequence[Path]) -> list[Path]:
    sized = (path for path in paths if path.is_file() and path.stat().st_size == _BYTES)
    return sorted(sized, key=natural_order)


def _plausible(values: UInt16) -> bool:
    """Returns whether numbers look like distances: some are near enough, and hardly any too far."""
    known = values[values > 0]
    return known.size > 100 and float(np.mean(known > _FARTHEST)) < 0.001


def _read(path: Path) -> UInt16:
    try:
        values = np.fromfile(path, "<u2")
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror or error})", where=str(path)) from None
    if values.size * 2 != _BYTES or path.stat().st_size != _BYTES:
        raise InputError(
            f"it has {path.stat().st_size} bytes, a depth image of 640x480 has {_BYTES}",
            where=str(path),
            mend="Copy it again; it may have been cut off.",
        )
    return values.astype(np.uint16).reshape(KINECT1.height, KINECT1.width)
