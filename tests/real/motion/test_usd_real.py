"""Tests that every real model is valid USD, and that the USD library skins it as enliven does."""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.document import Project
from enliven.exporters import exporter_of, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip

pytest.importorskip("pxr", reason="usd-core is not installed (the extra 'usd')")

from pxr import Usd
from usd_reader import validation_errors, vertices_at

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
FILES = sorted(
    p for p in (*DATA.glob("gltf/*/*"), *DATA.glob("humanoids/*")) if p.suffix in (".glb", ".gltf", ".vrm")
)
SAME = 2e-6
"""Maximum difference of a vertex as a fraction of the size. The file and the poses are float32."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FILES, reason=f"no real models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_real_model_is_valid_usd_and_moves_alike(path, tmp_path):
    rig = read_gltf(path)
    project, name, end = Project().with_characters(rig.shape), rig.shape.id, 0.0
    if rig.clips:
        project, shape = play_clip(Project(), rig.shape, rig.clips[0])
        name, end = shape.id, min(rig.clips[0].duration, 0.5)
    performance = sample_performance(project, name, 0.0, end, 20.0)
    target = tmp_path / "out.usdc"
    exporter_of(target).save(target, [performance], "out")
    assert validation_errors(target) == []
    stage = Usd.Stage.Open(str(target))
    names = [child.GetName() for child in stage.GetDefaultPrim().GetChildren()]
    (character,) = (own for own in names if own != "Materials")
    surfaces = list(performance.surfaces())
    size = float(np.ptp(performance.mesh.vertices, axis=0).max())
    for frame in {0, len(surfaces) // 2, len(surfaces) - 1}:
        read = vertices_at(target, character, float(frame))
        assert np.abs(read - surfaces[frame]).max() < SAME * size
    own = performance.mesh.materials
    if own is not None and own.textures:
        images = {image.read_bytes() for image in (tmp_path / "out_textures").iterdir()}
        assert {texture.image.tobytes() for texture in own.textures} == images
