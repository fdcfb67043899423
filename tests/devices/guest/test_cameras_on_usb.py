"""Tests of depth cameras' USB numbers on the kernel's virtual USB: the system's udev with our rules, real
sysfs."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from as_user import HELPER, SEATED, SLOW, STRANGER, answer, command
from usb_device import HIGH, SUPER, Kind, UsbDevice

RULES = sorted((Path(__file__).parents[3] / "firmware_configs" / "udev").glob("*.rules"))
OURS = Path("/etc/udev/rules.d/60-enliven-cameras.rules")
REALSENSE = "Intel(R) RealSense(TM) Depth Camera 435"
CAMERAS = {
    "OAK": Kind(0x03E7, 0x2485, "Movidius MyriadX", "Movidius Ltd.", "03e72485", HIGH),
    "RealSense": Kind(0x8086, 0x0B07, REALSENSE, "Intel(R) RealSense(TM)", "012345678901", SUPER),
    "RealSense by a cable of USB 2": Kind(0x8086, 0x0B07, REALSENSE, "Intel(R) RealSense(TM)", "98765", HIGH),
    "Orbbec": Kind(0x2BC5, 0x0670, "Orbbec Gemini 335", "Orbbec", "CP1", SUPER),
    "Kinect v1": Kind(0x045E, 0x02AE, "Xbox NUI Camera", "Microsoft", "A0", HIGH),
}
OTHERS = {
    "an Intel device that is no camera": Kind(0x8086, 0x0189, "Bluetooth", "Intel", "", HIGH),
    "a mouse": Kind(0x045E, 0x0040, "Wheel Mouse Optical", "Microsoft", "", HIGH),
}
MAY_OPEN = """
import json, os
print(json.dumps(os.access({path!r}, os.R_OK | os.W_OK) and os.open({path!r}, os.O_RDWR) > 0))
"""
ATTACHED = """
import json
from enliven_edge.sensors.attached_cameras import list_attached
print(json.dumps([[c.kind.name, c.title, c.mbit, str(c.node), c.find_problems()] for c in list_attached()]))
"""


def settle() -> None:
    subprocess.run(["udevadm", "settle", "--timeout=30"], check=True)


def node_of(kind: Kind) -> Path:
    """Returns the device file of a device, as listed in sysfs."""
    for device in Path("/sys/bus/usb/devices").glob("*"):
        attributes = {
            part: read(device / part)
            for part in ("idVendor", "idProduct", "serial", "busnum", "devnum", "product")
        }
        if (attributes["idVendor"], attributes["idProduct"]) == (
            f"{kind.vendor:04x}",
            f"{kind.product:04x}",
        ) and (attributes["product"] == kind.title and attributes["serial"] == kind.serial):
            return Path(f"/dev/bus/usb/{int(attributes['busnum']):03d}/{int(attributes['devnum']):03d}")
    raise LookupError(kind.title)


def read(path: Path) -> str:
    return path.read_text().strip() if path.exists() else ""


def nodes_of(kinds: dict[str, Kind]) -> dict[str, Path]:
    deadline = time.monotonic() + SLOW
    while True:
        settle()
        try:
            return {name: node_of(kind) for name, kind in kinds.items()}
        except LookupError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)


@pytest.fixture(scope="module", autouse=True)
def plugged_in():
    """Plugs in all devices before the rules are installed."""
    subprocess.run(["modprobe", "vhci_hcd"], check=True)
    OURS.unlink(missing_ok=True)
    subprocess.run(["udevadm", "control", "--reload"], check=True)
    devices = [UsbDevice(kind, port) for port, kind in enumerate((CAMERAS | OTHERS).values())]
    nodes_of(CAMERAS | OTHERS)
    yield devices
    for device in devices:
        device.unplug()


def test_udev_accepts_our_rules():
    done = subprocess.run(["udevadm", "verify", *map(str, RULES)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stdout.strip().splitlines()[-1])


def test_doctors_advice_gives_access_to_cameras_only():
    listed = answer(SEATED, ATTACHED)
    assert sorted(name for name, *_ in listed) == ["Kinect v1", "OAK", "Orbbec", "RealSense", "RealSense"]
    mends = {
        remedy
        for *_, troubles in listed
        for trouble, remedy in troubles
        if trouble == "your user may not open the camera"
    }
    assert len(mends) == 1, "each of them is closed to an ordinary user, for one reason"
    line = mends.pop().removeprefix("Type: ").replace("sudo ", "")
    subprocess.run(["sh", "-euc", line], check=True, cwd=Path(__file__).parents[3])
    settle()
    for name, node in nodes_of(CAMERAS).items():
        stat = node.stat()
        acl = subprocess.run(["getfacl", "-cp", str(node)], capture_output=True, text=True, check=True).stdout
        assert stat.st_mode & 0o777 == 0o660 and node.group() == "plugdev", name
        assert f"user:{SEATED}:rw-" in acl, f"{name}: {acl}"
        allowed = [answer(user, MAY_OPEN.format(path=str(node))) for user in (SEATED, HELPER, STRANGER)]
        assert allowed == [True, True, False], name
    for name, node in nodes_of(OTHERS).items():
        assert not answer(SEATED, MAY_OPEN.format(path=str(node))), name
    print(f"{len(CAMERAS)} cameras are open to two users of three; {len(OTHERS)} others to none")


def test_camera_plugged_in_later_is_accessible_at_once(plugged_in):
    kind, device = CAMERAS["OAK"], plugged_in[0]
    for _ in range(5):
        device.unplug()
        settle()
        assert "OAK" not in [name for name, *_ in answer(SEATED, ATTACHED)]
        device = plugged_in[0] = UsbDevice(kind, 0)
        (node,) = nodes_of({"OAK": kind}).values()
        assert answer(SEATED, MAY_OPEN.format(path=str(node)))


def test_attached_cameras_are_listed_with_speed_and_problems():
    listed = {
        title: (name, mbit, [trouble for trouble, _ in troubles])
        for name, title, mbit, _, troubles in answer(SEATED, ATTACHED)
    }
    print(json.dumps(listed, indent=1))
    assert listed[f"{REALSENSE} 012345678901"][:2] == ("RealSense", 5000.0)
    assert "the camera is on USB 2" not in listed[f"{REALSENSE} 012345678901"][2]
    assert (
        listed[f"{REALSENSE} 98765"][1] == 480.0
        and "the camera is on USB 2" in listed[f"{REALSENSE} 98765"][2]
    )
    name, mbit, troubles = listed["Movidius MyriadX 03e72485"]
    assert (name, mbit) == ("OAK", 480.0) and "the camera is on USB 2" not in troubles, (
        "it has no firmware yet"
    )
    assert "depthai is not installed" in troubles
    assert listed["Xbox NUI Camera A0"][2] == ["enliven has no driver for this camera"], (
        "a Kinect v1 has no other link than USB 2"
    )
    assert all("your user may not open the camera" not in troubles for _, _, troubles in listed.values())


def test_command_lists_attached_cameras():
    words = command(SEATED, str(Path(sys.executable).with_name("enliven")), "sensors")
    done = subprocess.run(words, capture_output=True, text=True, timeout=SLOW)
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    assert "Movidius MyriadX 03e72485" in output and "depthai is not installed" in output
    assert "98765: " in output and "the camera is on USB 2" in output and '"enliven-edge[oak]"' in output
    print(done.stdout)
