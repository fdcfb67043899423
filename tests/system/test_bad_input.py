"""Tests that unusable input gives a one-line error and an exit code, never a traceback or a hang.

One file of each kind is given to a real process, which also covers its start and end. The others use the same
command line within this process, which takes a tenth of the time.
"""

import logging
import os
import socket
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from enliven import cli
from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.recording import Recorder

pytestmark = pytest.mark.system


AS_PROCESS = {"foreign.obj", "foreign.mcap"}
"""Files that are tested in a separate process."""


@dataclass
class CommandResult:
    """The exit code of a command line, and its standard error."""

    returncode: int
    stderr: str


def started(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "enliven", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=150)


@pytest.fixture
def enliven(capsys, caplog):
    """Returns a function that runs a command line in this process."""

    def run(*arguments: str) -> CommandResult:
        with caplog.at_level(logging.INFO):
            code = cli.run(list(arguments))
        return CommandResult(code, capsys.readouterr().err + caplog.text)

    return run


def recorded(path, depth_of, frames=20):
    """Writes a recording with the depth image ``depth_of(number)`` in each frame."""
    with Recorder(path) as recorder:
        for i in range(frames):
            intrinsics = Intrinsics(160, 120, 130, 130, 79.5, 59.5)
            recorder.write_frame(DepthFrame(depth_of(i), intrinsics, i * 33_333_333, "test"))
    return path


OBJ = {
    "empty.obj": "",
    "faceless.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "foreign.obj": "this is a shopping list\nmilk\n",
    "nan.obj": "v nan nan nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat.stl": "solid nothing\nendsolid\n",
}


@pytest.mark.parametrize("name", OBJ)
def test_unusable_mesh_is_reported(tmp_path, name, enliven):
    path = tmp_path / name
    path.write_text(OBJ[name])
    ask = started if name in AS_PROCESS else enliven
    asked = ask("edge", "--mesh", str(path), "--port", "0", "--control-port", "0", "--name", name)
    assert asked.returncode == 3, asked.stderr
    assert name in asked.stderr
    assert "Traceback" not in asked.stderr


@pytest.mark.filterwarnings("ignore::enliven.recording.reader.RecordingWarning")
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("missing.mcap", None),
        ("empty.mcap", b""),
        ("foreign.mcap", b"\x89PNG\r\n" * 40),
        ("cut.mcap", b"\x89MCAP0\r\n"),
    ],
)
def test_unusable_recording_is_reported(tmp_path, name, content, enliven):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    ask = started if name in AS_PROCESS else enliven
    asked = ask("edge", "--recording", str(path), "--port", "0", "--control-port", "0", "--name", name)
    assert asked.returncode == 3, asked.stderr
    assert name in asked.stderr
    assert "Traceback" not in asked.stderr


@pytest.mark.parametrize("value", [0, 65535, 2000])
def test_frames_without_people_are_processed(tmp_path, value, enliven):
    """For depth images of only 0, only 65535, or a wall, the edge runs to the end without attaching a
    character.
    """
    path = recorded(tmp_path / "nobody.mcap", lambda i: np.full((120, 160), value, np.uint16))
    ports = ["--port", "0", "--control-port", "0", "--name", f"nobody-{value}"]
    asked = enliven("edge", "--recording", str(path), "--speed", "0", "--possess-at", "0.1", *ports)
    assert asked.returncode == 0, asked.stderr
    assert "20 frames" in asked.stderr
    assert "Traceback" not in asked.stderr


def test_port_in_use_is_reported(enliven):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        # The edge checks the port before it reads the mesh, so the missing mesh is not reported.
        ports = ["--port", str(port), "--control-port", "0", "--name", "taken"]
        asked = enliven("edge", "--mesh", "none.obj", *ports)
    assert asked.returncode == 4, asked.stderr
    assert f"port {port} is in use" in asked.stderr
    assert "Traceback" not in asked.stderr


@pytest.mark.slow
def test_second_edge_of_a_name_is_refused(tmp_path, enliven):
    path = recorded(tmp_path / "long.mcap", lambda i: np.zeros((120, 160), np.uint16), 900)
    ports = ["--port", "0", "--control-port", "0", "--name", "twin"]
    command = [sys.executable, "-m", "enliven", "edge", "--recording", str(path), *ports]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as first:
        try:
            for line in first.stderr:
                if "listens" in line:
                    break
            second = enliven("edge", "--recording", str(path), "--mesh", "none.obj", *ports)
        finally:
            first.terminate()
    assert second.returncode == 4, second.stderr
    assert "twin" in second.stderr
    assert first.returncode == 0


@pytest.mark.slow
def test_edge_without_a_log_reader_continues_and_ends_well(tmp_path):
    """If the reader of its log disappears, the edge loses only later messages."""
    path = recorded(tmp_path / "short.mcap", lambda i: np.zeros((120, 160), np.uint16), 30)
    ports = ["--port", "0", "--control-port", "0", "--name", "unheard"]
    command = [sys.executable, "-m", "enliven", "edge", "--recording", str(path), *ports]
    # By default, Python keeps unwritten output and tries to write it again at exit.
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=usual) as edge:
        try:
            first_line = next(line for line in edge.stderr if "listens" in line)
            edge.stderr.close()
            assert edge.wait(120) == 0, first_line
        finally:
            edge.kill()


@pytest.mark.slow
def test_viewer_reports_missing_edge(tmp_path, enliven):
    settings = tmp_path / "viewer.toml"
    settings.write_text("[film]\npatience = 1.0\n")
    film = ["--film", str(tmp_path / "a.mp4"), "--settings", str(settings)]
    asked = enliven("view", *film, "--port", "1", "--control-port", "2")
    assert asked.returncode == 4, asked.stderr
    assert "no edge appeared" in asked.stderr
    assert "Traceback" not in asked.stderr


def test_misspelt_setting_is_reported(tmp_path, enliven):
    path = tmp_path / "edge.toml"
    path.write_text("[tracker]\nlost_aftr = 3\n")
    asked = enliven("edge", "--settings", str(path))
    assert asked.returncode == 3
    assert "Did you mean tracker.lost_after" in asked.stderr


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("edge", "--parts", "left foo"), 2, "Did you mean left foot?"),
        (("run", "--parts", "legs / left foo"), 2, "Did you mean left foot?"),
        (("edge", "--record", "moveis/take.mcap"), 4, "Did you mean movies?"),
        (("run", "--film", "--out", "moveis/out"), 4, "Did you mean movies?"),
        (("graph", "chair", "-o", "moveis/chair.png"), 4, "Did you mean movies?"),
        (("view", "--film", "moveis/out.mp4"), 4, "the folder 'moveis' does not exist"),
        (("retarget", "a.bvh", "b.glb", "-o", "out.fbx"), 3, "Known suffixes: .bvh, .csv, .glb"),
        (("retarget", "a.bvh", "b.glb", "-o", "out.glb", "--sheet", "moveis/out.png"), 4, "does not exist"),
        (("examples", "fit", "a.toml", "-o", "moveis/out.mcap"), 4, "does not exist"),
        (("view", "x.glb"), 3, "enliven studio x.glb. Or render a film: enliven export x.glb"),
        (("view", "x.enliven"), 3, "Open the file: enliven studio x.enliven."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_command_line_errors_are_reported_before_any_work(tmp_path, monkeypatch, enliven, words, code, said):
    (tmp_path / "movies").mkdir()
    for name in ("x.glb", "x.enliven"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    result = enliven(*words)
    assert result.returncode == code and said in " ".join(result.stderr.split()), result.stderr
    assert not (tmp_path / "moveis").exists()
