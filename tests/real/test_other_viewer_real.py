"""Tests that real models with their first animation look the same in enliven, in three.js, and after
export.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from three_viewer import MISSING_REASON
from web_pictures import compare

from enliven.cli import run
from enliven.document import Project, character_of
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.motion import frame_times
from enliven.motion.layers.evaluate import Player

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
PICTURES = Path(__file__).parents[2] / "out" / "web" / "pictures"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(bool(MISSING_REASON), reason=MISSING_REASON or "all is here"),
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
MODELS = {
    "gltf/khronos/CesiumMan.glb": 20.0,
    "gltf/khronos/Monster.glb": 6.0,
    "gltf/quaternius/Manta_ray.glb": 6.0,
    "humanoids/mixamo_xbot.glb": 6.0,
}
"""Maximum difference of a region's mean colour, 0..255. Each viewer smooths fine stripes differently, for
example on CesiumMan.
"""
LEAST = 0.97
"""Minimum intersection over union of the silhouettes, which fill a tenth of 256 x 256 pixels. An outline that
is a quarter of a pixel off costs 2 %.
"""


@pytest.mark.parametrize("name", list(MODELS))
def test_both_viewers_show_the_same(name: str, tmp_path: Path) -> None:
    path, out = DATA / name, tmp_path / "out.glb"
    rig = read_gltf(path)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    assert run(["export", str(path), "-o", str(out), "-c", rig.clips[0].id]) == 0
    player, times = Player(project, shape.id), rig.clips[0].duration * np.array([0.0, 0.37, 0.8])
    begin = frame_times(GltfFile(path), 0)[0]
    poses = [player.compute_message_pose(second) for second in times]
    files = [(out.read_bytes(), times.tolist())]
    if len(rig.clips) == 1:  # three.js plays all animations of a file together
        files.append((path.read_bytes(), (times + begin).tolist()))
    compared, picture = compare(character_of(shape), poses, files, tmp_path / "browser")
    PICTURES.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(PICTURES / f"{path.stem}.png")
    for comparison in [comparison for row in compared for comparison in row]:
        assert comparison.overlap > LEAST
        assert len(comparison.colours) > 3 and comparison.colours.max() < MODELS[name]
