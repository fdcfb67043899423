"""Lists all cameras of this machine: depth cameras on USB, camera ports, time of flight, webcams."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from collections import Counter
from pathlib import Path

import msgspec

from enliven.errors import ResourceError
from enliven_edge.sensors.attached_cameras import AttachedCamera, list_attached
from enliven_edge.sensors.drivers.libcamera_library import list_cameras

VIDEO, NODES = Path("/sys/class/video4linux"), Path("/dev")
"""Linux's list of video devices, and the folder of the device files that open them."""
_TOF = re.compile(r"arducam|pivariety", re.IGNORECASE)
"""Driver names of Arducam's time-of-flight camera."""
_OTHER_DEVICES = re.compile(
    r"realsense|orbbec|oak|luxonis|bcm2835|rpi|pisp|unicam|loopback codec", re.IGNORECASE
)
"""Names of video devices that belong to depth cameras and to the processors of camera ports."""
_BY_SERIAL = {"realsense": "serial", "oak": "device"}
"""The driver's option that selects one of several cameras of the same brand."""
_EXTRA = 'Type: pip install "enliven-edge[colour]"; in a checkout: pip install "./edge[colour]"'


class DetectedCamera(msgspec.Struct, frozen=True, rename={"remedy": "mend"}):
    """One camera.

    Attributes:
        title: the common name.
        sensor: the driver's name in enliven; empty if there is none.
        options: options of the driver, by name.
        trouble, remedy: the problem that prevents its use, and the remedy; both empty if it can be used.
            ``enliven sensors --json`` calls the remedy "mend".
        hint: a note about a usable camera, such as a slow link, or empty.
        depth: True if it measures depth, so that a preview image can be made.
    """

    title: str
    sensor: str = ""
    options: dict[str, str] = {}
    trouble: str = ""
    remedy: str = ""
    hint: str = ""
    depth: bool = True


def find_cameras() -> list[DetectedCamera]:
    """Returns all cameras of this machine, depth cameras first."""
    return [*_list_usb_cameras(list_attached()), *_list_port_cameras(), *video_cameras()]


def _list_usb_cameras(cameras: list[AttachedCamera]) -> list[DetectedCamera]:
    """Returns the depth cameras on USB. If there are several cameras of one brand, they are selected by
    serial number.
    """
    makers = Counter(camera.kind.sensor for camera in cameras)
    listed = []
    for camera in cameras:
        sensor, problems = camera.kind.sensor, camera.find_problems()
        slow = [usb_problem for usb_problem in problems if usb_problem[0] == "the camera is on USB 2"]
        serious = [usb_problem for usb_problem in problems if usb_problem not in slow]
        options = {}
        if makers[sensor] > 1 and sensor in _BY_SERIAL and " " in camera.title:
            options[_BY_SERIAL[sensor]] = camera.title.rsplit(" ", 1)[1]
        problem, remedy = serious[0] if serious else ("", "")
        hint = f"{slow[0][0]}. {slow[0][1]}" if slow else ""
        title = (
            camera.title
            if camera.kind.name.lower() in camera.title.lower()
            else f"{camera.kind.name} {camera.title}"
        )
        listed.append(DetectedCamera(title, sensor, options, problem, remedy, hint))
    return listed


def _list_port_cameras() -> list[DetectedCamera]:
    """Returns the cameras that libcamera lists, or the problem that prevents listing them."""
    try:
        return [
            DetectedCamera(f"{listed.model} at camera port {number}", "libcamera", {"left": str(number)})
            for number, listed in enumerate(list_cameras())
        ]
    except ResourceError as error:
        return [DetectedCamera("Cameras at the camera ports", "libcamera", {}, error.what, error.remedy)]


def video_cameras(devices: Path = VIDEO, nodes: Path = NODES) -> list[DetectedCamera]:
    """Returns time-of-flight cameras and webcams, recognised by the names of their drivers."""
    cameras = []
    for device in sorted(devices.glob("video*"), key=lambda path: int("0" + re.sub(r"\D", "", path.name))):
        name, first = _read_attribute(device, "name"), _read_attribute(device, "index") in ("", "0")
        node = nodes / device.name
        if not first or not name or (_OTHER_DEVICES.search(name) and not _TOF.search(name)):
            continue
        if _TOF.search(name):
            cameras.append(
                _add_problem(
                    DetectedCamera(f"Time-of-flight camera ({name})", "tof"), node, "ArducamDepthCamera"
                )
            )
            continue
        webcam = DetectedCamera(f"Webcam {name}", "webcam", {"device": str(node)}, depth=False)
        cameras.append(_add_problem(webcam, node, "mediapipe"))
    if not sys.platform.startswith("linux") and not cameras:
        cameras.append(_add_problem(DetectedCamera("Webcam", "webcam", depth=False), None, "mediapipe"))
    return cameras


def _add_problem(camera: DetectedCamera, node: Path | None, module: str) -> DetectedCamera:
    """Returns a camera with the problem that prevents its use, if any: missing permission or library."""
    if node is not None and not os.access(node, os.R_OK | os.W_OK):
        remedy = "Type: sudo usermod -aG video $USER, and log in again."
        return msgspec.structs.replace(camera, trouble="your user may not open the camera", remedy=remedy)
    if importlib.util.find_spec(module) is None:
        remedy = _EXTRA if module == "mediapipe" else f"Type: pip install {module}"
        return msgspec.structs.replace(camera, trouble=f"{module} is not installed", remedy=remedy)
    return camera


def _read_attribute(device: Path, part: str) -> str:
    """Returns an attribute of a device from the system, or an empty string if it does not exist."""
    try:
        return (device / part).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
