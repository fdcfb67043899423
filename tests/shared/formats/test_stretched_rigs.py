"""Tests that motion of clips that move and scale joints is played, saved, cut, merged, scaled and written.

The reference is glTF's own skinning, one vertex at a time (slow_gltf).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_builder import random_rig
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_gltf import SlowGltf

from enliven.deformation.skinning import skin_vertices
from enliven.document import Project, character_of, joint_places, smooth_take
from enliven.exporters import sample_performance
from enliven.exporters.bvh import bvh_text
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.formats.motion.bvh import parse_bvh
from enliven.formats.project.file import read_project, write_project
from enliven.formats.rig.rig import play_clip, scale_to_height
from enliven.modeling.edits import mirror_character, scale_character
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain
from enliven.motion_clips.capture_clip import clip_of_capture

CLOSE = 1e-4
"""Tolerance as a fraction of the model's size: float32 in the file, its weights and the poses, over seven
joints.
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stretched")


def model(folder, seed, uneven=0.2):
    """Returns a random stretched rig, its file, and a project in which its own clip plays."""
    path = random_rig(seed, folder / f"{seed}.gltf", stretched=uneven)
    rig = read_gltf(path)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    return path, rig, project, shape


def size_of(shape):
    return float(np.ptp(shape.mesh.vertices, axis=0).max())


def seen(project, shape_id, time):
    return skin_vertices(
        character_of(project.shape(shape_id)), Player(project, shape_id).compute_message_pose(time)
    )


def agree(a, b, size):
    assert np.abs(np.asarray(a) - np.asarray(b)).max() < CLOSE * size


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000))
def test_stretched_rig_moves_like_reference_skinning(folder, seed):
    path, rig, project, shape = model(folder, seed)
    slow, (clip,) = SlowGltf(path), rig.clips
    assert clip.strains is not None and not [note for note in rig.notes if "not kept" in note]
    for frame in (0, 5, len(clip.turns) - 1):
        expected = slow.vertices_at(0, frame * clip.step)
        agree(seen(project, shape.id, frame * clip.step), expected, max(size_of(shape), np.ptp(expected)))


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10_000))
def test_written_file_matches_displayed_motion(folder, seed):
    # Nodes have no shear, which unlike factors of joints above one another make.
    _, rig, project, shape = model(folder, seed, 0.0)
    target = folder / "out.glb"
    clip = rig.clips[0]
    target.write_bytes(build_glb([sample_performance(project, shape.id, rate=1.0 / clip.step)]))
    slow, reread = SlowGltf(target), read_gltf(target)
    played, other = play_clip(Project(), reread.shape, reread.clips[0])
    for frame in (0, 4, len(clip.turns) - 1):
        places = seen(project, shape.id, frame * clip.step)
        size = max(size_of(shape), np.ptp(places))
        agree(slow.vertices_at(0, float(np.float32(frame * clip.step))), places, size)
        agree(seen(played, other.id, frame * clip.step), places, size)


def test_joints_of_a_clip_are_where_its_player_puts_them(folder):
    _, rig, project, shape = model(folder, 3)
    clip = rig.clips[0]
    times = np.arange(len(clip.turns)) * clip.step
    np.testing.assert_allclose(
        joint_places(clip), Player(project, shape.id).sample(times)[1], atol=CLOSE * size_of(shape)
    )


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.2, 5.0))
def test_size_and_mirror_go_with_the_stretches(folder, seed, factor):
    _, _, project, shape = model(folder, seed)
    before = seen(project, shape.id, 0.3)
    large = scale_character(project, shape.id, factor)
    # Its stride grows with it, so the root is looked at apart.
    moved = seen(large, shape.id, 0.3) - Player(large, shape.id).compute_root(0.3)
    agree(
        moved,
        factor * (before - Player(project, shape.id).compute_root(0.3)),
        factor * max(1.0, np.ptp(before)),
    )
    there = mirror_character(project, shape.id, [1.0, 0.0, 0.0])
    back = mirror_character(there, shape.id, [1.0, 0.0, 0.0])
    agree(seen(back, shape.id, 0.3), before, np.ptp(before))
    place, other = Player(there, shape.id).compute_root(0.3), Player(project, shape.id).compute_root(0.3)
    agree((seen(there, shape.id, 0.3) - place) * [-1, 1, 1], before - other, np.ptp(before))


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.2, 0.8), st.floats(0.05, 0.7))
def test_cut_and_merge_keep_world_pose(folder, seed, at, time):
    _, _, project, shape = model(folder, seed)
    bare = shape.with_changes(mesh=None, skin=None)
    project = project.with_characters(bare)
    bone = next(j for j in range(1, len(shape.skeleton)) if shape.skeleton.children[j])
    before = named(project, shape.id, time)
    parts, (upper, lower) = cut_bone(project, shape.id, bone, at, time=time)
    after = named(parts, upper, time) | named(parts, lower, time)
    same(before, after, np.ptp(bare.skeleton.positions))
    whole = merge(parts, upper, parts.shape(upper).skeleton.names[bone], lower, time)[0]
    same(before, named(whole, upper, time), np.ptp(bare.skeleton.positions))


def test_both_halves_of_a_bone_keep_its_stretch_and_part_its_length(folder):
    _, _, project, shape = model(folder, 11)
    bone = next(j for j in range(1, len(shape.skeleton)) if shape.skeleton.children[j])
    before = Player(project, shape.id).compute_pose(0.4)
    noded, name = insert_node(project, shape.id, bone, 0.3, rigid=True)
    parted = Player(noded, shape.id).compute_pose(0.4)
    first = noded.shape(shape.id).skeleton.index(name)
    whole = np.linalg.norm(before.joints[bone] - before.joints[shape.skeleton.parents[bone]])
    for half, share in ((first, 0.3), (first + 1, 0.7)):
        start = noded.shape(shape.id).skeleton.parents[half]
        agree(parted.stretch[half], before.stretch[bone], 1.0)
        assert np.linalg.norm(parted.joints[half] - parted.joints[start]) == pytest.approx(share * whole)


def named(project, shape_id, time):
    """Returns the (3,) position of each joint, and the (3, 3) linear map of the bone that ends there."""
    pose = Player(project, shape_id).compute_pose(time)
    both = zip(pose.joints, pose.linear, strict=True)
    return dict(zip(project.shape(shape_id).skeleton.names, both, strict=True))


def same(before, after, size):
    for name, (place, linear) in before.items():
        agree(after[name][0], place, size)
        # The root of the cut-off part is new, so no bone ends there.
        if name in after:
            agree(after[name][1], linear, 1.0)


def test_saving_smoothing_and_retargeting_keep_stretch_tracks(folder):
    _, rig, project, shape = model(folder, 5)
    write_project(folder / "kept.enliven", project)
    loaded = read_project(folder / "kept.enliven")
    np.testing.assert_array_equal(seen(loaded, shape.id, 0.31), seen(project, shape.id, 0.31))
    clip = rig.clips[0]
    even = smooth_take(clip, 0.1)
    assert np.abs(np.diff(even.strains, axis=0)).max() < np.abs(np.diff(clip.strains, axis=0)).max()
    # The rig's own clip keeps its stretches, bone by bone. A clip of another body gives only rotations.
    project = Project().with_takes(clip).with_characters(rig.shape)
    foreign = replace(clip, id="other", skeleton=renamed(clip.skeleton))
    for take, own in ((clip, True), (foreign, False)):
        bound = bind_chain(project.with_takes(take), shape.id, (0, 1), take.id, (0, 1), basis=[1, 0, 0, 0])
        assert bound.shape(shape.id).layers[0].stretch == own
        changed = np.abs(Player(bound, shape.id).compute_pose(0.3).linear[1] - turned(bound, shape.id)).max()
        assert (changed > 1e-3) == own


def turned(project, shape_id):
    pose = Player(project, shape_id).compute_pose(0.3)
    return replace(pose, stretch=None).linear[1]


def renamed(skeleton):
    return replace(skeleton, names=tuple(f"another {name}" for name in skeleton.names))


def test_a_bvh_has_the_places_that_its_joints_move_to(folder):
    _, rig, project, shape = model(folder, 8)
    clip = rig.clips[0]
    capture = parse_bvh(bvh_text(sample_performance(project, shape.id, rate=1.0 / clip.step)))
    again = clip_of_capture(capture, "again", rest="zero", unit="m")
    assert again.offsets is not None
    places, theirs = joint_places(again), joint_places(clip)
    number = {name: k for k, name in enumerate(again.skeleton.names)}
    for k, name in enumerate(clip.skeleton.names):
        if name in number:
            np.testing.assert_allclose(places[:, number[name]], theirs[:, k], atol=1e-4)


def test_a_model_that_is_resized_keeps_its_motion(folder):
    _, rig, project, shape = model(folder, 21)
    large = scale_to_height(rig, 3.0 * float(np.ptp(shape.mesh.vertices[:, 1])))
    played, other = play_clip(Project(), large.shape, large.clips[0])
    before = seen(project, shape.id, 0.25)
    agree(seen(played, other.id, 0.25), 3.0 * before, 3.0 * np.ptp(before))
