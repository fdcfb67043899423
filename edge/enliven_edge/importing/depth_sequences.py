"""Sequences of depth images.

Images that cannot be used leave a gap in time. Values are converted to millimetres.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import UInt16
from enliven.errors import InputError
from enliven_edge.importing.base import ImportOptions, natural_order, read_head
from enliven_edge.importing.images import PNG_MAGIC, describe_colour_image, is_depth_png, read_depth_png

MILLIMETRES = 1000.0
"""Number of values per metre of most depth images."""
TUM_UNITS = 5000.0
"""Number of values per metre of the images of the TUM RGB-D benchmark."""
_D405_UNITS = 10_000.0
"""Number of values per metre of a RealSense D405. Its depth unit is 0.1 mm from the factory."""
_NO_DISTANCE = 65_535
"""Value that some cameras and 7-Scenes write for missing depth. In millimetres it would be 65 m."""
_FAR_MM = 8000.0
"""Maximum median distance of an image in millimetres. If it is larger, another unit is likelier, because
depth cameras measure less far."""
_MAX_NAMED = 5
"""Maximum number of images that are named in notes. The others are counted."""
_UNIT_HINT = "--units-per-metre sets another unit"


class DepthUnit:
    """Converts the values of a sequence's images to millimetres, and reports the unit with the first image.

    Args:
        options: the user's options; their unit takes precedence.
        usual: usual number of units per metre in this layout.
        reason: why this unit is assumed, such as "as in the TUM benchmark".
    """

    def __init__(self, options: ImportOptions, usual: float = MILLIMETRES, reason: str = "") -> None:
        self._units = options.units_per_metre or usual
        self._note, self._is_stated = options.note, options.units_per_metre is not None
        self._reason, self._is_reported = reason, False

    def millimetres(self, values: UInt16) -> UInt16:
        """Returns (H, W) uint16 millimetres, 0 for missing depth or depth beyond 16 bits."""
        values = np.where(values == _NO_DISTANCE, 0, values).astype(np.uint16)
        depth = values
        if self._units != MILLIMETRES:
            millimetres = np.rint(values * (MILLIMETRES / self._units))
            depth = np.where(millimetres < _NO_DISTANCE, millimetres, 0).astype(np.uint16)
        if not self._is_reported:
            self._is_reported = True
            self._report(depth)
        return depth

    def _report(self, depth: UInt16) -> None:
        """Reports the unit, and a doubt about it if the first image suggests another unit."""
        if self._is_stated:
            return
        name = "millimetres" if self._units == MILLIMETRES else f"{self._units:g} units per metre"
        reason = f" ({self._reason})" if self._reason else ""
        self._note(f"depth values are read as {name}{reason}; {_UNIT_HINT}")
        measured_depths = depth[depth > 0]
        if measured_depths.size and float(np.median(measured_depths)) > _FAR_MM:
            median_m = float(np.median(measured_depths)) / 1000
            self._note(
                f"half of the first image is beyond {median_m:.1f} m, farther than depth cameras measure: "
                "check the unit (TUM images have 5000 units per metre, images of a D405 10000)"
            )


def detect_unit(path: Path, options: ImportOptions, device: str = "") -> DepthUnit:
    """Returns the unit of images without a stated unit.

    A D405 is recognised by the name of the device, file or folder.
    """
    names = (device, path.name, path.parent.name)
    if any(re.search(r"(?<![a-z0-9])d405(?![0-9])", name.lower()) for name in names):
        return DepthUnit(options, _D405_UNITS, "as a RealSense D405 writes them")
    return DepthUnit(options)


def find_depth_series(paths: Iterable[Path]) -> list[Path]:
    """Returns the PNG files of the series that contain depth, in order.

    Names within a series differ only in numbers.

    Images without depth in such a series are included, so that later images keep their number in the series.
    """
    series: dict[tuple[Path, str], list[Path]] = {}
    for path in paths:
        if path.suffix.lower() == ".png":
            series.setdefault((path.parent, re.sub(r"\d+", "#", path.name)), []).append(path)
    depth_files = [images for images in series.values() if any(is_depth_png(path) for path in images)]
    return sorted((path for images in depth_files for path in images), key=natural_order)


def list_usable_images(
    timed: Iterable[tuple[Path, int]], options: ImportOptions
) -> Iterator[tuple[Path, int]]:
    """Yields the images that contain depth with their times in nanoseconds.

    Other images are reported by name and leave a gap in time.

    Raises:
        InputError: if none of them contains depth.
    """
    used_count, skipped_paths = 0, list[Path]()
    for path, time_ns in timed:
        if is_depth_png(path) or not path.exists():
            used_count += 1
            yield path, time_ns
            continue
        skipped_paths.append(path)
        if len(skipped_paths) <= _MAX_NAMED:
            options.note(f"{path.name} is skipped: {_find_problem(path)}; later images keep their times")
    if skipped_paths and not used_count:
        raise InputError(
            _find_problem(skipped_paths[0]),
            where=str(skipped_paths[0]),
            remedy="Choose the depth images (16-bit PNG).",
        )
    if len(skipped_paths) > _MAX_NAMED:
        count = len(skipped_paths) - _MAX_NAMED
        options.note(f"{count} more images are skipped; the last is {skipped_paths[-1].name}")


def _find_problem(path: Path) -> str:
    """Returns why a file contains no depth. The text is never empty."""
    if path.is_file() and path.stat().st_size == 0:
        return "the file is empty"
    kind = describe_colour_image(path)
    if kind is not None:
        return f"the file is {kind}, not an image with one 16-bit channel"
    return (
        "the file is not a PNG with one 16-bit channel"
        if read_head(path, 8) == PNG_MAGIC
        else "the file is not a PNG image"
    )


def read_millimetres(path: Path, unit: DepthUnit) -> UInt16:
    """Reads (H, W) uint16 millimetres from a depth image. Raises InputError like :func:`read_depth_png`."""
    return unit.millimetres(read_depth_png(path))


def list_timed_images(
    images: Sequence[Path], options: ImportOptions, fps: float = 30.0
) -> Iterator[tuple[Path, int]]:
    """Yields the usable images, as :func:`list_usable_images` does, with evenly spaced times in
    nanoseconds."""
    return list_usable_images(zip(images, options.times_ns(fps), strict=False), options)
