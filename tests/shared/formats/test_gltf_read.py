"""Tests that rigged glTF becomes a shape that moves like glTF's own skinning, and that unsupported motion is
reported.
"""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pygltflib
import pytest
from gltf_builder import GltfBuilder, random_rig, trs
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from slow_gltf import SlowGltf

from enliven.deformation.skinning import skin_vertices
from enliven.document.project import Project
from enliven.document.rigged import character_of
from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes import load_mesh
from enliven.meshes.gltf.parts import find_strongest_influences
from enliven.motion.layers.evaluate import Player


def vertices_of(rig, clip, frame):
    """Returns (V, 3) the model at a frame of a clip, by our own evaluation and skinning."""
    project, shape = play_clip(Project(), rig.shape, clip)
    return skin_vertices(
        character_of(shape), Player(project, shape.id).compute_message_pose(frame * clip.step)
    )


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000))
def test_rotating_rig_moves_like_reference_skinning(tmp_path_factory, seed):
    path = random_rig(seed, tmp_path_factory.mktemp("rig") / "odd.gltf")
    rig, slow = read_gltf(path), SlowGltf(path)
    (clip,) = rig.clips
    size = np.ptp(rig.shape.mesh.vertices, axis=0).max()
    assert clip.duration == pytest.approx(0.75)
    for frame in (0, len(clip.turns) // 2, len(clip.turns) - 1):
        expected = slow.vertices_at(0, frame * clip.step)
        assert np.abs(vertices_of(rig, clip, frame) - expected).max() < 1e-4 * size
    assert not [note for note in rig.notes if "move" in note or "stretch" in note]


def two_joints(**child) -> GltfBuilder:
    """Returns a root and a child a metre above it, with one triangle each."""
    gltf = GltfBuilder()
    root = gltf.node(name="root")
    end = gltf.node(root, name="child", translation=[0, 1, 0], **child)
    inverse = np.stack([np.eye(4), trs([0, -1, 0], [0, 0, 0, 1])]).transpose(0, 2, 1).reshape(-1, 16)
    skin = {"joints": [root, end], "inverseBindMatrices": gltf.accessor(inverse.astype(np.float32))}
    gltf.add("skins", skin)
    points = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.5, 0], [0, 1, 0], [0.2, 1, 0], [0, 1.5, 0]], np.float32)
    joints = np.zeros((6, 4), np.uint8)
    joints[3:, 0] = 1
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (6, 1))
    attributes = {
        "POSITION": gltf.accessor(points),
        "JOINTS_0": gltf.accessor(joints),
        "WEIGHTS_0": gltf.accessor(weights),
    }
    gltf.node(mesh=gltf.add("meshes", {"primitives": [{"attributes": attributes}]}), skin=0)
    return gltf


def animated(made: GltfBuilder, node: int, path: str, values) -> None:
    times = made.accessor(np.array([0.0, 1.0], np.float32))
    sampler = {"input": times, "output": made.accessor(np.array(values, np.float32))}
    animation = made.json.setdefault("animations", [{"channels": [], "samplers": []}])[0]
    animation["samplers"].append(sampler)
    animation["channels"].append(
        {"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}}
    )


def test_bones_of_a_simple_rig(tmp_path):
    skeleton = read_gltf(two_joints().write(tmp_path / "two.gltf")).shape.skeleton
    assert skeleton.names == ("root", "child", "child end")
    np.testing.assert_allclose(skeleton.positions, [[0, 0, 0], [0, 1, 0], [0.1, 1.5, 0]], atol=0.1)
    skin = read_gltf(tmp_path / "two.gltf").shape.skin
    # The root's vertices follow the whole body's rotation, the child's the bone that begins at the child.
    assert skin.indices[:, 0].tolist() == [0, 0, 0, 2, 2, 2]


def test_a_joint_that_is_moved_or_grown_is_so_in_its_clip(tmp_path):
    gltf = two_joints()
    animated(gltf, 1, "translation", [[0, 1, 0], [0, 1.5, 0]])
    rig = read_gltf(gltf.write(tmp_path / "moved.gltf"))
    (clip,) = rig.clips
    assert rig.notes == () and clip.strains is None
    np.testing.assert_allclose(clip.offsets[-1], [[0, 0, 0], [0, 0.5, 0], [0, 0, 0]], atol=1e-6)
    gltf = two_joints()
    animated(gltf, 1, "scale", [[1, 1, 1], [1, 2, 1]])
    rig = read_gltf(gltf.write(tmp_path / "grown.gltf"))
    (clip,) = rig.clips
    assert rig.notes == () and clip.offsets is None
    np.testing.assert_allclose(clip.strains[-1, 2], [0, np.log(2.0), 0, 0, 0, 0], atol=1e-6)


def test_a_size_that_never_changes_belongs_to_the_rest_pose(tmp_path):
    gltf = two_joints(scale=[0.5, 0.5, 0.5])
    animated(gltf, 1, "rotation", [[0, 0, 0, 1], [0, 0, np.sin(0.4), np.cos(0.4)]])
    rig, slow = read_gltf(gltf.write(tmp_path / "small.gltf")), SlowGltf(tmp_path / "small.gltf")
    assert rig.notes == ()
    np.testing.assert_allclose(rig.shape.mesh.vertices, slow.vertices_at(None, 0.0), atol=1e-6)
    (clip,) = rig.clips
    for frame in (0, 11, len(clip.turns) - 1):
        expected = slow.vertices_at(0, frame * clip.step)
        assert np.abs(vertices_of(rig, clip, frame) - expected).max() < 1e-5


def test_a_foot_under_a_controller_hangs_on_the_shin(tmp_path):
    """Baked inverse kinematics leaves this: the foot is parented to the ground, and moved to the shin's
    end.
    """
    gltf = GltfBuilder()
    ground = gltf.node(name="ground")
    hip = gltf.node(ground, name="hip", translation=[0, 2, 0])
    shin = gltf.node(hip, name="shin", translation=[0, -1, 0])
    foot = gltf.node(ground, name="foot")
    pole = gltf.node(ground, name="pole", translation=[0, 1, 5])
    places = [[0, 2, 0], [0, 1, 0], [0, 0, 0], [0, 1, 5]]
    inverse = np.stack([trs([-x for x in p], [0, 0, 0, 1]) for p in places]).transpose(0, 2, 1)
    skin = {
        "joints": [hip, shin, foot, pole],
        "inverseBindMatrices": gltf.accessor(inverse.reshape(-1, 16).astype(np.float32)),
    }
    gltf.add("skins", skin)
    points = np.concatenate(
        [
            np.array([[0, 0, 0], [0.1, 0, 0], [0, -0.9 if k < 2 else 0, 0.3]]) + p
            for k, p in enumerate(places[:3])
        ]
    )
    joints = np.zeros((9, 4), np.uint8)
    joints[:, 0] = np.repeat([0, 1, 2], 3)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (9, 1))
    attributes = {
        "POSITION": gltf.accessor(points.astype(np.float32)),
        "JOINTS_0": gltf.accessor(joints),
        "WEIGHTS_0": gltf.accessor(weights),
    }
    gltf.node(mesh=gltf.add("meshes", {"primitives": [{"attributes": attributes}]}), skin=0)
    half = [np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)]
    animated(gltf, hip, "rotation", [[0, 0, 0, 1], half])
    steps = np.linspace(0, np.pi / 4, 9)
    times = gltf.accessor(np.linspace(0, 1, 9).astype(np.float32))
    path = np.stack([np.zeros(9), 2 - 2 * np.cos(steps), -2 * np.sin(steps)], 1).astype(np.float32)
    animation = gltf.json["animations"][0]
    animation["samplers"].append({"input": times, "output": gltf.accessor(path)})
    animation["channels"].append({"sampler": 1, "target": {"node": foot, "path": "translation"}})
    rig = read_gltf(gltf.write(tmp_path / "leg.gltf"))
    skeleton = rig.shape.skeleton
    assert skeleton.names == ("hip", "shin", "foot", "foot end")
    assert "joints were attached to the joints that they follow: foot on shin" in rig.notes
    slow = SlowGltf(tmp_path / "leg.gltf")
    (clip,) = rig.clips
    for frame in range(0, len(clip.turns), 3):
        expected = slow.vertices_at(0, frame * clip.step)
        assert np.abs(vertices_of(rig, clip, frame) - expected).max() < 1e-4 * 3


def test_joints_at_one_place_are_one_and_their_limbs_turn_apart(tmp_path):
    gltf = GltfBuilder()
    hips = gltf.node(name="hips")
    legs = [gltf.node(hips, name=f"hips to {side}") for side in ("left", "right")]
    feet = [gltf.node(legs[k], name=f"foot {k}", translation=[0.3 - 0.6 * k, -1, 0]) for k in (0, 1)]
    nodes = [hips, *legs, *feet]
    places = [[0, 0, 0]] * 3 + [[0.3, -1, 0], [-0.3, -1, 0]]
    inverse = np.stack([trs([-x for x in p], [0, 0, 0, 1]) for p in places]).transpose(0, 2, 1)
    gltf.add(
        "skins",
        {"joints": nodes, "inverseBindMatrices": gltf.accessor(inverse.reshape(-1, 16).astype(np.float32))},
    )
    points = np.concatenate([np.array([[0, 0, 0], [0.1, 0, 0], [0, -0.1, 0.1]]) + p for p in places])
    joints = np.zeros((15, 4), np.uint8)
    joints[:, 0] = np.repeat(np.arange(5), 3)
    attributes = {
        "POSITION": gltf.accessor(points.astype(np.float32)),
        "JOINTS_0": gltf.accessor(joints),
        "WEIGHTS_0": gltf.accessor(np.tile(np.array([1, 0, 0, 0], np.float32), (15, 1))),
    }
    gltf.node(mesh=gltf.add("meshes", {"primitives": [{"attributes": attributes}]}), skin=0)
    for k, leg in enumerate(legs):
        animated(gltf, leg, "rotation", [[0, 0, 0, 1], [np.sin(0.3 + k), 0, 0, np.cos(0.3 + k)]])
    rig = read_gltf(gltf.write(tmp_path / "hips.gltf"))
    assert rig.shape.skeleton.names == ("hips", "foot 0", "foot 0 end", "foot 1", "foot 1 end")
    slow, (clip,) = SlowGltf(tmp_path / "hips.gltf"), rig.clips
    expected = slow.vertices_at(0, clip.duration)
    assert np.abs(vertices_of(rig, clip, len(clip.turns) - 1) - expected).max() < 1e-5


def test_colours_come_from_factor_texture_and_vertex(tmp_path):
    gltf = two_joints()
    picture = io.BytesIO()
    Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8)).save(picture, "PNG")
    gltf.add("images", {"bufferView": gltf.view(picture.getvalue()), "mimeType": "image/png"})
    gltf.add("textures", {"source": 0})
    pbr = {"baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": {"index": 0}}
    gltf.add("materials", {"pbrMetallicRoughness": pbr})
    primitive = gltf.json["meshes"][0]["primitives"][0]
    uv = np.array([[0.1, 0.5]] * 3 + [[0.9, 0.5]] * 3, np.float32)
    colours = np.full((6, 4), 65535, np.uint16)
    colours[5] = 0
    primitive["attributes"] |= {
        "TEXCOORD_0": gltf.accessor(uv),
        "COLOR_0": gltf.accessor(colours, normalized=True),
    }
    primitive["material"] = 0
    mesh = read_gltf(gltf.write(tmp_path / "coloured.gltf")).shape.mesh
    # Half as much light equals sRGB 188.
    assert mesh.colours.tolist() == [[188, 0, 0]] * 3 + [[0, 255, 0]] * 2 + [[0, 0, 0]]


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 8))
def test_the_four_largest_weights_are_kept(seed, width):
    random = np.random.default_rng(seed)
    joints, weights = random.integers(0, 6, (5, width)), random.uniform(0, 1, (5, width))
    four, shares = find_strongest_influences(joints, weights)
    assert np.allclose(shares.sum(1), 1)
    for v in range(5):
        total: dict[int, float] = {}
        for j, w in zip(joints[v], weights[v], strict=True):
            total[int(j)] = total.get(int(j), 0.0) + w
        best = sorted(total.values(), reverse=True)[:4]
        np.testing.assert_allclose(sorted(shares[v], reverse=True)[: len(best)], np.array(best) / sum(best))
        for j, share in zip(four[v], shares[v], strict=True):
            assert share == 0 or share == pytest.approx(total[int(j)] / sum(best))


def test_a_model_without_a_rig_gets_one_bone(tmp_path):
    gltf = two_joints()
    del gltf.json["skins"], gltf.json["nodes"][2]["skin"]
    rig = read_gltf(gltf.write(tmp_path / "still.gltf"), height=3.0, floor=True)
    np.testing.assert_allclose(rig.shape.skeleton.positions[:, 1], [0, 3])
    assert rig.notes == ("the model has no rig, so one bone from its bottom to its top was added",)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda d: d.update(extensionsRequired=["ACME_wobble"]), "unsupported glTF extensions: ACME_wobble"),
        (lambda d: d["meshes"][0]["primitives"][0].update(mode=1), "no triangle"),
        (lambda d: d["nodes"][0].update(children=[0]), "has the child 0"),
        (lambda d: d["bufferViews"][1].update(byteLength=10**6), "truncated or damaged"),
        (lambda d: d["accessors"][1].update(count=10**6), "beyond the end of its buffer"),
        (lambda d: d["nodes"][2].update(mesh=7), "the mesh 7, which does not exist"),
        (lambda d: d["skins"][0].update(joints=[0]), "refers to joint 1, but the skin has only 1 joints"),
        (lambda d: d["asset"].update(version="1.0"), "cannot be read as glTF 2"),
    ],
)
def test_invalid_file_is_reported(tmp_path, spoil, words):
    gltf = two_joints()
    path = gltf.write(tmp_path / "wrong.gltf")
    document = json.loads(path.read_text())
    spoil(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=words) as caught:
        read_gltf(path)
    assert str(path) in caught.value.where


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="the file does not exist"):
        read_gltf(tmp_path / "none.glb")
    with pytest.raises(InputError, match="not a glTF file"):
        (tmp_path / "a.txt").write_text("x")
        read_gltf(tmp_path / "a.txt")
    (tmp_path / "cut.glb").write_bytes(b"glTF" + struct.pack("<II", 2, 1000) + b"\0" * 20)
    with pytest.raises(InputError, match="cannot be read as glTF 2"):
        read_gltf(tmp_path / "cut.glb")


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_a_damaged_file_is_read_or_refused_and_never_worse(tmp_path_factory, seed):
    random, folder = np.random.default_rng(seed), tmp_path_factory.mktemp("damaged")
    data = bytearray(random_rig(seed % 3, folder / "whole.gltf", joints=4).read_bytes())
    end = data.index(b'"buffers"') if seed % 2 else len(data)
    for at in random.integers(0, end, 3):
        digit = chr(data[at]).isdigit()
        data[at] = ord(str(random.integers(10))) if digit else data[at] ^ (1 << int(random.integers(8)))
    (folder / "damaged.gltf").write_bytes(bytes(data))
    try:
        rig = read_gltf(folder / "damaged.gltf")
    except InputError as error:
        assert "damaged.gltf" in error.where or "shape" in error.where or "clip" in error.where
        return
    assert np.isfinite(rig.shape.skeleton.positions).all()


@pytest.mark.parametrize("version", [0, 1])
def test_a_vrm_names_its_human_bones(tmp_path, version):
    """Damaged entries of the bone map are left out."""
    plain = two_joints().write(tmp_path / "plain.gltf")
    document = json.loads(plain.read_text())
    table = {"hips": 0, "leftUpperArm": 1, "rightHand": 10_000, "leftHand": "x"}
    if version:
        humanoid = {"humanBones": {bone: {"node": node} for bone, node in table.items()}}
        document["extensions"] = {"VRMC_vrm": {"humanoid": humanoid}}
    else:
        entries = [{"bone": bone, "node": node} for bone, node in table.items()]
        document["extensions"] = {"VRM": {"humanoid": {"humanBones": [*entries, 7]}}}
    avatar = tmp_path / "avatar.vrm"
    avatar.write_text(json.dumps(document))
    assert read_gltf(plain).shape.skeleton.names[:2] == ("root", "child")
    assert read_gltf(avatar).shape.skeleton.names[:2] == ("hips", "leftUpperArm")
    packed = tmp_path / "packed.vrm"
    pygltflib.GLTF2().load(str(plain)).save_binary(str(tmp_path / "packed.glb"))
    (tmp_path / "packed.glb").rename(packed)
    np.testing.assert_array_equal(load_mesh(packed).mesh.faces, load_mesh(plain).mesh.faces)
