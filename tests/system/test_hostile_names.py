"""Tests of files, animations, sensors and devices with terminal escapes and markup in their names."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gltf_twins import TWINS
from PIL import Image

import enliven_edge.sensors
from enliven.camera import Intrinsics
from enliven.cli import run
from enliven.frames import DepthFrame
from enliven.meshes import load_mesh, save_mesh
from enliven.recording import Recorder
from enliven_edge.sensors.attached_cameras import list_attached

HOSTILE = "a\x1b[31m\u202e[red]x[nothing]\x9b2J\n"
SHOWN = r"a\x1b[31m\u202e[red]x[nothing]\x9b2J\n"
r"""The escaped form of the name. Some commands write a line end as \n, the option library as \x0a."""
Print = Callable[..., str]


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Print:
    """Returns a function that runs a command and returns its output. Tables are wide enough not to wrap
    names.
    """
    monkeypatch.setenv("COLUMNS", "600")

    def call(*words: object) -> str:
        run([str(word) for word in words])
        output = capsys.readouterr()
        text = output.out + output.err
        assert not {"\u202e", "\x9b"} & set(text) and "\x1b[31m" not in text, text
        return text

    return call


def test_file_names_are_escaped(printed: Print, tmp_path: Path) -> None:
    model = tmp_path / f"{HOSTILE}.glb"
    TWINS["waving"]().write(model)
    mesh = tmp_path / f"{HOSTILE}.ply"
    save_mesh(load_mesh(model).mesh, tmp_path / "a.ply")
    mesh.write_bytes((tmp_path / "a.ply").read_bytes() + b"tail")
    bvh, film = tmp_path / f"{HOSTILE}.bvh", tmp_path / f"{HOSTILE}.mcap"
    out = tmp_path / f"{HOSTILE}out"
    assert SHOWN[:-2] in printed("export", model, "-o", f"{out}.bvh")
    shutil.copy(f"{out}.bvh", bvh)
    assert SHOWN[:-2] in printed("retarget", bvh, model, "-o", f"{out}.glb")
    assert SHOWN[:-2] in printed("import", bvh, "-o", film)
    assert SHOWN[:-2] in printed("inspect", film, "-o", f"{out}.mp4")
    assert SHOWN[:-2] in printed("recover", film, "-o", f"{out}.mcap")
    assert SHOWN[:-2] in printed("possess", film, "--mesh", mesh, "-o", f"{out}.enliven")
    assert SHOWN[:-2] in printed("examples", film, "--mesh", mesh, "-o", f"{out}.toml")
    assert SHOWN[:-2] in printed("track", film, "-o", f"{out}2.mcap")
    assert SHOWN[:-2] in printed("scan", tmp_path / f"{HOSTILE}.none", "-o", f"{out}.ply")
    assert SHOWN[:-2] in printed("calibrate", tmp_path / f"{HOSTILE}.none", "-o", f"{out}.toml")
    assert SHOWN[:-2] in printed("stage", "put", tmp_path / f"{HOSTILE}.none")
    assert SHOWN[:-2] in printed("export", film, "--bad" + HOSTILE)
    assert SHOWN[:-2] in printed(HOSTILE)


def test_image_names_in_a_folder_are_escaped(printed: Print, tmp_path: Path) -> None:
    for number in range(3):
        picture = np.full((48, 64), 2000, np.uint16)
        Image.fromarray(picture).save(tmp_path / f"depth_{number}.png")
    (tmp_path / "depth_1.png").rename(tmp_path / f"depth_{HOSTILE}1.png")
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / f"depth_{HOSTILE}2.png")
    for command in ("import", "track"):
        printed(command, tmp_path, "-o", tmp_path / f"{command}.mcap")


def test_animation_names_are_escaped(printed: Print, tmp_path: Path) -> None:
    twin = TWINS["waving"]()
    twin.json["animations"][0]["name"] = HOSTILE
    twin.json["nodes"][0]["name"] = HOSTILE
    twin.extension(HOSTILE)
    path = twin.write(tmp_path / "a.glb")
    assert SHOWN[:-2] in printed("export", path, "-o", tmp_path / "b.glb")
    assert SHOWN[:-2] in printed("export", path, "-c", "another", "-o", tmp_path / "b.glb")


def test_sensor_names_in_recordings_are_escaped(printed: Print, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        lens, picture = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5), np.full((48, 64), 2000, np.uint16)
        for frame in range(10):
            recorder.write_frame(DepthFrame(picture, lens, frame * 33_333_333, HOSTILE))
    assert SHOWN[:-2] in printed("track", tmp_path / "a.mcap", "-o", tmp_path / "b.mcap")
    printed("inspect", tmp_path / "a.mcap")
    printed("recover", tmp_path / "a.mcap", "-o", tmp_path / "c.mcap")


def test_device_names_are_escaped(printed: Print, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / "devices" / "1-1"
    device.mkdir(parents=True)
    attributes = {"idVendor": "2bc5", "idProduct": "0660", "product": f"Orbbec {HOSTILE}x", "speed": "480"}
    for name, value in {**attributes, "serial": HOSTILE, "busnum": "1", "devnum": "2"}.items():
        (device / name).write_text(value, encoding="utf-8")
    attached_there = functools.partial(list_attached, tmp_path / "devices", tmp_path / "nodes")
    monkeypatch.setattr(enliven_edge.sensors, "list_attached", attached_there)
    assert SHOWN[:-2] in printed("sensors")
