"""Tests that the start of an edge loads only the modules that this run needs."""

import os
import subprocess
import sys

import pytest

from enliven_edge.camera_preview import PRIVACY_NOTE
from enliven_edge.doctor import checks

START = """
import sys
from enliven.cli import run
code = run(["edge", "--seconds", "0.1", "--port", "0", "--name", "start"])
print(code, *sorted(sys.modules), sep="\\n")
"""
UNASKED = {
    "trimesh": "reads mesh files",
    "scipy.linalg": "solves what the edge's kernels solve",
    "scipy.ndimage": "filters the lessons of the estimator",
    "scipy.optimize": "assigns by the edge's own kernel",
    "scipy.sparse": "prepares meshes that are not prepared yet",
    "scipy.spatial": "finds neighbours of what was not made to fit",
    "numba.np.arraymath": "compiles kernels that are not compiled yet",
    "asyncio": "is the health page's",
    "rich.progress": "draws on a terminal",
    "PIL.Image": "reads pictures",
    "enliven_edge.stage.rig.rig_actor": "is a rigged model's",
    "enliven_edge.stage.puppet.puppet_actor": "is a puppet's",
    "enliven.document.project": "is the studio's",
    "enliven_edge.importing.motion_capture": "reads motion captures",
    "enliven_edge.uploaded_actor": "prepares characters that viewers send",
}
"""Modules that a start with the chair must not load, and their purpose."""


@pytest.mark.slow
def test_an_edge_loads_only_what_its_character_needs(tmp_path):
    """If a kiosk's edge fails, the kiosk waits for this start. The first start prepares the character and
    kernels.
    """
    environment = os.environ | {"ENLIVEN_CHARACTERS": str(tmp_path)}
    for _ in range(2):
        shown = subprocess.run(
            [sys.executable, "-c", START], env=environment, capture_output=True, text=True, timeout=600
        )
    code, *loaded = shown.stdout.splitlines()
    assert code == "0", shown.stderr
    assert "enliven_edge.tracking.tracker" in loaded, "it did start"
    assert sorted(UNASKED.keys() & set(loaded)) == []


@pytest.mark.slow
@pytest.mark.parametrize("sends_picture", [True, False])
def test_first_log_lines_say_what_viewers_can_see(tmp_path, sends_picture):
    settings = tmp_path / "edge.toml"
    settings.write_text("" if sends_picture else "[wire]\npicture = false\n")
    options = ["--seconds", "0.1", "--port", "0", "--name", "start", "--settings", str(settings)]
    command = [sys.executable, "-m", "enliven", "edge", *options, "--log-json"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert shown.returncode == 0 and "listens on" in shown.stderr, shown.stderr
    assert (PRIVACY_NOTE in shown.stderr) is sends_picture


def test_the_doctor_says_what_viewers_can_see_and_how_to_turn_it_off():
    (check,) = [check for check in checks() if check.name == "camera preview"]
    assert check.ok and "people can be recognised" in check.detail and "picture = false" in check.detail
