"""Tests of bodies and their named parts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.person.body import Body
from enliven.person.joints import MIRROR, Joint
from enliven.person.parts import PARTS, parse_parts


def test_a_body_needs_no_more_than_joints_and_confidence():
    body = Body(1, np.zeros((20, 3)), np.ones(20))
    assert body.orientations is None and body.contacts is None and body.stature is None


def test_the_stature_is_the_height_where_it_was_measured():
    body = Body(1, np.random.default_rng(0).normal(size=(20, 3)), np.ones(20), stature=1.81)
    assert body.height == 1.81


def test_the_mirror_of_a_joint_is_on_the_other_side():
    for joint in Joint:
        other = Joint(MIRROR[joint])
        assert other.name == joint.name.replace("LEFT", "?").replace("RIGHT", "LEFT").replace("?", "RIGHT")
        assert MIRROR[other] == joint


@pytest.mark.parametrize(
    "name",
    ["left arm", "right arm", "both arms", "legs", "upper body", "hip and right arm", "head", "lower body"],
)
def test_the_parts_that_people_ask_for_are_there(name):
    assert parse_parts(name) == PARTS[name] != frozenset()


@given(
    st.lists(st.sampled_from(sorted(PARTS)), min_size=1, max_size=5),
    st.sampled_from(["+", " + ", " and ", ", ", "&"]),
)
def test_parts_are_joined_by_plus_and_comma(names, between):
    expected = frozenset().union(*(PARTS[name] for name in names))
    assert parse_parts(between.join(names)) == expected
    assert parse_parts(between.join(names).upper()) == expected
    assert parse_parts(names) == expected


def test_common_combinations_of_parts_are_parsed():
    assert parse_parts("hip + right arm") == PARTS["hip and right arm"]
    assert parse_parts("left hand and right hand") == PARTS["hands"]
    assert parse_parts("  Left   Arm ") == PARTS["left arm"]


@pytest.mark.parametrize("name", ["tail", "left arm + tail", "left arm and tail", "", "+", "left"])
def test_an_unknown_part_names_the_known_ones(name):
    with pytest.raises(InputError, match="Known parts: all, left arm"):
        parse_parts(name)


def test_a_near_miss_is_guessed():
    with pytest.raises(InputError, match="Did you mean left arm"):
        parse_parts("lft arm + legs")
