"""Tests that ten held-out bodies follow their performer's waving, limb by limb."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from known_bodies import BODIES, compare_limbs, t_woman

from enliven.deformation.graph.graph import DeformationGraph
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.possession import ActorSettings, prepare_mesh, rotation_about_y
from enliven.possession.likeness.finding import find_body_in_mesh
from enliven.possession.likeness.standing_person import make_standing_figure
from enliven.possession.placement import yaw_between
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333
ARM = {"left": (model.UPPER_ARM_L, model.FOREARM_L, 1), "right": (model.UPPER_ARM_R, model.FOREARM_R, -1)}
FAR = 0.35
"""Distance from an arm's bones, for a body of 1.75 m, beyond which no point belongs to the arm, metres. A
bear's arm is thick.
"""
STILL = 0.3
"""Maximum motion of points far from the arm, as a fraction of the hand's path. A bear's head leans by 17
cm.
"""
TAKEN = 0.005
"""Maximum motion of an aligned mesh at attachment, metres per frame. The solver is still converging."""
SETTLED, WAVING = 75, 40
"""Number of frames until the mesh has its performer's pose, and number of frames of the wave."""


def waving(side: str, share: float) -> Body:
    """Returns a standing person with hanging arms that lifts one arm sideways by a fraction, and waves the
    forearm.
    """
    upper, fore, sign = ARM[side]
    rotations = standing_pose()
    rotations[upper] = rotation(z=sign * (0.12 + 2.1 * share))
    rotations[fore] = rotation(x=-0.15 - 0.5 * share)
    joints = Posture(np.array([0.0, 1.0, -2.5]), rotations, model.lengths_for_height(1.75)).joints()
    return Body(1, joints, np.ones(20), stature=1.75)


@pytest.fixture(scope="module", params=BODIES)
def known(request):
    return BODIES[request.param]()


def test_all_limbs_are_found(known):
    like = find_body_in_mesh(known.mesh, DeformationGraph.build(known.mesh, nodes=32))
    assert like.human
    missed = [limb for limb, is_found in compare_limbs(like.joints, known).items() if not is_found]
    assert not missed, f"{known.mesh.name}: {', '.join(missed)}"


def at_origin(known) -> np.ndarray:
    """Returns the (20, 3) joints of a mesh of 1.75 m in its modelled position, metres."""
    low, high = known.mesh.bounds
    middle = [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    return (known.joints - middle) * 1.75 / (high[1] - low[1])


def test_trunk_of_the_mesh_matches_the_performers(known):
    """The trunk is within 4 cm of the performer's, and faces the same direction."""
    modelled, _ = prepare_mesh(known.mesh, ActorSettings(stand="modelled"))
    fitted, _ = prepare_mesh(known.mesh, ActorSettings(stand="fitted"))
    first = slice(len(known.mesh.vertices))
    before, after = modelled.vertices[first], fitted.vertices[first]
    turn = rotation_about_y(yaw_between(before - before.mean(0), after - after.mean(0)))
    joints = at_origin(known) @ turn.T + after.mean(0) - before.mean(0) @ turn.T
    hips_and_shoulders = [Joint.HIP_LEFT, Joint.HIP_RIGHT, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]
    apart = (joints - make_standing_figure())[hips_and_shoulders].mean(0)[[0, 2]]
    assert np.linalg.norm(apart) < 0.04
    across = joints[Joint.SHOULDER_LEFT] - joints[Joint.SHOULDER_RIGHT]
    assert across[0] > 0.95 * np.linalg.norm(across[[0, 2]])


def test_known_bones_follow_the_fitted_mesh():
    """Each bone is given as the centre of some vertices, so it is correct for any position of the mesh."""
    turned = t_woman()
    vertices = turned.mesh.vertices @ rotation_about_y(0.7).T * 0.6 + [1.0, 0.3, -2.0]
    joints = turned.joints @ rotation_about_y(0.7).T * 0.6 + [1.0, 0.3, -2.0]
    groups = [np.argsort(np.linalg.norm(vertices - joint, axis=1))[:30] for joint in joints]
    middles = np.array([vertices[group].mean(0) for group in groups])
    settings = ActorSettings(how="mapped", stand="fitted")
    actor = create_mesh_actor(replace(turned.mesh, vertices=vertices), "me", 32, settings, joints=middles)
    moved = actor.character.vertices[: len(vertices)].astype(float)
    there = np.array([moved[group].mean(0) for group in groups])
    assert np.ptp(moved[:, 1]) == pytest.approx(1.75, abs=0.01) and np.abs(there - middles).max() > 1.0
    np.testing.assert_allclose(np.array(actor.settings.joints), there, atol=1e-4)
    across = there[Joint.SHOULDER_LEFT] - there[Joint.SHOULDER_RIGHT]
    assert across[0] > 0.95 * np.linalg.norm(across[[0, 2]]), "it faces +Z"


@pytest.mark.parametrize(("how", "side"), [("mapped", "left"), ("inside", "right")])
@pytest.mark.slow
def test_mesh_waves_with_its_performer(known, how, side):
    """The mesh reaches its performer's pose (hanging arms) without a jump, and then waves."""
    own = ActorSettings(how=how, stand="modelled")
    actor = create_mesh_actor(known.mesh, "it", 128, own)
    joints = at_origin(known)
    stage = Stage([actor])
    still = stage.perform([waving(side, 0.0)], 0)[0]
    stage.possess("it")
    for i in range(SETTLED):
        before, still = still, stage.perform([waving(side, 0.0)], (i + 1) * FRAME)[0]
        step = np.linalg.norm(still.positions - before.positions, axis=1).max()
        assert step < 2.0 * own.fade_pace * FRAME * 1e-9, "nothing jumps"
    for i in range(WAVING):
        pose = stage.perform([waving(side, i / (WAVING - 1))], (SETTLED + i + 1) * FRAME)[0]
    moved = np.linalg.norm(pose.positions - still.positions, axis=1)
    arm = joints[[Joint[f"{name}_{side.upper()}"] for name in ("SHOULDER", "ELBOW", "WRIST", "HAND")]]
    hand = np.argsort(np.linalg.norm(actor.graph.positions - arm[3], axis=1))[:3]
    lengths = np.linalg.norm(np.diff(arm, axis=0), axis=1).sum()
    other = joints[Joint.HAND_RIGHT if side == "left" else Joint.HAND_LEFT]
    across = np.argsort(np.linalg.norm(actor.graph.positions - other, axis=1))[:3]
    level = still.positions[hand, 1].mean() - still.positions[across, 1].mean()
    assert abs(level) < 0.15, "both arms hang alike before one waves"
    rose = (pose.positions - still.positions)[hand, 1].mean()
    assert rose > 0.9 * lengths, "the hand is lifted from below the shoulder to above it"
    far = np.ones(len(moved), bool)
    for a, b in itertools.pairwise(arm):
        for share in np.linspace(0, 1, 8):
            far &= np.linalg.norm(actor.graph.positions - a - share * (b - a), axis=1) > FAR
    assert far.sum() > 40
    assert moved[far].max() < STILL * moved[hand].mean(), "nothing else far away does"


@pytest.mark.slow
@pytest.mark.parametrize("how", ["mapped", "inside"])
@pytest.mark.parametrize("ahead", [True, False])
def test_t_pose_lowers_its_arms_before_attachment(how, ahead):
    """It approaches the pose of the performer in view without a jump, and does not move at attachment."""
    woman = t_woman()
    own = ActorSettings(how=how, stand="modelled", ahead=ahead)
    actor = create_mesh_actor(woman.mesh, "it", 128, own)
    joints, stage = at_origin(woman), Stage([actor])
    hands = [
        np.argsort(np.linalg.norm(actor.graph.positions - joints[hand], axis=1))[:3]
        for hand in (Joint.HAND_LEFT, Joint.HAND_RIGHT)
    ]
    poses = [stage.perform([], 0)[0], stage.perform([waving("left", 0.0)], FRAME)[0]]
    for i in range(2, SETTLED):
        poses.append(stage.perform([waving("left", 0.0)], i * FRAME)[0])
        step = np.linalg.norm(poses[-1].positions - poses[-2].positions, axis=1).max()
        assert i < 3 or step < 2.0 * own.fade_pace * FRAME * 1e-9, "nothing jumps"
    assert actor.state == "free"
    for hand in hands:
        fell = (poses[1].positions - poses[-1].positions)[hand, 1].mean()
        assert (fell > 0.3) == ahead
        assert ahead or abs(fell) < 1e-6
    stage.possess("it")
    for i in range(10 if ahead else 0):
        poses.append(stage.perform([waving("left", 0.0)], (SETTLED + i) * FRAME)[0])
        step = np.linalg.norm(poses[-1].positions - poses[-2].positions, axis=1).max()
        assert step < TAKEN
