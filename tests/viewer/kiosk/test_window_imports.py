"""Tests that a kiosk's window loads only the modules for its first image, because visitors wait for it."""

import subprocess
import sys

import pytest

UNUSED = {
    "enliven.document.project": "is the studio's",
    "enliven.formats.project.file": "reads projects",
    "scipy.linalg": "solves what the kernels solve",
    "scipy.ndimage": "filters images",
    "scipy.optimize": "fits",
    "scipy.sparse": "prepares meshes that are not prepared yet",
    "scipy.spatial": "finds neighbours in meshes that are not prepared yet",
    "starlette": "is the server's of souvenirs",
    "trimesh": "reads mesh files",
}
"""Modules that the window must not load at its start, each with its purpose."""
LOAD = "import sys, enliven_viewer.kiosk.window; print(*sys.modules, sep='\\n')"


@pytest.mark.slow
def test_window_loads_no_module_that_its_first_picture_does_not_need() -> None:
    done = subprocess.run([sys.executable, "-c", LOAD], capture_output=True, text=True, timeout=600)
    loaded = set(done.stdout.split())
    assert "enliven_viewer.kiosk.painter" in loaded, done.stderr
    assert sorted(UNUSED.keys() & loaded) == []
