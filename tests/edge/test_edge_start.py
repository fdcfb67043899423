"""Tests that an edge's start loads only the modules that this run needs."""

import subprocess
import sys

START = """
import sys
from enliven.cli import run
code = run(["edge", "--seconds", "0.1", "--port", "0", "--name", "start"])
print(code, *sorted(sys.modules), sep="\\n")
"""
UNASKED = {
    "trimesh": "reads mesh files",
    "scipy.optimize": "assigns by the edge's own kernel",
    "scipy.spatial": "finds neighbours of what was not made to fit",
    "scipy.ndimage": "is the lessons'",
    "rich.progress": "draws on a terminal",
    "PIL.Image": "reads pictures",
    "enliven_edge.stage.rig.rig_actor": "is a rigged model's",
    "enliven_edge.stage.puppet.puppet_actor": "is a puppet's",
    "enliven.document.project": "is the studio's",
}
"""Modules that a start with the chair must not load, and their purpose."""


def test_an_edge_loads_only_what_its_character_needs():
    shown = subprocess.run([sys.executable, "-c", START], capture_output=True, text=True, timeout=600)
    code, *loaded = shown.stdout.splitlines()
    assert code == "0", shown.stderr
    assert "enliven_edge.tracking.tracker" in loaded, "it did start"
    assert sorted(UNASKED.keys() & set(loaded)) == []
