"""Tests of joint limits on real animals with large human motions: calmer surfaces, no jumps."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.formats.gltf.read import read_gltf
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.quality import MAX_INTERSECTION, measure_quality
from enliven.motion.layers.evaluate import Player
from enliven.motion_clips.take_files import read_take

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
PAIRS = [
    ("gltf/quaternius/Manta_ray.glb", "bvh/bandai_namco/dataset-1_bow_normal_001.bvh"),
    ("gltf/quaternius/Horse.glb", "cmu_expmap/train_jumping_1.txt"),
    ("gltf/quaternius/Horse.glb", "bvh/bandai_namco/dataset-1_bow_normal_001.bvh"),
    ("gltf/khronos/Fox.glb", "bvh/bandai_namco/dataset-1_bow_normal_001.bvh"),
    ("gltf/quaternius/Trex.glb", "bvh/bandai_namco/dataset-1_punch_normal_001.bvh"),
]
"""Animals and takes that bend them strongly."""
PEOPLE = sorted(p for p in DATA.glob("humanoids/*") if p.suffix in (".glb", ".vrm"))
PEOPLE += [
    p for p in [DATA / "gltf/khronos/CesiumMan.glb", DATA / "gltf/khronos/BrainStem.glb"] if p.exists()
]
THROUGH_TOLERANCE = 0.001
"""One vertex in a thousand. In the horse's bow, knees are lifted above the floor after the limits, and a few
vertices more touch."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(
        not all((DATA / name).exists() for pair in PAIRS for name in pair),
        reason=f"no real animals in {DATA} (set ENLIVEN_DATA)",
    ),
]


@pytest.mark.parametrize(("model", "take"), PAIRS, ids=lambda name: Path(name).stem)
def test_limits_of_an_animal_calm_its_surface_and_make_no_jumps(model, take):
    rig, clip = read_gltf(DATA / model), read_take(DATA / take, None, 0.0, 4.0)[0]
    plan = create_automatic_plan(clip, rig.shape)
    wild, calm = (
        retarget(rig.shape, clip, replace(plan, limits=on), clips=rig.clips) for on in (False, True)
    )
    assert calm.limited and not wild.limited
    before, after = (measure_quality(m.project, m.shape_id, clip, m.duration, m.plan) for m in (wild, calm))
    assert after.stretch <= before.stretch + 0.005
    assert after.through <= max(before.through + THROUGH_TOLERANCE, MAX_INTERSECTION)
    speeds = []
    for result in (wild, calm):
        turns = Player(result.project, result.shape_id).sample(np.arange(0.0, result.duration, 1 / 60))[0]
        cosines = np.abs(np.sum(turns[1:] * turns[:-1], axis=2)).clip(0.0, 1.0)
        speeds.append(float((2.0 * np.arccos(cosines)).max()))
    assert speeds[1] <= 1.25 * speeds[0]


@pytest.mark.parametrize("path", PEOPLE, ids=lambda p: p.stem)
def test_a_person_moves_the_same_with_limits_and_without(path):
    rig, clip = read_gltf(path), read_take(DATA / PAIRS[-1][1], None, 0.0, 1.5)[0]
    poses = []
    for on in (False, True):
        plan = replace(create_automatic_plan(clip, rig.shape), limits=on)
        result = retarget(rig.shape, clip, plan, clips=rig.clips)
        assert result.limited == ()
        poses.append(Player(result.project, result.shape_id).sample(np.linspace(0.0, 1.4, 15))[0])
    np.testing.assert_array_equal(poses[0], poses[1])
