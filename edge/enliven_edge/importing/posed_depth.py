"""Depth images with the camera's pose: frame-N.depth.png, frame-N.pose.txt, camera-intrinsics.txt."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.camera import LEVEL_WORLD_FROM_CAMERA, Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, floats_of, natural_order
from enliven_edge.importing.images import is_depth_png, png_size, read_colour, read_depth_png

_SUFFIX = ".depth.png"
_CAMERA = "camera-intrinsics.txt"
_LENS = ((0, 0), (1, 1), (0, 2), (1, 2))
"""Rows and columns of fx, fy, cx, cy in the camera matrix."""


class PosedDepthReader(Reader):
    """16-bit PNG in millimetres with camera-to-world matrices, as 3D scanning data sets have them.

    The files' world is a camera's (+Y down); it is turned so that +Y is up. Where the floor is, the files
    do not say: y = 0 is at the height of that camera.
    """

    name = "posed-depth"
    description = "depth PNG with camera poses (frame-N.depth.png, frame-N.pose.txt, camera-intrinsics.txt)"
    note = "no times in the files: evenly spaced; no floor: y = 0 is at the first camera"

    def can_read(self, paths: Sequence[Path]) -> bool:
        images = [path for path in paths if path.name.endswith(_SUFFIX)]
        if not images or not is_depth_png(images[0]):
            return False
        return _pose_file(images[0]).is_file() and (images[0].parent / _CAMERA).is_file()

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        images = sorted((path for path in paths if path.name.endswith(_SUFFIX)), key=natural_order)
        if not images:
            raise InputError(f"no file is named *{_SUFFIX}", where=str(paths[0]))
        matrix = _matrix(images[0].parent / _CAMERA, 3)
        fx, fy, cx, cy = (float(matrix[at]) for at in _LENS)
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            width, height = png_size(path)
            camera = Intrinsics(width, height, fx, fy, cx, cy)
            pose = LEVEL_WORLD_FROM_CAMERA @ _rigid(_matrix(_pose_file(path), 4), _pose_file(path))
            colour = read_colour(path.with_name(path.name.removesuffix(_SUFFIX) + ".color.png"))
            yield DepthFrame(read_depth_png(path), camera, time_ns, options.device or "rgbd", colour, pose)


def _pose_file(depth: Path) -> Path:
    return depth.with_name(depth.name.removesuffix(_SUFFIX) + ".pose.txt")


def _matrix(path: Path, side: int) -> Float:
    """Reads (side, side) numbers from a text file."""
    values = floats_of(path)
    if values.size != side * side or not np.isfinite(values).all():
        raise InputError(
            f"it holds {values.size} numbers, expected {side * side} finite ones", where=str(path)
        )
    return values.reshape(side, side)


def _rigid(matrix: Float, path: Path) -> Float:
    """Returns (4, 4) the matrix after checking that it is a rotation and a translation."""
    turn = matrix[:3, :3]
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0:
        raise InputError(
            "the pose is not a rotation and a translation",
            where=str(path),
            mend="Remove the frame: its tracking was lost.",
        )
    return matrix
