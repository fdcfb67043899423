"""Libcamera's own Python binding, the cameras that it knows, and how their images lie in memory.

It is used rather than Picamera2, which stands on it: it runs wherever libcamera does, on the kernel's virtual
camera too, and needs nothing else. There is no wheel of it; the system's package manager installs it.
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
"""Where Debian and Raspberry Pi OS have Python modules; Debian 12 alone has them below its architecture."""
_INSTALL = (
    "Type: sudo apt install python3-libcamera; and use the system's Python: "
    "python3 -m venv --system-site-packages .venv"
)
_BOARD = Path("/proc/device-tree/model")
"""Where Linux has the name of a small computer."""
_LISTING = 10.0
"""Seconds that libcamera may take to list its cameras; it took half a second."""


@dataclass(frozen=True)
class ListedCamera:
    """One camera that libcamera knows.

    Attributes:
        model: the name of its image sensor.
        name: its id, which stays the same while it stays at its port.
    """

    model: str
    name: str


def listed_cameras() -> list[ListedCamera]:
    """The cameras in libcamera's order; none where it is not installed on anything but a Raspberry Pi.

    They are asked for in a process of their own, since libcamera ends its process where it fails itself.

    Raises:
        ResourceError: where it does not load or does not answer, or a Raspberry Pi has it not.
    """
    if not _installed() and not _is_raspberry_pi():
        return []
    asked = [sys.executable, "-c", f"from {__name__} import tell; tell()"]
    try:
        done = subprocess.run(asked, capture_output=True, text=True, timeout=_LISTING, check=False)
    except subprocess.TimeoutExpired:
        what = f"libcamera has not listed its cameras within {_LISTING:.0f} s"
        raise ResourceError(what, where="sensor libcamera", mend="Close what else uses a camera.") from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [""])[-1]
        what = f"libcamera cannot list its cameras (exit code {done.returncode}: {said})"
        raise ResourceError(what, where="sensor libcamera", mend="Type: rpicam-hello --list-cameras")
    told = json.loads(done.stdout.splitlines()[-1])
    if isinstance(told, str):
        raise ResourceError(told, where="sensor libcamera", mend=_INSTALL)
    return [ListedCamera(model, name) for model, name in told]


def libcamera_library(tuning: str) -> Any:
    """The binding, also where the system has it outside of what this Python looks through.

    Raises:
        InputError: where there is no such tuning file.
        ResourceError: where it is not installed for this Python.
    """
    if tuning:
        if not Path(tuning).is_file():
            mend = "Those that ship are in firmware_configs/libcamera."
            raise InputError("there is no such tuning file", where=tuning, mend=mend)
        os.environ["LIBCAMERA_RPI_TUNING_FILE"] = tuning
    os.environ.setdefault("LIBCAMERA_LOG_LEVELS", "*:WARN")
    known = list(sys.path)
    sys.path += _places()
    try:
        return importlib.import_module("libcamera")
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == "libcamera"
        what = "libcamera is not installed" if missing else f"libcamera does not load ({error})"
        raise ResourceError(what, where="sensor libcamera", mend=_INSTALL) from None
    finally:
        sys.path[:] = known


def _places() -> list[str]:
    """The system's folders that hold the binding."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    places = [*_SYSTEM.glob(f"*/python{version}/site-packages"), _SYSTEM / "python3" / "dist-packages"]
    return [str(place) for place in places if (place / "libcamera").is_dir()]


def _installed() -> bool:
    return bool(_places()) or importlib.util.find_spec("libcamera") is not None


def _is_raspberry_pi() -> bool:
    try:
        return "Raspberry Pi" in _BOARD.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False


def tell() -> None:
    """Prints a line of JSON: the cameras' models and ids, or why there can be none."""
    try:
        cameras = libcamera_library("").CameraManager.singleton().cameras
    except ResourceError as error:
        print(json.dumps(error.what))
        return
    about = [({key.name: value for key, value in each.properties.items()}, each.id) for each in cameras]
    print(json.dumps([(str(told.get("Model", "")), name) for told, name in about]))


class Layout(NamedTuple):
    """How an image lies in its first plane: bytes a pixel, and which are grey, or red, green and blue."""

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
"""Formats that grey is read from, the best first; of red, green and blue the green: most light is there."""
COLOUR = {
    "BGR888": Layout(3, (0, 1, 2)),
    "RGB888": Layout(3, (2, 1, 0)),
    "XBGR8888": Layout(4, (0, 1, 2)),
    "XRGB8888": Layout(4, (2, 1, 0)),
}
"""Formats that colour is read from; libcamera names them from the highest byte down."""


def image_of(plane: UInt8, size: tuple[int, int], stride: int, layout: Layout) -> UInt8 | None:
    """(H, W) or (H, W, 3) a copy of the image in a plane's bytes; None where they are too few.

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
