"""Tests that the quality measures of driven meshes are correct, and that the shipped meshes stay within
bounds.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
import pytest
from possess_cast import cut, make_dance, repeat_body, retarget_to_person
from possess_measures import Measures, measure
from possess_take import Act, Shot, Take, perform

from enliven.document.character import Character, Pose, SkinWeights
from enliven.person.joints import PARENTS, Joint
from enliven.possession.highlights import Cues
from enliven_edge.stage.character_setup import create_actor

NOBODY = Cues("possessed", np.empty(0, np.int64), np.empty(0), -1)
SECOND = 1_000_000_000


def boxes(apart: float = 0.01) -> Character:
    """Returns two unit cubes, one above the other, with one transform each."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32)  # fmt: skip
    above = np.array([0, 1 + apart, 0], np.float32)
    indices, weights = np.zeros((16, 4), np.uint16), np.zeros((16, 4), np.float32)
    indices[8:, 0], weights[:, 0] = 1, 1
    return Character(
        "boxes", np.concatenate([corners, corners + above]), np.concatenate([faces, faces + 8]),
        SkinWeights(indices, weights), np.array([[0.5, 0.5, 0.5], [0.5, 1.5 + apart, 0.5]], np.float32),
        np.array([[0, 1]], np.int32),
    )  # fmt: skip


def taken(character: Character, *changes) -> Measures:
    """Returns the measures of shots 0.1 s apart. Each change is (linear, shift) by node."""
    take = Take(character, [], [0])
    for n, (linear, shift) in enumerate(changes):
        rest = character.rest_pose(n * SECOND // 10)
        pose = Pose(
            "boxes", rest.time_ns, np.array(linear, np.float32), rest.positions + np.array(shift, np.float32)
        )
        take.shots.append(Shot(pose.time_ns, [], pose, NOBODY))
    return measure(take, 1)


STILL = ([np.eye(3)] * 2, [[0, 0, 0]] * 2)


def test_rest_pose_has_no_deformation() -> None:
    measures = taken(boxes(), STILL)
    assert measures.stretch_100 == pytest.approx(1.0)
    assert measures.squeeze_5 == pytest.approx(1.0)
    assert measures.inverted == 0.0
    assert measures.volume == pytest.approx((1.0, 1.0))
    assert measures.gap == pytest.approx(0.0, abs=1e-6)
    assert measures.lowest == pytest.approx(0.0)


def test_stretch_and_volume_of_scaled_boxes() -> None:
    measures = taken(boxes(), STILL, ([np.diag([1, 1, 2]), np.eye(3)], [[0, 0, 0]] * 2))
    # A common motion of the transforms changes nothing.
    size = (2 ** (1 / 3) + 1) / 2
    assert measures.stretch_100 == pytest.approx(2.0 / size)
    assert measures.volume[1] == pytest.approx(1.5 / size**3)


def test_parting_shells_give_gap_and_speed() -> None:
    measures = taken(boxes(), STILL, ([np.eye(3)] * 2, [[0, 0, 0], [0, 0.3, 0]]))
    assert measures.gap == pytest.approx(0.3, abs=1e-3)
    assert measures.hold_speed == pytest.approx(3.0, rel=1e-3)
    assert measures.hold_push == pytest.approx(3.0, rel=1e-3)


def test_inverted_box_is_detected() -> None:
    """Triangles whose normal opposes the one rotated by their transforms count as inverted."""
    character = boxes()
    character.skin.indices[[1, 3, 5, 7], 0] = 1
    measures = taken(character, STILL, ([np.eye(3)] * 2, [[0, 0, 2], [0, 0, -2]]))
    assert measures.inverted > 0.1


@pytest.fixture(scope="module")
def driven() -> dict[str, Measures]:
    acts = {"chair": ("chair", Act(1.0)), "lamp": ("overhead", Act(1.65, "hip and right arm"))}
    return {
        mesh: measure(perform(make_dance(moves, 15.0), create_actor(mesh), [act]), 2)
        for mesh, (moves, act) in acts.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["chair", "lamp"])
def test_shipped_meshes_stay_within_bounds(driven, mesh) -> None:
    """Values when the films were made. The chair has 1.59 (its arms flap by 90 degrees), 12.7 for its worst
    edge, 0.6 % inverted in the armpits, volume 0.93..1.17. The lamp has 1.01, 1.6, none, 0.99..1.00.
    """
    measures = driven[mesh]
    assert measures.stretch_95 < (2.0 if mesh == "chair" else 1.2)
    assert measures.squeeze_5 > 0.7
    assert measures.inverted < (0.02 if mesh == "chair" else 0.002)
    assert 0.8 < measures.volume[0] <= measures.volume[1] < 1.4
    assert measures.lowest > -0.3


@pytest.mark.slow
def test_lamp_stays_in_one_piece(driven) -> None:
    assert driven["lamp"].gap < 0.02


@pytest.mark.slow
def test_attachment_causes_no_jump(driven) -> None:
    """The nodes are no faster than the joints, and the parts at the end of an arm."""
    for measures in driven.values():
        assert measures.hold_push < 3.0


def test_retargeted_motion_starts_in_own_posture() -> None:
    frames = make_dance("overhead")
    own = make_dance("kneel")[0].bodies[0]
    moved = retarget_to_person(own, frames, 5 * SECOND)
    np.testing.assert_allclose(moved[0].bodies[0].joints, own.joints, atol=1e-9)
    assert moved[0].time_ns == 5 * SECOND
    for frame, other in zip(moved[::20], frames[::20], strict=True):
        joints = frame.bodies[0].joints
        for joint, parent in enumerate(PARENTS[1:], 1):
            length = np.linalg.norm(own.joints[joint] - own.joints[parent])
            assert np.linalg.norm(joints[joint] - joints[parent]) == pytest.approx(length, abs=1e-9)
        raised = other.bodies[0].joints[Joint.HAND_LEFT, 1] > other.bodies[0].joints[Joint.HEAD, 1] + 0.2
        assert not raised or joints[Joint.HAND_LEFT, 1] > joints[Joint.SHOULDER_LEFT, 1]


def test_cut_pieces_follow_without_pause() -> None:
    frames = make_dance("overhead")
    pieces = cut(frames, (1.0, 2.0), (4.0, 5.0))
    times = np.diff([frame.time_ns for frame in pieces])
    assert times.min() > 0
    assert times.max() < 0.05 * SECOND
    assert pieces[0].time_ns == 0
    still = repeat_body(frames[0].bodies[0], 0.5)
    assert len(still) == 15
