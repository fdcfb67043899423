"""Lists depth cameras on USB, and imports their libraries when a driver needs them."""

from __future__ import annotations

import importlib
import os
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from enliven.errors import ResourceError

DEVICES, NODES = Path("/sys/bus/usb/devices"), Path("/dev/bus/usb")
"""Linux's list of USB devices, and the device files that open them."""
_SLOW_MBIT = 480.0
"""Link speed of USB 2 in megabits per second."""
FORBIDDEN = "your user may not open the camera"
"""Message about a camera that the user has no permission to open."""
ALLOW = (
    "Type: sudo cp firmware_configs/udev/60-enliven-cameras.rules /etc/udev/rules.d/ "
    "&& sudo udevadm control --reload && sudo udevadm trigger"
)
"""Advice that gives ordinary users permission to open the cameras."""


@dataclass(frozen=True)
class CameraKind:
    """One brand or model range of camera on USB.

    Attributes:
        name: the common name.
        vendor: the USB vendor id, four hexadecimal digits.
        products: a regular expression for the USB product ids.
        title: text that the device's own name must contain, because a vendor such as Intel makes many other
            devices.
        sensor: the driver's name in enliven; empty if there is none.
        package: the name of its library on PyPI.
        requirement: argument of pip install, if the library cannot be part of an extra.
        bad: regular expressions for versions of the library that do not work, each with the reason.
        boots: True if it has these ids only until its firmware is loaded. Until then its link is always slow.
    """

    name: str
    vendor: str
    products: str = ".*"
    title: str = ""
    sensor: str = ""
    package: str = ""
    requirement: str = ""
    bad: tuple[tuple[str, str], ...] = ()
    boots: bool = False


_OAK_BAD = (
    (r"[0-2]\.", "the driver needs depthai 3, which has another interface"),
    (r"3\.(7\.[1-9]|[89]\.|10\.)", "an OAK-D Lite sends no depth with this version (luxonis/depthai#1252)"),
)
_REALSENSE_BAD = ((r"[01]\.|2\.([0-9]|[1-4][0-9]|5[0-5])\.", "the driver needs version 2.56 or later"),)
KINDS = (
    CameraKind("OAK", "03e7", "2485", sensor="oak", package="depthai", bad=_OAK_BAD, boots=True),
    CameraKind("OAK", "03e7", sensor="oak", package="depthai", bad=_OAK_BAD),
    CameraKind(
        "RealSense", "8086", title="RealSense", sensor="realsense", package="pyrealsense2", bad=_REALSENSE_BAD
    ),
    CameraKind(
        "Orbbec", "2bc5", sensor="orbbec", package="pyorbbecsdk2", requirement="--no-deps pyorbbecsdk2"
    ),
    CameraKind("Kinect v1", "045e", "02ae|02bf"),
    CameraKind("Kinect v2", "045e", "02c4|02d8|02d9"),
    CameraKind("Azure Kinect", "045e", "097[a-e]"),
)


@dataclass(frozen=True)
class AttachedCamera:
    """One camera on USB.

    Attributes:
        kind: its kind.
        title: its own name, and its serial number if it reports one.
        mbit: megabits per second of its link.
        node: the device file that opens it.
        device: its folder in the system's list of USB devices.
    """

    kind: CameraKind
    title: str
    mbit: float
    node: Path
    device: Path = Path()

    def find_problems(self) -> list[tuple[str, str]]:
        """Returns each problem with its remedy."""
        return [problem for problem in (self._driver(), self._permission(), self._link()) if problem]

    def _driver(self) -> tuple[str, str] | None:
        kind = self.kind
        if not kind.sensor:
            return "enliven has no driver for this camera", "Write a driver: docs/add-a-sensor.md."
        try:
            installed = version(kind.package)
        except PackageNotFoundError:
            return f"{kind.package} is not installed", install_advice(kind.sensor, kind.requirement)
        reason = explain_unsupported(kind.package, installed)
        return (reason, install_advice(kind.sensor, kind.requirement)) if reason else None

    def _permission(self) -> tuple[str, str] | None:
        return None if os.access(self.node, os.R_OK | os.W_OK) else (FORBIDDEN, ALLOW)

    def _link(self) -> tuple[str, str] | None:
        if self.kind.boots or not self.kind.sensor or self.mbit > _SLOW_MBIT:
            return None
        return "the camera is on USB 2", "Use a USB 3 port and a USB 3 cable."


def install_advice(sensor: str, requirement: str = "") -> str:
    """Returns the advice to install the library of a sensor in a working version.

    ``requirement`` is installed instead of the extra, if it is given.
    """
    if requirement:
        return f"Type: pip install {requirement}"
    return f'Type: pip install "enliven-edge[{sensor}]"; in a checkout: pip install "./edge[{sensor}]"'


def explain_unsupported(package: str, installed: str) -> str:
    """Returns why a version of a camera's library is not supported, or an empty string if it is supported."""
    for kind in KINDS:
        for pattern, reason in kind.bad if kind.package == package else ():
            if re.match(pattern, installed):
                return f"{package} {installed} is installed: {reason}"
    return ""


def list_attached(devices: Path = DEVICES, nodes: Path = NODES) -> list[AttachedCamera]:
    """Returns the depth cameras on USB, sorted by name."""
    cameras = [camera for device_path in devices.glob("*") if (camera := _camera(device_path, nodes))]
    return sorted(cameras, key=lambda camera: (camera.kind.name, camera.title))


def _camera(device: Path, nodes: Path) -> AttachedCamera | None:
    vendor, product, title = (_read_attribute(device, part) for part in ("idVendor", "idProduct", "product"))
    for kind in KINDS:
        if vendor == kind.vendor and re.fullmatch(kind.products, product) and kind.title in title:
            serial = _read_attribute(device, "serial")
            mbit = float(_read_attribute(device, "speed") or "nan")
            node = (
                nodes
                / _read_attribute(device, "busnum").zfill(3)
                / _read_attribute(device, "devnum").zfill(3)
            )
            name = " ".join(word for word in (title or kind.name, serial) if word)
            return AttachedCamera(kind, name, mbit, node, device)
    return None


def _read_attribute(device: Path, part: str) -> str:
    """Returns an attribute of a device from the system, or an empty string if it does not exist."""
    try:
        return (device / part).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def import_library(module: str, sensor: str, requirement: str = "") -> Any:
    """Imports a camera's library.

    Args:
        requirement: argument of pip install, if the library cannot be part of an extra.

    Raises:
        ResourceError: if it is not installed, its version does not work, or it does not load on this machine.
    """
    where, remedy = f"sensor {sensor}", install_advice(sensor, requirement)
    try:
        reason = explain_unsupported(module, version(module))
    except PackageNotFoundError:
        reason = ""
    if reason:
        raise ResourceError(reason, where=where, remedy=remedy)
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == module
        problem = f"{module} is not installed" if missing else f"{module} cannot be loaded ({error})"
        raise ResourceError(problem, where=where, remedy=remedy) from None
