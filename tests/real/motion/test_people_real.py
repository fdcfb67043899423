"""Tests of mapping people to people: seven third-party human rigs, with motions of every convention."""

import os
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.mapping.automatic_mapping import create_automatic_plan, list_idle_limbs, retarget
from enliven.mapping.quality import measure_quality
from enliven.motion_clips.take_files import read_take
from enliven.skeletons.anatomy import find_anatomy

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "retargeting"))
from limb_directions import limb_errors

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
MODELS = sorted([*DATA.glob("humanoids/*.glb"), *DATA.glob("humanoids/*.vrm")])
TAKES = sorted([*DATA.glob("bvh/*/*.bvh"), *DATA.glob("cmu_expmap/t*.txt")])
CONVENTIONS = {"mixamo": "mixamo", "cryptovoxels": "cryptovoxels"}
OTHERS = 7
"""Stride through the takes. Each model gets every seventh take, with a different offset."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not (MODELS and TAKES), reason=f"no human rigs in {DATA} (set ENLIVEN_DATA)"),
]


@cache
def take(path):
    """Returns the start of a take."""
    return read_take(path, None, 0.0, 1.5)[0]


@pytest.mark.parametrize("number", range(len(MODELS)), ids=lambda n: MODELS[n].stem)
def test_every_limb_of_the_written_file_points_as_the_performers(number):
    shape = read_gltf(MODELS[number]).shape
    convention = CONVENTIONS.get(MODELS[number].stem.split("_")[0], "quaternius")
    for path in TAKES[number % OTHERS :: OTHERS]:
        clip = take(path)
        result = retarget(shape, clip)
        assert list_idle_limbs(clip, result.plan) == ()
        rate = min(60.0, 1.0 / clip.step)
        glb = build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, rate)])
        for limb, angles in limb_errors(path, glb, convention).items():
            # The pose is exact up to the frame rates of the two files.
            assert np.median(angles) < 2.0 and np.percentile(angles, 90) < 4.0, (path.stem, limb)


@pytest.mark.parametrize(("gait", "slide"), [("walk", 2.5), ("run", 15.0)])
@pytest.mark.parametrize("number", range(len(MODELS)), ids=lambda n: MODELS[n].stem)
def test_a_planted_gait_does_not_slide(number, gait, slide):
    shape = read_gltf(MODELS[number]).shape
    path = next(path for path in TAKES if path.stem == f"dataset-1_{gait}_normal_001")
    clip, _ = read_take(path, None, 0.0, 4.0)
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    quality = measure_quality(result.project, result.shape_id, clip, result.duration, result.plan)
    # Every contact with the floor counts, including the frames in which a runner lands and takes off.
    assert quality.slide < slide
    # With feet at the performer's positions, the legs of a rig with boots of half a leg's length are bent.
    assert max(limb.median for limb in quality.limbs) < 14.0
    assert all("arm" not in limb.limb for limb in quality.worst_limbs)


def test_the_humanoid_map_of_a_vrm_names_its_joints():
    path = next((path for path in MODELS if path.suffix == ".vrm"), None)
    if path is None:
        pytest.skip("no VRM")
    skeleton = read_gltf(path).shape.skeleton
    assert {"hips", "leftUpperArm", "rightLowerLeg", "head"} <= set(skeleton.names)
    anatomy = find_anatomy(skeleton)
    # A VRM 0 model faces -Z.
    assert abs(abs(anatomy.facing) - np.pi) < 0.1
    assert [skeleton.names[j] for j in anatomy.arms[0][0].main] == [
        "leftUpperArm",
        "leftLowerArm",
        "leftHand",
    ]
