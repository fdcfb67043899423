"""Tests that a hanging camera is reset on its USB port, with real system calls on a simulated USB tree.

A real port reset needs a camera. Here, the request goes to a regular file, and the kernel refuses it.
"""

import itertools
import logging
import os
import sys
import time
from pathlib import Path

import pytest

from enliven.errors import ResourceError
from enliven_edge.sensors import power_cycle
from enliven_edge.sensors.base import Sensor
from enliven_edge.sensors.power_cycle import CameraPower
from enliven_edge.sensors.reopening import ReopeningSensor

RULES = Path(__file__).parents[3] / "firmware_configs" / "udev" / "61-enliven-power-cycle.rules"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="USB devices are listed in sysfs")


@pytest.fixture
def usb(tmp_path: Path):
    """Creates two OAK cameras and a mouse in a simulated sysfs. Returns its folders."""
    devices, nodes = tmp_path / "devices", tmp_path / "nodes"
    for number, (vendor, title) in enumerate((("03e7", "Luxonis Device"),) * 2 + (("046d", "Mouse"),), 1):
        device = devices / f"1-{number}"
        device.mkdir(parents=True)
        attributes = {"idVendor": vendor, "idProduct": "f63b", "product": title, "speed": "5000"}
        attributes |= {"busnum": "1", "devnum": str(number), "serial": f"S{number}", "authorized": "1"}
        for part, text in attributes.items():
            (device / part).write_text(text)
        node = nodes / "001" / f"{number:03}"
        node.parent.mkdir(parents=True, exist_ok=True)
        node.touch()
    return devices, nodes


@pytest.fixture
def switched(usb, monkeypatch) -> list[list[str]]:
    """Records the state of all switches while a camera is disconnected, without waiting."""
    states: list[list[str]] = []

    def look(seconds: float) -> None:
        states.append([(device / "authorized").read_text() for device in sorted(usb[0].iterdir())])

    monkeypatch.setattr(power_cycle, "time", type("Time", (), {"sleep": look, "monotonic": time.monotonic}))
    return states


def test_camera_with_the_serial_number_is_disconnected_and_connected(usb, switched, caplog) -> None:
    assert CameraPower("oak", "S2", 1, *usb).cycle() == 1
    assert switched == [["1", "0", "1"]]
    assert [(device / "authorized").read_text() for device in sorted(usb[0].iterdir())] == ["1", "1", "1"]
    assert "Luxonis Device S2 could not be opened several times" in caplog.text


def test_all_cameras_of_the_driver_are_reset_without_a_serial_number(usb, switched) -> None:
    assert CameraPower("oak", "", 1, *usb).cycle() == 2
    assert switched == [["0", "1", "1"], ["1", "0", "1"]]
    assert CameraPower("realsense", "", 1, *usb).cycle() == 0


def test_port_reset_comes_first_and_a_new_connection_second(usb, switched, monkeypatch) -> None:
    requests = []
    monkeypatch.setattr(power_cycle.fcntl, "ioctl", lambda *request: requests.append(request[1:]))
    power = CameraPower("oak", "S1", 1, *usb)
    assert power.cycle() == 1 and switched == []
    assert requests == [(0x5514, 0)], "USBDEVFS_RESET on x86 and ARM"
    assert power.cycle() == 1 and switched == [["0", "1", "1"]]


def test_missing_permission_is_reported_once_with_the_rule_to_install(usb, caplog) -> None:
    for device in usb[0].iterdir():
        (device / "authorized").unlink()
    power = CameraPower("oak", "S1", 1, *usb)
    with caplog.at_level(logging.WARNING):
        assert power.cycle() == power.cycle() == 0
    assert len(caplog.records) == 1
    assert "61-enliven-power-cycle.rules" in caplog.text
    assert not any((device / "authorized").exists() for device in usb[0].iterdir())


def test_pauses_between_resets_grow_until_frames_come(usb, monkeypatch) -> None:
    now = [1000.0]
    clock = type("Time", (), {"sleep": lambda seconds: None, "monotonic": lambda: now[0]})
    monkeypatch.setattr(power_cycle, "time", clock)
    power, resets = CameraPower("oak", "S1", 3, *usb), []
    for _ in range(400):
        now[0] += 1.0
        power.record_failure()
        if power.is_due:
            power.cycle()
            resets.append(now[0])
    pauses = [b - a for a, b in itertools.pairwise(resets)]
    assert resets[0] == 1003.0 and pauses == [30.0, 60.0, 120.0]
    power.record_frame()
    assert not power.is_due
    assert not CameraPower("oak", "", 0, *usb).is_due


class Hanging(Sensor):
    """A driver that cannot open its camera until the camera was reset."""

    def __init__(self, usb, resets: int) -> None:
        self.opened = 0
        self.power = CameraPower("oak", "S1", 3, *usb)
        self._resets = resets

    def __call__(self):
        self.opened += 1
        if self.power.count < self._resets:
            raise ResourceError("it does not answer", where="sensor oak")
        return self

    name, fps = "oak", 30.0

    def read(self, timeout=None):
        return None

    def close(self) -> None:
        return None


def test_reopening_resets_a_camera_that_stays_hung(usb, switched) -> None:
    hanging = Hanging(usb, 1)
    with ReopeningSensor(hanging, awaited="oak", power=hanging.power) as sensor:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline:
            assert sensor.is_waiting, "attempts run and end, so a restart of the edge does not help"
            try:
                sensor.read(0.1)
            except (ResourceError, TimeoutError):
                continue
            break
    assert hanging.power.count == 1 and hanging.opened == 4


def test_rule_gives_the_group_exactly_the_switch_of_known_cameras() -> None:
    text = RULES.read_text()
    assert "chgrp plugdev /sys%p/authorized" in text and "chmod g+w" in text
    assert {"03e7", "8086", "2bc5"} == {
        line.split('"')[1] for line in text.splitlines() if "idVendor" in line
    }
    assert os.fspath(RULES.name) in power_cycle.RULES_ADVICE
