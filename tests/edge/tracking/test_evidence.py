"""What a frame says of a joint, and the confidence made of it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking import evidence as of_joints
from enliven_edge.tracking import model, ranges
from enliven_edge.tracking.confidence import GROUP_OF_JOINT, confidence
from enliven_edge.tracking.evidence import NAMES
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.observation import Observation, nearest_columns
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.settings import FitSettings

MOUNT = np.diag([1.0, -1.0, -1.0, 1.0])
MOUNT[1, 3] = 1.0
CAMERA = np.array([130.0, 130.0, 79.5, 59.5])


def standing(x: float = 0.0) -> Posture:
    return Posture(np.array([x, 0.95, -2.5]), ranges.standing(), model.lengths_for_height(1.7))


def picture(posture: Posture) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) depth and mask of the capsules before a wall at 4 m: every pixel's ray against every capsule."""
    ends, radii = posture.capsules()
    v, u = np.mgrid[:120, :160]
    ray = np.stack([(u - CAMERA[2]) / CAMERA[0], (v - CAMERA[3]) / CAMERA[1], np.ones(u.shape)], -1)
    direction = ray @ MOUNT[:3, :3].T
    depth = np.full(u.shape, 4.0)
    for (a, b), (ra, rb) in zip(ends, radii, strict=True):
        for t in np.linspace(0, 1, 25):
            centre, radius = a + t * (b - a) - MOUNT[:3, 3], ra + t * (rb - ra)
            along = direction @ centre
            square = (direction**2).sum(-1)
            inside = along**2 - square * (centre @ centre - radius**2)
            hit = (along - np.sqrt(np.maximum(inside, 0))) / square
            depth = np.where((inside > 0) & (hit < depth), hit, depth)
    return depth, depth < 4.0


def observed(posture: Posture, hide=None) -> Observation:
    """The observation of a posture's own picture, rows from ``hide`` on behind a board at one metre."""
    depth, mask = picture(posture)
    if hide is not None:
        depth[hide:], mask[hide:] = 1.0, False
    rows, columns = np.nonzero(mask)
    z = depth[mask]
    camera = np.stack([(columns - CAMERA[2]) / CAMERA[0] * z, (rows - CAMERA[3]) / CAMERA[1] * z, z], 1)
    points = camera @ MOUNT[:3, :3].T + MOUNT[:3, 3]
    towards = MOUNT[:3, 3] - points
    normals = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    view = (depth, mask, nearest_columns(mask), CAMERA, MOUNT)
    pixels = np.stack([rows, columns], 1)
    return Observation(points.astype(np.float32), normals.astype(np.float32), pixels, view, False)


def test_a_person_in_full_view_is_visible_and_a_shifted_one_is_seen_through():
    seen = of_joints.capsule_shares(*standing().capsules(), observed(standing()).view)
    np.testing.assert_allclose(seen.sum(1), 1.0)
    assert seen[:, 0].mean() > 0.9
    beside = of_joints.capsule_shares(*standing(0.6).capsules(), observed(standing()).view)
    assert beside[:, 2].mean() > 0.8


def test_what_a_board_hides_is_hidden_and_what_is_beside_the_image_is_outside():
    hidden = of_joints.capsule_shares(*standing().capsules(), observed(standing(), hide=70).view)
    shins = np.isin(model.CAPSULES.frame, [model.SHIN_L, model.SHIN_R])
    assert hidden[shins, 1].min() == 1.0
    outside = of_joints.capsule_shares(*standing(5.0).capsules(), observed(standing()).view)
    assert outside[:, 3].min() == 1.0


def test_a_joint_that_nothing_holds_is_the_loosest():
    """Behind a board from the hips down, the feet are looser than the hands, and looser than in full view."""
    fitter = Fitter(FitSettings())
    full = of_joints.uncertainty(fitter, standing(), observed(standing()))
    hidden = of_joints.uncertainty(fitter, standing(), observed(standing(), hide=70))
    feet, head = [15, 19], 3
    assert hidden[feet].min() > 2.0 * hidden[head]
    assert (hidden[feet] > 1.5 * full[feet]).all()


@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_uncertainty_is_that_of_the_inverse_matrix(seed):
    """The factor's short cut against the plain J inv(H) J' with numerical derivatives."""
    from enliven_edge.tracking.gauss_newton import stepped

    posture = standing()
    turns = (model.DOF_FRAME, model.DOF_AXIS)
    step = np.random.default_rng(seed).normal(0, 0.2, 42) * np.r_[np.ones(30), np.zeros(12)]
    posture = Posture(*stepped(posture.position, posture.rotations, posture.lengths, step, *turns))
    fitter, observation = Fitter(FitSettings()), observed(standing())
    upper = fitter.information(posture, observation)
    full = np.triu(upper) + np.triu(upper, 1).T + 1e-3 * np.eye(30)
    rows, h = np.zeros((20, 3, 30)), 1e-6
    for k in range(30):
        for sign in (1, -1):
            moved = np.zeros(42)
            moved[k] = sign * h
            at = Posture(*stepped(posture.position, posture.rotations, posture.lengths, moved, *turns))
            rows[:, :, k] += sign * at.joints() / (2 * h)
    slow = np.sqrt(np.einsum("jak,kl,jal->j", rows, np.linalg.inv(full), rows))
    np.testing.assert_allclose(of_joints.uncertainty(fitter, posture, observation), slow, rtol=1e-3)


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_confidence_is_a_probability_and_alike_for_both_sides(seed):
    found = np.random.default_rng(seed).uniform(0, 3, (20, len(NAMES)))
    found[:, NAMES.index("outside")] = 0.0
    left, right = slice(4, 8), slice(8, 12)
    found[right] = found[left]
    sure = confidence(found)
    assert ((sure >= 0) & (sure <= 1)).all()
    np.testing.assert_array_equal(sure[left], sure[right])
    assert (GROUP_OF_JOINT[left] == GROUP_OF_JOINT[right]).all()


def test_what_is_outside_the_image_is_not_invented():
    found = np.ones((20, len(NAMES)))
    found[15, NAMES.index("outside")] = 1.0
    found[19, NAMES.index("outside")] = 0.0
    sure = confidence(found)
    assert sure[15] == 0.0
    assert sure[19] > 0.0


def test_a_joint_that_is_visible_is_surer_than_one_that_is_seen_through():
    """The same evidence otherwise, that of a usual frame. The weights are learnt: for the hands, whose thin
    capsules are seen through rightly too, it is a draw."""
    usual = np.zeros((20, len(NAMES)))
    for name, value in (
        ("constant", 1),
        ("support", 2),
        ("visible beside", 1),
        ("uncertainty", -3),
        ("explained", 1),
    ):
        usual[:, NAMES.index(name)] = value
    visible, through = usual.copy(), usual.copy()
    visible[:, NAMES.index("visible")] = 1.0
    through[:, NAMES.index("seen through")] = 1.0
    through[:, NAMES.index("violated")] = 1 / 20  # a capsule of twenty
    surer = confidence(visible) - confidence(through)
    assert surer.min() > -0.05 and np.median(surer) > 0.3
