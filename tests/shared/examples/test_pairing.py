"""Tests of suggesting which joint a control point follows."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1] / "mapping"))
sys.path.append(str(Path(__file__).parents[1] / "motion_clips"))
from made_bodies import man, random_motion, rotate_skeleton
from test_capture_clip import STANDING

from enliven.document.skeleton import Skeleton
from enliven.examples.pairing import (
    foot_joints,
    guess_joints,
    keep_one_point_per_hand,
    measure_joint_motion,
    mirror_joint,
)
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.person.body import Body
from enliven.rotation import from_rotation_vector
from enliven.skeletons.facing import rotate_about_y

CACTUS = np.array([[0.4, 0.8, 0.0], [-0.35, 0.7, 0.0], [0.0, 1.2, 0.0], [0.12, 0.0, 0.0], [-0.12, 0.0, 0.0]])
MEANT = ("Left finger", "Right finger", "top", "Left toe", "Right toe")


@settings(max_examples=30, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(0.05, 30.0), st.permutations(range(5)))
def test_arms_follow_arms_whatever_the_size_the_order_and_where_the_performer_looks(angle, scale, order):
    joints = guess_joints(rotate_skeleton(man(), angle), scale * CACTUS[order])
    assert joints == tuple(MEANT[k] for k in order)


def test_a_mesh_that_is_wide_from_the_side_looks_at_x():
    turned = rotate_about_y(CACTUS, np.pi / 2)
    assert np.ptp(turned[:, 0]) < 1e-9 and guess_joints(man(), turned) == MEANT


def test_middle_points_follow_the_trunk():
    joints = guess_joints(man(), np.concatenate([CACTUS, [[0.0, 0.55, 0.0]]]))
    assert joints[:5] == MEANT and joints[5] in ("hips", "spine", "chest")


def test_elbows_pair_below_raised_hands_and_joints_pair_once():
    arms = np.array([[0.44, 1.07, 0.0], [-0.44, 1.07, 0.0], [0.4, 0.66, 0.0], [-0.4, 0.66, 0.0]])
    rest = np.concatenate([arms, [[0.0, 1.3, 0.0], [0.15, 0.0, 0.0], [-0.15, 0.0, 0.0]]])
    hanging = man()
    joints = guess_joints(hanging, rest)
    assert joints == (
        "Left finger", "Right finger", "Left elbow", "Right elbow", "top", "Left toe", "Right toe",
    )  # fmt: skip
    others = guess_joints(hanging, rest, taken=joints)
    assert not set(others) & set(joints)


def test_a_head_that_is_too_short_for_a_limb_is_still_the_head():
    joints = guess_joints(
        clip_of_bodies([Body(1, STANDING, np.ones(20))] * 2, [0.0, 1.0], "one").skeleton, CACTUS
    )
    assert joints == ("hand left", "hand right", "head", "foot left", "foot right")


@pytest.mark.parametrize("rest", [[(0, 1, 0), (0, 0, 0)], [(0.02, 1, 0.1), (0.15, 0, 0)]])
def test_a_chess_piece_has_a_head_and_hips(rest):
    assert guess_joints(man(), np.array(rest, float)) == ("top", "hips")


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 9))
def test_a_joint_that_does_not_move_is_no_suggestion(seed, count):
    """This holds for any mesh. The base of an object on a single foot may follow the hips."""
    random = np.random.default_rng(seed)
    clip = random_motion(random, man(), frames=6, size=0.5)
    motion = measure_joint_motion(clip)
    still = motion.still
    assert "hips" in still and not still & {"Left finger", "Right toe", "top"}
    rest = random.normal(size=(count, 3)) * random.uniform(0.2, 2.0, 3)
    joints = guess_joints(clip.skeleton, rest, motion=motion)
    given = [k for k, joint in enumerate(joints) if joint in still]
    assert given in ([], [int(rest[:, 1].argmin())])
    if given:
        assert (
            joints[given[0]] == "hips" and np.ptp(rest[:, 1]) >= 0.6 * np.ptp(rest[:, [0, 2]], axis=0).max()
        )


def test_a_fish_follows_nothing_that_does_not_move_and_a_chess_piece_stands():
    clip = random_motion(np.random.default_rng(1), man(), frames=6, size=0.5)
    motion = measure_joint_motion(clip)
    fish = [(0, 0.2, 1.5), (0, 0.2, -1.5), (0, 0.5, 0), (0, 0, 0.1), (0.3, 0.15, 0.5), (-0.3, 0.15, 0.5)]
    assert not set(guess_joints(clip.skeleton, np.array(fish), motion=motion)) & motion.still
    piece = np.array([(0.02, 1, 0.1), (0, 0, 0)], float)
    assert guess_joints(clip.skeleton, piece, motion=motion) == ("top", "hips")


FISH = np.array([(0, 0.4, 1.3), (0, 0.6, -1.3), (0, 0.8, 0.1), (0.33, 0.05, 0.2), (-0.32, 0.06, 0.2)])
"""Points of a fish: nose, tail, fin, and a fin on each side that is low enough to be taken for a foot."""
FISH_PARTNERS = (0, 1, 2, 4, 3)


def acting(names, seed=0, frames=40):
    """Returns a clip in which the named joints of a person move, and the others only sway."""
    random, body = np.random.default_rng(seed), man()
    clip = random_motion(random, body, frames=frames, size=0.03)
    turns = clip.turns.copy()
    turns[:, 0] = [1.0, 0.0, 0.0, 0.0]
    t = np.arange(frames)[:, None] / frames
    for name in names:
        waves = np.sin(2 * np.pi * (t * random.integers(1, 4, 3) + random.uniform(size=3)))
        turns[:, body.index(name)] = from_rotation_vector(0.9 * waves)
    return replace(clip, turns=turns)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.permutations(range(5)))
@example(261, [0, 1, 2, 3, 4])  # no middle joint moves
def test_fins_follow_hands_when_only_hands_act_and_feet_when_only_feet_do(seed, order):
    partners = tuple(order.index(FISH_PARTNERS[k]) for k in order)
    for limbs, ends in (
        (("Left wrist", "Right wrist", "Left elbow", "Right elbow"), ("Left finger", "Right finger")),
        (("Left knee", "Right knee", "Left ankle", "Right ankle"), ("Left toe", "Right toe")),
    ):
        clip = acting(limbs, seed)
        motion = measure_joint_motion(clip)
        joints = guess_joints(clip.skeleton, FISH[order], motion=motion, partners=partners)
        fins = tuple(joints[order.index(k)] for k in (3, 4))
        assert fins == ends
        # A wrist, knee or ankle may move a little more than the end.
        assert max(motion.relative_variances[name] for name in ends) > 0.8


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 4), st.integers(1, 4))
@example(5743, 2, 1)  # too few middle joints move
@example(114, 4, 3)  # the joints of one side are still
def test_mirror_images_follow_the_same_joint_of_both_sides(seed, middle, pairs):
    """Whatever acts, even one hand alone, and wherever the points are."""
    random = np.random.default_rng(seed)
    clip = acting(random.choice(["Left wrist", "Right knee", "Left elbow", "chest"], 2), seed)
    side = random.uniform([0.1, 0.0, -1.0], [1.0, 1.5, 1.0], (pairs, 3))
    rest = np.concatenate([side, side * [-1, 1, 1], random.uniform(size=(middle, 3)) * [0, 1.5, 1]])
    partners = (*range(pairs, 2 * pairs), *range(pairs), *range(2 * pairs, len(rest)))
    joints = guess_joints(clip.skeleton, rest, motion=measure_joint_motion(clip), partners=partners)
    for own, other in enumerate(partners):
        assert joints[other] == mirror_joint(clip.skeleton, joints[own])
        assert (joints[own] == mirror_joint(clip.skeleton, joints[own])) == (own == other)
    assert len(set(joints[: 2 * pairs])) == 2 * pairs


def test_joints_of_feet_are_those_from_the_ankle_on():
    feet = foot_joints(man())
    assert {"Left toe", "Right toe"} <= feet and not feet & {"Left knee", "Left finger", "hips"}
    assert mirror_joint(man(), "Left toe") == "Right toe" and mirror_joint(man(), "chest") == "chest"


def test_hand_is_paired_once_and_its_mirror_with_remaining_points():
    parents = [-1, 0, 1, 0, 3, 4, 5, 5, 0, 8, 9, 10, 10]
    side = [(0.2, 0.9, 0), (0.5, 0.9, 0), (0.8, 0.9, 0), (0.9, 0.9, 0), (0.85, 0.9, 0.05)]
    places = [(0, 0, 0), (0, 1, 0), (0, 1.4, 0), *side, *(np.array(side) * [-1, 1, 1])]
    ends = ("shoulder", "elbow", "wrist", "finger", "thumb")
    names = ("hips", "neck", "head", *(f"{s} {end}" for s in ("Left", "Right") for end in ends))
    skeleton = Skeleton(names, np.array(parents), np.array(places, float))
    joints = ("Left finger", "Right finger", "head", "Left thumb", "Right wrist", "Left elbow", "Right elbow")
    assert keep_one_point_per_hand(skeleton, joints, (1, 0, 2, 4, 3, 6, 5)) == [0, 1, 2, 5, 6]


def test_more_points_than_joints_share_them():
    rest = np.random.default_rng(4).normal(size=(100, 3))
    joints = guess_joints(man(), rest)
    count = len(man().names)
    assert len(joints) == 100 and max(joints.count(name) for name in joints) == -(-100 // count)


def test_empty_point_list_gives_no_pairs():
    assert guess_joints(man(), np.zeros((0, 3))) == ()
