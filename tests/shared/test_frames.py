"""Tests of bodies and characters: the required shapes and values of their arrays."""

import numpy as np
import pytest

from enliven.document.character import Character, SkinWeights
from enliven.errors import InputError
from enliven.person.body import Body
from enliven.person.joints import BONES, PARENTS, J, Joint
from enliven.person.parts import PARTS


def test_the_skeleton_is_a_tree_with_parents_first():
    assert len(PARENTS) == J == 20
    assert all(parent < joint for joint, parent in enumerate(PARENTS))
    assert len(BONES) == J - 1


def test_left_parts_mirror_right_parts():
    for name, part in PARTS.items():
        if "left" in name:
            other = PARTS[name.replace("left", "right")]
            assert {Joint[j.name.replace("LEFT", "RIGHT")] for j in part} == set(other)


def test_height_is_the_posture_s_no_more_than_the_bones():
    joints = np.random.default_rng(0).normal(size=(20, 3))
    turned = joints @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    assert Body(1, joints, np.ones(20)).height == pytest.approx(Body(1, turned, np.ones(20)).height)


def made(**changes) -> Character:
    values = {
        "id": "a",
        "vertices": np.zeros((3, 3), np.float32),
        "faces": np.array([[0, 1, 2]], np.int32),
        "skin": SkinWeights(np.zeros((3, 4), np.uint16), np.full((3, 4), 0.25, np.float32)),
        "pivots": np.zeros((2, 3), np.float32),
        "edges": np.array([[0, 1]], np.int32),
    }
    return Character(**{**values, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vertices": np.zeros((0, 3), np.float32)}, "no vertices"),
        ({"faces": np.array([[0, 1, 3]], np.int32)}, "a face refers to a vertex outside"),
        ({"edges": np.array([[0, 2]], np.int32)}, "an edge of the graph refers to a transform outside"),
        ({"colours": np.zeros((2, 3), np.uint8)}, "the vertex colours have the shape"),
        (
            {"skin": SkinWeights(np.full((3, 4), 2, np.uint16), np.ones((3, 4), np.float32))},
            "refers to transform 2",
        ),
        (
            {"skin": SkinWeights(np.zeros((2, 4), np.uint16), np.ones((2, 4), np.float32))},
            "skin weights have the shape",
        ),
    ],
)
def test_inconsistent_character_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        made(**changes)


def test_the_rest_pose_moves_nothing():
    character = made(pivots=np.random.default_rng(0).normal(size=(2, 3)).astype(np.float32))
    matrices = character.rest_pose().matrices(character.pivots)
    np.testing.assert_allclose(matrices, np.tile(np.eye(3, 4, dtype=np.float32), (2, 1, 1)), atol=1e-6)
