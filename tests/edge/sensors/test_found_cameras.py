"""Tests of the window's list of cameras: model, command to start it, and missing software."""

import json

import pytest

from enliven import cli
from enliven_edge.sensors import attached_cameras
from enliven_edge.sensors import camera_list as module
from enliven_edge.sensors.attached_cameras import KINDS, AttachedCamera
from enliven_edge.sensors.camera_list import find_cameras, video_cameras


@pytest.fixture
def video(tmp_path):
    """Returns a function that adds video devices to a simulated system tree."""
    devices, nodes = tmp_path / "video4linux", tmp_path / "dev"
    devices.mkdir()
    nodes.mkdir()

    def plug(name: str, index: int = 0, *, allowed: bool = True) -> None:
        number = len(list(devices.glob("*")))
        device = devices / f"video{number}"
        device.mkdir()
        (device / "name").write_text(name + "\n")
        (device / "index").write_text(f"{index}\n")
        if allowed:
            (nodes / device.name).touch()

    plug.found = lambda: video_cameras(devices, nodes)
    return plug


def camera(name: str, title: str, mbit: float = 5000.0, tmp: object = "/") -> AttachedCamera:
    kind = next(kind for kind in KINDS if kind.name == name and not kind.boots)
    return AttachedCamera(kind, title, mbit, tmp)


def test_webcams_and_time_of_flight_cameras_are_recognised(video, monkeypatch):
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: object())
    video("HD Pro Webcam C920")
    video("HD Pro Webcam C920", 1)
    video("Intel(R) RealSense(TM) 435")
    video("bcm2835-codec-decode")
    video("arducam-pivariety")
    video("Locked Cam", allowed=False)
    listed = video.found()
    assert [(entry.sensor, entry.options.get("device", "")[-6:]) for entry in listed] == [
        ("webcam", "video0"),
        ("tof", ""),
        ("webcam", "video5"),
    ]
    assert not listed[0].trouble and not listed[0].depth and listed[1].depth
    assert "may not open" in listed[2].trouble and "usermod" in listed[2].remedy


def test_camera_without_its_library_gives_the_install_command(video, monkeypatch):
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    video("A webcam")
    (listed,) = video.found()
    assert listed.trouble == "mediapipe is not installed" and "pip install" in listed.remedy


def test_several_of_one_make_are_chosen_by_serial_and_a_slow_link_is_no_obstacle(monkeypatch, tmp_path):
    plugged = [
        camera("RealSense", "Intel RealSense 435 S1", 480.0, tmp_path),
        camera("RealSense", "Intel RealSense 455 S2", 5000.0, tmp_path),
        camera("OAK", "OAK-D S3", 5000.0, tmp_path),
        camera("Kinect v2", "Xbox NUI Sensor", 5000.0, tmp_path),
    ]
    monkeypatch.setattr(
        attached_cameras, "version", lambda package: "3.6.1" if package == "depthai" else "2.57"
    )
    monkeypatch.setattr(module, "list_attached", lambda: plugged)
    monkeypatch.setattr(module, "list_cameras", list)
    monkeypatch.setattr(module, "video_cameras", list)
    first, second, oak, kinect = find_cameras()
    assert first.options == {"serial": "S1"} and second.options == {"serial": "S2"} and not oak.options
    assert not first.trouble and "USB 3" in first.hint and not second.hint
    assert kinect.trouble == "enliven has no driver for this camera" and kinect.remedy and not kinect.sensor


def test_the_command_prints_the_cameras_as_json(capsys, monkeypatch):
    monkeypatch.setattr(module, "list_attached", list)
    assert cli.run(["sensors", "--json"]) == 0
    for listed in json.loads(capsys.readouterr().out.splitlines()[-1]):
        assert listed["title"]
