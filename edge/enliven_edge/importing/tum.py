"""Reads sequences of the TUM RGB-D benchmark, and other images that are named after their time in seconds."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.rotation import to_matrix
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    ImportOptions,
    Reader,
    are_numbers,
    first_lines,
    read_head,
    read_text,
)
from enliven_edge.importing.depth_sequences import TUM_UNITS, DepthUnit, list_usable_images, read_millimetres
from enliven_edge.importing.images import find_usual_camera, is_depth_png, read_colour

_LIST = "depth.txt"
"""File name of the list of depth images with their times, in the folder of a sequence."""
_COLOURS = "rgb.txt"
_POSES = "groundtruth.txt"
_TIME = re.compile(r"\d{9,11}\.\d{3,9}")
"""Pattern of an image name that is a time: seconds since 1970, with at least milliseconds."""
_MAX_GAP_NS = 20_000_000
"""Maximum time in nanoseconds between a depth image and its colour image or pose. The benchmark uses the same
0.02 s."""
_Y_UP_FROM_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
"""(4, 4) rotation from the benchmark's world, which has +Z up."""


class TumReader(Reader):
    """Reads a folder with depth.txt, or with images named after seconds since 1970.

    The depth has 5000 units per metre.
    """

    name = "tum-depth"
    description = "TUM RGB-D benchmark (depth.txt with rgb.txt and groundtruth.txt; or SECONDS.png)"
    note = "the files contain no camera, so a focal length of 525 pixels is assumed unless --lens is given"

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if there is a file depth.txt, or a depth PNG that is named after its time."""
        return any(_is_list(path) for path in paths) or any(
            _is_timed(path) and is_depth_png(path) for path in paths
        )

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the images ordered by time, with the nearest colour image and pose if one is near enough in
        time.

        Raises:
            InputError: if no image is named after its time, or if a list or an image cannot be read.
        """
        lists = [path for path in paths if _is_list(path)]
        if lists:
            folder, timed = lists[0].parent, _read_list(lists[0])
        else:
            timed = [(path, _parse_time(path.stem)) for path in paths if _is_timed(path)]
            folder = timed[0][0].parent.parent if timed else Path()
        if not timed:
            raise InputError("no image file is named after its time in seconds", where=str(paths[0]))
        timed.sort(key=lambda one: one[1])
        colours = _read_list(folder / _COLOURS)
        poses = _read_poses(folder / _POSES, [time_ns for _, time_ns in timed])
        unit = DepthUnit(options, TUM_UNITS, "as in the TUM benchmark")
        for path, time_ns in list_usable_images(timed, options):
            depth = read_millimetres(path, unit)
            camera = _choose_camera(path, depth.shape[1], depth.shape[0], options)
            colour = _find_nearest(colours, time_ns)
            colour_image = read_colour(colour) if colour is not None else None
            yield DepthFrame(
                depth, camera, time_ns, options.device or "rgbd", colour_image, poses.get(time_ns)
            )


def _is_timed(path: Path) -> bool:
    return path.suffix.lower() == ".png" and _TIME.fullmatch(path.stem) is not None


def _is_list(path: Path) -> bool:
    """Returns True if a file lists depth images in the benchmark's format."""
    if path.name != _LIST:
        return False
    rows = [line.split() for line in first_lines(read_head(path), 20) if not line.startswith("#")]
    rows = [row for row in rows[:-1] or rows if row]
    return bool(rows) and all(len(row) == 2 and are_numbers(row[:1]) for row in rows)


def _parse_time(seconds: str) -> int:
    """Returns the exact nanoseconds of a time in decimal seconds."""
    return int(Decimal(seconds) * 10**9)


def _read_rows(path: Path, columns: int) -> list[list[str]]:
    """Returns the rows of a list without comments, or no rows if the file is missing.

    Raises:
        InputError: for a row with another number of columns, or without a time.
    """
    if not path.is_file():
        return []
    rows = list[list[str]]()
    for number, line in enumerate(read_text(path).split("\n"), 1):
        row = line.split("#")[0].replace(",", " ").split()
        if not row:
            continue
        if len(row) != columns or not are_numbers(row[:1]) or not np.isfinite(float(row[0])):
            problem = f"line {number} does not consist of a time and {columns - 1} more columns"
            raise InputError(problem, where=str(path), remedy="Remove the line, or copy the file again.")
        rows.append(row)
    return rows


def _read_list(path: Path) -> list[tuple[Path, int]]:
    """Returns the images named in a list file, with their times in nanoseconds, in order.

    The images must be inside the folder of the list.
    """
    images = [(path.parent / name, _parse_time(seconds)) for seconds, name in _read_rows(path, 2)]
    folder = path.parent.resolve()
    for image, _ in images:
        if not image.resolve().is_relative_to(folder):
            raise InputError(
                f"the list names {str(image)[:80]!r}, which is outside the folder of the list",
                where=str(path),
            )
    return sorted(images, key=lambda one: one[1])


def _find_nearest(images: list[tuple[Path, int]], time_ns: int) -> Path | None:
    """Returns the image nearest in time, or None if all are too far away."""
    if not images:
        return None
    times = np.array([time for _, time in images])
    index = int(np.abs(times - time_ns).argmin())
    return images[index][0] if abs(int(times[index]) - time_ns) <= _MAX_GAP_NS else None


def _read_poses(path: Path, times: list[int]) -> dict[int, Float]:
    """Returns (4, 4) world_from_camera, +Y up, at each of the times.

    The result is empty if any time has no pose.
    """
    rows = _read_rows(path, 8)
    if not rows:
        return {}
    pose_times = np.array([_parse_time(row[0]) for row in rows])
    try:
        values = np.array([[float(word) for word in row[1:]] for row in rows])
    except ValueError:
        raise InputError("a pose contains text that is not a number", where=str(path)) from None
    poses: dict[int, Float] = {}
    for time_ns in times:
        nearest_index = int(np.abs(pose_times - time_ns).argmin())
        x, y, z, w = values[nearest_index, 3:]
        length = float(np.linalg.norm(values[nearest_index, 3:]))
        if abs(int(pose_times[nearest_index]) - time_ns) > _MAX_GAP_NS or not (
            np.isfinite(values[nearest_index]).all() and length > 0.5
        ):
            return {}
        pose = np.eye(4)
        pose[:3, :3] = to_matrix(np.array([w, x, y, z]) / length)
        pose[:3, 3] = values[nearest_index, :3]
        poses[time_ns] = _Y_UP_FROM_Z_UP @ pose
    return poses


def _choose_camera(path: Path, width: int, height: int, options: ImportOptions) -> Intrinsics:
    """Returns the camera that the user gave, or a common one with this image size."""
    if options.lens is not None:
        return Intrinsics(width, height, *options.lens)
    usual_camera = find_usual_camera(width, height)
    if usual_camera is None:
        raise InputError(
            f"the image has {width}x{height} pixels, and no file describes its camera",
            where=str(path),
            remedy="Pass focal lengths and principal point in pixels, --lens FX,FY,CX,CY.",
        )
    return usual_camera[1]
