"""Libcamera's own Python binding, its list of cameras, and the memory layout of their images.

The binding is used directly instead of Picamera2, which builds on it. The binding runs wherever libcamera
runs, including on the kernel's virtual camera, and needs no other package. The system's package manager must
install it, because it has no wheel.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from enliven.arrays import UInt8
from enliven.errors import InputError, ResourceError

_SYSTEM = Path("/usr/lib")
"""Folder of the Python modules of Debian and Raspberry Pi OS. Debian 12 has them in a subfolder for the
architecture."""
_INSTALL = (
    "Type: sudo apt install python3-libcamera. Then use the system's Python: python3 -m venv "
    "--system-site-packages .venv"
)
_BOARD = Path("/proc/device-tree/model")
"""Linux's file with the name of a single-board computer."""
_LISTING_TIMEOUT_S = 10.0
"""Maximum seconds that libcamera may take to list its cameras. It took half a second."""


@dataclass(frozen=True)
class ListedCamera:
    """One camera that libcamera supports.

    Attributes:
        model: the name of its image sensor.
        name: its id, which stays the same while it stays at its port.
    """

    model: str
    name: str


def list_cameras() -> list[ListedCamera]:
    """Returns the cameras in libcamera's order. The list is empty if libcamera is not installed, except on a
    Raspberry Pi.

    A separate process lists them, because libcamera terminates its process on internal errors.

    Raises:
        ResourceError: if libcamera does not load or does not answer, or is missing on a Raspberry Pi.
    """
    if not is_installed() and not _is_raspberry_pi():
        return []
    command = [sys.executable, "-c", f"from {__name__} import print_cameras; print_cameras()"]
    try:
        process = subprocess.run(
            command, capture_output=True, text=True, timeout=_LISTING_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        problem = f"libcamera has not listed its cameras within {_LISTING_TIMEOUT_S:.0f} s"
        raise ResourceError(
            problem, where="sensor libcamera", remedy="Close other programs that use a camera."
        ) from None
    if process.returncode:
        last_line = (process.stderr.strip().splitlines() or [""])[-1]
        problem = f"libcamera cannot list its cameras (exit code {process.returncode}: {last_line})"
        raise ResourceError(problem, where="sensor libcamera", remedy="Type: rpicam-hello --list-cameras")
    listing = json.loads(process.stdout.splitlines()[-1])
    if isinstance(listing, str):
        raise ResourceError(listing, where="sensor libcamera", remedy=_INSTALL)
    return [ListedCamera(model, name) for model, name in listing]


def libcamera_library(tuning: str) -> Any:
    """Imports the binding, even if the system has it outside of this Python's search path.

    Raises:
        InputError: if the tuning file does not exist.
        ResourceError: if it is not installed for this Python.
    """
    if tuning:
        if not Path(tuning).is_file():
            remedy = "The shipped tuning files are in firmware_configs/libcamera."
            raise InputError("the tuning file does not exist", where=tuning, remedy=remedy)
        os.environ["LIBCAMERA_RPI_TUNING_FILE"] = tuning
    os.environ.setdefault("LIBCAMERA_LOG_LEVELS", "*:WARN")
    search_path = list(sys.path)
    sys.path += _library_folders()
    try:
        return importlib.import_module("libcamera")
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == "libcamera"
        problem = "libcamera is not installed" if missing else f"libcamera cannot be loaded ({error})"
        raise ResourceError(problem, where="sensor libcamera", remedy=_INSTALL) from None
    finally:
        sys.path[:] = search_path


def _library_folders() -> list[str]:
    """Returns the system's folders that contain the binding."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    folders = [*_SYSTEM.glob(f"*/python{version}/site-packages"), _SYSTEM / "python3" / "dist-packages"]
    return [str(folder) for folder in folders if (folder / "libcamera").is_dir()]


def is_installed() -> bool:
    """Returns True if Python, or the system's Python, has the libcamera binding."""
    return bool(_library_folders()) or importlib.util.find_spec("libcamera") is not None


def _is_raspberry_pi() -> bool:
    try:
        return "Raspberry Pi" in _BOARD.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False


def print_cameras() -> None:
    """Prints a line of JSON: the cameras' models and ids, or the reason why there are none."""
    try:
        cameras = libcamera_library("").CameraManager.singleton().cameras
    except ResourceError as error:
        print(json.dumps(error.what))
        return
    description = [
        ({key.name: value for key, value in camera.properties.items()}, camera.id) for camera in cameras
    ]
    print(json.dumps([(str(properties.get("Model", "")), name) for properties, name in description]))


class Layout(NamedTuple):
    """Memory layout of an image in its first plane: bytes per pixel, and the index of grey, or of red,
    green, blue."""

    bytes: int
    channels: tuple[int, ...]


GREY = {
    "R8": Layout(1, (0,)),
    "YUV420": Layout(1, (0,)),
    "NV12": Layout(1, (0,)),
    "YUYV": Layout(2, (0,)),
    "BGR888": Layout(3, (1,)),
    "RGB888": Layout(3, (1,)),
    "XBGR8888": Layout(4, (1,)),
    "XRGB8888": Layout(4, (1,)),
}
"""Formats with usable grey, the best first. In RGB formats the green channel is used, because it receives the
most light."""
COLOUR = {
    "BGR888": Layout(3, (0, 1, 2)),
    "RGB888": Layout(3, (2, 1, 0)),
    "XBGR8888": Layout(4, (0, 1, 2)),
    "XRGB8888": Layout(4, (2, 1, 0)),
}
"""Formats with usable colour. Libcamera names the channels from the highest byte to the lowest."""


def copy_image(plane: UInt8, size: tuple[int, int], stride: int, layout: Layout) -> UInt8 | None:
    """Returns a copy of the image in a plane's bytes, (H, W) or (H, W, 3). Returns None if there are too few
    bytes.

    Args:
        size: (width, height) of the image.
        stride: bytes from one row to the next.
    """
    width, height = size
    if len(plane) < height * stride or stride < width * layout.bytes:
        return None
    rows = plane[: height * stride].reshape(height, stride)[:, : width * layout.bytes]
    pixels = rows.reshape(height, width, layout.bytes)
    if len(layout.channels) == 1:
        return pixels[..., layout.channels[0]].copy()
    return np.array(pixels[..., :3] if layout.channels[0] == 0 else pixels[..., 2::-1], order="C")
