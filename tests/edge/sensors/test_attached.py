"""Tests of the USB cameras listed by the system: their models, missing software, and the command to install
it.
"""

import fnmatch
import re
from pathlib import Path

import pytest

from enliven_edge import doctor
from enliven_edge.sensors import attached_cameras as module
from enliven_edge.sensors.attached_cameras import KINDS, list_attached

RULES = Path(__file__).parents[3] / "firmware_configs" / "udev" / "60-enliven-cameras.rules"


@pytest.fixture
def usb(tmp_path):
    """Returns a function that adds a device to a simulated USB tree."""
    devices, nodes = tmp_path / "devices", tmp_path / "nodes"

    def plug(vendor: str, product: str, title: str = "", speed: str = "5000", mode: int = 0o666) -> None:
        number = len(list(devices.glob("*"))) + 1
        device = devices / f"1-{number}"
        device.mkdir(parents=True)
        attributes = {"idVendor": vendor, "idProduct": product, "product": title, "speed": speed}
        attributes |= {"busnum": "1", "devnum": str(number), "serial": f"S{number}"}
        for part, text in attributes.items():
            (device / part).write_text(text + "\n")
        node = nodes / "001" / f"{number:03}"
        node.parent.mkdir(parents=True, exist_ok=True)
        node.touch()
        if mode:
            node.chmod(mode)
        else:
            node.unlink()

    plug.found = lambda: list_attached(devices, nodes)
    return plug


def test_only_known_cameras_are_recognised(usb):
    usb("8086", "0b07", "Intel(R) RealSense(TM) Depth Camera 435")
    usb("8086", "0032", "AX210 Bluetooth")
    usb("045e", "07b2", "Microsoft Nano Transceiver")
    usb("045e", "02c4", "Xbox NUI Sensor")
    usb("03e7", "2485", "Movidius MyriadX", speed="480")
    usb("03e7", "f63b", "Luxonis Device")
    usb("2bc5", "0670", "Orbbec Gemini 335")
    usb("1d6b", "0003", "xHCI Host Controller")
    assert [camera.kind.name for camera in usb.found()] == ["Kinect v2", "OAK", "OAK", "Orbbec", "RealSense"]


def test_missing_parts_of_a_camera_are_reported_with_the_command(usb, monkeypatch):
    versions = {"depthai": "3.6.1"}

    def version(package: str) -> str:
        if package not in versions:
            raise module.PackageNotFoundError(package)
        return versions[package]

    monkeypatch.setattr(module, "version", version)
    usb("03e7", "f63b", "Luxonis Device")
    assert usb.found()[0].find_problems() == []
    usb("8086", "0b07", "Intel(R) RealSense(TM) Depth Camera 435", speed="480", mode=0)
    troubles = dict(usb.found()[1].find_problems())
    assert set(troubles) == {
        "pyrealsense2 is not installed",
        "your user may not open the camera",
        "the camera is on USB 2",
    }
    mends = " ".join(troubles.values())
    assert 'pip install "enliven-edge[realsense]"' in mends and "60-enliven-cameras.rules" in mends
    versions["depthai"] = "3.8.0"
    assert "3.8.0" in usb.found()[0].find_problems()[0][0]
    usb("03e7", "2485", "Movidius MyriadX", speed="480")
    assert len(usb.found()) == 3 and "USB 2" not in str(usb.found()[1].find_problems()[1:])


def test_doctor_lists_each_camera(usb, monkeypatch):
    usb("045e", "02c4", "Xbox NUI Sensor")
    monkeypatch.setattr(doctor, "list_attached", usb.found)
    check = next(check for check in doctor.checks() if check.name == "Kinect v2")
    assert not check.ok and "NUI" in check.detail and "add-a-sensor" in check.remedy


def test_a_library_that_no_extra_can_have_has_its_own_line(usb, monkeypatch):
    def nothing(package: str) -> str:
        raise module.PackageNotFoundError(package)

    monkeypatch.setattr(module, "version", nothing)
    usb("2bc5", "0670", "Orbbec Gemini 335")
    (trouble,) = usb.found()[0].find_problems()
    assert trouble == ("pyorbbecsdk2 is not installed", "Type: pip install --no-deps pyorbbecsdk2")


def test_the_rules_open_the_cameras_that_are_known_and_no_other_devices(usb):
    """The rules are read as udev reads them: all conditions of a line must hold."""
    lines = [line for line in RULES.read_text().splitlines() if line.startswith("ATTR")]
    assert all('TAG+="uaccess"' in line and 'MODE="0660"' in line for line in lines)

    def opened(vendor: str, product: str, title: str) -> bool:
        attributes = {"idVendor": vendor, "idProduct": product, "product": title}
        return any(
            all(
                any(fnmatch.fnmatchcase(attributes[part], each) for each in wanted.split("|"))
                for part, wanted in re.findall(r'ATTR\{(\w+)\}=="([^"]+)"', line)
            )
            for line in lines
        )

    for kind in KINDS:
        for product in re.findall("[0-9a-f]{4}", kind.products.replace("[a-e]", "c")) or ["f63b"]:
            assert opened(kind.vendor, product, kind.title and f"Intel(R) {kind.title}(TM) D435"), kind
    assert not opened("8086", "0032", "AX210 Bluetooth") and not opened("045e", "07b2", "Mouse")
