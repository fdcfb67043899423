"""Depth images of RealSense cameras beside a list of the devices' calibrations."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, natural_order, text_of
from enliven_edge.importing.images import is_depth_png, png_size, read_depth_png

_REPOSITORY = "device_repository.json"


class RealSenseReader(Reader):
    """16-bit PNG in millimetres named after a device (``0_M11_depth_0.png``) of device_repository.json."""

    name = "realsense"
    description = "RealSense depth PNG (N_DEVICE_depth_N.png) with device_repository.json"
    note = "no times in the files: evenly spaced"

    def can_read(self, paths: Sequence[Path]) -> bool:
        images = _images(paths)
        return bool(images) and (images[0].parent / _REPOSITORY).is_file() and is_depth_png(images[0])

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        images = _images(paths)
        if not images:
            raise InputError("no file is named N_DEVICE_depth_N.png", where=str(paths[0]))
        for path, time_ns in zip(images, options.times_ns(30.0), strict=False):
            device = path.stem.split("_")[1]
            entry = _device(path.parent / _REPOSITORY, device)
            camera = _camera(entry, *png_size(path), where=f"{path.parent / _REPOSITORY}, device {device}")
            sensor = options.device or f"{_model(entry)}-{entry.get('Serial', device)}"
            yield DepthFrame(read_depth_png(path), camera, time_ns, sensor)


def _images(paths: Sequence[Path]) -> list[Path]:
    named = (path for path in paths if path.suffix == ".png" and len(path.stem.split("_")) == 4)
    return sorted((path for path in named if path.stem.split("_")[2] == "depth"), key=natural_order)


def _model(entry: dict[str, Any]) -> str:
    """ "Intel RealSense D415" as "realsense-d415"."""
    return "-".join(str(entry.get("Type", "RealSense")).lower().split()[-2:])


def _device(repository: Path, device: str) -> dict[str, Any]:
    """The entry of a device in the list of calibrations."""
    try:
        entries = json.loads(text_of(repository))
        known = {str(entry["Device"]): entry for entry in entries}
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise InputError(f"the list of devices is damaged ({error!r})", where=str(repository)) from None
    if device not in known:
        raise InputError(
            f"the device {device} is not in the list",
            where=str(repository),
            mend=f"Known: {', '.join(sorted(known))}.",
        )
    return known[device]


def _camera(entry: dict[str, Any], width: int, height: int, *, where: str) -> Intrinsics:
    """The depth camera at this size: as stated, or scaled from a stated size of the same shape."""
    stated: dict[str, list[float]] = {}
    for group in entry.get("Depth Intrinsics", []):
        stated.update(group)
    for size, matrix in stated.items():
        full_width, full_height = (int(number) for number in size.split("x"))
        if full_width * height == width * full_height and len(matrix) == 9:
            full = Intrinsics(full_width, full_height, matrix[0], matrix[4], matrix[2], matrix[5])
            return full if full_width == width else full.scaled(width / full_width)
    raise InputError(
        f"there is no depth calibration for {width}x{height}",
        where=where,
        mend=f"Stated are {', '.join(stated) or 'none'}.",
    )
