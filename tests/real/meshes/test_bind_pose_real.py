"""Tests that on the stage, rigged models that only their nodes rotate or scale stand like their joints."""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.formats.gltf.read import read_gltf
from enliven.meshes import load_upright

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
MODELS = sorted(p for p in DATA.glob("humanoids/*") if p.suffix in (".glb", ".vrm"))

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not MODELS, reason=f"no models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_person_stands_on_the_stage(path):
    own = read_gltf(path).shape.mesh
    mesh = load_upright(path).mesh
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.ptp(own.vertices, axis=0), rtol=0.02)
    assert len(mesh.faces) > 0.99 * len(own.faces)
