"""Tests of a rigged character on the stage, which is selected by posing and driven by moving."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.matching.body_limbs import body_source
from enliven.matching.picking import PickingSettings
from enliven.matching.views import ScreenView
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.rotation import from_rotation_vector, rotate
from enliven.wire.matches import board_to_message, message_to_board
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage import Stage

sys.path.insert(0, str(Path(__file__).parent))

from rigs_for_stage import person, star

STEP = 33_333_333


class Show:
    """A stage with the star, played frame by frame."""

    def __init__(self, **settings) -> None:
        self.actor = RigActor(star(), MatchingSettings(**{"fade": 0.0, **settings}))
        self.stage, self.time_ns = Stage([self.actor]), 0

    def play(self, *bodies: Body, frames: int = 1):
        for _ in range(frames):
            self.time_ns += STEP
            (self.pose,) = self.stage.perform(list(bodies), self.time_ns)
        return self.stage.boards()[0]

    @property
    def names(self) -> tuple[str, ...]:
        return self.actor.live_shape.shape.skeleton.names

    @property
    def shown(self) -> list[str]:
        """Returns the limbs that are assigned to each limb of the performer."""
        return [self.names[b.chain[1]][:-2] for b in self.actor.chooser.pick.match.pairs if b is not None]

    def limb(self, name: str) -> np.ndarray:
        """Returns (3,) the current vector from the centre to the tip of a limb."""
        joints = self.actor.live_shape.joints
        return joints[self.names.index(f"{name} 2")] - joints[0]

    def last_bone(self, name: str) -> np.ndarray:
        """Returns (3,) the direction of a limb's second bone, which has the arm's complete rotation."""
        joints = self.actor.live_shape.joints
        bone = joints[self.names.index(f"{name} 2")] - joints[self.names.index(f"{name} 1")]
        return bone / np.linalg.norm(bone)


def test_arms_held_out_mean_the_limbs_that_a_mirror_shows() -> None:
    show = Show()
    show.actor.preview(None, "arms")
    board = show.play(person())
    # The left arm, at +X, is on the left of the mirror, and so is the star's left limb (-X).
    assert show.shown == ["left", "right"]
    assert (board.state, board.body, board.shown, board.total) == ("choosing", 1, 0, 15)
    assert board.rows[0].score == pytest.approx(2.0, abs=0.01)
    up_and_down = person(left=(0.0, 1.0, 0.0), right=(-0.6, -0.8, 0.0))
    show.play(up_and_down, frames=20)
    assert show.shown == ["up", "lower right"]


def test_without_a_mirror_left_is_where_it_is_seen() -> None:
    show = Show(mirror=False)
    show.actor.preview(None, "arms")
    show.play(person())
    assert show.shown == ["right", "left"]


def test_view_from_behind_mirrors_the_match() -> None:
    show = Show()
    show.actor.preview(None, "arms")
    show.stage.set_view(ScreenView(np.array([0.0, 0.0, 1.0])))
    show.play(person())
    assert show.shown == ["right", "left"]
    show.stage.set_view(ScreenView(np.array([1.0, 0.0, 0.0])))
    show.play(person(left=(0.0, 1.0, 0.0)), frames=20)
    assert show.shown == ["up", "front"], "seen from the left, the front limb is on the right"


def moved(degrees: float, axis: tuple[float, float, float]) -> Body:
    """Returns the person with both arms rotated about an axis through each shoulder."""
    turn = from_rotation_vector(np.radians(degrees) * np.array(axis))
    left, right = rotate(turn, np.array([1.0, 0.0, 0.0])), rotate(turn, np.array([-1.0, 0.0, 0.0]))
    return person(tuple(left), tuple(right))


@pytest.mark.parametrize(
    ("degrees", "axis"), [(40, (0, 0, 1)), (-70, (0, 0, 1)), (50, (0, 1, 0)), (60, (0, -1, 0.5))]
)
def test_the_limbs_move_as_the_arms_do_in_a_mirror(degrees, axis) -> None:
    show = Show()
    show.play(person())
    show.stage.possess("star", parts="arms")
    still = {name: show.limb(name) for name in ("left", "right", "up", "lower left")}
    show.play(person())
    for name, limb in still.items():  # the pose at the time of attachment becomes the rest pose
        np.testing.assert_allclose(show.limb(name), limb, atol=1e-9)
    body = moved(degrees, axis)
    board = show.play(body)
    for own, limb in (("LEFT", "left"), ("RIGHT", "right")):
        arm = body.joints[Joint[f"HAND_{own}"]] - body.joints[Joint[f"SHOULDER_{own}"]]
        arm = arm / np.linalg.norm(arm) * np.array([-1.0, 1.0, 1.0])
        np.testing.assert_allclose(show.last_bone(limb), arm, atol=1e-6)
    np.testing.assert_allclose(show.limb("up"), still["up"], atol=1e-9)
    assert (board.state, board.body) == ("playing", 1)
    assert show.stage.cues()["star"].state == "possessed"


def test_the_mesh_goes_with_the_bones() -> None:
    show = Show()
    show.play(person())
    show.stage.possess("star", parts="arms")
    show.play(moved(90, (0, 0, 1)))
    bone = show.names.index("right 2")
    place = show.actor.live_shape.shape.place
    tip = show.actor.live_shape.shape.skeleton.positions[bone] - show.actor.character.pivots[bone]
    np.testing.assert_allclose(
        show.pose.linear[bone] @ tip + show.pose.positions[bone],
        show.actor.live_shape.joints[bone],
        atol=1e-5,
    )
    left = (show.actor.character.vertices[:, 0] + place[0]).min()
    assert left == pytest.approx(person().joints[0, 0] + 0.7), "it stands beside the performer"


def test_release_returns_to_choosing_and_limbs_to_rest() -> None:
    show = Show()
    show.play(person())
    show.stage.possess("star", parts="arms")
    rest = show.limb("right")
    show.play(moved(60, (0, 0, 1)))
    assert np.linalg.norm(show.limb("right") - rest) > 0.3
    show.stage.release("star")
    assert show.play(person()).state == "choosing"
    np.testing.assert_allclose(show.limb("right"), rest, atol=1e-9)


def test_pose_does_not_jump_on_release() -> None:
    show = Show(fade=0.5)
    show.play(person())
    show.stage.possess("star", parts="arms")
    show.play(moved(60, (0, 0, 1)), frames=30)
    before = show.pose.linear
    show.stage.release("star")
    for _ in range(30):
        show.play(person())
        assert np.abs(show.pose.linear - before).max() < 0.15
        before = show.pose.linear
    np.testing.assert_allclose(before, np.tile(np.eye(3), (len(before), 1, 1)), atol=0.01)


def test_a_pose_held_still_is_taken() -> None:
    show = Show(picking=PickingSettings(by_holding=True, still_seconds=0.5))
    show.actor.preview(None, "arms")
    show.play(person(), frames=5)
    raised = person(left=(0.0, 1.0, 0.0))
    board = show.play(raised, frames=12)
    assert board.state == "choosing" and 0.0 < board.held < 1.0
    board = show.play(raised, frames=20)
    assert board.state == "playing"
    assert len(board.rows[0].lines) == 2


def test_the_next_match_is_shown_and_taken() -> None:
    show = Show()
    show.actor.preview(None, "arms")
    board = show.play(person())
    second = [tuple(line[-1]) for line in board.rows[1].lines]
    show.stage.browse("star", 1)
    board = show.play(person())
    assert board.shown == 1
    show.stage.possess("star", parts="arms")
    board = show.play(person())
    assert [tuple(line[-1]) for line in board.rows[0].lines] == second


def test_low_ranked_match_is_published_too() -> None:
    show = Show(listed=3)
    show.actor.preview(None, "arms")
    show.play(person())
    show.stage.browse("star", -1)
    board = show.play(person())
    assert [row.place for row in board.rows] == [0, 1, 2, 14]
    assert board.shown == 3


def test_one_of_two_driving_performers_releases() -> None:
    show = Show()
    first, second = (
        person(id=1),
        person(left=(0.6, -0.8, 0.0), right=(-0.6, -0.8, 0.0), id=2, at=(1.0, 0, -2.5)),
    )
    show.play(first, second)
    show.stage.possess("star", body=1, parts="arms")
    board = show.play(first, second)
    assert (board.state, board.body) == ("playing", 1), "the match of who comes next would hide what is held"
    assert [(row.body, row.limbs) for row in board.rows] == [(1, (1, 2))], "both arms, by their numbers"
    show.stage.possess("star", body=2, parts="arms", mode="join")
    board = show.play(first, second)
    assert [(row.body, row.limbs) for row in board.rows] == [(1, (1, 2)), (2, (1, 2))]
    assert show.stage.holders == {1, 2}
    rest = show.limb("right")
    show.play(replace(moved(60, (0, 0, 1)), id=1), second)
    assert np.linalg.norm(show.limb("right") - rest) > 0.3
    limb_before = show.limb("right")
    show.stage.release("star", 2)
    show.play(replace(second, id=3))
    np.testing.assert_allclose(
        show.limb("right"), limb_before, atol=1e-9, err_msg="who is away stays as they were"
    )
    with pytest.raises(InputError, match="performer 2 does not drive this character"):
        show.stage.release("star", 2)


def test_lost_performer_continues_under_another_id() -> None:
    show = Show(hand_over=1.0)
    show.play(person())
    show.stage.possess("star", parts="arms")
    rest = show.limb("right")
    raised = moved(60, (0, 0, 1))
    show.play(raised)
    kept = show.limb("right")
    show.play(frames=20)
    show.play(replace(raised, id=7), frames=5)
    assert show.stage.holders == {1}, "not yet"
    np.testing.assert_allclose(show.limb("right"), kept, atol=1e-9)
    show.play(replace(raised, id=7), frames=10)
    assert show.stage.holders == {7}
    np.testing.assert_allclose(show.limb("right"), kept, atol=1e-9)
    show.play(replace(person(), id=7))
    np.testing.assert_allclose(show.limb("right"), rest, atol=1e-9)


def test_another_limb_is_added_to_a_performers_limbs() -> None:
    show = Show()
    show.play(person())
    show.stage.possess("star", parts="left arm")
    show.stage.possess("star", parts="right arm", mode="extend")
    (hold,) = show.actor.holds
    assert {show.names[target[1]] for _, target in hold.pairs} == {"left 1", "right 1"}


def test_invisible_joint_has_no_effect() -> None:
    show = Show()
    show.play(person())
    show.stage.possess("star", parts="arms")
    rest = show.limb("right")
    body = moved(60, (0, 0, 1))
    unsure = body.confidence.copy()
    unsure[[Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT]] = 0.0
    show.play(replace(body, confidence=unsure))
    np.testing.assert_allclose(show.limb("right"), rest, atol=1e-6)
    assert np.linalg.norm(show.limb("left") - rest * [-1, 1, 1]) > 0.3


def test_a_joint_that_is_seen_again_eases_back() -> None:
    show = Show(fade=0.5)
    show.play(person())
    show.stage.possess("star", parts="arms")
    unsure = np.ones(20)
    unsure[[Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT]] = 0.0
    body = moved(60, (0, 0, 1))
    before = show.limb("right")
    show.play(replace(body, confidence=unsure), frames=10)
    for _ in range(20):
        show.play(body)
        assert np.linalg.norm(show.limb("right") - before) < 0.2, "of a way of 0.8"
        before = show.limb("right")
    fresh = Show()
    fresh.play(person())
    fresh.stage.possess("star", parts="arms")
    fresh.play(body)
    np.testing.assert_allclose(before, fresh.limb("right"), atol=1e-6)


def test_the_limbs_of_a_body() -> None:
    body = person()
    arms = body_source(body, "arms")
    assert arms.source.root == Joint.SHOULDER_CENTER
    assert [chain[-1] for chain in arms.chains] == [Joint.HAND_LEFT, Joint.HAND_RIGHT]
    whole = body_source(body, "all")
    assert whole.source.root == Joint.SPINE
    assert [chain[0] for chain in whole.chains] == [2, 2, 2, 0, 0]
    assert len(body_source(body, "left leg").chains) == 1
    assert body_source(body, "spine").chains == ((0, 1, 2, 3),)
    with pytest.raises(InputError, match="no part of the body"):
        body_source(body, "tail")


def test_a_board_survives_the_wire() -> None:
    show = Show()
    show.actor.preview(None, "all")
    board = show.play(person())
    back = message_to_board(board_to_message(board))
    assert (back.state, back.shown, back.total, len(back.rows)) == ("choosing", board.shown, board.total, 6)
    for row, other in zip(board.rows, back.rows, strict=True):
        assert (row.name, row.place, row.score) == (other.name, other.place, other.score)
        for a, b in zip(row.lines, other.lines, strict=True):
            np.testing.assert_allclose(a, b, atol=3e-4)


def test_nan_body_is_ignored() -> None:
    show = Show()
    show.actor.preview(None, "arms")
    lost = replace(person(), joints=np.full((20, 3), np.nan))
    assert show.play(lost).state == "off"
    show.play(person())
    with pytest.raises(InputError, match="not known"):
        show.actor.possess(lost, "arms")
    show.stage.possess("star", parts="arms")
    assert show.play(lost).state == "playing"
    assert np.isfinite(show.pose.linear).all()


def test_missing_performer_and_character_are_refused() -> None:
    show = Show()
    assert show.play().state == "off"
    with pytest.raises(InputError, match="nobody is in view"):
        show.stage.possess("star")
    show.stage.browse("star", 1)
    with pytest.raises(InputError, match="there is no character"):
        show.stage.browse("moon", 1)
