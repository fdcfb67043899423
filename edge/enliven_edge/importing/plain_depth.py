"""Depth images alone: 16-bit PNG of the size of a Kinect v1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, natural_order
from enliven_edge.importing.images import KINECT1, is_depth_png, read_depth_png


class PlainDepthReader(Reader):
    """16-bit PNG in millimetres without a camera file."""

    name = "plain-depth"
    description = "depth PNG sequence alone (16-bit, millimetres, the shape of a Kinect v1 image)"
    note = "no camera in the files: the usual Kinect v1 (525 pixels) is assumed; no times: evenly spaced"

    def can_read(self, paths: Sequence[Path]) -> bool:
        return bool(paths) and any(is_depth_png(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        images = sorted((path for path in paths if is_depth_png(path)), key=natural_order)
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            depth = read_depth_png(path)
            camera = KINECT1.scaled(depth.shape[1] / KINECT1.width)
            if (camera.height, camera.width) != depth.shape:
                raise InputError(
                    f"the image is {depth.shape[1]}x{depth.shape[0]}, and no file states its camera",
                    where=str(path),
                    mend="Put a camera file beside it: NAME_camera.xml for NAME_depth.png.",
                )
            yield DepthFrame(depth, camera, time_ns, options.device or "kinect1")
