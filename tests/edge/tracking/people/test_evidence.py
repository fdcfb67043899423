"""Tests of a frame's evidence for a joint, and of the resulting confidence."""

from functools import cache

import numpy as np
import pytest
from estimates_for_tests import estimate_of
from hypothesis import given, settings
from hypothesis import strategies as st
from postures_seen_for_tests import observed
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.people import evidence as of_joints
from enliven_edge.tracking.people.confidence import (
    ALONE,
    GROUP_OF_JOINT,
    WITH_NETWORK,
    joint_confidences,
    load_evidence_weights,
)
from enliven_edge.tracking.people.evidence import NAMES
from enliven_edge.tracking.settings import FitSettings


def standing(x: float = 0.0) -> Posture:
    return Posture(np.array([x, 0.95, -2.5]), joint_limits.standing_pose(), model.lengths_for_height(1.7))


def test_a_person_in_full_view_is_visible_and_a_shifted_one_is_seen_through():
    seen = of_joints.capsule_visibility(*standing().capsules(), observed(standing()).view)
    np.testing.assert_allclose(seen.sum(1), 1.0)
    assert seen[:, 0].mean() > 0.9
    beside = of_joints.capsule_visibility(*standing(0.6).capsules(), observed(standing()).view)
    assert beside[:, 2].mean() > 0.8


def test_joints_behind_board_are_occluded_and_beyond_image_are_outside():
    hidden = of_joints.capsule_visibility(*standing().capsules(), observed(standing(), hide=70).view)
    shins = np.isin(model.CAPSULES.frame, [model.SHIN_L, model.SHIN_R])
    assert hidden[shins, 1].min() == 1.0
    outside = of_joints.capsule_visibility(*standing(5.0).capsules(), observed(standing()).view)
    assert outside[:, 3].min() == 1.0


def looseness(posture, information):
    """Returns (20,) the uncertainty of each joint, from how weakly the fit constrains it."""
    state = (posture.position, posture.rotations, posture.lengths)
    turns = (model.MOVES, model.DOF_FRAME, model.DOF_AXIS, model.FRAME_LENGTHS)
    body = (model.FRAME_PARENTS, model.PIVOTS, turns, model.JOINT_FRAMES, model.JOINT_OFFSETS)
    return of_joints.joint_uncertainty(information, *state, *body)[1]


@pytest.mark.slow
def test_unconstrained_joint_is_the_loosest():
    """Hips and legs are behind a board. The feet are less constrained than the hands, and than in full
    view.
    """
    fitter = Fitter(FitSettings())
    full, hidden = (
        looseness(standing(), fitter.fit(seen, standing(), iterations=0)[1].information)
        for seen in (observed(standing()), observed(standing(), hide=70))
    )
    feet, head = [15, 19], 3
    assert hidden[feet].min() > 2.0 * hidden[head]
    assert (hidden[feet] > 1.5 * full[feet]).all()


@given(st.floats(-0.3, 0.3), st.booleans(), st.integers(0, 6))
@settings(max_examples=10, deadline=None)
def test_fit_information_excludes_the_prediction(turned, built, steps):
    """At the final posture, without the temporal prediction, with free or frozen lengths."""
    fitter, observation = Fitter(FitSettings()), in_full_view()
    firmness = np.full(12, 40.0) if built else None
    options = {"predicted": standing(), "proportions": firmness, "iterations": steps}
    ended, report = fitter.fit(observation, standing(turned), **options)
    alone = fitter.fit(observation, ended, iterations=0)[1].information
    # The prediction is added and subtracted again; matrix entries reach a hundred thousand.
    np.testing.assert_allclose(report.information, alone, rtol=1e-9, atol=1e-8)


@pytest.mark.slow
@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_uncertainty_is_that_of_the_inverse_matrix(seed):
    """The factorised computation equals J inv(H) J' with numerical derivatives."""
    from enliven_edge.tracking.fit.gauss_newton import apply_step

    posture = standing()
    turns = (model.DOF_FRAME, model.DOF_AXIS)
    step = np.random.default_rng(seed).normal(0, 0.2, 42) * np.r_[np.ones(30), np.zeros(12)]
    posture = Posture(*apply_step(posture.position, posture.rotations, posture.lengths, step, *turns))
    fitter, observation = Fitter(FitSettings()), observed(standing())
    upper = fitter.fit(observation, posture, iterations=0)[1].information
    full = np.triu(upper) + np.triu(upper, 1).T + 1e-3 * np.eye(30)
    rows, h = np.zeros((20, 3, 30)), 1e-6
    for k in range(30):
        for sign in (1, -1):
            moved = np.zeros(42)
            moved[k] = sign * h
            at = Posture(*apply_step(posture.position, posture.rotations, posture.lengths, moved, *turns))
            rows[:, :, k] += sign * at.joints() / (2 * h)
    slow = np.sqrt(np.einsum("jak,kl,jal->j", rows, np.linalg.inv(full), rows))
    np.testing.assert_allclose(looseness(posture, upper), slow, rtol=1e-3)


def test_the_network_is_evidence_where_there_is_one():
    """The evidence is the estimated joint error, and the distance between the joint and its estimate."""
    fitter, observation = Fitter(FitSettings()), observed(standing())
    posture, report = fitter.fit(observation, standing())
    estimate = estimate_of(posture.joints() + np.array([0.0, 0.0, 0.3]), np.linspace(0.02, 0.4, 20))
    last = [NAMES.index("spread"), NAMES.index("apart")]
    alone = of_joints.joint_evidence(posture, report, observation, np.zeros(20))
    evidence = of_joints.joint_evidence(posture, report, observation, np.zeros(20), estimate)
    assert evidence.shape == (20, len(NAMES)) and not alone[:, last].any()
    assert_alike(np.delete(evidence, last, 1), np.delete(alone, last, 1), SOLVER_TOLERANCE)
    np.testing.assert_allclose(np.exp(evidence[:, last[0]]), estimate.expected_errors)
    nearer = estimate_of(posture.joints() + np.array([0.0, 0.0, 0.1]))
    near = of_joints.joint_evidence(posture, report, observation, np.zeros(20), nearer)
    assert (near[:, last[1]] < evidence[:, last[1]]).all()


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=30, deadline=None)
def test_gathered_evidence_matches_the_slow_reference(seed, alone):
    random = np.random.default_rng(seed)
    shares, support, violated = random.random((20, 4)), random.integers(0, 90, 20) * 1.0, random.random(20)
    loose, unsupported = random.uniform(0.01, 2, 20), random.integers(0, 50, 20) * 1.0
    joints, network_joints, spread = (
        random.normal(size=(20, 3)),
        random.normal(size=(20, 3)),
        random.uniform(0, 1, 20),
    )
    first, second = of_joints.neighbour_averages()
    of_network = np.zeros((20, 2))
    if not alone:
        distances = np.linalg.norm(joints - network_joints, axis=1)
        of_network = np.stack([np.log(spread), np.log(0.02 + distances)], 1)
    counted = np.log1p(support)[:, None]
    slow = [np.ones((20, 1)), first @ counted, first @ shares, second @ counted, second @ shares]
    slow += [np.log(loose)[:, None], np.full((20, 1), 0.9), np.full((20, 1), violated.mean())]
    slow += [np.log1p(unsupported)[:, None], of_network]
    estimates = (np.zeros((0, 3)), np.zeros(0)) if alone else (network_joints, spread)
    gathered = of_joints.assemble_evidence(
        shares, support, violated, 0.9, loose, unsupported, joints, *estimates, first, second
    )
    np.testing.assert_allclose(gathered, np.concatenate(slow, 1), atol=1e-12)


@cache
def in_full_view():
    """Returns the view of a standing person, rendered once for all examples."""
    return observed(standing())


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_a_capsule_is_believed_by_its_share_of_the_points(seed):
    """By frontal area: a third of the points in full view is enough; occluded parts get none."""
    random = np.random.default_rng(seed)
    report = FitReport(1.0, 0.9, random.integers(0, 60, 20) * 1.0, random.random(20), np.eye(30))
    ends, radii = standing().capsules()
    area = (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) + radii.sum(1)) * radii.sum(1)
    observation = in_full_view()
    expected = len(observation.points) * area / area.sum()
    slow = np.minimum(1.0, report.support / np.maximum(1.0, 0.35 * expected)) * (1.0 - report.violated)
    confidences = of_joints.capsule_confidence(report, observation, standing())
    np.testing.assert_allclose(confidences, slow, atol=1e-12)


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=30, deadline=None)
def test_confidence_is_the_logistic_regression_of_the_joints_group(seed, alone):
    evidence = np.random.default_rng(seed).normal(0, 3, (20, len(NAMES)))
    evidence[:, NAMES.index("outside")] = np.random.default_rng(seed).choice([0.5, 0.98, 1.0], 20)
    table = load_evidence_weights(ALONE if alone else WITH_NETWORK)
    likely = [
        1 / (1 + np.exp(-(row @ table[group]))) for row, group in zip(evidence, GROUP_OF_JOINT, strict=True)
    ]
    slow = np.where(evidence[:, NAMES.index("outside")] == 1.0, 0.0, likely)
    np.testing.assert_allclose(joint_confidences(evidence, alone=alone), slow, atol=1e-12)


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=30, deadline=None)
def test_confidence_is_a_probability_and_alike_for_both_sides(seed, alone):
    evidence = np.random.default_rng(seed).uniform(0, 3, (20, len(NAMES)))
    evidence[:, NAMES.index("outside")] = 0.0
    left, right = slice(4, 8), slice(8, 12)
    evidence[right] = evidence[left]
    sure = joint_confidences(evidence, alone=alone)
    assert ((sure >= 0) & (sure <= 1)).all()
    assert_alike(sure[left], sure[right])
    assert (GROUP_OF_JOINT[left] == GROUP_OF_JOINT[right]).all()


@pytest.mark.parametrize("alone", [False, True])
def test_joints_outside_the_image_are_not_invented(alone):
    evidence = np.ones((20, len(NAMES)))
    evidence[15, NAMES.index("outside")] = 1.0
    evidence[19, NAMES.index("outside")] = 0.0
    sure = joint_confidences(evidence, alone=alone)
    assert sure[15] == 0.0
    assert sure[19] > 0.0


@pytest.mark.parametrize("alone", [False, True])
def test_visible_joint_is_surer_than_occluded_one(alone):
    """All other evidence has typical values.

    The weights are learnt. For the hands both confidences are equal, since correctly fitted thin capsules are
    often seen through as well.
    """
    usual = np.zeros((20, len(NAMES)))
    for name, value in (
        ("constant", 1),
        ("support", 2),
        ("visible beside", 1),
        ("uncertainty", -3),
        ("explained", 1),
        ("spread", 0 if alone else np.log(0.06)),
        ("apart", 0 if alone else np.log(0.06)),
    ):
        usual[:, NAMES.index(name)] = value
    visible, through = usual.copy(), usual.copy()
    visible[:, NAMES.index("visible")] = 1.0
    through[:, NAMES.index("seen through")] = 1.0
    through[:, NAMES.index("violated")] = 1 / 20  # one capsule of twenty
    surer = joint_confidences(visible, alone=alone) - joint_confidences(through, alone=alone)
    assert surer.min() > -0.3 and np.median(surer) > 0.1
