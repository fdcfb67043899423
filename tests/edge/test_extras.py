"""Tests of an edge without optional libraries: it runs, or an error names the extra to install."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from enliven.errors import ResourceError
from enliven.meshes.gltf import compression
from enliven_edge.importing.bags import ros1

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "enliven": "shared", "enliven-edge": "edge", "enliven-viewer": "viewer", "enliven-synthesis": "synthesis"
}  # fmt: skip
NAMED = re.compile(r"(enliven(?:-\w+)?|\./\w+)\[([\w, ]+)\]")
"""Matches a package or its folder with extras, such as enliven-edge[oak] or ./edge[oak]."""
HIDDEN = """
import sys
OF_EXTRAS = (
    "DracoPy meshopt lz4 av cv2 depthai hid libusb_package mediapipe mujoco pocketsphinx pxr pyorbbecsdk "
    "pyrealsense2 serial sounddevice"
)
sys.modules.update(dict.fromkeys(OF_EXTRAS.split()))
from enliven.__main__ import main
main()
"""
"""Runs the command line as if no library of an extra were installed."""


def extras(folder: str) -> set[str]:
    project = tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]
    return set(project.get("optional-dependencies", {}))


@pytest.mark.slow
def test_an_edge_records_a_performance_without_any_extra(tmp_path):
    words = ["edge", "--possess-at", "0.3", "--seconds", "0.5", "--speed", "0", "--port", "0"]
    command = [sys.executable, "-c", HIDDEN, *words, "--record", "performance.mcap"]
    done = subprocess.run(command, cwd=tmp_path, env=os.environ, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "performance.mcap").stat().st_size > 10_000


@pytest.mark.parametrize("module", ["DracoPy", "meshopt"])
def test_a_missing_decoder_names_the_extra_and_the_file(monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ResourceError) as refused:
        compression.load_decoder(module, "horse.glb")
    message = str(refused.value)
    assert message.startswith(f"horse.glb: the file is compressed, but the library {module}")
    assert 'pip install "enliven[compressed]"' in message


def test_a_bag_packed_by_lz4_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "lz4", None)
    header = {b"compression": b"lz4", b"size": b"\1\0\0\0"}
    with pytest.raises(ResourceError, match=r"take\.bag: .*lz4.*enliven-edge\[bags\]"):
        ros1.decompress_chunk(header, b"", tmp_path / "take.bag")


def test_every_extra_that_is_named_exists():
    extras_by_package = {name: extras(folder) for name, folder in FOLDERS.items()}
    extras_by_package |= {f"./{folder}": extras(folder) for folder in FOLDERS.values()}
    places = [path for folder in FOLDERS.values() for path in (ROOT / folder).glob("enliven*/**/*.py")]
    places += [
        ROOT / "README.md",
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / folder / "pyproject.toml" for folder in FOLDERS.values()),
    ]
    named = [
        (path.relative_to(ROOT), package, extra.strip())
        for path in places
        for package, some in NAMED.findall(path.read_text())
        for extra in some.split(",")
        if package in extras_by_package
    ]
    assert len(named) > 10
    assert not [entry for entry in named if entry[2] not in extras_by_package[entry[1]]]
