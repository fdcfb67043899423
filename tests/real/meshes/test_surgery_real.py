"""Tests of surgery on third-party rigs and animations: cut during a motion, attached elsewhere."""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.document.project import Project
from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip, scale_to_height, weld_shape
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.posed import compute_pose
from enliven.modeling.rigged.posing import drag_joint
from enliven.motion.layers.evaluate import evaluate_pose

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
CHOSEN = ("Fox", "Monster", "CesiumMan", "Horse", "Spider", "Snake", "Wasp")
MODELS = sorted(path for path in (DATA / "gltf").glob("*/*.glb") if path.stem in CHOSEN)
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not MODELS, reason=f"no rigged models in {DATA} (set ENLIVEN_DATA)"),
]


def animated(path):
    """Returns a project with the model and its first animation."""
    rig = read_gltf(path)
    rig = scale_to_height(rig, 1.7)
    project, shape = play_clip(Project(), weld_shape(rig.shape), rig.clips[0])
    return project, shape, rig.clips[0].duration


def apart(a, b):
    """Returns the angles between quaternions (..., 4), radians."""
    distance = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return float(4 * np.arcsin(np.minimum(distance / 2, 1)).max())


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_limbs_of_a_moving_model_are_cut_off_and_put_on_elsewhere(path):
    project, shape, duration = animated(path)
    random = np.random.default_rng(len(shape.skeleton))
    cuts = 0
    for j in random.permutation(np.arange(1, len(shape.skeleton))):
        if cuts == 3:
            break
        time = float(random.uniform(0, duration))
        turns, joints = compute_pose(project, shape, time)
        here = {n: (q, x) for n, q, x in zip(shape.skeleton.names, turns, joints, strict=True)}
        try:
            cut, (upper, lower) = cut_bone(project, shape.id, int(j), 0.5, time)
        except InputError as refusal:
            assert "no part of the mesh surrounds the bone" in str(refusal)
            continue
        cuts += 1
        for part in (upper, lower):
            names = cut.shape(part).skeleton.names
            for name, turn, joint in zip(names, *compute_pose(cut, cut.shape(part), time), strict=True):
                if name in here:
                    assert apart(turn, here[name][0]) < 1e-9
                    np.testing.assert_allclose(joint, here[name][1], atol=1e-9)
        onto = int(random.integers(0, len(cut.shape(upper).skeleton)))
        spot = compute_pose(cut, cut.shape(upper), time)[1][onto]
        moved = drag_joint(cut, lower, 0, spot, time)
        seen = compute_pose(moved, moved.shape(lower), time)[1]
        merged, names = merge(moved, upper, onto, lower, time, loose=True)
        now = compute_pose(merged, merged.shape(upper), time)[1]
        for old, new in names.items():
            i, k = moved.shape(lower).skeleton.index(old), merged.shape(upper).skeleton.index(new)
            np.testing.assert_allclose(now[k], seen[i], atol=1e-9)
        skin = merged.shape(upper).skin
        np.testing.assert_allclose(skin.weights.sum(1), 1, atol=1e-5)
    assert cuts == 3


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_nodes_of_a_moving_model_come_and_go(path):
    project, shape, duration = animated(path)
    edited = project
    for bone in shape.skeleton.names[1:8]:
        edited, name = insert_node(edited, shape.id, bone, 0.4)
        edited = remove_node(edited, shape.id, name)
    for time in np.linspace(0, duration, 5):
        before, after = evaluate_pose(project, shape.id, time), evaluate_pose(edited, shape.id, time)
        assert apart(before.turns, after.turns) < 1e-9
        np.testing.assert_allclose(after.joints, before.joints, atol=1e-9)
    np.testing.assert_array_equal(
        np.sort(edited.shape(shape.id).skin.weights, 1), np.sort(shape.skin.weights, 1)
    )
