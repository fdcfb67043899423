"""Tests of the stage: approaching, attaching, releasing, and no jumps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.placement import Placement, body_yaw, placement_at_performer
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333


@pytest.fixture(scope="module")
def chair():
    mesh = make_chair(0.03)
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "chair"), graph


def person(x=0.0, z=-2.5, yaw=0.0, id=1, elbow=1.5, lift=0.0, confidence=1.0) -> Body:
    """Returns a standing person with the forearms forward and the left knee lifted by ``lift`` radians."""
    rotations = standing_pose(yaw, arm_forward=0.1, elbow=elbow)
    rotations[model.THIGH_L] = rotation(x=-lift) @ rotations[model.THIGH_L]
    rotations[model.SHIN_L] = rotation(x=lift)
    posture = Posture(np.array([x, 1.0, z]), rotations, model.lengths_for_height(1.75))
    return Body(id, posture.joints(), np.full(20, confidence))


def make_stage(chair, **options) -> Stage:
    return Stage([EmbeddedActor(*chair, ActorSettings(**options))])


def farthest(a, b) -> float:
    return float(np.linalg.norm(a.positions - b.positions, axis=1).max())


def test_a_free_character_meets_the_first_performer(chair):
    poses = make_stage(chair).perform([person(x=0.4, z=-2.2)], 0)
    centre = poses[0].positions.mean(0)
    assert abs(centre[0] - 0.4) < 0.1
    assert -2.3 < centre[2] < -1.6


def test_attachment_does_not_jump(chair):
    stage = make_stage(chair)
    before = stage.perform([person()], 0)[0]
    stage.possess("chair")
    after = stage.perform([person()], FRAME)[0]
    assert farthest(before, after) < 0.01


def test_a_lifted_knee_lifts_the_chairs_leg(chair):
    stage = make_stage(chair, fade=0.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    still = stage.perform([person()], FRAME)[0]
    for i in range(20):
        pose = stage.perform([person(lift=0.06 * i)], (i + 2) * FRAME)[0]
    rest = chair[0].pivots
    left_back_foot = (rest[:, 1] < 0.3) & (rest[:, 0] > 0) & (rest[:, 2] < 0.25)
    right_back_foot = (rest[:, 1] < 0.3) & (rest[:, 0] < 0) & (rest[:, 2] < 0.25)
    moved = pose.positions - still.positions
    assert moved[left_back_foot, 2].mean() > 0.15
    assert np.linalg.norm(moved[right_back_foot], axis=1).mean() < 0.1


@pytest.mark.slow
@given(st.floats(-1, 1), st.floats(-1.5, 1.5), st.floats(-0.6, 0.6))
@settings(max_examples=8, deadline=None)
def test_walking_and_turning_as_a_whole_moves_the_mesh_rigidly(chair, dx, dz, yaw):
    """A rigid motion of the performer causes the same rigid motion of the mesh."""
    stage = make_stage(chair, fade=0.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    start = stage.perform([person()], FRAME)[0]
    steps = 30
    for i in range(1, steps + 1):
        body = person()
        turn = rotation(y=yaw * i / steps)
        joints = (body.joints - [0, 0, -2.5]) @ turn.T + [dx * i / steps, 0, -2.5 + dz * i / steps]
        moved = Body(1, joints, body.confidence)
        pose = stage.perform([moved], (i + 1) * FRAME)[0]
    for i in range(20):
        pose = stage.perform([moved], (steps + 2 + i) * FRAME)[0]
    expected = (start.positions - [0, 0, -2.5]) @ rotation(y=yaw).T + [dx, 0, -2.5 + dz]
    assert np.linalg.norm(pose.positions - expected, axis=1).max() < 0.01


def test_release_blends_back_to_rest_in_place(chair):
    stage = make_stage(chair)
    stage.perform([person()], 0)
    stage.possess("chair")
    for i in range(30):
        held = stage.perform([person(x=0.02 * i, lift=0.02 * i)], (i + 1) * FRAME)[0]
    stage.release("chair")
    next_pose = stage.perform([], 31 * FRAME)[0]
    assert farthest(held, next_pose) < 0.02
    for i in range(32, 70):
        last = stage.perform([], i * FRAME)[0]
    turns = last.linear / np.cbrt(np.linalg.det(last.linear))[:, None, None]
    np.testing.assert_allclose(turns, np.broadcast_to(turns[0], turns.shape), atol=1e-5)
    assert abs(last.positions[:, 0].mean() - held.positions[:, 0].mean()) < 0.05


def test_lost_performer_leaves_the_mesh_unchanged_and_resumes(chair):
    stage = make_stage(chair, fade=0.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    held = stage.perform([person(lift=0.3)], FRAME)[0]
    assert farthest(stage.perform([], 2 * FRAME)[0], held) < 1e-4
    for i in range(3, 30):
        again = stage.perform([person(x=0.3)], i * FRAME)[0]
    assert again.positions[:, 0].mean() > held.positions[:, 0].mean() + 0.2


def test_other_person_never_takes_over_a_character(chair):
    """Neither while the performer is present, nor while they are away, nor when they return."""
    stage = make_stage(chair, fade=0.0, hand_over=0.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    held = stage.perform([person(lift=0.3)], FRAME)[0]
    for i in range(2, 300):
        alone = stage.perform([person(x=1.0, id=7)], i * FRAME)[0]
    assert farthest(alone, held) < 1e-4
    assert stage.cues()["chair"].body == 1
    for i in range(300, 330):
        again = stage.perform([person(x=1.0, id=7), person(x=-0.5)], i * FRAME)[0]
    assert again.positions[:, 0].mean() < held.positions[:, 0].mean() - 0.3


def test_single_free_performer_takes_over_without_a_jump(chair):
    stage = make_stage(chair, hand_over=2.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    before = stage.perform([person()], FRAME)[0]
    taken = []
    for i in range(2, 120):
        pose = stage.perform([person(x=0.4, id=7)], i * FRAME)[0]
        assert farthest(pose, before) < 0.06
        before = pose
        taken.append(stage.cues()["chair"].body == 7)
    assert 59 <= taken.index(True) <= 63
    assert all(taken[taken.index(True) :])


def test_possession_takes_a_character_over_at_once(chair):
    stage = make_stage(chair)
    stage.perform([person(), person(x=0.8, id=2)], 0)
    stage.possess("chair", body=1)
    stage.perform([person(), person(x=0.8, id=2)], FRAME)
    stage.possess("chair", body=2)
    stage.perform([person(), person(x=0.8, id=2)], 2 * FRAME)
    assert stage.cues()["chair"].body == 2


def test_nan_joints_leave_the_pose_finite(chair):
    stage = make_stage(chair, fade=0.0)
    stage.perform([person()], 0)
    stage.possess("chair")
    broken = person()
    broken.joints[Joint.HAND_LEFT] = np.nan
    broken.joints[Joint.KNEE_RIGHT] = 1e30
    for i in range(5):
        pose = stage.perform([broken], (i + 1) * FRAME)[0]
        assert np.isfinite(pose.positions).all()
        assert np.abs(pose.positions).max() < 10


def test_only_the_named_part_is_attached(chair):
    stage = make_stage(chair)
    stage.perform([person()], 0)
    stage.possess("chair", parts="legs")
    cues = stage.cues()["chair"]
    assert cues.state == "possessed"
    assert chair[0].pivots[cues.nodes, 1].max() < 1.2


def test_preview_shows_the_parts_that_would_be_attached(chair):
    stage = make_stage(chair)
    stage.perform([person()], 0)
    preview = stage.cues()["chair"]
    assert preview.state == "free"
    assert len(preview.nodes) > 10
    stage.possess("chair")
    held = stage.cues()["chair"]
    assert set(preview.nodes) <= set(held.nodes)


@pytest.mark.parametrize(
    "asked",
    [{"character": "chiar"}, {"character": "chair", "body": 9}, {"character": "chair", "parts": "tail"}],
)
def test_impossible_order_is_reported_and_changes_nothing(chair, asked):
    stage = make_stage(chair)
    before = stage.perform([person()], 0)[0]
    with pytest.raises(InputError):
        stage.possess(**{"character": "chair"} | asked)
    assert stage.actors["chair"].state == "free"
    assert farthest(stage.perform([person()], FRAME)[0], before) < 1e-6


def test_possession_with_nobody_in_view_is_refused(chair):
    stage = make_stage(chair)
    stage.perform([], 0)
    with pytest.raises(InputError, match="nobody is in view"):
        stage.possess("chair")


def test_possession_out_of_reach_is_refused(chair):
    stage = make_stage(chair, place="fixed")
    stage.perform([person(z=-9.0)], 0)
    with pytest.raises(InputError, match="no part of the mesh is within"):
        stage.possess("chair")


@given(st.floats(-3, 3), st.floats(0.3, 3), st.integers(0, 100))
@settings(max_examples=30, deadline=None)
def test_placement_there_and_back(yaw, scale, seed):
    random = np.random.default_rng(seed)
    placement = Placement(scale, yaw, random.normal(size=3))
    points = random.normal(size=(5, 3))
    np.testing.assert_allclose(placement.to_rest(placement.to_world(points)), points, atol=1e-9)


@given(st.floats(-3.1, 3.1))
@settings(max_examples=30, deadline=None)
def test_facing_is_the_yaw_of_the_person(yaw):
    assert body_yaw(person(yaw=yaw)) == pytest.approx(yaw, abs=1e-6)


def test_the_mesh_is_as_tall_as_the_performer():
    body = person()
    assert placement_at_performer(body, 0.9, 1.0).scale * 0.9 == pytest.approx(body.height)
    assert body.height == pytest.approx(1.75, abs=0.07)
