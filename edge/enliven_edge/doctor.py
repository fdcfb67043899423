"""What an edge needs of this machine: sensors, their recording, their permissions."""

from __future__ import annotations

import sys
from importlib import resources
from pathlib import Path

from enliven.doctor import Check
from enliven_edge.sensors.profile import profile_names
from enliven_edge.sensors.registry import sensor_names


def checks() -> list[Check]:
    """The sensors that are known, the profiles, the shipped recording, and access to USB."""
    return [
        Check("sensors", True, ", ".join(sensor_names())),
        Check(
            "sensor profiles",
            bool(profile_names()),
            ", ".join(profile_names()),
            "Install enliven-edge again.",
        ),
        _shipped_recording(),
        *_usb_permissions(),
    ]


def _shipped_recording() -> Check:
    """The recording that ``enliven run`` replays."""
    path = shipped_recording()
    mend = "Make it again: enliven synthesize -o chair.mcap"
    return Check("shipped recording", path.is_file(), path.name if path.is_file() else "not found", mend)


def shipped_recording() -> Path:
    """The path of the recording that comes with the package."""
    return Path(str(resources.files("enliven_edge") / "assets" / "chair.mcap"))


def _usb_permissions() -> list[Check]:
    """On Linux a depth camera on USB must be writable for the user; without one there is nothing to check."""
    if not sys.platform.startswith("linux"):
        return []
    return [_access(camera) for camera in _cameras()]


_DEPTH_CAMERAS = {"03e7": "OAK (Luxonis)", "045e": "Kinect (Microsoft)", "8086": "RealSense (Intel)"}


def _cameras() -> list[Path]:
    """The depth cameras on USB, where the system shows them."""
    return [d for d in Path("/sys/bus/usb/devices").glob("*") if _vendor(d) in _DEPTH_CAMERAS]


def camera_names() -> list[str]:
    """What the depth cameras on USB are called."""
    return [_DEPTH_CAMERAS[_vendor(camera)] for camera in _cameras()]


def _vendor(device: Path) -> str:
    try:
        return (device / "idVendor").read_text().strip()
    except OSError:
        return ""


def _access(device: Path) -> Check:
    """Whether this user may open a camera."""
    name = _DEPTH_CAMERAS[_vendor(device)]
    bus, number = ((device / part).read_text().strip().zfill(3) for part in ("busnum", "devnum"))
    node = Path("/dev/bus/usb") / bus / number
    try:
        with node.open("r+b"):
            return Check(name, True, "may be opened")
    except OSError as error:
        mend = f'Let your user open it: a udev rule with ATTRS{{idVendor}}=="{_vendor(device)}", MODE="0666".'
        return Check(name, False, f"cannot be opened ({error.strerror})", mend)
