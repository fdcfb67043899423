"""Tests of ``enliven sensors``, which lists the sensors and describes what one sensor sees."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enliven import cli
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.sensors import attached_cameras
from enliven_edge.sensors.drivers import libcamera_library


def said(capsys, *words: str) -> tuple[int, str, str]:
    code = cli.run(["sensors", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_all_sensors_are_listed(capsys):
    code, out, _ = said(capsys)
    assert (
        code == 0
        and "oak, orbbec, osc-trackers, realsense, replay, rokoko, synthetic, tof, vmc, webcam"
        in " ".join(out.split())
    )


def test_connected_cameras_are_listed_with_install_commands(capsys, monkeypatch):
    kind = next(kind for kind in attached_cameras.KINDS if kind.sensor == "oak")
    camera = attached_cameras.AttachedCamera(
        replace(kind, package="no-such-package"), "[OAK] 1", 5000.0, Path("/")
    )
    monkeypatch.setattr("enliven_edge.sensors.list_attached", lambda: [camera])
    _, out, _ = said(capsys)
    assert "[OAK] 1" in out and '"enliven-edge[oak]"' in " ".join(out.split())


BINDING = """
import os, time
class Key:
    def __init__(self, name): self.name = name
class Camera:
    def __init__(self, id, model): self.id, self.properties = id, {Key("Model"): model, Key("Rotation"): 0}
class CameraManager:
    @classmethod
    def singleton(cls):
        made = cls()
        models = {"/base/i2c@88000/imx708@1a": "imx708", "/base/i2c@70000/ov9281@60": "ov9281"}
        made.cameras = [Camera(*each) for each in models.items()]
        return made
"""
"""A minimal version of libcamera's Python binding, as in the virtual machine of make test-devices."""
AT_PORTS = [
    ("", ["imx708 /base/i2c@88000/imx708@1a: --sensor libcamera --set left=0", "@60: --sensor", "left=1"]),
    ("os.abort()", ["libcamera cannot list its cameras (exit code -6", "rpicam-hello --list-cameras"]),
    ("time.sleep(60)", ["libcamera has not listed its cameras within"]),
    (
        "import nothing_of_the_kind",
        ["libcamera cannot be loaded (No module named", "apt install python3-lib"],
    ),
]
"""A line to add to the binding, and the expected output. libcamera may end or block its process."""


@pytest.mark.parametrize(("line", "words"), AT_PORTS)
def test_cameras_at_camera_ports_are_listed_whatever_libcamera_does(
    capsys, monkeypatch, tmp_path, line, words
):
    (tmp_path / "libcamera.py").write_text(f"{BINDING}\n{line}\n")
    monkeypatch.setattr(libcamera_library, "_LISTING_TIMEOUT_S", 3.0 if "sleep" in line else 60.0)
    monkeypatch.setattr(libcamera_library, "_SYSTEM", tmp_path / "nothing")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    code, out, _ = said(capsys)
    assert code == 0
    assert all(word in " ".join(out.split()) for word in words), out


def test_only_raspberry_pi_gets_libcamera_advice(capsys, monkeypatch, tmp_path):
    if libcamera_library.is_installed():
        pytest.skip("libcamera is installed")
    monkeypatch.setattr(libcamera_library, "_BOARD", tmp_path / "model")
    assert "libcamera is not" not in said(capsys)[1]
    (tmp_path / "model").write_bytes(b"Raspberry Pi 5 Model B Rev 1.0\0")
    assert "libcamera is not installed. Type: sudo apt install" in " ".join(said(capsys)[1].split())


def test_view_of_one_sensor_is_described_and_drawn(capsys, tmp_path):
    """Floor height, tilt and size in the shipped recording are known: 1.15 m high, five degrees down."""
    path = f"path={find_shipped_recording()}"
    code, out, _ = said(capsys, "replay", "--set", path, "--seconds", "0.5", "-o", str(tmp_path / "a.png"))
    assert code == 0
    facts = dict(line.split(maxsplit=1) for line in out.splitlines() if not line.startswith(str(tmp_path)))
    assert facts["image"].strip() == "320 x 240" and float(facts["rate"].split()[0]) == 30.0
    assert abs(float(facts["floor"].split()[0]) - 1.15) < 0.011 and int(facts["floor"].split()[-2]) == 5
    picture = np.asarray(Image.open(tmp_path / "a.png"))
    assert picture.shape[:2] == (240, 320) and picture.std() > 10


def test_accelerometer_is_shown_next_to_the_floor():
    from enliven_edge.commands.sensors import describe_condition
    from enliven_edge.sensors.base import Condition

    tilted = np.array([0.0, np.cos(0.3), np.sin(0.3)])
    facts = dict(describe_condition(Condition("USB 2", True, 61.0, 90.0, (0.0, 9.8, 0.0)), tilted))
    assert (
        facts["gravity"]
        == "sensor tilted down by 0 degrees, by its accelerometer; 17 degrees from the floor's normal"
    )
    assert "slow" in facts["link"] and facts["temperature"] == "61 degrees"


@pytest.mark.parametrize(
    ("words", "code", "what"),
    [
        (["synthetic", "-o", "a.jpg"], 3, ".png"),
        (["sinthetic"], 3, "Did you mean synthetic"),
        (["replay", "--set", "path=missing.mcap"], 3, "missing.mcap"),
        (["webcam", "--set", "device=/dev/video99"], 4, "/dev/video99"),
    ],
)
def test_invalid_sensor_arguments_are_reported(capsys, words, code, what):
    exit_code, _, err = said(capsys, *words)
    assert exit_code == code and what in err
