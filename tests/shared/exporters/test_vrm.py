"""Tests of VRM avatars and animations: they are valid, in the T-pose, and move as the humanoid does."""

import numpy as np
import pytest
from made_bodies import horse, random_motion, rotate_skeleton, shape_with_markers
from made_people import CONVENTIONS, convention_name, person
from slow_gltf import SlowGltf
from strict_gltf import checked_glb
from vrm_reader import chunks, human_nodes, world_matrices

from enliven.cli import run
from enliven.document import Project
from enliven.errors import InputError
from enliven.exporters import exporter_of, performance_of_clip, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip

REQUIRED = {
    *("hips", "spine", "head"),
    *(f"{side}{bone}" for side in ("left", "right") for bone in ("UpperArm", "LowerArm", "Hand")),
    *(f"{side}{bone}" for side in ("left", "right") for bone in ("UpperLeg", "LowerLeg", "Foot")),
}
"""The bones without which VRM 1.0 refuses a model."""
LIMBS = {
    "UpperArm": ("shoulder", "elbow", "LowerArm"),
    "LowerArm": ("elbow", "wrist", "Hand"),
    "UpperLeg": ("hip", "knee", "LowerLeg"),
    "LowerLeg": ("knee", "ankle", "Foot"),
}
ANGLES = (0.0, 1.0, np.pi)


def written(path, performance):
    exporter_of(path).save(path, [performance], "walk")
    data = path.read_bytes()
    checked_glb(data)
    return data


def straight(limb, side):
    """Returns the direction of a limb in the T-pose."""
    return np.array([0.0, -1, 0]) if "Leg" in limb else np.array([1.0, 0, 0]) * (1 if side == "left" else -1)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_limbs_of_an_animation_point_as_those_of_the_performer(tmp_path, convention, angle):
    skeleton = rotate_skeleton(person(convention), angle)
    clip = random_motion(np.random.default_rng(2), skeleton, frames=5, name="walk")
    performance = performance_of_clip(clip)
    data = written(tmp_path / "walk.vrma", performance)
    nodes = human_nodes(chunks(data)[0], "VRMC_vrm_animation")
    assert set(nodes) >= REQUIRED
    rest = world_matrices(data)
    np.testing.assert_allclose(rest[:, :3, :3], np.tile(np.eye(3), (len(rest), 1, 1)), atol=1e-6)
    joints = {
        (side, joint): skeleton.index(convention_name(convention, f"{side.title()} {joint}"))
        for side in ("left", "right")
        for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    }
    for side in ("left", "right"):
        for limb, (start, end, below) in LIMBS.items():
            along = rest[nodes[f"{side}{below}"], :3, 3] - rest[nodes[f"{side}{limb}"], :3, 3]
            length = np.linalg.norm(along)
            np.testing.assert_allclose(along, straight(limb, side) * length, atol=1e-5)
            for key in (0, 2, 4):
                at = performance.joints[key]
                way = at[joints[side, end]] - at[joints[side, start]]
                turned = world_matrices(data, key)[nodes[f"{side}{limb}"], :3, :3] @ straight(limb, side)
                np.testing.assert_allclose(turned, way / np.linalg.norm(way), atol=1e-4)
    for key in (0, 4):
        hips = world_matrices(data, key)[nodes["hips"], :3, 3]
        hip_joint = performance.joints[key, skeleton.index(convention_name(convention, "hips"))]
        np.testing.assert_allclose(hips, hip_joint, atol=1e-5)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_front_of_the_rest_pose_is_that_of_the_animation(tmp_path, angle):
    skeleton = rotate_skeleton(person("mixamo"), angle)
    clip = random_motion(np.random.default_rng(2), skeleton, frames=3, size=0.0, name="still")
    data = written(tmp_path / "still.vrma", performance_of_clip(clip))
    hips = human_nodes(chunks(data)[0], "VRMC_vrm_animation")["hips"]
    front = world_matrices(data, 0)[hips, :3, :3] @ [0, 0, 1]
    turns = performance_of_clip(clip).linear[0, 0] @ [np.sin(angle), 0, np.cos(angle)]
    np.testing.assert_allclose(front, turns, atol=1e-2)


@pytest.mark.parametrize("angle", ANGLES)
def test_avatar_stands_in_the_t_pose_with_the_skin_of_the_model(tmp_path, angle):
    shape = shape_with_markers("man", rotate_skeleton(person("vrm"), angle))
    project, _ = play_clip(
        Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk")
    )
    data = written(tmp_path / "man.vrm", sample_performance(project, "man", rate=10.0))
    document = chunks(data)[0]
    assert "animations" not in document and document["extensionsUsed"] == ["VRMC_vrm"]
    extension = document["extensions"]["VRMC_vrm"]
    assert extension["specVersion"] == "1.0" and extension["meta"]["name"] == "walk"
    assert extension["meta"]["authors"] == ["unknown"] and extension["meta"]["licenseUrl"]
    nodes, rest = human_nodes(document, "VRMC_vrm"), world_matrices(data)
    assert set(nodes) >= REQUIRED and len(set(nodes.values())) == len(nodes)
    for side in ("left", "right"):
        for limb, (_, _, below) in LIMBS.items():
            along = rest[nodes[f"{side}{below}"], :3, 3] - rest[nodes[f"{side}{limb}"], :3, 3]
            np.testing.assert_allclose(
                along, straight(limb, side) * np.linalg.norm(along), atol=1e-5 * np.ptp(rest[:, :3, 3])
            )
    # Each vertex follows the joints at the upper ends of its bones, as in enliven.
    skin, upper = shape.skin, np.maximum(shape.skeleton.parents, 0)
    expected = np.zeros_like(shape.mesh.vertices)
    for slot in range(4):
        joint = upper[skin.indices[:, slot]]
        away = shape.mesh.vertices - shape.skeleton.positions[joint]
        moved = np.einsum("vab,vb->va", rest[joint, :3, :3], away) + rest[joint, :3, 3]
        expected += skin.weights[:, slot, None] * moved
    seen = SlowGltf(tmp_path / "man.vrm").vertices_at(None, 0.0)
    np.testing.assert_allclose(seen, expected, atol=1e-5)
    again = read_gltf(tmp_path / "man.vrm").shape
    assert len(again.mesh.faces) == len(shape.mesh.faces)


@pytest.mark.parametrize("kind", ["vrm", "vrma"])
def test_no_humanoid_is_refused_with_the_reason(tmp_path, kind):
    path = tmp_path / f"out.{kind}"
    animal = sample_performance(Project().with_characters(shape_with_markers("horse", horse())), "horse")
    with pytest.raises(InputError, match=r"character 'horse'.*not a humanoid.*Export a \.glb file instead"):
        exporter_of(path).save(path, [animal], "horse")
    human = sample_performance(Project().with_characters(shape_with_markers("man", person("mixamo"))), "man")
    with pytest.raises(InputError, match="only one character, but 2"):
        exporter_of(path).save(path, [human, human], "two")
    for options in ({"up": "z"}, {"unit": "cm"}):
        with pytest.raises(InputError, match="does not support the option '"):
            exporter_of(path, **options)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_avatar_and_animation(tmp_path, capsys):
    source, shape = tmp_path / "man.glb", shape_with_markers("man", person("mixamo"))
    project, _ = play_clip(
        Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk")
    )
    exporter_of(source).save(source, [sample_performance(project, "man", rate=10.0)], "man")
    assert run(["export", str(source), "-o", str(tmp_path / "man.vrma"), "--in-place"]) == 0
    assert run(["export", str(source), "-o", str(tmp_path / "man.vrm")]) == 0
    assert capsys.readouterr().out.count("contains 0.70 s of motion of man") == 2
