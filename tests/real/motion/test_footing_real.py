"""Tests of foot locking on real walks: no standing foot slides, and with grounding none sinks."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.ground import compute_posed_surfaces, floor_height_under
from enliven.mapping.quality import measure_quality
from enliven.modeling.edits import lock_feet
from enliven.motion.contact.pin import resolve_pins, unpin
from enliven.motion.layers.evaluate import Player
from enliven.motion_clips.take_files import read_take

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "retargeting"))
from limb_directions import limb_errors
from standing_feet import standing_leg_slides, standing_slides

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
WALKS = (
    "bandai_namco/dataset-1_walk_normal_001.bvh",
    "bandai_namco/dataset-1_run_normal_001.bvh",
    "xia_styles/old_13_000.bvh",
)
MODEL = "gltf/khronos/CesiumMan.glb"
SECONDS = 3.0


@pytest.mark.parametrize("walk", WALKS)
def test_a_real_walk_stands_as_its_clip_says(walk: str) -> None:
    clip, _ = read_take(DATA / "bvh" / walk, None, 0.0, SECONDS)
    shape = read_gltf(DATA / MODEL, height=1.75).shape
    result = retarget(
        shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=False, floor=False)
    )
    project, name, times = (
        unpin(result.project, result.shape_id),
        result.shape_id,
        np.arange(0.0, SECONDS, 1 / 60),
    )
    every = range(len(project.shape(name).layers))
    free = Player(project, name).sample(times)[1]

    never = Player(lock_feet(project, name, every, "never"), name).sample(times)[1]
    np.testing.assert_allclose(never, free, atol=1e-9)

    always = lock_feet(project, name, every, "always")
    player = Player(always, name)
    joints, before, after = player.sample(times)[1], 0.0, 0.0
    for pin in resolve_pins(always.shape(name)):
        ankle = pin.chain[-1]
        contact = player.contacts()[always.shape(name).skeleton.names[ankle]]
        for start, end in zip(contact.starts, contact.ends, strict=True):
            inside = (start <= times) & (end >= times)
            if inside.sum() > 1:
                before = max(before, np.ptp(free[inside][:, ankle][:, [0, 2]], axis=0).max())
                after = max(after, np.ptp(joints[inside][:, ankle][:, [0, 2]], axis=0).max())
    assert before > 0.005, "it slid"
    assert after < 1e-3

    sunk = project.with_characters(project.shape(name).with_changes(place=[0.0, -0.05, 0.0]))
    ground = lock_feet(sunk, name, every, "ground")
    joints = Player(ground, name).sample(times)[1]
    for pin in resolve_pins(ground.shape(name)):
        assert joints[:, pin.below, 1].min() > pin.sole - 1e-5


@pytest.mark.parametrize(("model", "names"), [("mixamo_ely", "mixamo"), ("quaternius_knight", "quaternius")])
def test_feet_of_a_real_runner_that_turn_on_the_spot_do_not_slide(model: str, names: str) -> None:
    """Measured on the written GLB by code that shares nothing with the retargeting."""
    path = DATA / "cmu_expmap" / "train_running_1.txt"
    clip, shape = read_take(path)[0], read_gltf(DATA / "humanoids" / f"{model}.glb").shape
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    speeds = standing_slides(
        path, build_glb([sample_performance(result.project, result.shape_id, 0.0, 1.3, 60.0)]), names
    )
    assert len(speeds) > 20
    assert np.median(speeds) < 2.0 and np.percentile(speeds, 90) < 5.0


def test_a_real_leg_without_foot_does_not_spin_on_its_sole() -> None:
    """The skin of its soles is weighted to the shins, which twist as the performer's shins do."""
    path = DATA / "bvh" / "bandai_namco" / "dataset-1_walk_normal_001.bvh"
    clip, _ = read_take(path, None, 0.0, 2.0)
    shape = read_gltf(DATA / "humanoids" / "quaternius_cyberpunk.glb").shape
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    glb = build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, 30.0)])
    speeds, errors = standing_slides(path, glb, "quaternius"), limb_errors(path, glb, "quaternius")
    assert len(speeds) > 20 and np.median(speeds) < 0.4 and np.percentile(speeds, 90) < 1.0
    assert np.percentile(errors["shin"], 90) < 12.0


@pytest.mark.slow
@pytest.mark.parametrize("model", ["Spider", "Horse", "Deer"])
@pytest.mark.parametrize(
    "take", ["bandai_namco/dataset-1_walk_normal_001.bvh", "bandai_namco/dataset-1_run_normal_001.bvh"]
)
def test_standing_feet_of_a_real_animal_do_not_slide(model: str, take: str) -> None:
    path = DATA / "bvh" / take
    clip, _ = read_take(path, None, 0.0, SECONDS)
    shape = read_gltf(DATA / f"gltf/quaternius/{model}.glb").shape
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    glb = build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, 30.0)])
    slides = standing_leg_slides(path, glb, model)
    assert len(slides) >= 4 and all(len(speeds) >= 5 for speeds in slides.values())
    speeds = np.concatenate(list(slides.values()))
    assert np.median(speeds) < 2.0 and np.percentile(speeds, 90) < 5.0
    quality = measure_quality(result.project, result.shape_id, clip, result.duration)
    assert quality.slide < 5.0 and max(quality.sunk, quality.afloat) < 0.03


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "take"),
    [
        ("khronos/Fox", "cmu_expmap/train_jumping_1.txt"),
        ("quaternius/Deer", "cmu_expmap/train_jumping_1.txt"),
        ("quaternius/Trex", "bvh/cmu_mirrors/01_01.bvh"),
        ("quaternius/Trex", "bvh/bandai_namco/dataset-1_call_normal_001.bvh"),
        ("khronos/Fox", "bvh/bandai_namco/dataset-1_bow_normal_001.bvh"),
        ("quaternius/Spider", "bvh/bandai_namco/dataset-1_bow_normal_001.bvh"),
    ],
)
def test_a_real_animal_that_jumps_or_bows_neither_hovers_nor_slides(model: str, take: str) -> None:
    clip, shape = read_take(DATA / take, None, 0.0, 4.0)[0], read_gltf(DATA / f"gltf/{model}.glb").shape
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    quality = measure_quality(result.project, result.shape_id, clip, result.duration)
    assert quality.slide < 5.0 and max(quality.sunk, quality.afloat) < 0.03


@pytest.mark.parametrize(("model", "names"), [("BrainStem", "brainstem"), ("CesiumMan", "khronos")])
@pytest.mark.parametrize("take", ["cmu_expmap/train_running_1.txt", "bvh/cmu_mirrors/CMU_Sample_05_01.bvh"])
def test_a_real_rig_without_joint_names_moves_as_the_performer(model: str, names: str, take: str) -> None:
    """BrainStem has no wrists: three fingers begin at its left elbow, and one bone at its right elbow."""
    clip, shape = (
        read_take(DATA / take, None, 0.0, SECONDS)[0],
        read_gltf(DATA / f"gltf/khronos/{model}.glb").shape,
    )
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    rate = min(60.0, 1.0 / clip.step)
    glb = build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, rate)])
    errors = limb_errors(DATA / take, glb, names)
    for limb in ("upper arm", "forearm"):
        assert np.median(errors[limb]) < 1.0 and np.percentile(errors[limb], 90) < 2.0
    for limb in ("thigh", "shin"):
        assert np.median(errors[limb]) < 8.0 and np.percentile(errors[limb], 90) < 15.0
    speeds = standing_slides(DATA / take, glb, names)
    assert len(speeds) > 20 and np.median(speeds) < 2.0


@pytest.mark.parametrize(
    ("model", "take"),
    [
        ("quaternius/Spider", "dataset-1_punch_normal_001"),
        ("quaternius/Spider", "dataset-2_wave-both-hands_normal_001"),
        ("quaternius/Deer", "dataset-1_bow_normal_001"),
        ("khronos/Monster", "dataset-1_bow_normal_001"),
    ],
)
def test_an_arm_that_drives_a_foreleg_does_not_lift_the_other_feet(model: str, take: str) -> None:
    clip, _ = read_take(DATA / "bvh" / "bandai_namco" / f"{take}.bvh", None, 0.0, 4.0)
    shape = read_gltf(DATA / "gltf" / f"{model}.glb").shape
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=True, pin=True))
    tall, rest = np.ptp(shape.mesh.vertices[:, 1]), shape.skeleton.positions
    root = Player(result.project, result.shape_id).compute_root(np.linspace(0.0, result.duration, 30))[:, 1]
    assert np.abs(root - rest[0, 1] - shape.place[1]).max() < 0.1 * tall


def test_a_real_weapon_does_not_lift_the_body() -> None:
    """The weapon hangs below the feet while its owner crouches before a jump."""
    clip, _ = read_take(DATA / "cmu_expmap" / "train_jumping_1.txt", None, 0.9, 1.7)
    shape = read_gltf(DATA / "humanoids" / "quaternius_cyberpunk.glb").shape
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    result = retarget(shape, clip, plan)
    assert min(
        at[:, 1].min()
        for at in compute_posed_surfaces(result.project, result.shape_id, np.linspace(0.0, 0.8, 9))
    ) < (floor_height_under(shape) - 0.1)
    quality = measure_quality(result.project, result.shape_id, clip, result.duration, plan)
    assert quality.afloat < 0.01 and quality.slide < 5.0
