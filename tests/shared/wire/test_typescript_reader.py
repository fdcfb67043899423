"""Tests of integrations/web: the reader gets the same numbers as Python, and built files are current."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from enliven.deformation.skinning import skin_vertices
from enliven.wire import PoseCodec, message_to_pose, unpack_stream

HOUSE = Path(__file__).parents[3]
FOLDER = HOUSE / "integrations" / "web"
sys.path.insert(0, str(HOUSE / "scripts"))

import web_vectors  # noqa: E402

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")
needs_packages = pytest.mark.skipif(
    NODE is None or not (FOLDER / "node_modules" / "esbuild").is_dir(),
    reason="the packages are not installed: npm ci in integrations/web",
)


def run_node(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(NODE), *words], cwd=FOLDER, capture_output=True, text=True, timeout=300)


def test_vectors_are_those_of_the_current_wire() -> None:
    stored = json.loads(web_vectors.PATH.read_text())
    built = json.loads(json.dumps(web_vectors.make_vectors()))
    assert stored.keys() == built.keys()
    for old, new in zip(stored["characters"], built["characters"], strict=True):
        assert old["payload"] == new["payload"], "the wire has changed: scripts/web_vectors.py"
        for a, b in zip(old["poses"], new["poses"], strict=True):
            for name in ("linear", "positions", "skinned"):
                np.testing.assert_allclose(a[name], b[name], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("number", range(3))
def test_python_reads_the_stored_vectors(number: int) -> None:
    case = json.loads(web_vectors.PATH.read_text())["characters"][number]
    character, packed = web_vectors.read_vector_poses(case)
    codec = PoseCodec(character)
    for data, expected in zip(packed, case["poses"], strict=True):
        pose = message_to_pose(unpack_stream(data)[1], codec)
        np.testing.assert_allclose(pose.linear.reshape(-1), expected["linear"], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(pose.positions.reshape(-1), expected["positions"], rtol=1e-6, atol=1e-6)
        skinned = skin_vertices(character, pose).reshape(-1)
        np.testing.assert_allclose(skinned, expected["skinned"], rtol=1e-5, atol=1e-5)


@needs_node
def test_reader_gets_the_numbers_of_python() -> None:
    tests = sorted(str(path.relative_to(FOLDER)) for path in (FOLDER / "test").glob("*.test.mjs"))
    result = run_node("--test", *tests)
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-1000:]
    assert "# pass 11" in result.stdout


@needs_packages
def test_built_files_are_current() -> None:
    result = run_node("build.mjs", "--check")
    assert result.returncode == 0, result.stderr


@needs_packages
def test_types_fit() -> None:
    result = run_node("node_modules/typescript/bin/tsc", "--noEmit", "-p", ".")
    assert result.returncode == 0, result.stdout


def test_script_of_the_page_can_be_inside_a_page() -> None:
    from enliven.web_page.page_files import read_page_file

    assert b"</script" not in read_page_file("page.js").lower()
