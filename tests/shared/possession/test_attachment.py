"""Tests of possession: which points attach, where their targets are, and how bones rotate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven import rotation
from enliven.deformation.embedded.solver import EmbeddedSolver
from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.person.joints import BONES, PARENTS, J, Joint
from enliven.person.parts import PARTS
from enliven.possession.actor_settings import AttachmentSettings
from enliven.possession.attachment.bone_attachment import ReachGrowth, attach
from enliven.possession.attachment.bone_cylinders import bone_rotations, bone_samples
from enliven.possession.attachment.nearest_nodes import nearest_facing

SURE = np.ones(J)
LEFT_ARM = (Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT)


def standing():
    """Returns (20, 3) a person of 1.75 m at the origin, facing +Z, with forearms forward and feet apart."""
    joints = np.zeros((J, 3))
    spine = {Joint.HIP_CENTER: 0.95, Joint.SPINE: 1.08, Joint.SHOULDER_CENTER: 1.42, Joint.HEAD: 1.6}
    for joint, height in spine.items():
        joints[joint, 1] = height
    left = {
        Joint.SHOULDER_LEFT: (0.18, 1.40, 0.0),
        Joint.ELBOW_LEFT: (0.23, 1.12, 0.0),
        Joint.WRIST_LEFT: (0.26, 1.11, 0.25),
        Joint.HAND_LEFT: (0.27, 1.10, 0.33),
        Joint.HIP_LEFT: (0.10, 0.90, 0.0),
        Joint.KNEE_LEFT: (0.16, 0.50, 0.0),
        Joint.ANKLE_LEFT: (0.22, 0.08, 0.0),
        Joint.FOOT_LEFT: (0.22, 0.03, 0.12),
    }
    for joint, place in left.items():
        joints[joint] = place
        joints[Joint[joint.name.replace("LEFT", "RIGHT")]] = np.array(place) * [-1, 1, 1]
    return joints


@pytest.fixture(scope="module")
def graph():
    return DeformationGraph.build(make_chair())


@pytest.fixture(scope="module")
def held(graph):
    return attach(graph, standing(), SURE)


def moved(joints, turn, about, which):
    """Returns the joints with those in ``which`` rotated by a rotation vector about a point."""
    out = joints.copy()
    which = list(which)
    out[which] = rotation.rotate(rotation.from_rotation_vector(turn), joints[which] - about) + about
    return out


def test_bone_samples_lie_on_cylinders_and_face_outwards():
    joints = standing()
    points, normals = bone_samples(joints, 0.04, 4, 4)
    assert points.shape == normals.shape == (19, 16, 3)
    for (parent, child), around, facing in zip(BONES, points, normals, strict=True):
        axis = (joints[child] - joints[parent]) / np.linalg.norm(joints[child] - joints[parent])
        arms = around - joints[parent]
        along = arms @ axis
        np.testing.assert_allclose(arms - along[:, None] * axis, 0.04 * facing, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(facing, axis=1), 1)
        length = np.linalg.norm(joints[child] - joints[parent])
        np.testing.assert_allclose(along, np.repeat([0.125, 0.375, 0.625, 0.875], 4) * length)
        for ring in facing.reshape(4, 4, 3):
            np.testing.assert_allclose(ring.sum(0), 0, atol=1e-12)


def slow_attachment(graph, joints, reach=0.10):
    """Returns the points that have a node within reach that faces their direction, and their weights. Slow
    reference.
    """
    points, normals = bone_samples(joints)
    points = np.concatenate([points.reshape(-1, 3), joints])
    normals = np.concatenate([normals.reshape(-1, 3), np.zeros((J, 3))])
    attachment = []
    for p, n in zip(points, normals, strict=True):
        lengths = np.linalg.norm(graph.positions - p, axis=1)
        valid = (lengths < reach) & ((graph.normals @ n > 1e-9) | (not n.any()))
        nearest = sorted(np.flatnonzero(valid), key=lengths.__getitem__)[:4]
        if nearest:
            weights = 1 - lengths[nearest] / reach
            attachment.append((p, nearest, weights / weights.sum()))
    return attachment


def test_samples_attach_to_the_expected_nodes(graph, held):
    expected = slow_attachment(graph, standing())
    assert len(held) == len(expected) > 100
    actual = sorted(
        zip(held.points.tolist(), held.node_indices, held.node_weights, strict=True), key=lambda c: c[0]
    )
    for (point, indices, weights), (p, nodes, w) in zip(
        actual, sorted(expected, key=lambda e: e[0].tolist()), strict=True
    ):
        np.testing.assert_allclose(point, p)
        assert indices[: len(nodes)].tolist() == nodes
        np.testing.assert_allclose(weights[: len(nodes)], w, atol=1e-9)
        assert (weights[len(nodes) :] == 0).all()


def test_a_standing_person_holds_every_limb_of_the_chair(held):
    assert set(held.bone) == set(range(1, J))
    nodes, strength = held.nodes
    assert len(nodes) > 30
    assert 0 < strength.min() <= strength.max() == 1
    assert set(nodes) == set(held.node_indices[held.node_weights > 0])


@pytest.mark.parametrize("name", PARTS)
def test_a_named_part_takes_hold_with_its_own_bones_only(graph, held, name):
    part = attach(graph, standing(), SURE, name, AttachmentSettings(joints=False))
    pelvis = {1} if PARTS[name] & {0, 1, 12, 16} == {0} else set()  # the hip alone, see below
    assert set(part.bone) <= {int(j) for j in PARTS[name]} | pelvis
    whole = attach(graph, standing(), SURE, "all", AttachmentSettings(joints=False))
    own = np.isin(whole.bone, list(PARTS[name])) | (np.isin(whole.bone, list(pelvis)) & (whole.along < 0.5))
    assert len(part) == own.sum()


def test_parts_may_be_several_and_must_be_known(graph):
    both = attach(graph, standing(), SURE, ["left arm", "right arm"])
    np.testing.assert_array_equal(both.points, attach(graph, standing(), SURE, "arms").points)
    with pytest.raises(InputError, match="left arm"):
        attach(graph, standing(), SURE, "tail")


def test_out_of_reach_nothing_is_held(graph):
    far = attach(graph, standing() + 5, SURE)
    assert len(far) == 0
    assert far.targets(standing()).shape == (0, 3)
    assert far.target_weights(SURE).shape == (0,)
    assert len(far.nodes[0]) == 0
    rest = EmbeddedSolver(graph, far).solve(far.targets(standing()), far.target_weights(SURE))
    assert_alike(rest[1], graph.positions, SOLVER_TOLERANCE)


def test_unknown_joints_are_not_attached(graph):
    joints, sure = standing(), SURE.copy()
    joints[Joint.ELBOW_LEFT] = np.nan
    sure[Joint.KNEE_RIGHT] = 0.0
    sure[Joint.HEAD] = np.nan
    held = attach(graph, joints, sure)
    on_bone = (held.along > 0) & (held.along < 1)
    lost = {Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT, Joint.HEAD}
    assert set(held.bone[on_bone]) == set(range(1, J)) - {int(j) for j in lost}
    assert not {Joint.ELBOW_LEFT, Joint.KNEE_RIGHT, Joint.HEAD} & set(held.bone[~on_bone])


@pytest.mark.parametrize(("joints", "sure"), [(np.zeros((19, 3)), SURE), (standing(), np.ones(19))])
def test_wrong_shapes_are_refused(graph, joints, sure):
    with pytest.raises(InputError):
        attach(graph, joints, sure)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_held_points_follow_a_rigid_body_rigidly(graph, seed):
    held = attach(graph, standing(), SURE)
    rng = np.random.default_rng(seed)
    turn, shift = rotation.from_rotation_vector(3 * rng.normal(size=3)), rng.normal(size=3)
    targets = held.targets(rotation.rotate(turn, standing()) + shift)
    np.testing.assert_allclose(targets, rotation.rotate(turn, held.points) + shift, atol=1e-9)


def test_at_the_moment_of_taking_hold_nothing_moves(held):
    np.testing.assert_allclose(held.targets(standing()), held.points, atol=1e-12)


def test_an_elbow_moves_the_forearm_only(held):
    joints = standing()
    forward = joints[Joint.WRIST_LEFT] - joints[Joint.ELBOW_LEFT]
    hinge = np.cross(forward, [0.0, 1.0, 0.0])
    hinge /= np.linalg.norm(hinge)
    bent = moved(joints, hinge, joints[Joint.ELBOW_LEFT], (Joint.WRIST_LEFT, Joint.HAND_LEFT))
    shift = np.linalg.norm(held.targets(bent) - held.points, axis=1)
    forearm = np.isin(held.bone, [Joint.WRIST_LEFT, Joint.HAND_LEFT])
    assert shift[~forearm].max() < 1e-9
    turn = rotation.from_rotation_vector(hinge)
    expected = rotation.rotate(turn, held.points - joints[Joint.ELBOW_LEFT]) + joints[Joint.ELBOW_LEFT]
    np.testing.assert_allclose(held.targets(bent)[forearm], expected[forearm], atol=1e-9)


def test_points_slide_along_a_bone_that_gets_longer(held):
    longer = standing()
    offset = longer[Joint.WRIST_LEFT] - longer[Joint.ELBOW_LEFT]
    longer[Joint.WRIST_LEFT] += offset
    on_bone = held.bone == Joint.WRIST_LEFT
    expected = held.points[on_bone] + held.along[on_bone, None] * offset
    np.testing.assert_allclose(held.targets(longer)[on_bone], expected, atol=1e-9)


def test_limbs_twist_with_the_torso():
    joints = standing()
    turned = moved(joints, [0, 0.8, 0], np.zeros(3), range(J))
    turns, axes = bone_rotations(joints, turned)
    expected = rotation.to_matrix(rotation.from_rotation_vector([0, 0.8, 0]))
    np.testing.assert_allclose(turns, np.broadcast_to(expected, (19, 3, 3)), atol=1e-9)
    np.testing.assert_allclose(axes[0], expected, atol=1e-9)


def arm_pose(direction):
    """Returns a standing person whose left arm points in a direction. At rest, the arm hangs."""
    joints = standing()
    shoulder = joints[Joint.SHOULDER_LEFT]
    for joint, reach in zip(LEFT_ARM[1:], (0.28, 0.53, 0.61), strict=True):
        joints[joint] = shoulder + reach * np.asarray(direction)
    return joints


@pytest.mark.parametrize("way", ["side", "front"])
def test_a_raised_arm_never_spins(way):
    """The arm moves from hanging to overhead and beyond. Each step rotates the bone by little more than
    itself.
    """
    rest = arm_pose([0, -1, 0])
    last = None
    for angle in np.linspace(0, np.pi + 0.2, 120):
        out = [np.sin(angle), 0] if way == "side" else [0, np.sin(angle)]
        turn = bone_rotations(rest, arm_pose([out[0], -np.cos(angle), out[1]]))[0][Joint.ELBOW_LEFT - 1]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        if last is not None:
            step = rotation.to_rotation_vector(rotation.from_matrix(turn @ last.T))
            assert np.linalg.norm(step) < 6 * (np.pi + 0.2) / 119
        last = turn


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_bones_turn_to_where_they_point_whatever_the_body_does(seed):
    rng = np.random.default_rng(seed)
    joints = rng.normal(size=(J, 3))
    turns, _ = bone_rotations(standing(), joints)
    for (parent, child), turn in zip(BONES, turns, strict=True):
        before = standing()[child] - standing()[parent]
        after = joints[child] - joints[parent]
        expected = after / np.linalg.norm(after)
        np.testing.assert_allclose(turn @ before / np.linalg.norm(before), expected, atol=1e-6)
        assert np.linalg.det(turn) == pytest.approx(1.0)


def test_degenerate_bodies_are_tolerated():
    for joints in (np.zeros((J, 3)), np.full((J, 3), np.nan), np.tile([0.0, 1, 0], (J, 1))):
        for rest in (standing(), joints):
            turns, axes = bone_rotations(rest, joints)
            assert np.isfinite(turns).all() and np.isfinite(axes).all()


def test_lost_joints_give_no_target_and_no_weight(held):
    joints, sure = standing(), SURE.copy()
    joints[Joint.KNEE_LEFT] = np.nan
    sure[Joint.ELBOW_RIGHT] = 0.0
    sure[Joint.HEAD] = np.nan
    targets, weights = held.targets(joints), held.target_weights(sure)
    at_ankle = (held.bone == Joint.ANKLE_LEFT) & (held.along == 1)
    on_knee = np.isin(held.bone, [Joint.KNEE_LEFT, Joint.ANKLE_LEFT]) & ~at_ankle
    assert np.isnan(targets[on_knee]).all()
    np.testing.assert_allclose(targets[~on_knee], held.points[~on_knee], atol=1e-9)
    at_wrist = (held.bone == Joint.WRIST_RIGHT) & (held.along == 1)
    lost = np.isin(held.bone, [Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HEAD]) & ~at_wrist
    assert (weights[lost] == 0).all()
    assert (weights[~lost] == 1).all()


def test_the_weight_rises_smoothly_with_confidence(held):
    levels = np.linspace(0, 1, 101)
    weights = np.array([held.target_weights(np.full(J, level))[0] for level in levels])
    assert weights[0] == 0 and weights[-1] == 1
    steps = np.diff(weights)
    assert (steps >= 0).all() and steps.max() < 0.02


def test_taking_hold_of_a_deformed_mesh_moves_nothing(graph):
    joints = standing()
    first = attach(graph, joints, SURE)
    lifted = moved(joints, [-0.5, 0, 0], joints[Joint.KNEE_LEFT], (Joint.ANKLE_LEFT, Joint.FOOT_LEFT))
    solver = EmbeddedSolver(graph, first)
    state = solver.solve(first.targets(lifted))
    again = attach(graph, lifted, SURE, deformed=state)
    assert len(again) > 0.7 * len(first)
    # Each point was transformed to the rest pose. Transformed back, it is at the body's point.
    linear, positions = state
    arms = again.points[:, None] - graph.positions[again.node_indices]
    forth = np.einsum("lkab,lkb->lka", linear[again.node_indices], arms) + positions[again.node_indices]
    forth = (forth * again.node_weights[..., None]).sum(1)
    gaps = np.linalg.norm(forth - again.targets(lifted), axis=1)
    assert np.median(gaps) < 1e-3 and gaps.max() < 0.03
    # Stretched parts relax slightly, and nothing jumps.
    after = EmbeddedSolver(graph, again, start=state).solve(again.targets(lifted))[1]
    moves = np.linalg.norm(after - positions, axis=1)
    assert moves.mean() < 0.01 and moves.max() < 0.06


def test_a_walking_leg_moves_the_chair_leg_with_it(graph):
    joints = standing()
    held = attach(graph, joints, SURE)
    solver = EmbeddedSolver(graph, held)
    leg = (Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT)
    for part in np.linspace(0, 1, 10):
        step = moved(joints, [-0.5 * part, 0, 0], joints[Joint.HIP_LEFT], leg)
        linear, positions = solver.solve(held.targets(step))
    low = graph.positions[:, 1] < 0.3
    back, left = graph.positions[:, 2] < 0.2, graph.positions[:, 0] > 0
    forward = (positions - graph.positions)[:, 2]
    assert forward[low & back & left].mean() > 0.25
    assert abs(forward[low & back & ~left].mean()) < 0.1
    assert np.linalg.det(linear).min() > 0.5


def test_every_bone_belongs_to_its_child():
    assert [child for _, child in BONES] == list(range(1, J))
    assert [parent for parent, _ in BONES] == list(PARENTS[1:])


def plainly_nearest(points, normals, nodes, node_normals, reach, cosine):
    """Returns the nearest nodes of each sample by sorting all nodes, as a reference for
    ``nearest_facing``.
    """
    for point, normal in zip(points, normals, strict=True):
        lengths = np.linalg.norm(nodes - point, axis=1)
        fits = (lengths < reach) & (~normal.any() | (node_normals @ normal > cosine))
        order = np.flatnonzero(fits)[np.argsort(lengths[fits], kind="stable")][:4]
        yield order, lengths[order]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 3.0), st.floats(-0.9, 0.9))
def test_the_nearest_nodes_are_those_that_a_look_at_all_would_find(seed, reach, cosine):
    rng = np.random.default_rng(seed)
    points, nodes = rng.normal(size=(30, 3)), rng.normal(size=(50, 3))
    normals, node_normals = rng.normal(size=(30, 3)), rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    node_normals /= np.linalg.norm(node_normals, axis=1, keepdims=True)
    normals[20:] = 0
    starts = np.array([0, 7, 7, 20, *range(21, 31)])
    indices, lengths = nearest_facing(points, normals, starts, nodes, node_normals, reach, cosine)
    expected = plainly_nearest(points, normals, nodes, node_normals, reach, cosine)
    for i, (who, near) in enumerate(expected):
        assert indices[i, : len(who)].tolist() == who.tolist()
        np.testing.assert_allclose(lengths[i, : len(who)], near, atol=1e-12)
        assert np.isinf(lengths[i, len(who) :]).all()


@settings(deadline=None, max_examples=20)
@given(st.floats(0.0, 1.0), st.floats(0.05, 0.6))
def test_each_limb_reaches_until_enough_of_it_holds(graph, enough, farthest):
    """As if each were attached alone, with reach after reach; arms, as far as the whole body needs."""
    grown = attach(
        graph, standing(), SURE, settings=AttachmentSettings(reach=0.03), grow=ReachGrowth(enough, farthest)
    )
    limbs = [range(4), range(4, 8), range(8, 12), range(12, 16), range(16, 20)]
    for number, limb in enumerate(limbs):
        looked_at = set(range(1, J)) if number in (1, 2) else set(limb) - {0}
        reach = 0.03
        while True:
            plain = attach(graph, standing(), SURE, settings=AttachmentSettings(reach=reach))
            if len(set(plain.bone) & looked_at) >= enough * len(looked_at) or reach >= farthest:
                break
            reach = min(1.5 * reach + 0.01, farthest)
        expected, is_held = np.isin(plain.bone, limb), np.isin(grown.bone, limb)
        np.testing.assert_array_equal(grown.bone[is_held], plain.bone[expected])
        np.testing.assert_allclose(grown.node_weights[is_held], plain.node_weights[expected], atol=1e-12)


def test_named_arm_is_attached_at_any_distance(graph):
    joints = standing()
    joints[[Joint.WRIST_LEFT, Joint.HAND_LEFT, Joint.ELBOW_LEFT, Joint.SHOULDER_LEFT]] += [0.3, 0.0, 0.0]
    grow = ReachGrowth(0.25, 5.0)
    for parts in ("legs + left arm", "left arm"):
        held = attach(graph, joints, SURE, parts, AttachmentSettings(reach=0.03), grow=grow)
        assert set(held.bone) & {4, 5, 6, 7}


def test_the_hip_alone_holds_by_more_than_a_point(graph):
    """With more than one point, the hip can also rotate the mesh."""
    held = attach(graph, standing(), SURE, "hip", AttachmentSettings(reach=3.0))
    assert len(held) > 4
    assert set(held.bone) == {1} and held.along.max() < 0.5
    spread = held.points - held.points.mean(0)
    assert np.linalg.matrix_rank(spread, tol=1e-3) == 3
    turned = standing() @ np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    moved = held.targets(turned)
    np.testing.assert_allclose(
        moved - moved.mean(0), spread @ np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), atol=1e-9
    )


def test_a_node_squashed_flat_leaves_held_points_finite(graph):
    linear = np.tile(np.eye(3), (len(graph.positions), 1, 1))
    linear[::2, 2] = 0
    again = attach(graph, standing(), SURE, deformed=(linear, graph.positions))
    assert len(again) > 0 and np.isfinite(again.points).all()
