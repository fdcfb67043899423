"""Tests of which source chain drives which target chain (legs to legs, arms to forelegs, left to left), and
of matching joints.
"""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, snake, spider

from enliven.mapping.assignment import (
    Drive,
    assign_limbs,
    joints_at_one_arc,
    match_joints,
    match_joints_of_poses,
    split_drive,
)
from enliven.skeletons.anatomy import find_anatomy


def told(source, target):
    """Returns the last joints of both chains for each role."""
    drives = assign_limbs(find_anatomy(source), find_anatomy(target))
    return {d.role: (source.names[d.source[-1]], target.names[d.target[-1]]) for d in drives}


def test_man_maps_to_himself():
    pairs = told(man(), man())
    assert all(a == b for a, b in pairs.values())
    assert set(pairs) >= {"left leg", "right leg", "left arm", "right arm", "trunk", "head"}


def test_man_drives_a_horse():
    pairs = told(man(), horse())
    assert pairs["left leg"] == ("Left toe", "Left hind hoof")
    assert pairs["right foreleg"] == ("Right finger", "Right fore hoof")
    assert pairs["trunk"] == ("chest", "withers")
    assert pairs["head"][0] == "top"
    assert pairs["tail"] == ("top", "tail end")


def test_a_horse_on_a_man_lends_its_forelegs_to_the_arms():
    pairs = told(horse(), man())
    assert pairs["left leg"] == ("Left hind hoof", "Left ankle")
    assert pairs["left arm"] == ("Left fore hoof", "Left wrist")


def test_man_drives_spider_legs_alternately():
    pairs = told(man(), spider())
    assert pairs["left leg"] == ("Left toe", "Left foot 3")
    assert pairs["left foreleg"] == ("Left finger", "Left foot 0")
    assert pairs["left leg 2"] == ("Right toe", "Left foot 2")
    assert pairs["left leg 3"] == ("Left toe", "Left foot 1")


def test_a_snake_gets_a_leg_at_its_tail():
    pairs = told(man(), snake())
    assert pairs["head"] == ("top", "fore 3")
    assert pairs["tail"] == ("Left toe", "hind 3")


def test_a_horse_on_itself_takes_all():
    pairs = told(horse(), horse())
    assert all(a == b for a, b in pairs.values())
    assert {"left leg 1", "left leg 2", "trunk", "head", "tail"} <= set(pairs)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_a_split_is_in_order_and_covers_both(seed):
    random = np.random.default_rng(seed)
    first, second = ([0.0, *np.sort(random.uniform(0, 1, random.integers(0, 5))).tolist(), 1.0] for _ in "ab")
    drive = Drive(tuple(range(len(first))), tuple(range(100, 100 + len(second))), "limb", (77,))
    pieces = split_drive(drive, joints_at_one_arc(first, second, 0.15))
    assert pieces[0].source[:2] == (77, 0)
    rebuilt = list(pieces[0].source[1:])
    for piece in pieces[1:]:
        assert piece.source[0] == rebuilt[-1]
        rebuilt += piece.source[1:]
    assert tuple(rebuilt) == drive.source
    for a, b in pairwise(pieces):
        assert a.target[-1] == b.target[0]
        assert abs(first[b.source[0]] - second[b.target[0] - 100]) <= 0.15
    assert (pieces[0].target[0], pieces[-1].target[-1]) == (drive.target[0], drive.target[-1])
    assert len(pieces) - 1 == most(first[1:-1], second[1:-1], 0.15)


def most(one, other, near):
    """Returns the largest number of pairs in order, by trying all."""
    if not one or not other:
        return 0
    best = max(most(one[1:], other, near), most(one, other[1:], near))
    if abs(one[0] - other[0]) <= near:
        best = max(best, 1 + most(one[1:], other[1:], near))
    return best


def test_equal_numbers_of_segments_map_one_to_one():
    arm = Drive((0, 1, 2), (5, 6, 7), "arm")
    assert match_joints(arm, [0, 0.2, 1], [0, 0.8, 1]) == [(1, 1)]


def test_other_numbers_of_segments_map_by_arc_length():
    arm = Drive((0, 1, 2), (5, 6, 7, 8), "arm")
    assert match_joints(arm, [0, 0.45, 1], [0, 0.1, 0.55, 1]) == [(1, 2)]
    assert match_joints(arm, [0, 0.45, 1], [0, 0.1, 0.8, 1]) == []


def test_joints_of_one_name_match_whatever_their_place():
    arm = Drive((0, 1, 2), (5, 6, 7, 8), "arm", knots=((1, 6),))
    assert match_joints(arm, [0, 0.5, 1], [0, 0.1, 0.5, 1]) == [(1, 1)]


def random_arc(random, above, below):
    """Returns arc lengths 0..1 at the joints of a limb, and the index of its wrist.

    It has inner joints above the wrist and below it.
    """
    wrist = random.uniform(0.6, 0.95)
    arc = [0.0, *np.sort(random.uniform(0.02, wrist - 0.02, above)), wrist]
    return [*arc, *np.sort(random.uniform(wrist + 0.01, 0.99, below)), 1.0], above + 1


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    above=st.tuples(*[st.integers(1, 3)] * 2),
    below=st.tuples(*[st.integers(0, 2)] * 2),
)
def test_posed_limbs_have_an_elbow_and_a_wrist_at_any_proportions(seed, above, below):
    random = np.random.default_rng(seed)
    (source, source_tip), (target, target_tip) = (
        random_arc(random, *counts) for counts in zip(above, below, strict=True)
    )
    cuts = match_joints_of_poses(source, target, source_tip, target_tip)
    assert cuts == sorted(set(cuts)) and (source_tip, target_tip) in cuts
    assert sum(a < source_tip for a, _ in cuts) == min(above)
    assert all((a < source_tip) == (b < target_tip) for a, b in cuts)
    if above[0] == above[1]:
        assert [cut for cut in cuts if cut[0] < source_tip] == [(k, k) for k in range(1, source_tip)]


def test_a_limb_without_a_hand_has_an_elbow():
    assert match_joints_of_poses([0, 0.4, 0.75, 0.9, 1], [0, 0.15, 1], 2, 2) == [(1, 1)]
