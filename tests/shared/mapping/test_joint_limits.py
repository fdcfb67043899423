"""Tests of joint limits of retargeted animals: derived from clips, applied only when exceeded, never for
people.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, random_motion, shape_with_markers, walk
from made_people import person

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.skeleton import Skeleton
from enliven.mapping.automatic_mapping import create_automatic_plan, play_own_take, retarget
from enliven.mapping.joint_limits import joint_ranges
from enliven.mapping.model_clips import list_own_clips
from enliven.mapping.plan import Plan
from enliven.mapping.plan_file import read_plan, write_plan
from enliven.motion.kinematics.ranges import FREE_SWING, MAX_UNKNOWN_SWING, SOFT_MARGIN
from enliven.motion.layers.evaluate import Player
from enliven.rotation import conjugate, from_rotation_vector, multiply, rotate, unit

FORELEGS = [f"{side} {joint}" for side in ("Left", "Right") for joint in ("elbow", "fore knee")]
SEEDS = st.integers(0, 10_000)


def raised_arms(most=2.4, frames=40):
    """Returns a man who stands, raises his hanging arms by ``most`` radians, and lowers them."""
    clip = walk(0.0)
    turns = np.repeat(clip.turns[:1], frames, axis=0)
    up = most * np.sin(np.linspace(0.0, np.pi, frames))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        hanging = from_rotation_vector(np.array([0.0, 0.0, -sign * np.pi / 2]))
        ahead = multiply(from_rotation_vector(-up[:, None] * [1.0, 0.0, 0.0]), hanging)
        for name in ("elbow", "wrist", "finger", "thumb"):
            turns[:, man().index(f"{side} {name}")] = ahead
    return Clip("raise", man(), turns, np.repeat(clip.root[:1], frames, axis=0), 1 / 30)


def grazing(degrees=20.0):
    """Returns a clip of a horse in which only the left foreleg swings back and forth."""
    skeleton, frames = horse(), 9
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (frames, len(skeleton), 1))
    swing = from_rotation_vector(np.radians(np.linspace(-degrees, degrees, frames))[:, None] * [1, 0, 0])
    for name in ("Left elbow", "Left fore knee", "Left fore hoof"):
        turns[:, skeleton.index(name)] = swing
    return Clip("graze", skeleton, turns, np.tile(skeleton.positions[0], (frames, 1)), 0.1)


def free(clip, shape, **changes):
    """Returns the mapping without steps, in which only limits change a bone's rotation."""
    return replace(create_automatic_plan(clip, shape), floor=False, steps=False, **changes)


def all_moved(clip, shape):
    """Returns the mapping without steps, and with every chain in the mode "move"."""
    plan = free(clip, shape)
    return replace(plan, chains=tuple(replace(chain, mode="move") for chain in plan.chains))


def local_turns(made, count=61):
    """Returns (T, N, 4) rotations of bones relative to their parents."""
    times = np.linspace(0.0, made.duration, count)
    turns = Player(made.project, made.shape_id).sample(times)[0]
    return multiply(conjugate(turns[:, np.maximum(horse().parents, 0)]), turns)


def swings(local, name):
    """Returns (T,) degrees between a bone and its rest direction, relative to its parent."""
    j = horse().index(name)
    bone = unit(horse().vectors[j])
    return np.degrees(np.arccos(np.clip(rotate(local[:, j], bone) @ bone, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("clips", "reach"),
    [((), MAX_UNKNOWN_SWING), ((grazing(),), np.radians(20.0) + FREE_SWING)],
    ids=["no clips", "a clip"],
)
def test_a_foreleg_swings_as_far_as_its_clips_and_a_margin_and_no_other_bone_changes(clips, reach):
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    wild = retarget(shape, clip, free(clip, shape, limits=False), clips=clips)
    calm = retarget(shape, clip, free(clip, shape), clips=clips)
    before, after = local_turns(wild), local_turns(calm)
    assert max(swings(before, name).max() for name in FORELEGS) > np.degrees(reach + SOFT_MARGIN)
    for name in FORELEGS:
        assert swings(after, name).max() < np.degrees(reach + SOFT_MARGIN) + 0.1, name
    assert swings(after, "Left elbow").max() > np.degrees(reach), "it goes to its limit"
    assert wild.limited == () and set(calm.limited) == {"Left shoulder", "Right shoulder"}
    same = [j for j, name in enumerate(horse().names) if name not in ("Left elbow", "Right elbow")]
    assert np.degrees(2.0 * np.arccos(np.abs(np.sum(before * after, axis=2))[:, same].clip(0, 1))).max() < 0.1
    np.testing.assert_allclose(swings(after, "Left elbow"), swings(after, "Right elbow"), atol=1e-6)


def test_a_limited_leg_moves_without_jumps():
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    wild, calm = (
        retarget(shape, clip, free(clip, shape, limits=on), clips=(grazing(),)) for on in (False, True)
    )
    turns = [local_turns(body, 400)[:, horse().index("Left elbow")] for body in (wild, calm)]
    steps = [2.0 * np.arccos(np.abs(np.sum(turn[1:] * turn[:-1], axis=1)).clip(0, 1)).max() for turn in turns]
    assert steps[1] <= 1.05 * steps[0]


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_small_movements_are_not_touched(seed):
    clip, shape = (
        random_motion(np.random.default_rng(seed), man(), size=0.05),
        shape_with_markers("horse", horse()),
    )
    for clips in ((), (grazing(),)):
        result = retarget(shape, clip, free(clip, shape), clips=clips)
        other = retarget(shape, clip, free(clip, shape, limits=False), clips=clips)
        assert result.limited == ()
        ids = [[layer.id for layer in body.project.shape("horse").layers] for body in (result, other)]
        assert ids[0] == ids[1]
        assert list(result.project.takes) == list(other.project.takes)


@settings(max_examples=3, deadline=None)
@given(SEEDS, st.sampled_from(["mixamo", "vrm"]))
def test_people_are_not_limited_in_any_mode(seed, convention):
    random = np.random.default_rng(seed)
    clip, skeleton = random_motion(random, man(), size=1.5), person(convention)
    shape = shape_with_markers("person", skeleton)
    for how in (create_automatic_plan(clip, shape), all_moved(clip, shape)):
        poses = []
        for on in (False, True):
            result = retarget(
                shape, clip, replace(how, limits=on), clips=(random_motion(random, skeleton, 3),)
            )
            assert result.limited == ()
            poses.append(Player(result.project, "person").sample(np.linspace(0.0, clip.duration, 9))[0])
        np.testing.assert_array_equal(poses[0], poses[1])


def test_a_body_without_names_that_is_posed_as_the_performer_is_not_limited():
    random = np.random.default_rng(5)
    clip, shape = random_motion(random, man(), size=1.5), shape_with_markers("body", man(named=False))
    plan = free(clip, shape)
    assert "pose" in {chain.mode for chain in plan.chains}
    assert retarget(shape, clip, plan).limited == ()
    assert retarget(shape, clip, all_moved(clip, shape)).limited != ()


def test_takes_of_the_very_skeleton_are_not_limited():
    shape, clip = (
        shape_with_markers("horse", horse()),
        random_motion(np.random.default_rng(1), horse(), size=1.5),
    )
    assert play_own_take(shape, clip).limited == ()
    assert retarget(shape, clip, all_moved(clip, shape), clips=(grazing(5.0),)).limited == ()


def test_bones_that_play_at_another_pace_keep_their_layers():
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    plan = free(clip, shape)
    chains = tuple(replace(chain, loop=True) for chain in plan.chains)
    assert retarget(shape, clip, replace(plan, chains=chains)).limited == ()


def test_what_begins_at_a_limited_joint_moves_along():
    """A mane that begins at the neck follows the neck's rotation, also at the neck's limit."""
    plain = horse()
    skeleton = Skeleton(
        (*plain.names, "mane"),
        np.append(plain.parents, plain.index("neck")),
        np.vstack([plain.positions, [0.0, 2.05, 0.85]]),
    )
    shape, clip = shape_with_markers("horse", skeleton), raised_arms()
    turns = clip.turns.copy()
    turns[10:30, man().index("head")] = from_rotation_vector(np.array([2.4, 0.0, 0.0]))
    clip = replace(clip, turns=turns)
    wild, limited = (retarget(shape, clip, free(clip, shape, limits=on)) for on in (False, True))
    poll, mane = skeleton.index("poll"), skeleton.index("mane")
    times = np.linspace(0.0, limited.duration, 61)
    before, after = (Player(each.project, "horse").sample(times)[0] for each in (wild, limited))
    assert "neck" in limited.limited and np.abs(before[:, poll] - after[:, poll]).max() > 0.05
    for turns in (before, after):
        np.testing.assert_allclose(np.abs(np.sum(turns[:, poll] * turns[:, mane], axis=1)), 1.0, atol=1e-9)


def test_a_take_of_one_pose_is_limited_too():
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    still = clip.map_values(lambda track: track[19:20])
    result = retarget(shape, still, free(still, shape, rest="zero"), clips=(grazing(),))
    assert "Left shoulder" in result.limited
    assert (
        swings(local_turns(result, 2), "Left elbow").max() < 20.0 + np.degrees(FREE_SWING + SOFT_MARGIN) + 0.1
    )


def test_both_of_a_pair_have_the_range_that_clips_show_of_either():
    skeleton = horse()
    left, right = (skeleton.index(f"{side} elbow") for side in ("Left", "Right"))
    ranges = joint_ranges(skeleton, [grazing()], {left: 1.0, right: 1.0})
    assert np.degrees(ranges[right].swing_reach) == pytest.approx(50.0, abs=0.1)
    assert ranges[left].swing_reach == pytest.approx(ranges[right].swing_reach)


def test_the_mapping_file_keeps_the_key(tmp_path):
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    for on in (True, False):
        write_plan(replace(create_automatic_plan(clip, shape), limits=on), tmp_path / "map.toml")
        assert f"limits = {str(on).lower()}" in (tmp_path / "map.toml").read_text()
        assert read_plan(tmp_path / "map.toml").limits is on
    assert Plan().limits


def test_takes_that_limits_made_are_not_clips_of_the_model():
    """A model that is mapped again has the range of its own clips, not that of the last mapping."""
    shape, clip = shape_with_markers("horse", horse()), raised_arms()
    project = Project().with_takes(grazing(), clip)
    result = retarget(
        shape, clip, replace(create_automatic_plan(clip, shape), travel=True), project, (grazing(),)
    )
    assert result.limited and "raise: limits" in result.project.takes
    assert list_own_clips(result.project, shape) == ("graze",)
