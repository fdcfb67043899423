"""Tests that every real model moves by motions of every convention, and that the files are valid."""

import os
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from enliven.document import joint_places
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.mapping.applying import source_anatomy
from enliven.mapping.automatic_mapping import retarget
from enliven.motion.layers.evaluate import Player
from enliven.motion_clips.take_files import read_take
from enliven.skeletons.anatomy import find_anatomy

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "formats"))
from strict_gltf import checked_glb

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
MODELS = sorted(p for p in DATA.glob("gltf/*/*") if p.suffix in (".glb", ".gltf"))
TAKES = sorted([*DATA.glob("bvh/*/*.bvh"), *DATA.glob("cmu_expmap/t*.txt")])
OTHERS = 8
"""Stride through the takes. Each model gets every eighth take, with a different offset."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not (MODELS and TAKES), reason=f"no real models in {DATA} (set ENLIVEN_DATA)"),
]


@cache
def take(path):
    """Returns the start of a take."""
    return read_take(path, None, 0.0, 0.6)[0]


@pytest.mark.parametrize("number", range(len(MODELS)), ids=lambda n: MODELS[n].stem)
def test_a_real_model_moves_by_real_motions(number):
    rig = read_gltf(MODELS[number])
    size = float(np.ptp(rig.shape.mesh.vertices, axis=0).max())
    for path in TAKES[number % OTHERS :: OTHERS]:
        result = retarget(rig.shape, take(path))
        performance = sample_performance(result.project, result.shape_id, 0.0, result.duration, 10.0)
        checked_glb(build_glb([performance]))
        joints = Player(result.project, result.shape_id).sample(performance.times)[1]
        assert np.isfinite(joints).all()
        # It moves, and stays near its initial position.
        assert np.ptp(joints, axis=0).max() > 1e-4 * size, path.stem
        assert np.abs(joints - rig.shape.skeleton.positions).max() < 1.5 * size, path.stem


@pytest.mark.parametrize("path", TAKES, ids=lambda p: p.stem)
def test_a_real_performer_has_two_arms_two_legs_and_a_head(path):
    anatomy = source_anatomy(take(path))
    assert (len(anatomy.arms), len(anatomy.legs)) == (1, 1)
    assert anatomy.head is not None and anatomy.tail is None


@pytest.mark.parametrize(
    ("stem", "legs", "arms", "tail"),
    [
        ("Horse", 2, 0, True), ("Fox", 2, 0, True), ("Spider", 4, 0, True), ("Trex", 1, 1, True),
        ("CesiumMan", 1, 1, False), ("BrainStem", 1, 1, False), ("Manta_ray", 0, 1, True),
        ("platformer_game_pack_Character", 1, 1, False), ("Wasp", 0, 4, True), ("Monster", 2, 0, True),
    ],
)  # fmt: skip
def test_the_parts_of_real_models(stem, legs, arms, tail):
    path = next((p for p in MODELS if p.stem == stem), None)
    if path is None:
        pytest.skip(f"no {stem}")
    anatomy = find_anatomy(read_gltf(path).shape.skeleton)
    assert (len(anatomy.legs), len(anatomy.arms), anatomy.tail is not None) == (legs, arms, tail)


@pytest.mark.parametrize("path", TAKES, ids=lambda p: p.stem)
def test_a_real_take_does_not_jump_at_its_ends(path):
    """Eight takes begin with a T-pose that is not part of the motion."""
    places = joint_places(read_take(path)[0])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).max(1)
    assert max(steps[0], steps[-1]) < 2.0 * steps[1:-1].max()
