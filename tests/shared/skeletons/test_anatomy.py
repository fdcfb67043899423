"""Tests of finding the facing direction and the body parts, for any joint names and any pose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import build_skeleton, horse, man, rotate_skeleton, snake, spider

from enliven.document.skeleton import Skeleton, skeleton_from_links
from enliven.skeletons.anatomy import find_anatomy, has_parallel_fingers, is_tip_start, tip_number
from enliven.skeletons.facing import find_facing, rotate_about_y, side_from_name

ANGLES = st.floats(-np.pi + 0.01, np.pi - 0.01)


def apart(a, b):
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@settings(max_examples=30, deadline=None)
@given(ANGLES)
def test_names_tell_where_the_front_is(angle):
    for skeleton in (man(), horse(), spider()):
        assert apart(find_facing(rotate_skeleton(skeleton, angle)), angle) < 1e-6


@settings(max_examples=30, deadline=None)
@given(ANGLES)
def test_symmetry_and_toes_tell_where_the_front_is(angle):
    heading = find_facing(rotate_skeleton(man(named=False), angle))
    assert apart(heading, angle) < np.radians(4.0)  # +Z is believed where it is nearly right


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("LeftUpLeg", 1), ("UpperLeg.L", 1), ("Shoulder_L", 1), ("l_hand", 1), ("LHipJoint", 1),
        ("RightArm", -1), ("eye.r", -1), ("R Clavicle", -1), ("Bip01 R Hand", -1),
        ("Spine", 0), ("Pelvis", 0), ("Hair", 0), ("leftright", 0), ("Tail.001", 0),
    ],
)  # fmt: skip
def test_sides_by_name(name, side):
    assert side_from_name(name) == side


def named(skeleton, chain):
    return [skeleton.names[j] for j in chain]


def test_parts_of_a_man_are_found():
    skeleton = man()
    anatomy = find_anatomy(skeleton)
    assert named(skeleton, anatomy.trunk) == ["hips", "spine", "chest"]
    ((left, right),) = anatomy.arms
    assert named(skeleton, left.proper) == ["Left shoulder", "Left elbow", "Left wrist", "Left finger"]
    assert named(skeleton, left.girdle) == ["chest", "Left collar", "Left shoulder"]
    assert named(skeleton, right.proper) == ["Right shoulder", "Right elbow", "Right wrist", "Right finger"]
    ((leg, _),) = anatomy.legs
    assert named(skeleton, leg.proper) == ["Left hip", "Left knee", "Left ankle", "Left toe"]
    assert named(skeleton, anatomy.head.chain) == ["chest", "neck", "head", "top"]
    assert anatomy.tail is None


def test_parts_of_a_horse_are_found():
    skeleton = horse()
    anatomy = find_anatomy(skeleton)
    assert named(skeleton, anatomy.trunk) == ["croup", "loin", "withers"]
    assert [skeleton.names[pair[0].chain[-1]] for pair in anatomy.legs] == [
        "Left fore hoof",
        "Left hind hoof",
    ]
    assert not anatomy.arms
    assert named(skeleton, anatomy.head.chain)[:3] == ["withers", "neck", "poll"]
    assert named(skeleton, anatomy.tail.chain) == ["croup", "dock", "tail", "tail end"]


def test_eight_legs_from_front_to_back_and_none():
    skeleton = spider()
    anatomy = find_anatomy(skeleton)
    assert [skeleton.names[pair[0].chain[-1]] for pair in anatomy.pairs] == [
        f"Left foot {k}" for k in range(4)
    ]
    assert len(anatomy.legs) == 4
    skeleton = snake()
    anatomy = find_anatomy(skeleton)
    assert not anatomy.pairs
    assert (skeleton.names[anatomy.head.chain[-1]], skeleton.names[anatomy.tail.chain[-1]]) == (
        "fore 3",
        "hind 3",
    )


def test_ears_on_a_trunk_that_goes_on_are_no_arms():
    skeleton = build_skeleton(
        ("hips", None, (0, 1, 0)),
        ("chest", "hips", (0, 2, 0)),
        ("head", "chest", (0, 3, 0)),
        ("Lear", "head", (0.5, 4, 0)),
        ("Lshoulder", "chest", (0.3, 2, 0)),
        ("Lhand", "Lshoulder", (1.3, 2, 0)),
        ("Lhip", "hips", (0.3, 0.9, 0)),
        ("Lfoot", "Lhip", (0.3, 0, 0)),
    )
    anatomy = find_anatomy(skeleton)
    assert named(skeleton, anatomy.head.chain) == ["chest", "head"]
    assert [skeleton.names[pair[0].chain[-1]] for pair in anatomy.pairs] == ["Left hand", "Left foot"]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), ANGLES, st.floats(0.01, 100))
def test_parts_do_not_depend_on_size_place_heading_or_order(seed, angle, scale):
    random = np.random.default_rng(seed)
    for skeleton in (man(), horse(), spider()):
        moved = rotate_skeleton(skeleton, angle)
        at = moved.positions * scale + random.normal(size=3) * [1, 0, 1]
        order = [0, *(1 + random.permutation(len(skeleton) - 1))]
        links = [(order.index(int(p)), order.index(j)) for j, p in enumerate(skeleton.parents) if p >= 0]
        shuffled, _ = skeleton_from_links([skeleton.names[j] for j in order], links, at[order])
        before, after = find_anatomy(skeleton), find_anatomy(shuffled)

        def told(anatomy, skeleton):
            ends = [[skeleton.names[limb.chain[-1]] for limb in pair] for pair in anatomy.pairs]
            return ends, named(skeleton, anatomy.trunk), [pair[0].grounded for pair in anatomy.pairs]

        assert told(before, skeleton) == told(after, shuffled)


def test_turning_level_is_about_the_upright():
    np.testing.assert_allclose(rotate_about_y(np.array([0.0, 2.0, 1.0]), np.pi / 2), [1, 2, 0], atol=1e-12)


def test_a_single_bone_is_a_head():
    skeleton = Skeleton(("foot", "top"), np.array([-1, 0]), np.array([[0, 0, 0], [0, 1, 0.0]]))
    assert named(skeleton, find_anatomy(skeleton).head.chain) == ["foot", "top"]


def test_brows_are_no_arms_and_fingers_are_left_to_the_hand():
    crab = build_skeleton(
        ("shell", None, (0, 0.5, 0)),
        ("top", "shell", (0, 0.9, 0)),
        ("crest", "top", (0, 1.2, 0)),
        ("Leyebrow", "shell", (0.5, 0.9, 0.4)),
        ("Leyebrow end", "Leyebrow", (0.5, 1.3, 0.4)),
    )
    assert find_anatomy(crab).pairs == ()
    unnamed = replace(crab, names=tuple(name.replace("eyebrow", "claw") for name in crab.names))
    assert len(find_anatomy(unnamed).pairs) == 1
    arm = find_anatomy(man()).arms[0][0]
    assert man().names[arm.chain[-1]] == "Left finger"
    longer = build_skeleton(*FINGERED)
    assert [[longer.names[j] for j in limb.tip] for limb in find_anatomy(longer).arms[0]] == [
        ["Left wrist", "Left finger"],
        ["Right wrist", "Right finger"],
    ]


FINGERED = (
    ("hips", None, (0, 0.95, 0)),
    ("chest", "hips", (0, 1.35, 0)),
    ("head", "chest", (0, 1.7, 0)),
    ("Lshoulder", "chest", (0.18, 1.44, 0)),
    ("Lelbow", "Lshoulder", (0.46, 1.44, 0)),
    ("Lwrist", "Lelbow", (0.71, 1.44, 0)),
    ("Lfinger", "Lwrist", (0.8, 1.44, 0)),
    ("Lfinger 2", "Lfinger", (0.84, 1.44, 0)),
    ("Lfinger 3", "Lfinger 2", (0.88, 1.44, 0)),
    ("Lhip", "hips", (0.09, 0.9, 0)),
    ("Lknee", "Lhip", (0.1, 0.5, 0.01)),
    ("Lankle", "Lknee", (0.1, 0.02, 0)),
)


def test_a_file_that_rests_in_mid_stride_faces_where_its_hips_do():
    striding = man().positions.copy()
    for name, ahead in (
        ("Left wrist", -0.5),
        ("Left finger", -0.6),
        ("Right wrist", 0.5),
        ("Right finger", 0.6),
    ):
        striding[man().index(name), 2] += ahead
    assert find_facing(replace(man(), positions=striding)) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(upper=st.floats(0.1, 0.6), fore=st.floats(0.2, 0.4), spread=st.floats(0.01, 0.03))
def test_fingers_that_begin_at_the_elbow_have_no_wrist(upper, fore, spread):
    """Their first bones lead along the forearm. An upper arm of any length ends at the elbow."""
    elbow, wrist = 0.18 + upper, 0.18 + upper + fore
    claws = build_skeleton(
        *FINGERED[:3],
        ("Lshoulder", "chest", (0.18, 1.44, 0)),
        ("Lelbow", "Lshoulder", (elbow, 1.44, 0)),
        *(
            joint
            for number, (y, z) in enumerate(((0.0, spread), (spread, 0.0), (-spread, 0.0)))
            for joint in (
                (f"Lclaw {number}", "Lelbow", (wrist, 1.44 + y, z)),
                (f"Ltip {number}", f"Lclaw {number}", (wrist + 0.1, 1.44 + y, z)),
            )
        ),
        *FINGERED[-3:],
        named=False,
    )
    for limb in find_anatomy(claws).arms[0]:
        shoulder, elbow_joint, claw, _ = limb.main
        assert tip_number(claws, limb) == 2
        assert is_tip_start(claws, limb, claw) and not is_tip_start(claws, limb, elbow_joint)
        assert has_parallel_fingers(claws, claw) and not has_parallel_fingers(claws, elbow_joint)
        assert not has_parallel_fingers(claws, shoulder)


def test_fingers_of_a_palm_are_not_parallel():
    hand = build_skeleton(
        *FINGERED, ("Lthumb", "Lwrist", (0.76, 1.44, 0.05)), ("Lthumb 2", "Lthumb", (0.8, 1.44, 0.08))
    )
    assert not any(has_parallel_fingers(hand, joint) for joint in range(len(hand)))
