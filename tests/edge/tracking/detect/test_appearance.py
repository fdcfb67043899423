"""Tests of appearance: body parts at points, the limbs to which they belong, and a person's facing."""

from __future__ import annotations

import numpy as np
import pytest
from bodies_for_tests import foot
from estimates_for_tests import EYE, estimate_of, seen_as, ways_of
from hypothesis import given, settings
from hypothesis import strategies as st
from people_seen_for_tests import CLASSES, SEEDS, seen_in, seen_person, taken
from tolerances import are_alike, assert_alike

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.detect.appearance import (
    CAPSULE_PARTS,
    chest_facing,
    compute_facing_score,
    estimate_at_points,
    flip_posture,
    network_agreement,
)
from enliven_edge.tracking.estimator.labels import FACINGS, MIRRORED, PARTS, BodyPart

PARTS_RIGHT = 0.6
"""Minimum fraction of points with the correct body part from the shipped network."""
FRONT_TOLD = 0.7
"""Minimum fraction of people with the correct facing, front or back."""
YAWS = st.floats(-3.1, 3.1)
NECK = 6
"""Index of the neck capsule between the two sides, which contains a little of each side."""
MIRRORED_CAPSULE = np.array(
    [3, 4, 5, 0, 1, 2, 6, 7, *range(11, 14), *range(8, 11), *range(17, 20), *range(14, 17)]
)


def standing(yaw: float = 0.0) -> Posture:
    return Posture(
        np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(yaw), model.lengths_for_height(1.7)
    )


def noise(seed: int, count: int = 30):
    """Returns random (points, probabilities)."""
    dice = np.random.default_rng(seed)
    probabilities = dice.dirichlet(np.full(PARTS, 0.2), count)
    return dice.normal([0, 1, -2.5], 0.5, (count, 3)), probabilities


def surface_of(posture: Posture, points_each: int = 12):
    """Returns (points, probabilities) on a posture's capsules. Each point certainly has a part of its
    capsule.
    """
    dice = np.random.default_rng(0)
    (ends, radii), points, shown = posture.capsules(), [], []
    for c, (a, b) in enumerate(ends):
        for t in dice.uniform(0.2, 0.8, points_each):
            out = np.cross(b - a, dice.normal(size=3))
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            points.append(a + t * (b - a) + radius * out / np.linalg.norm(out))
            shown.append(np.eye(PARTS)[CAPSULE_PARTS[c].argmax()])
    return np.array(points), np.array(shown)


def test_every_capsule_carries_a_part_and_every_part_is_carried():
    assert (CAPSULE_PARTS.sum(1) >= 1).all() and (CAPSULE_PARTS.sum(0) >= 1).all()
    assert set(np.unique(CAPSULE_PARTS)) == {0.0, 1.0}


def test_a_capsule_of_the_other_side_carries_the_other_sides_parts():
    assert np.array_equal(CAPSULE_PARTS[MIRRORED_CAPSULE], CAPSULE_PARTS[:, MIRRORED])
    x = model.CAPSULES.ends @ model.lengths_for_height(1.7)
    np.testing.assert_allclose(x[MIRRORED_CAPSULE], x * [-1, 1, 1], atol=1e-12)


def test_parent_of_a_left_part_is_on_the_left():
    x = standing().capsules()[0].mean(1)[:, 0]
    for part in range(1, PARTS):
        carriers = [c for c in np.flatnonzero(CAPSULE_PARTS[:, part]) if c != NECK]
        side = 1 if part % 2 else -1
        assert carriers and all(side * x[c] > 0.02 for c in carriers), BodyPart(part).name


@given(st.integers(0, 10_000), st.floats(0.01, 0.5))
@settings(max_examples=25, deadline=None)
def test_a_point_is_farther_from_a_capsule_the_less_it_looks_like_it(seed, metres):
    """One point and one capsule at a time."""
    points, shown = noise(seed, 12)
    sighting = seen_as(estimate_of(np.zeros((20, 3))), points, shown)
    affinity, sideless = sighting.affinity(metres), sighting.sideless_affinity(metres)
    assert affinity.shape == (20, 12) and affinity.dtype == np.float32
    for c in range(20):
        for i in range(12):
            like = sum(shown[i, p] for p in range(PARTS) if CAPSULE_PARTS[c, p])
            either = sum(
                shown[i, p] for p in range(PARTS) if CAPSULE_PARTS[c, p] or CAPSULE_PARTS[c, MIRRORED[p]]
            )
            assert affinity[c, i] == pytest.approx(metres * (1 - like), abs=1e-5)
            assert sideless[c, i] == pytest.approx(metres * (1 - either), abs=1e-5)
    assert (
        affinity.min() > -1e-5 and affinity.max() <= metres * 1.0001 and (sideless <= affinity + 1e-5).all()
    )


def test_a_left_hand_is_far_from_the_right_one_unless_sides_do_not_matter():
    shown = np.eye(PARTS)[[BodyPart.HAND_LEFT]]
    seen = seen_as(estimate_of(np.zeros((20, 3))), np.zeros((1, 3)), shown)
    left, right = (
        int(np.flatnonzero(CAPSULE_PARTS[:, part])[0]) for part in (BodyPart.HAND_LEFT, BodyPart.HAND_RIGHT)
    )
    assert seen.affinity(0.1)[[left, right], 0].tolist() == pytest.approx([0.0, 0.1])
    assert seen.sideless_affinity(0.1)[[left, right], 0].tolist() == pytest.approx([0.0, 0.0])


@given(st.integers(0, 10_000), st.integers(1, 9))
@settings(max_examples=25, deadline=None)
def test_thinning_keeps_what_each_point_looks_like(seed, step):
    seen = seen_as(estimate_of(np.zeros((20, 3))), *noise(seed))
    thin = seen.thin(step)
    assert np.array_equal(thin.surface, seen.surface[:, ::step])
    assert np.array_equal(thin.rays, seen.rays[::step])
    assert are_alike(thin.affinity(0.1), seen.affinity(0.1)[:, ::step])
    assert thin.estimate is seen.estimate


@given(YAWS)
@settings(max_examples=20, deadline=None)
def test_a_posture_agrees_with_its_own_surface_more_than_turned_about(yaw):
    seen = seen_as(estimate_of(standing(yaw).joints()), *surface_of(standing(yaw)))
    own, other = network_agreement(seen, standing(yaw)), network_agreement(seen, flip_posture(standing(yaw)))
    assert own > 0.8
    assert 0.0 <= other < own - 0.4


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_agreement_is_the_mean_likelihood_on_the_nearest_surface(seed):
    """A point between two capsules may be evaluated on either: the search compares 18 bits of distances."""
    points, shown = noise(seed)
    seen, posture = seen_as(estimate_of(np.zeros((20, 3))), points, shown), standing(0.3)
    surfaces = list(zip(*posture.capsules(), strict=True))
    likelihoods = []
    for point, shares in zip(points, seen.probabilities.T, strict=True):
        away = np.abs([foot(*point, ends, radii)[1] for ends, radii in surfaces])
        likelihoods.append((CAPSULE_PARTS @ shares)[away < away.min() * (1 + 1e-5) + 1e-6])
    lowest, highest = (np.mean([bound(each) for each in likelihoods]) for bound in (min, max))
    assert lowest - 1e-6 < network_agreement(seen, posture) < highest + 1e-6


@given(YAWS, st.floats(-0.6, 0.6))
@settings(max_examples=30, deadline=None)
def test_turning_about_reverses_the_facing(yaw, bend):
    assert np.cos(
        chest_facing(flip_posture(standing(yaw)), EYE) - chest_facing(standing(yaw), EYE)
    ) == pytest.approx(-1)
    posture = standing(yaw)
    posture.rotations[model.CHEST] = rotation(x=bend, z=0.5 * bend)
    kept = posture.copy()
    np.testing.assert_allclose(flip_posture(flip_posture(posture)).joints(), kept.joints(), atol=1e-9)
    np.testing.assert_array_equal(posture.rotations, kept.rotations)


def test_facing_is_measured_from_the_sensor_anticlockwise_from_above():
    assert chest_facing(standing(), EYE) == pytest.approx(0.0)
    assert chest_facing(standing(0.7), EYE) == pytest.approx(0.7)
    assert chest_facing(standing(), EYE + np.array([2.5, 0, 0])) == pytest.approx(-np.pi / 4)


@given(YAWS)
@settings(max_examples=30, deadline=None)
def test_posture_with_the_observed_facing_scores_best(yaw):
    seen = seen_as(estimate_of(standing().joints(), ways=ways_of(standing(yaw), 4.0)))
    scores = [compute_facing_score(seen, standing(yaw + off), EYE) for off in (0.0, 1.0, 2.0, np.pi)]
    assert scores == sorted(scores, reverse=True)
    assert scores[0] - scores[3] > 6.0


@given(st.integers(0, 10_000), st.integers(0, FACINGS - 1))
@settings(max_examples=30, deadline=None)
def test_a_way_between_two_is_as_likely_as_both(seed, way):
    ways = np.random.default_rng(seed).normal(0, 2, FACINGS)
    seen, eighth = seen_as(estimate_of(standing().joints(), ways=ways)), np.pi / 4
    here, next_, between = (
        compute_facing_score(seen, standing(turn * eighth), EYE) - 0.5 * np.cos(turn * eighth)
        for turn in (way, way + 1, way + 0.25)
    )
    assert here == pytest.approx(ways[way] - ways.max(), abs=1e-6)
    assert between == pytest.approx(0.75 * here + 0.25 * next_, abs=1e-6)


def test_ambiguous_facing_defaults_to_the_sensor():
    seen = seen_as(estimate_of(standing().joints()))
    assert compute_facing_score(seen, standing(), EYE) > compute_facing_score(seen, standing(np.pi), EYE)


def test_the_parts_at_the_points_are_those_of_the_picture():
    right = []
    for name in CLASSES:
        for seed in SEEDS:
            observation, _ = seen_person(name, seed)
            seen, _ = seen_in(observation)
            assert seen.probabilities.shape == (PARTS, len(observation.points))
            truth = taken(name, seed).label[tuple(observation.pixels.T)]
            right.append(np.mean(seen.probabilities.argmax(0) == truth))
    assert np.mean(right) > PARTS_RIGHT


def test_network_distinguishes_front_and_back_for_most():
    right = []
    for name in ("arms overhead", "back", "crouching", "one leg up", "kneeling"):
        for seed in SEEDS:
            observation, _ = seen_person(name, seed)
            seen, eye = seen_in(observation)[0], observation.view[4][:3, 3].copy()
            front = Posture(
                observation.points.mean(0).astype(float), joint_limits.standing_pose(), standing().lengths
            )
            right.append(
                (
                    compute_facing_score(seen, front, eye)
                    > compute_facing_score(seen, flip_posture(front), eye)
                )
                == (name != "back")
            )
    assert np.mean(right) > FRONT_TOLD


def test_another_estimate_of_the_same_frame_is_seen_at_the_same_points():
    """The result equals that of a separate evaluation, with all points or with a sample."""
    observation, _ = seen_person("one leg up", SEEDS[0])
    seen, by_facing = seen_in(observation)
    for estimate in by_facing:
        other, itself = seen.with_estimate(estimate), estimate_at_points(observation, estimate)
        assert other.estimate is estimate and other.surface is observation.surface
        assert_alike(other.probabilities, itself.probabilities)
        assert_alike(seen.thin(7).with_estimate(estimate).affinity(0.1), other.affinity(0.1)[:, ::7])
    np.testing.assert_allclose(seen.with_estimate(by_facing[0]).probabilities, seen.probabilities, atol=1e-3)
