"""The depth cameras on USB that the system shows, whether a driver for them is installed or not."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DEVICES, NODES = Path("/sys/bus/usb/devices"), Path("/dev/bus/usb")
"""Where Linux lists what is on USB, and the files by which it is opened."""
_SLOW_MBIT = 480.0
"""Megabits a second of USB 2."""


@dataclass(frozen=True)
class CameraKind:
    """One make of camera on USB.

    Attributes:
        name: what people call it.
        vendor: USB's vendor id, four hexadecimal digits.
        products: the product ids, a regular expression.
        title: what the device's own name contains; a vendor such as Intel makes much else.
        sensor: the driver's name in enliven; empty where there is none.
        package: its library on PyPI.
        bad: versions of the library that do not work, a regular expression, and why.
        boots: whether it has these ids only until its firmware is loaded, on a link that is slow anyway.
    """

    name: str
    vendor: str
    products: str = ".*"
    title: str = ""
    sensor: str = ""
    package: str = ""
    bad: tuple[str, str] | None = None
    boots: bool = False


_OAK_LITE = (r"3\.(7\.[1-9]|[89]\.|10\.)", "an OAK-D Lite delivers no depth with it (luxonis/depthai#1252)")
KINDS = (
    CameraKind("OAK", "03e7", "2485", sensor="oak", package="depthai", bad=_OAK_LITE, boots=True),
    CameraKind("OAK", "03e7", sensor="oak", package="depthai", bad=_OAK_LITE),
    CameraKind("RealSense", "8086", title="RealSense", sensor="realsense", package="pyrealsense2"),
    CameraKind("Orbbec", "2bc5"),
    CameraKind("Kinect v1", "045e", "02ae|02bf"),
    CameraKind("Kinect v2", "045e", "02c4|02d8|02d9"),
    CameraKind("Azure Kinect", "045e", "097[a-e]"),
)


@dataclass(frozen=True)
class Attached:
    """One camera on USB.

    Attributes:
        kind: its make.
        title: what it calls itself, and its serial number where it tells.
        mbit: megabits a second of its link.
        node: the file by which it is opened.
    """

    kind: CameraKind
    title: str
    mbit: float
    node: Path

    def troubles(self) -> list[tuple[str, str]]:
        """What is wrong, and what to do, for each thing that is."""
        return [trouble for trouble in (self._driver(), self._permission(), self._link()) if trouble]

    def _driver(self) -> tuple[str, str] | None:
        kind = self.kind
        if not kind.sensor:
            return "no driver ships for it", "Add one: docs/add-a-sensor.md."
        try:
            installed = version(kind.package)
        except PackageNotFoundError:
            return f"{kind.package} is not installed", f'Type: pip install "enliven-edge[{kind.sensor}]"'
        if kind.bad and re.match(kind.bad[0], installed):
            mend = f'Type: pip install "enliven-edge[{kind.sensor}]", which has a version that works.'
            return f"{kind.package} {installed}: {kind.bad[1]}", mend
        return None

    def _permission(self) -> tuple[str, str] | None:
        if os.access(self.node, os.R_OK | os.W_OK):
            return None
        rules = "sudo cp firmware_configs/udev/60-enliven-cameras.rules /etc/udev/rules.d/"
        mend = f"Type: {rules} && sudo udevadm control --reload && sudo udevadm trigger"
        return "your user may not open it", mend

    def _link(self) -> tuple[str, str] | None:
        if self.kind.boots or not self.kind.sensor or self.mbit > _SLOW_MBIT:
            return None
        return "it is on USB 2", "Use a USB 3 port and a USB 3 cable."


def attached(devices: Path = DEVICES, nodes: Path = NODES) -> list[Attached]:
    """The depth cameras on USB, sorted by name."""
    found = [camera for each in devices.glob("*") if (camera := _camera(each, nodes))]
    return sorted(found, key=lambda camera: (camera.kind.name, camera.title))


def _camera(device: Path, nodes: Path) -> Attached | None:
    """The camera that a USB device is, or None."""
    vendor, product, title = (_said(device, part) for part in ("idVendor", "idProduct", "product"))
    for kind in KINDS:
        if vendor == kind.vendor and re.fullmatch(kind.products, product) and kind.title in title:
            serial = _said(device, "serial")
            mbit = float(_said(device, "speed") or "nan")
            node = nodes / _said(device, "busnum").zfill(3) / _said(device, "devnum").zfill(3)
            called = " ".join(word for word in (title or kind.name, serial) if word)
            return Attached(kind, called, mbit, node)
    return None


def _said(device: Path, part: str) -> str:
    """What the system says of a device; empty where it says nothing."""
    try:
        return (device / part).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
