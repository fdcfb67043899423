"""Tests of a puppet on the stage: attaching, sharing, losing and releasing; no jumps."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.cactus_puppet import cactus_project

from enliven.document.character import Pose
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.puppet_examples import examples_from_key_poses
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.stage import Stage

sys.path.insert(0, str(Path(__file__).parent))

from people_for_puppets import FRAME, person

PROJECT = cactus_project(0.05)
PUPPET = PROJECT.puppet("cactus")
NAMES = [point.name for point in PUPPET.points]
LEFT, RIGHT, HEAD, POT = (1 + NAMES.index(name) for name in ("left hand", "right hand", "head", "pot"))
FEET = [1 + NAMES.index("left foot"), 1 + NAMES.index("right foot")]


class Show:
    """A stage with the cactus, played frame by frame."""

    def __init__(self, **options) -> None:
        chosen = replace(PuppetSettings(fade=0.5, meet=False), **options)
        self.actor = PuppetActor(PROJECT, PUPPET, chosen)
        self.stage, self.time_ns = Stage([self.actor]), 0
        self.poses: list[Pose] = []

    def play(self, *bodies: Body, frames: int = 1, step: int = FRAME) -> Pose:
        for _ in range(frames):
            self.time_ns += step
            (pose,) = self.stage.perform(list(bodies), self.time_ns)
            self.poses.append(pose)
        return pose

    def height(self, point: int) -> float:
        return float(self.poses[-1].positions[point, 1])

    @property
    def pace(self) -> float:
        """Returns the maximum speed of any control point in metres per second."""
        return max(
            np.linalg.norm(b.positions - a.positions, axis=1).max() / ((b.time_ns - a.time_ns) * 1e-9)
            for a, b in pairwise(self.poses)
        )


def test_puppet_rests_until_attached_performer_moves_it() -> None:
    show = Show()
    at_rest = show.play(person(), frames=3)
    np.testing.assert_allclose(at_rest.positions, show.actor.character.pivots, atol=1e-6)
    show.stage.possess("cactus")
    hanging = show.play(person(), frames=40).positions
    assert hanging[LEFT, 1] < 0.5
    show.play(person(left=1.45), frames=40)
    assert show.height(LEFT) > 0.6
    assert show.height(RIGHT) < 0.5
    show.play(person(left=2.8, right=2.8), frames=40)
    assert min(show.height(LEFT), show.height(RIGHT)) > 1.05


def test_puppet_reaches_the_key_pose_of_the_performers_pose() -> None:
    show = Show(fade=0.0)
    bodies = [person(left=a, right=a) for a in (0.0, 1.45, 2.9)]
    mapping = ExampleMap(examples_from_key_poses(PROJECT, PUPPET), PUPPET.examples)
    show.play(bodies[0], frames=2)
    show.stage.possess("cactus")
    for body in bodies:
        show.play(body, frames=60)
        pose = show.actor.holds[0].pose
        still = mapping.solve(np.tile(pose, (9, 1, 1)), 1 / 60)[4]
        np.testing.assert_allclose(show.actor._state.places, still, atol=2e-3)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(
    st.lists(
        st.sampled_from(["hold", "let go", "leave", "come", "wave", "turn", "arms", "join"]),
        min_size=3,
        max_size=9,
    )
)
def test_pose_never_jumps(deeds: list[str]) -> None:
    show = Show(fade_pace=2.0)
    there, arm, yaw = True, 0.0, 0.0
    for deed in deeds:
        present = [person(left=arm, yaw=yaw), person(id=2, x=1.0, right=arm)] if there else []
        if deed == "hold" and there:
            show.play(*present)
            show.stage.possess("cactus", 1)
        elif deed == "arms" and there:
            show.play(*present)
            show.stage.possess("cactus", 1, "left arm", "extend")
        elif deed == "join" and there:
            show.play(*present)
            show.stage.possess("cactus", 2, "right arm", "join")
        elif deed == "let go":
            show.stage.release("cactus")
        elif deed in ("leave", "come"):
            there = deed == "come"
        goal, way = (2.6 if deed == "wave" else arm), (yaw + 1.0 if deed == "turn" else yaw)
        for share in np.linspace(0.0, 1.0, 15):
            a, y = arm + share * (goal - arm), yaw + share * (way - yaw)
            show.play(*([person(left=a, yaw=y), person(id=2, x=1.0, right=a)] if there else []))
        arm, yaw = goal, way
    assert show.pace < 6.0


@pytest.mark.parametrize("step", [FRAME // 2, FRAME, 3 * FRAME])
def test_result_is_independent_of_the_frame_rate(step: int) -> None:
    def waving(seconds: float) -> Body:
        return person(left=1.4 - 1.4 * np.cos(1.5 * seconds))

    def played(step: int) -> dict[int, np.ndarray]:
        show = Show(fade=0.0)
        show.play(waving(0.0), step=step)
        show.stage.possess("cactus")
        shown = {}
        while show.time_ns < 2e9:
            pose = show.play(waving((show.time_ns + step) * 1e-9), step=step)
            shown[show.time_ns] = pose.positions
        return shown

    sure, other = played(FRAME // 4), played(step)
    times = [t for t in other if t > 0.5e9]
    nearest = np.array(sorted(sure))
    worst = max(
        np.linalg.norm(other[t] - sure[int(nearest[np.abs(nearest - t).argmin()])], axis=1).max()
        for t in times
    )
    assert worst < 0.03


def test_uneven_and_missing_frames_are_tolerated() -> None:
    rng = np.random.default_rng(1)
    show, smooth = Show(), Show()
    for performance, jitter in ((show, True), (smooth, False)):
        performance.play(person())
        performance.stage.possess("cactus")
        while performance.time_ns < 3e9:
            step = int(FRAME * rng.choice([0.4, 0.9, 1.0, 1.2, 3.0])) if jitter else FRAME
            when = (performance.time_ns + step) * 1e-9
            performance.play(person(left=1.3 - 1.3 * np.cos(2.0 * when)), step=step)
    assert show.pace < 1.3 * smooth.pace + 0.3


def test_puppet_blends_smoothly_after_a_pause() -> None:
    show = Show(fade_pace=2.0)
    show.play(person(), frames=5)
    show.stage.possess("cactus")
    show.play(person(), frames=40)
    before = show.poses[-1].positions
    show.play(person(left=2.8, right=2.8), step=int(3e9))
    assert np.abs(show.poses[-1].positions - before).max() < 0.25
    show.play(person(left=2.8, right=2.8), frames=60)
    assert show.height(LEFT) > 1.05
    assert max(np.abs(b.positions - a.positions).max() for a, b in pairwise(show.poses)) < 0.2


def test_clock_set_back_causes_no_jump() -> None:
    show = Show()
    show.play(person(), frames=5)
    show.stage.possess("cactus")
    show.play(person(left=1.0), frames=30)
    before, show.time_ns = show.poses[-1].positions, 0
    pose = show.play(person(left=1.0))
    assert np.abs(pose.positions - before).max() < 0.1
    assert np.isfinite(show.play(person(left=1.0), frames=30).positions).all()


def test_pose_is_held_while_performer_is_away() -> None:
    show = Show()
    show.play(person(), frames=3)
    show.stage.possess("cactus")
    show.play(person(left=2.5), frames=60)
    raised = show.height(LEFT)
    show.play(frames=60)
    assert show.height(LEFT) == pytest.approx(raised, abs=0.01)
    assert show.actor.state == "possessed"
    show.play(person(), frames=60)
    assert show.height(LEFT) < 0.5
    assert show.pace < 5.0


def test_other_performer_takes_over_after_a_long_absence() -> None:
    show = Show(hand_over=2.0)
    show.play(person(), frames=3)
    show.stage.possess("cactus")
    show.play(person(), frames=30)
    show.play(person(id=7, x=1.0, left=2.8), frames=45)
    assert [hold.body for hold in show.actor.holds] == [1]
    show.play(person(id=7, x=1.0, left=2.8), frames=60)
    assert [hold.body for hold in show.actor.holds] == [7]
    assert show.height(LEFT) > 1.0
    assert show.pace < 5.0


def test_release_blends_to_rest_in_place() -> None:
    show = Show()
    show.play(person(), frames=3)
    show.stage.possess("cactus")
    for yaw in np.linspace(0.0, 1.2, 60):
        show.play(person(left=2.0, yaw=yaw))
    show.play(person(left=2.0, yaw=1.2), frames=20)
    stood = show.poses[-1].positions[FEET].mean(0)
    show.stage.release("cactus")
    pose = show.play(person(left=2.0, yaw=1.2), frames=60)
    np.testing.assert_allclose(pose.positions[FEET].mean(0)[[0, 2]], stood[[0, 2]], atol=0.02)
    local = (pose.positions - pose.positions[0]) @ pose.linear[0]
    np.testing.assert_allclose(local, show.actor.character.pivots, atol=1e-4)
    turned = np.arctan2(pose.linear[0][0, 2], pose.linear[0][0, 0])
    assert turned == pytest.approx(1.2, abs=0.1)
    assert show.actor.state == "free"


def test_two_performers_move_their_own_parts_of_one_puppet() -> None:
    show = Show()
    bodies = [person(), person(id=2, x=1.0)]
    show.play(*bodies, frames=2)
    show.stage.possess("cactus", 1, "left arm + legs + torso + head")
    show.stage.possess("cactus", 2, "right arm", "join")
    assert [hold.body for hold in show.actor.holds] == [1, 2]
    show.play(person(left=2.7), person(id=2, x=1.0), frames=60)
    assert show.height(LEFT) > 1.0
    assert show.height(RIGHT) < 0.5
    show.play(person(), person(id=2, x=1.0, left=2.7, right=2.7), frames=60)
    assert show.height(LEFT) < 0.5
    assert show.height(RIGHT) > 1.0
    cues = show.stage.cues()["cactus"]
    assert set(cues.owners) == {1, 2}
    assert len(cues.nodes) == cues.held == len(NAMES)
    assert 0 not in cues.nodes
    show.stage.release("cactus", 2)
    show.play(person(), person(id=2, x=1.0, right=2.7), frames=60)
    rest = show.actor.character.pivots
    assert show.height(RIGHT) == pytest.approx(rest[RIGHT, 1], abs=0.05)


def test_unattached_points_are_at_rest() -> None:
    show = Show()
    show.play(person(), frames=2)
    show.stage.possess("cactus", parts="left arm")
    show.play(person(left=2.7, right=2.7), frames=60)
    local = (show.poses[-1].positions - show.poses[-1].positions[0]) @ show.poses[-1].linear[0]
    still = [k for k in range(1, len(local)) if "left" not in NAMES[k - 1] or "foot" in NAMES[k - 1]]
    np.testing.assert_allclose(local[still], show.actor.character.pivots[still], atol=1e-4)


def test_joining_takes_points_and_alone_takes_all() -> None:
    show = Show()
    bodies = [person(), person(id=2)]
    show.play(*bodies)
    show.stage.possess("cactus", 1)
    show.stage.possess("cactus", 2, "arms", "join")
    mine, theirs = (hold.points for hold in show.actor.holds)
    assert not mine & theirs
    assert len(mine | theirs) == len(NAMES)
    show.stage.possess("cactus", 2, "head", "extend")
    assert len(show.actor.holds[-1].points) == 4 + 3
    show.stage.possess("cactus", 2, "legs", "alone")
    assert [hold.body for hold in show.actor.holds] == [2]
    show.stage.possess("cactus", 1, "all", "join")
    assert [hold.body for hold in show.actor.holds] == [1]


def test_preview_shows_the_parts_that_would_move() -> None:
    show = Show()
    show.play(person())
    show.stage.preview("cactus", None, "left arm")
    cues = show.stage.cues()["cactus"]
    assert cues.state == "free"
    assert cues.body == 1
    assert [NAMES[node - 1] for node in cues.nodes] == ["left elbow", "left hand"]
    assert show.stage.candidate("cactus") == (None, "left arm")


def test_a_joint_that_is_lost_does_not_fling_anything() -> None:
    show = Show()
    show.play(person(left=2.0), frames=2)
    show.stage.possess("cactus")
    show.play(person(left=2.0), frames=50)
    raised = show.height(LEFT)
    for k in range(30):
        lost = person(left=2.0)
        lost.joints[[Joint.ELBOW_LEFT, Joint.WRIST_LEFT]] = (5.0 * np.sin(k), 9.0, np.nan)
        lost.confidence[[Joint.ELBOW_LEFT, Joint.WRIST_LEFT]] = 0.0
        show.play(lost)
    assert show.height(LEFT) == pytest.approx(raised, abs=0.02)
    assert show.pace < 5.0


def test_in_a_mirror_left_is_right() -> None:
    show = Show(mirror=True)
    show.play(person(), frames=2)
    show.stage.possess("cactus", parts="left arm + legs")
    show.play(person(left=2.7, right=2.7), frames=60)
    assert show.height(RIGHT) > 1.0
    rest = show.actor.character.pivots
    assert show.height(LEFT) == pytest.approx(rest[LEFT, 1], abs=0.02)


def test_puppet_stands_next_to_its_first_performer() -> None:
    show = Show(meet=True, beside=0.7)
    pose = show.play(person(x=1.0, z=-3.0))
    low = PUPPET.mesh.vertices[:, 0].min() + pose.positions[0, 0]
    assert low == pytest.approx(1.7, abs=0.05)
    assert pose.positions[0, 2] == pytest.approx(-3.0, abs=0.1)


def test_fixed_puppet_neither_moves_nor_turns() -> None:
    show = Show(place="fixed")
    show.play(person(), frames=2)
    show.stage.possess("cactus")
    for k in range(60):
        show.play(person(x=0.02 * k, yaw=0.03 * k, left=2.0, up=0.01 * k))
    pose = show.poses[-1]
    np.testing.assert_allclose(pose.positions[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(pose.linear[0], np.eye(3), atol=1e-6)
    assert show.height(LEFT) > 0.8


def test_puppet_motion_is_independent_of_performer_height() -> None:
    shown = []
    for height in (1.05, 1.95):
        show = Show(fade=0.0)
        show.play(person(height=height), frames=2)
        show.stage.possess("cactus")
        for k in range(40):
            show.play(person(left=0.06 * k, right=0.03 * k, knees=(0.02 * k, 0.0), height=height))
        shown.append(show.poses[-1].positions)
    np.testing.assert_allclose(shown[0], shown[1], atol=0.03)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("cactus", 1, "trunk"), "no part of the body"),
        (("cactus", 1, "left foot"), "no control point of the puppet follows the body parts 'left foot'"),
        (("cactus", 5, "all"), "performer 5 is not in view"),
        (("lamp", 1, "all"), "no character 'lamp'"),
    ],
)
def test_impossible_order_is_refused_and_changes_nothing(asked, words: str) -> None:
    show = Show()
    show.play(person())
    with pytest.raises(InputError, match=words):
        show.stage.possess(*asked)
    assert not show.actor.holds


def test_release_without_hold_and_hold_out_of_view_are_refused() -> None:
    show = Show()
    show.play(person())
    with pytest.raises(InputError, match="moved by: nobody"):
        show.stage.release("cactus", 1)
    ghost = Body(3, np.full((20, 3), np.nan), np.zeros(20))
    show.play(ghost)
    with pytest.raises(InputError, match="no joint of performer 3"):
        show.stage.possess("cactus", 3)


def test_rehearsal_leaves_the_puppet_unchanged() -> None:
    show = Show()
    show.actor.warm_up()
    assert not show.actor.holds
    np.testing.assert_allclose(show.play().positions, show.actor.character.pivots, atol=1e-6)


ODD = st.sampled_from([np.nan, np.inf, -np.inf, 1e9, -1e9, 0.0, 5.0])


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 19), st.integers(0, 2), ODD, st.booleans()), min_size=1, max_size=20)
)
def test_pose_is_finite_for_any_sensor_data(wrong) -> None:
    show = Show()
    show.play(person(), frames=2)
    show.stage.possess("cactus")
    show.play(person(left=1.0), frames=3)
    body = replace(person(left=1.0), stature=None, contacts=np.array([np.nan, 0.2]))
    for joint, axis, value, unseen in wrong:
        body.joints[joint, axis] = value
        body.confidence[joint] = 0.0 if unseen else 1.0
    for _ in range(6):
        pose = show.play(body)
        assert np.isfinite(pose.positions).all()
        assert np.isfinite(pose.linear).all()
        assert np.abs(pose.positions).max() < 100.0
    pose = show.play(person(left=1.0), frames=10)
    assert np.isfinite(pose.positions).all()
