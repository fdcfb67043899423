"""Tests of GLB export: the file is valid, moves as the document does, and gives the same skeleton when
read.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lost_shear import measure_lost_shear
from slow_gltf import SlowGltf
from strict_gltf import checked_glb

from enliven.deformation.skinning import skin_vertices
from enliven.document import graph_shape_from_poses
from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import character_of, still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError, ResourceError
from enliven.exporters import Performance, sample_performance
from enliven.exporters.gltf.write import build_glb, write_gltf
from enliven.exporters.joints import normalize_skin
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes.mesh import Mesh
from enliven.motion.layers.evaluate import Player
from enliven.rotation import multiply, normalized, to_matrix


def random_shape(random, name, joints=8):
    """Returns a tree of joints. Each has a triangle that follows it and other joints."""
    parents = [-1] + [int(random.integers(max(0, j - 3), j)) for j in range(1, joints)]
    at = np.zeros((joints, 3))
    for j in range(1, joints):
        at[j] = at[parents[j]] + normalized(np.r_[0.0, random.normal(size=3)])[1:] * random.uniform(0.3, 1)
    at += random.normal(size=3)
    skeleton = Skeleton(tuple(f"{name} {j}" for j in range(joints)), np.array(parents), at)
    vertices = np.repeat(at, 3, 0) + random.normal(size=(3 * joints, 3)) * 0.1
    mesh = Mesh(vertices, np.arange(3 * joints, dtype=np.int32).reshape(-1, 3), name)
    indices = random.integers(0, joints, (3 * joints, 4)).astype(np.uint16)
    indices[::3, 0] = np.arange(joints)  # the reader omits joints that no vertex follows
    weights = random.uniform(0, 1, (3 * joints, 4))
    weights[::3, 1:] = 0.0
    weights = (weights / weights.sum(1, keepdims=True)).astype(np.float32)
    colours = random.integers(0, 256, (3 * joints, 3)).astype(np.uint8)
    mesh = Mesh(mesh.vertices, mesh.faces, name, colours)
    return still_shape(name, skeleton, mesh, SkinWeights(indices, weights))


def random_clip(random, skeleton, frames=9):
    turns = np.empty((frames, len(skeleton), 4))
    turns[0] = normalized(random.normal(size=(len(skeleton), 4)))
    for f in range(1, frames):
        turns[f] = multiply(
            turns[f - 1], normalized([1, 0, 0, 0] + 0.2 * random.normal(size=(len(skeleton), 4)))
        )
    root = skeleton.positions[0] + random.normal(size=(frames, 3))
    return Clip("clip", skeleton, turns, root, 0.1)


def vertices_of(project, shape_id, time):
    character = character_of(project.shape(shape_id))
    return skin_vertices(character, Player(project, shape_id).compute_message_pose(time))


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000))
def test_written_glb_is_valid_and_moves_alike(tmp_path_factory, seed):
    random = np.random.default_rng(seed)
    shape = random_shape(random, "squid")
    project, shape = play_clip(Project(), shape, random_clip(random, shape.skeleton))
    path = tmp_path_factory.mktemp("glb") / "squid.glb"
    performance = sample_performance(project, "squid", rate=20.0)
    write_gltf(path, [performance])
    checked_glb(path.read_bytes())
    slow = SlowGltf(path)
    for frame in (0, 7, len(performance.times) - 1):
        time = performance.times[frame]
        here = vertices_of(project, "squid", time)
        assert np.abs(slow.vertices_at(0, float(np.float32(time))) - here).max() < 1e-5


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000))
def test_the_same_skeleton_is_read_again(tmp_path_factory, seed):
    random = np.random.default_rng(seed)
    shape = random_shape(random, "squid")
    path = tmp_path_factory.mktemp("glb") / "squid.glb"
    project, _ = play_clip(Project(), shape, random_clip(random, shape.skeleton))
    write_gltf(path, [sample_performance(project, "squid", rate=20.0)])
    rig = read_gltf(path)
    order = [rig.shape.skeleton.index(name) for name in shape.skeleton.names]
    parents = [-1 if p < 0 else order[p] for p in shape.skeleton.parents]
    assert [int(rig.shape.skeleton.parents[k]) for k in order] == parents
    np.testing.assert_allclose(rig.shape.skeleton.positions[order], shape.skeleton.positions, atol=1e-5)
    (clip,) = rig.clips
    turned, root = clip.turns[-1][order], clip.root[-1]
    again = Player(project, "squid").sample([clip.duration])
    agree = np.abs((turned * again[0][0]).sum(1))
    assert agree.min() > 1 - 1e-6
    np.testing.assert_allclose(root, again[1][0, 0], atol=1e-5)


def test_two_characters_in_one_file():
    random = np.random.default_rng(3)
    shapes = [random_shape(random, name) for name in ("one", "two")]
    project = Project()
    for shape in shapes:
        clip = Clip(shape.id, *_parts(random_clip(random, shape.skeleton)))
        project, _ = play_clip(project, shape, clip)
    performances = [sample_performance(project, shape.id) for shape in shapes]
    document = checked_glb(build_glb(performances))
    assert [skin["name"] for skin in document["skins"]] == ["one", "two"]
    (animation,) = document["animations"]
    moved = {c["target"]["node"] for c in animation["channels"]}
    for skin in document["skins"]:
        assert moved & set(skin["joints"])


def _parts(clip):
    return clip.skeleton, clip.turns, clip.root, clip.step


def test_a_shape_that_stands_still_has_no_animation_and_its_pose(tmp_path):
    shape = random_shape(np.random.default_rng(5), "statue")
    modeling = shape.modeling.copy()
    modeling[2] = normalized([1.0, 0.4, -0.2, 0.3])
    project = Project().with_characters(shape.with_changes(modeling=modeling))
    write_gltf(tmp_path / "statue.glb", [sample_performance(project, "statue")])
    document = checked_glb((tmp_path / "statue.glb").read_bytes())
    assert "animations" not in document
    seen = SlowGltf(tmp_path / "statue.glb").vertices_at(None, 0.0)
    np.testing.assert_allclose(seen, vertices_of(project, "statue", 0.0), atol=1e-5)


def test_bone_names_contain_both_ends(tmp_path):
    at = np.array([[0, 1, 0], [0, 2, 0], [0, 3, 0.1], [1, 2, 0], [0.0, 0.0, 0.0]], float)
    skeleton = Skeleton(("hips", "chest", "head", "hand", "foot"), np.array([-1, 0, 1, 1, 0]), at)
    mesh = Mesh(np.repeat(at, 3, 0) + np.tile(np.eye(3), (5, 1)), np.arange(15).reshape(5, 3))
    indices = np.zeros((15, 4), np.uint16)
    indices[:, 0] = np.repeat(np.arange(5), 3)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (15, 1))
    shape = still_shape("man", skeleton, mesh, SkinWeights(indices, weights))
    document = checked_glb(build_glb([sample_performance(Project().with_characters(shape), "man")]))
    names = [node["name"] for node in document["nodes"]]
    assert names == [
        "hips", "hips to chest", "chest", "chest to hand", "hips to foot", "head", "hand", "foot", "man",
    ]  # fmt: skip
    (tmp_path / "man.glb").write_bytes(
        build_glb([sample_performance(Project().with_characters(shape), "man")])
    )
    assert read_gltf(tmp_path / "man.glb").shape.skeleton.names == ("hips", "chest", "head", "hand", "foot")


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000))
def test_a_clean_skin_means_the_same(seed):
    random = np.random.default_rng(seed)
    indices = random.integers(0, 3, (6, 4)).astype(np.uint16)
    weights = random.uniform(0, 1, (6, 4)).astype(np.float32) * (random.random((6, 4)) < 0.6)
    weights[:, 0] += 0.1
    bones, shares = normalize_skin(indices, weights)
    for v in range(6):
        for bone in range(3):
            expected = weights[v][indices[v] == bone].sum() / weights[v].sum()
            assert shares[v][bones[v] == bone].sum() == pytest.approx(expected, abs=1e-6)


def test_unwritable_content_is_reported(tmp_path):
    random = np.random.default_rng(1)
    shape = random_shape(random, "squid")
    bare = still_shape("bare", shape.skeleton)
    project = Project().with_characters(shape, bare)
    with pytest.raises(InputError, match="the character has no mesh"):
        build_glb([sample_performance(project, "bare")])
    with pytest.raises(InputError, match="no character was selected"):
        build_glb([])
    with pytest.raises(InputError, match="frames per second is not valid"):
        sample_performance(project, "squid", 2.0, 1.0)
    (tmp_path / "file").write_text("x")
    with pytest.raises(ResourceError, match="cannot be written"):
        write_gltf(tmp_path / "file" / "a.glb", [sample_performance(project, "squid")])
    assert isinstance(sample_performance(project, "squid"), Performance)


def test_a_possessed_mesh_moves_as_its_nodes_do(tmp_path):
    random = np.random.default_rng(2)
    pivots = random.normal(size=(5, 3)).astype(np.float32)
    vertices = (np.repeat(pivots, 3, 0) + 0.2 * random.normal(size=(15, 3))).astype(np.float32)
    indices = random.integers(0, 5, (15, 4)).astype(np.uint16)
    weights = random.uniform(0, 1, (15, 4))
    skin = SkinWeights(indices, (weights / weights.sum(1, keepdims=True)).astype(np.float32))
    faces = np.arange(15, dtype=np.int32).reshape(-1, 3)
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4]], np.int32)
    character = Character("chair", vertices, faces, skin, pivots, edges)
    poses = []
    for k in range(6):
        turns = to_matrix(normalized([1, 0, 0, 0] + 0.1 * k * random.normal(size=(5, 4))))
        linear = turns * (1.0 + 0.05 * k * random.random((5, 1, 3)))
        places = pivots + 0.1 * k * random.normal(size=(5, 3))
        poses.append(Pose("chair", 100_000_000 * k, linear.astype(np.float32), places.astype(np.float32)))
    shape, stream = graph_shape_from_poses(character, poses, "dance")
    project = Project().with_streams(stream).with_characters(shape)
    performance = sample_performance(project, "chair", rate=10.0)
    assert measure_lost_shear(performance) < 1e-6 and len(performance.times) == 6
    path = tmp_path / "chair.glb"
    write_gltf(path, [performance])
    checked_glb(path.read_bytes())
    for k in (0, 3, 5):
        expected = skin_vertices(character, poses[k])
        seen = SlowGltf(path).vertices_at(0, float(np.float32(performance.times[k])))
        np.testing.assert_allclose(seen, expected, atol=1e-5)
