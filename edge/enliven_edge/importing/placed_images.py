"""Reads depth images with camera poses of a scan, or with calibrations of RealSense cameras."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import numpy as np

from enliven.arrays import Float
from enliven.camera import LEVEL_WORLD_FROM_CAMERA, Intrinsics
from enliven.errors import InputError
from enliven.files import DECODE_ERRORS, read_file
from enliven.frames import DepthFrame
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    ImportOptions,
    Reader,
    natural_order,
    read_floats,
)
from enliven_edge.importing.depth_sequences import DepthUnit, detect_unit, list_timed_images, read_millimetres
from enliven_edge.importing.images import is_depth_png, png_size, read_colour

_REPOSITORY = "device_repository.json"
_IMAGE_SIZE = re.compile(r"([1-9]\d{0,4})x([1-9]\d{0,4})")
"""Width and height of an image in pixels, as text."""


class _Device(msgspec.Struct):
    """An entry of the list of devices.

    Attributes:
        Device: the identifier in the names of its images.
        Type: the model, such as "Intel RealSense D415".
        Serial: its serial number.
        depth_intrinsics: groups of camera matrices, each with 9 numbers row by row, by the size of the image.
    """

    Device: str | int
    Type: str = "RealSense"
    Serial: str | int | None = None
    depth_intrinsics: list[dict[str, list[float]]] = msgspec.field(
        name="Depth Intrinsics", default_factory=list
    )


_decoder = msgspec.json.Decoder(list[_Device], strict=False)


class RealSenseReader(Reader):
    """Reads 16-bit PNG in millimetres.

    The files are named after a device in device_repository.json, such as ``0_M11_depth_0.png``.
    """

    name = "realsense"
    description = "RealSense depth PNG (N_DEVICE_depth_N.png) with device_repository.json"
    note = "the files contain no times, so frames are evenly spaced"

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if a depth PNG is named after a device, and the device list is in the same folder."""
        images = _find_images(paths)
        return any(is_depth_png(path) for path in images) and (images[0].parent / _REPOSITORY).is_file()

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the images of all devices in the order of their names. Each has the camera of its own
        device.

        Raises:
            InputError: if all images are missing, or the list has no calibration for an image.
        """
        images = _find_images(paths)
        if not images:
            raise InputError("no file has a name of the form N_DEVICE_depth_N.png", where=str(paths[0]))
        units: dict[str, DepthUnit] = {}
        for path, time_ns in list_timed_images(images, options):
            device = path.stem.split("_")[1]
            entry = _find_device(path.parent / _REPOSITORY, device)
            camera = _find_camera(
                entry, *png_size(path), where=f"{path.parent / _REPOSITORY}, device {device}"
            )
            serial = device if entry.Serial is None else entry.Serial
            sensor = options.device or f"{_sensor_name(entry)}-{serial}"
            unit = units.setdefault(device, detect_unit(path, options, _sensor_name(entry)))
            yield DepthFrame(read_millimetres(path, unit), camera, time_ns, sensor)


def _find_images(paths: Sequence[Path]) -> list[Path]:
    image_paths = (path for path in paths if path.suffix == ".png" and len(path.stem.split("_")) == 4)
    return sorted((path for path in image_paths if path.stem.split("_")[2] == "depth"), key=natural_order)


def _sensor_name(entry: _Device) -> str:
    """Returns the sensor name of a model, such as "realsense-d415" for "Intel RealSense D415"."""
    return "-".join(entry.Type.lower().split()[-2:])


def _find_device(repository: Path, device: str) -> _Device:
    try:
        devices = {str(entry.Device): entry for entry in _decoder.decode(read_file(repository))}
    except DECODE_ERRORS:
        remedy = "Copy the file again from the recording computer."
        raise InputError("the list of devices is damaged", where=str(repository), remedy=remedy) from None
    if device not in devices:
        raise InputError(
            f"the device {device} is not in the list",
            where=str(repository),
            remedy=f"Known devices: {', '.join(sorted(devices))}.",
        )
    return devices[device]


def _find_camera(entry: _Device, width: int, height: int, *, where: str) -> Intrinsics:
    """Returns the depth camera for this image size.

    It is listed for this size, or scaled from a listed size with the same aspect ratio.
    """
    listed_cameras: dict[str, list[float]] = {}
    for group in entry.depth_intrinsics:
        listed_cameras.update(group)
    for size, matrix in listed_cameras.items():
        match = _IMAGE_SIZE.fullmatch(size)
        if match is None:
            continue
        full_width, full_height = int(match[1]), int(match[2])
        if full_width * height == width * full_height and len(matrix) == 9:
            full_camera = Intrinsics(full_width, full_height, matrix[0], matrix[4], matrix[2], matrix[5])
            return full_camera if full_width == width else full_camera.scale(width / full_width)
    raise InputError(
        f"the files have no depth calibration for {width}x{height}",
        where=where,
        remedy=f"Known sizes: {', '.join(listed_cameras) or 'none'}.",
    )


_SUFFIX = ".depth.png"
_CAMERA = "camera-intrinsics.txt"
_SEVEN_SCENES_SIZE = (640, 480)
"""Width and height in pixels of all images of the 7-Scenes data set."""
_SEVEN_SCENES_LENS = (585.0, 585.0, 320.0, 240.0)
"""Focal lengths and centre in pixels that the 7-Scenes data set states for all its sequences."""
_LENS = ((0, 0), (1, 1), (0, 2), (1, 2))
"""Row and column in the camera matrix of each of fx, fy, cx and cy."""


class PosedDepthReader(Reader):
    """Reads 16-bit PNG in millimetres with camera-to-world matrices, the layout of 3D scanning data sets.

    The world of the files is the frame of a camera (+Y down). It is rotated so that +Y is up. The files do
    not contain the floor, so y = 0 is at the height of that camera.
    """

    name = "posed-depth"
    description = "depth PNG with camera poses and 7-Scenes (frame-N.depth.png, frame-N.pose.txt)"
    note = (
        "the files contain no times, so frames are evenly spaced; they contain no floor, so y = 0 is at "
        "the height of the first camera"
    )

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if the first image has a pose file. The camera must be in a file, or known from the
        image size.
        """
        images = [path for path in paths if path.name.endswith(_SUFFIX)]
        first = next((path for path in sorted(images, key=natural_order) if is_depth_png(path)), None)
        if first is None or not _pose_file(first).is_file():
            return False
        return (first.parent / _CAMERA).is_file() or png_size(first) == _SEVEN_SCENES_SIZE

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the images with their sensor's pose (4, 4) in the world, and with colour if it exists.

        Raises:
            InputError: if all images are missing, or if a pose is not rigid.
        """
        images = sorted((path for path in paths if path.name.endswith(_SUFFIX)), key=natural_order)
        if not images:
            raise InputError(f"no file name ends in {_SUFFIX}", where=str(paths[0]))
        lens = _choose_lens(images[0].parent / _CAMERA, options)
        unit = detect_unit(images[0], options)
        for path, time_ns in list_timed_images(images, options):
            camera = Intrinsics(*png_size(path), *lens)
            pose = LEVEL_WORLD_FROM_CAMERA @ _check_rigid(_read_matrix(_pose_file(path), 4), _pose_file(path))
            colour = read_colour(path.with_name(path.name.removesuffix(_SUFFIX) + ".color.png"))
            depth = read_millimetres(path, unit)
            yield DepthFrame(depth, camera, time_ns, options.device or "rgbd", colour, pose)


def _choose_lens(path: Path, options: ImportOptions) -> tuple[float, float, float, float]:
    """Returns focal lengths and centre in pixels.

    They come from the user, the file, or the 7-Scenes data set, in this order.
    """
    if options.lens is not None:
        return options.lens
    if not path.is_file():
        options.note(
            "the files contain no camera, so that of the 7-Scenes data set is assumed (585 pixels); "
            "--lens sets another camera"
        )
        return _SEVEN_SCENES_LENS
    matrix = _read_matrix(path, 3)
    fx, fy, cx, cy = (float(matrix[cell]) for cell in _LENS)
    return fx, fy, cx, cy


def _pose_file(depth: Path) -> Path:
    return depth.with_name(depth.name.removesuffix(_SUFFIX) + ".pose.txt")


def _read_matrix(path: Path, side: int) -> Float:
    """Reads (side, side) numbers from a text file."""
    values = read_floats(path)
    if values.size != side * side or not np.isfinite(values).all():
        raise InputError(
            f"the file contains {values.size} numbers, but must contain {side * side} finite numbers",
            where=str(path),
        )
    return values.reshape(side, side)


def _check_rigid(matrix: Float, path: Path) -> Float:
    """Returns the matrix (4, 4) after checking that it is a rotation and a translation."""
    rotation = matrix[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise InputError(
            "the pose is not a rotation and a translation",
            where=str(path),
            remedy="Remove the frame, because camera tracking was lost in it.",
        )
    return matrix
