"""Tests of several performers on one mesh: attaching, sharing, losing and releasing."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.person.parts import PARTS
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.easing.pose_blend import PoseBlend
from enliven.possession.placement import rotation_about_y
from enliven_edge.stage.initial_possession import InitialPossession
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333
FADE = 0.5
LEGS, ARMS = (sorted(PARTS[name]) for name in ("legs", "upper body"))


@pytest.fixture(scope="module")
def chair():
    mesh = make_chair(0.04)
    graph = DeformationGraph.build(mesh, nodes=48, seed=0)
    return character_from_graph(mesh, graph, "chair"), graph


def person(x=0.0, z=-2.5, yaw=0.0, id=1, lift=0.0, confidence=1.0, height=1.75) -> Body:
    rotations = standing_pose(yaw, arm_forward=0.1, elbow=1.5)
    rotations[model.THIGH_L] = rotation(x=-lift) @ rotations[model.THIGH_L]
    rotations[model.SHIN_L] = rotation(x=lift)
    posture = Posture(np.array([x, 1.0 * height / 1.75, z]), rotations, model.lengths_for_height(height))
    return Body(id, posture.joints(), np.full(20, confidence), stature=height)


def make_stage(chair, **options) -> Stage:
    return Stage([EmbeddedActor(*chair, ActorSettings(**{"fade": FADE} | options))])


def steps(poses):
    """Returns the (F - 1,) maximum motion of any node from frame to frame, metres."""
    return np.array([np.linalg.norm(b.positions - a.positions, axis=1).max() for a, b in pairwise(poses)])


def test_two_performers_hold_their_own_parts_of_one_mesh(chair):
    stage = make_stage(chair)
    stage.perform([person(), person(id=2)], 0)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "upper body", "join")
    actor = stage.actors["chair"]
    assert [hold.body for hold in actor.holds] == [1, 2]
    for i in range(1, 40):
        low = person(lift=0.02 * i)
        high = person(id=2)
        high.joints[ARMS] += [0.0, 0.0, 0.006 * i]
        pose = stage.perform([low, high], i * FRAME)[0]
    rest = chair[0].pivots
    moved = pose.positions - rest - [0, 0, -2.5]
    top = rest[:, 1] > 1.2
    left_back_foot = (rest[:, 1] < 0.3) & (rest[:, 0] > 0) & (rest[:, 2] < 0.25)
    right_back_foot = (rest[:, 1] < 0.3) & (rest[:, 0] < 0) & (rest[:, 2] < 0.25)
    assert moved[top, 2].mean() > 0.15
    assert moved[left_back_foot, 2].mean() > 0.15
    assert abs(moved[right_back_foot, 2].mean()) < 0.08
    cues = stage.cues()["chair"]
    assert set(cues.owners) == {1, 2} and cues.held == len(cues.nodes)


def test_join_replaces_and_extend_keeps_the_own_attachment(chair):
    stage, bodies = make_stage(chair), [person(), person(id=2)]
    stage.perform(bodies, 0)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "torso", "join")
    actor = stage.actors["chair"]
    stage.possess("chair", 1, "left leg", "join")
    assert [(h.body, [g.parts for g in h.attachments]) for h in actor.holds] == [
        (1, ["left leg"]),
        (2, ["torso"]),
    ]
    stage.possess("chair", 1, "left leg + torso", "extend")
    first = actor.holds[0]
    held = np.concatenate([g.attachment.bone for g in first.attachments])
    assert [g.parts for g in first.attachments] == ["left leg + torso"] and Joint.SPINE in held
    stage.possess("chair", 1, "right leg", "extend")
    assert [g.parts for g in actor.holds[0].attachments] == ["left leg + torso", "right leg"]
    stage.possess("chair", 2, "all", "alone")
    assert [h.body for h in actor.holds] == [2]


def test_unnamed_join_selects_a_free_performer(chair):
    stage, bodies = make_stage(chair), [person(), person(id=2)]
    stage.perform(bodies, 0)
    stage.possess("chair", parts="legs")
    stage.possess("chair", parts="torso", mode="join")
    assert [h.body for h in stage.actors["chair"].holds] == [1, 2]
    stage.release("chair", 1)
    assert [h.body for h in stage.actors["chair"].holds] == [2]
    with pytest.raises(InputError, match=r"performer 1 does not hold this character.*held by: 2"):
        stage.release("chair", 1)
    stage.release("chair")
    assert stage.actors["chair"].state == "free"


def test_limb_lost_at_attachment_is_attached_later(chair):
    stage = make_stage(chair)
    hidden = person()
    hidden.joints[[Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT]] = np.nan
    stage.perform([hidden], 0)
    stage.possess("chair")
    actor = stage.actors["chair"]
    leg = {Joint.ANKLE_LEFT, Joint.FOOT_LEFT}
    assert not leg & set(actor.holds[0].attachments[0].attachment.bone)
    poses = [stage.perform([person()], (i + 1) * FRAME)[0] for i in range(30)]
    stage.possess("chair", 1, "left leg", "extend")
    assert leg & {Joint(b) for g in actor.holds[0].attachments for b in g.attachment.bone}
    poses += [stage.perform([person()], (i + 31) * FRAME)[0] for i in range(10)]
    assert steps(poses[25:]).max() < 0.01, "it takes hold where the leg is: nothing moves"
    for i in range(30):
        lifted = stage.perform([person(lift=0.04 * i)], (i + 41) * FRAME)[0]
    foot = (chair[0].pivots[:, 1] < 0.3) & (chair[0].pivots[:, 0] > 0) & (chair[0].pivots[:, 2] < 0.25)
    assert (lifted.positions - poses[-1].positions)[foot, 2].mean() > 0.15


EVENTS = st.lists(
    st.tuples(
        st.integers(2, 12),
        st.sampled_from(["possess", "join", "extend", "release", "let go", "hide", "show"]),
        st.sampled_from([1, 2]),
        st.sampled_from(["all", "legs", "upper body", "hip + right arm"]),
    ),
    min_size=1,
    max_size=6,
)


@pytest.mark.slow
@given(EVENTS, st.floats(-0.5, 0.5))
@settings(max_examples=12, deadline=None)
def test_mesh_never_jumps_in_any_order_of_events(chair, events, apart):
    """The shown mesh moves no faster than the computed one plus the speed at which gaps are blended out.

    The performers only sway slowly, so the computed mesh may jump only if a performer is attached, lost,
    found or released. A jump is at most the mesh's size plus the distance between the performers. It is
    blended out at a rate of at most 1.5 / fade, or pi / 2 for a rotation.
    """
    stage, shown, poses, k = make_stage(chair), {1, 2}, [], 0
    for pause, event, who, parts in [*events, (12, "show", 1, "all")]:
        for _ in range(pause):
            sway = 0.1 * np.sin(0.1 * k)
            everybody = [person(lift=0.4 + sway), person(x=apart, id=2, lift=0.2 - sway)]
            poses.append(stage.perform([b for b in everybody if b.id in shown], k * FRAME)[0])
            k += 1
        try:
            if event in ("possess", "join", "extend"):
                stage.possess("chair", who, parts, "alone" if event == "possess" else event)
            elif event in ("release", "let go"):
                stage.release("chair", who if event == "release" else None)
            else:
                shown = shown - {who} if event == "hide" else shown | {who}
        except InputError:
            pass
    assert all(np.isfinite(pose.positions).all() and np.isfinite(pose.linear).all() for pose in poses)
    leap = abs(apart) + 0.6
    assert steps(poses).max() < np.pi / 2 * 1.5 / FADE * FRAME * 1e-9 * leap + 0.04


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.floats(-3, 3), st.floats(0.2, 3.0), st.sampled_from([0.5, 4.0, np.inf]))
@settings(max_examples=40, deadline=None)
def test_easing_keeps_its_documented_speed_bound(seed, yaw, growth, pace):
    """Easing alone, between two fixed states: the bound in its docstring holds, and both ends are exact."""
    rng = np.random.default_rng(seed)
    positions = rng.normal(size=(20, 3))
    linear = np.tile(np.eye(3), (20, 1, 1))
    moved = growth * positions @ rotation_about_y(yaw).T + rng.normal(size=3) + 0.2 * rng.normal(size=(20, 3))
    turned = growth * rotation_about_y(yaw) @ linear
    easing = PoseBlend(FADE, pace)
    last = easing(linear, positions, 0)[1]
    easing.restart_fade()
    gap = np.linalg.norm(moved - positions, axis=1).max() + np.ptp(moved, axis=0).max()
    assert PoseBlend(FADE, pace)(turned, moved, 0)[1] is moved, "without a tear nothing is eased"
    for k in range(1, 20 if pace == np.inf else 3000):
        now = easing(turned, moved, k * FRAME)[1]
        bound = FRAME * 1e-9 * min(np.pi / 2 * 1.5 / FADE * gap, pace)
        assert np.linalg.norm(now - last, axis=1).max() < bound
        last = now
    np.testing.assert_allclose(last, moved)
    assert not easing.is_active


def test_attachment_during_a_fade_continues_from_the_shown_pose(chair):
    stage, poses = make_stage(chair), []
    poses.append(stage.perform([person()], 0)[0])
    stage.possess("chair")
    poses += [stage.perform([person(lift=0.03 * i)], i * FRAME)[0] for i in range(1, 20)]
    stage.release("chair")
    poses += [stage.perform([person(lift=0.6)], i * FRAME)[0] for i in range(20, 25)]
    stage.possess("chair", mode="extend")
    poses += [stage.perform([person(lift=0.6)], i * FRAME)[0] for i in range(25, 50)]
    assert steps(poses[20:]).max() < 0.05


def pulled_apart(chair, order):
    """Returns two performers that are attached to the same parts and walk away from each other."""
    stage = make_stage(chair, fade=0.0)
    stage.perform([person(), person(id=2)], 0)
    for who in order:
        stage.possess("chair", who, "all", "join")
    for i in range(1, 60):
        way = 0.02 * min(i, 40)
        pose = stage.perform([person(x=-way), person(x=way, id=2)], i * FRAME)[0]
    return pose


def test_contradiction_is_shared_whoever_came_first(chair):
    first, second = pulled_apart(chair, (1, 2)), pulled_apart(chair, (2, 1))
    assert np.isfinite(first.positions).all()
    np.testing.assert_allclose(first.positions, second.positions, atol=2e-3)
    assert abs(first.positions[:, 0].mean()) < 0.02, "the mesh stays in the middle"
    assert np.abs(first.positions[:, 0]).max() < 0.8
    assert np.linalg.det(first.linear).min() > 0.05


def test_lost_performer_releases_smoothly_and_other_continues(chair):
    stage, poses = make_stage(chair), []

    def play(count, *ids):
        for _ in range(count):
            k = len(poses)
            bodies = {1: person(lift=0.5), 2: person(id=2)}
            bodies[2].joints[ARMS] += [0.0, 0.0, 0.2]
            bodies[1].joints[:, 0] += 0.1 * np.sin(0.2 * k)
            poses.append(stage.perform([bodies[i] for i in ids], k * FRAME)[0])

    play(2, 1, 2)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "upper body", "join")
    play(30, 1, 2)
    play(40, 1)
    assert stage.cues()["chair"].owners.max() == 1 and len(stage.actors["chair"].holds) == 2
    left = np.ptp([p.positions[:, 0].mean() for p in poses[-30:]])
    assert left > 0.12, "the mesh follows who is still there"
    play(40, 1, 2)
    assert set(stage.cues()["chair"].owners) == {1, 2}
    assert steps(poses).max() < 0.06


def test_performers_leave_and_return_to_their_parts(chair):
    """The mesh keeps its pose. Both performers continue with their parts, and a third never takes over."""
    stage = make_stage(chair, hand_over=0.0)
    stage.perform([person(), person(id=2)], 0)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "upper body", "join")
    pose = [stage.perform([person(lift=0.3), person(id=2)], i * FRAME)[0] for i in range(1, 40)][-1]
    for i in range(40, 400, 10):
        alone = stage.perform([person(id=3, x=0.5)] if i > 200 else [], i * FRAME)[0]
    np.testing.assert_allclose(alone.positions, pose.positions, atol=1e-4)
    for i in range(400, 430):
        back = stage.perform([person(lift=0.3), person(id=2)], i * FRAME)[0]
    np.testing.assert_allclose(back.positions, pose.positions, atol=0.02)
    assert [h.body for h in stage.actors["chair"].holds] == [1, 2]


def test_performer_below_the_floor_counts_as_lost(chair):
    """The skeleton of a half-occluded person sinks before it is lost. The mesh must not sink with it."""
    stage = make_stage(chair)
    stage.perform([person(), person(id=2)], 0)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "upper body", "join")
    before = stage.perform([person(), person(id=2)], FRAME)
    for i in range(2, 20):
        sunk = person(id=2)
        sunk = replace(sunk, joints=sunk.joints - [0.0, 0.05 * i, 0.0])
        (pose,) = stage.perform([person(), sunk], i * FRAME)
    assert [hold.active for hold in stage.actors["chair"].holds] == [True, False]
    # Parts shared by two performers move slightly when one of them releases.
    assert np.abs(pose.positions - before[0].positions).max() < 0.1


def test_newcomer_takes_over_from_the_longest_absent(chair):
    stage = make_stage(chair, hand_over=1.0)
    stage.perform([person(), person(id=2)], 0)
    stage.possess("chair", 1, "legs")
    stage.possess("chair", 2, "upper body", "join")
    for i in range(1, 80):
        stage.perform([person(), person(id=3)], i * FRAME)
    assert [h.body for h in stage.actors["chair"].holds] == [1, 3]


@pytest.mark.parametrize("mode", ["alone", "join"])
@pytest.mark.parametrize("how", ["inside", "beside"])
@pytest.mark.parametrize("parts", ["all", "legs + head"])
def test_preview_equals_the_attachment(chair, mode, how, parts):
    """In the same frame, the previewed nodes and strengths equal the attached ones."""
    stage = make_stage(chair, how=how)
    stage.preview("chair", parts=parts)
    bodies = [person(), person(id=2, x=0.05)]
    stage.perform(bodies, 0)
    if mode == "join":
        stage.possess("chair", 1, "torso")
        stage.preview("chair", parts=parts)
        for i in range(1, 6):
            stage.perform(bodies, i * FRAME)
    preview = stage.cues()["chair"]
    who = 2 if mode == "join" else 1
    would = dict(zip(preview.nodes[preview.held :], preview.strengths[preview.held :], strict=True))
    assert set(preview.owners[preview.held :]) == {who} and len(would) > 3
    stage.possess("chair", None, parts, mode)
    hold = next(h for h in stage.actors["chair"].holds if h.body == who)
    others = set(preview.nodes[: preview.held])
    held = hold.strengths(len(chair[0].pivots))
    assert {n: held[n] for n in np.flatnonzero(held) if n not in others} == pytest.approx(would)


def test_distant_or_unseen_performer_gets_advice(chair):
    stage = make_stage(chair)
    stage.perform([person(), person(id=2, x=3.0)], 0)
    stage.possess("chair", 1)
    with pytest.raises(InputError, match=r"the nearest part is 2\.\d m away.*Step into the mesh"):
        stage.possess("chair", 2, "all", "join")
    assert [h.body for h in stage.actors["chair"].holds] == [1]
    unseen = person(id=2)
    unseen.joints[:] = np.nan
    stage.perform([unseen], FRAME)
    with pytest.raises(InputError, match="no joint is tracked"):
        stage.possess("chair", 2, "all", "join")


def test_the_play_opens_with_each_performer_as_they_come(chair):
    stage = make_stage(chair)
    opening = InitialPossession(stage, 1.0, "legs / upper body")
    stage.perform([person()], 0)
    opening.possess_if_due(0.5)
    assert stage.actors["chair"].state == "free"
    opening.possess_if_due(1.0)
    for i in range(1, 4):
        stage.perform([person()], i * FRAME)
        opening.possess_if_due(1.0 + i / 30)
    assert [[h.body, h.attachments[0].parts] for h in stage.actors["chair"].holds] == [[1, "legs"]]
    stage.perform([person(), person(id=2)], 4 * FRAME)
    opening.possess_if_due(2.0)
    stage.release("chair", 1)
    opening.possess_if_due(2.1)
    assert [[h.body, h.attachments[0].parts] for h in stage.actors["chair"].holds] == [[2, "upper body"]]


def test_impossible_opening_is_logged_once(chair, caplog):
    stage = make_stage(chair)
    opening = InitialPossession(stage, 0.0, "tail")
    stage.perform([person()], 0)
    for _ in range(3):
        opening.possess_if_due(0.0)
    assert sum("tail" in record.message for record in caplog.records) == 1
    InitialPossession(stage, None).possess_if_due(100.0)
    assert stage.actors["chair"].state == "free"


def test_a_stiff_spot_of_the_mesh_bends_less(chair):
    def strain(**more):
        stage = make_stage(chair, **more)
        for frame in range(20):
            (pose,) = stage.perform([person(lift=1.2 * min(frame, 5) / 5)], frame * FRAME)
            if frame == 0:
                stage.possess("chair", 1)
        linear, actor = pose.linear, stage.actors["chair"]
        low = actor.graph.positions[:, 1] < 0.9
        return np.abs(np.swapaxes(linear, 1, 2) @ linear - np.eye(3))[low].mean()

    assert strain(stiffness=((0.0, 0.5, 0.0, 1.5, 30.0),)) < 0.8 * strain()
