"""Tests of finding limbs by joint names: every known convention, with extra joints that are not limbs."""

import numpy as np
import pytest
from made_bodies import horse, man, spider
from made_people import CONVENTIONS, convention_name, person

from enliven.document.skeleton import Skeleton
from enliven.person import BODY_NAMES, PARENTS
from enliven.skeletons.anatomy import find_anatomy
from enliven.skeletons.human_names import find_human_joints, finger_joints


@pytest.mark.parametrize("extras", [False, True], ids=["plain", "extras"])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_limbs_are_found_by_name(convention, extras):
    skeleton = person(convention, extras=extras)
    limbs = find_human_joints(skeleton)

    def named(*joints):
        return tuple(skeleton.index(convention_name(convention, joint)) for joint in joints)

    for side, arm, leg in zip(("Left", "Right"), limbs.arms, limbs.legs, strict=True):
        assert arm.knots == named(f"{side} shoulder", f"{side} elbow", f"{side} wrist")
        assert leg.knots == named(f"{side} hip", f"{side} knee", f"{side} ankle")
        assert leg.tip == named(f"{side} toe")[0]
    assert (limbs.hips, limbs.chest) == named("hips", "chest")
    if convention != "rigify":  # rigify calls its neck a spine
        assert limbs.head_knots == named("neck", "head")
    assert limbs.head[-1] == named("top")[0]


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_weapon_does_not_make_a_tail_of_an_arm(convention):
    skeleton = person(convention, extras=True)
    anatomy = find_anatomy(skeleton)
    assert (len(anatomy.arms), len(anatomy.legs), anatomy.tail) == (1, 1, None)
    left, right = anatomy.arms[0]
    assert [skeleton.names[j] for j in left.main] == [
        convention_name(convention, f"Left {joint}") for joint in ("shoulder", "elbow", "wrist")
    ]
    assert [skeleton.names[j] for j in right.main] == [
        convention_name(convention, f"Right {joint}") for joint in ("shoulder", "elbow", "wrist")
    ]


def test_split_deform_bones_begin_at_their_first_part():
    names = ["hips", "chest", *(f"{bone}.{s}" for s in "LR" for bone in ("thigh", "shin", "foot"))]
    parents, at = [-1, 0, 0, 2, 3, 0, 5, 6], [[0, 1, 0], [0, 1.4, 0]]
    at += [[s * 0.1, y, 0] for s in (1, -1) for y in (0.9, 0.5, 0.1)]
    for side, s in (("L", 1), ("R", -1)):
        above = 1
        for bone, x in (
            ("upper_arm", 0.2),
            ("upper_arm", 0.35),
            ("forearm", 0.5),
            ("forearm", 0.6),
            ("hand", 0.7),
        ):
            name = f"{bone}.{side}"
            names.append(f"{name}.001" if name in names else name)
            parents.append(above)
            at.append([s * x, 1.4, 0.0])
            above = len(names) - 1
    skeleton = Skeleton(tuple(names), np.array(parents), np.array(at))
    left = find_human_joints(skeleton).arms[0]
    assert [names[j] for j in left.knots] == ["upper_arm.L", "forearm.L", "hand.L"]


def test_a_tracked_person_is_found_by_name():
    skeleton = Skeleton(BODY_NAMES, np.array(PARENTS), np.random.default_rng(0).normal(size=(20, 3)))
    limbs = find_human_joints(skeleton)
    assert [BODY_NAMES[j] for j in limbs.arms[0].knots] == ["shoulder left", "elbow left", "wrist left"]
    assert [BODY_NAMES[j] for j in limbs.legs[1].knots] == ["hip right", "knee right", "ankle right"]


@pytest.mark.parametrize(
    "skeleton", [horse(), spider(), man(named=False)], ids=["horse", "spider", "nameless"]
)
def test_unknown_names_identify_no_limbs(skeleton):
    assert find_human_joints(skeleton) is None


def test_an_animal_with_human_names_is_told_by_its_level_back():
    upright = person("unreal")
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    level = Skeleton(upright.names, upright.parents, (upright.positions - [0, 1, 0]) @ turn + [0, 1, 0])
    assert all(limb.knots for pair in find_anatomy(upright).pairs for limb in pair)
    assert not any(limb.knots for pair in find_anatomy(level).pairs for limb in pair)


def test_fingers_are_found_in_any_spelling():
    names = (
        "wrist",
        "LeftHandIndex1",
        "LeftHandIndex2",
        "leftLittleProximal",
        "f_ring.01.L",
        "Thumb1.L",
        "Mid1",
    )
    parents = np.array([-1, 0, 1, 0, 0, 0, 0])
    skeleton = Skeleton(names, parents, np.random.default_rng(0).normal(size=(7, 3)))
    fingers = finger_joints(skeleton, 0)
    assert {finger: len(chain) for finger, chain in fingers.items()} == {
        "index": 3, "pinky": 2, "ring": 2, "thumb": 2, "middle": 2,
    }  # fmt: skip


def test_a_tail_is_found_by_name():
    plain = person("vrm")
    places = np.vstack([plain.positions, [(0.0, 0.9, -0.3), (0.0, 0.6, -0.6)]])
    parents = np.array([*plain.parents, 0, len(plain)])
    skeleton = Skeleton((*plain.names, "Tail1", "Tail2"), parents, places)
    anatomy = find_anatomy(skeleton)
    assert [skeleton.names[j] for j in anatomy.tail.chain] == ["hips", "Tail1", "Tail2"]
    assert len(anatomy.arms) == len(anatomy.legs) == 1
