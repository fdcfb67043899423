"""Tests of facing, which is decided over several frames by the network's output and the walking direction."""

import numpy as np
import pytest
from estimates_for_tests import EYE, estimate_of, seen_as, ways_of

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import (
    Posture,
    chest_axes,
    chest_axes_about,
    facing_direction,
    rotation,
)
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, compute_facing_score, flip_posture
from enliven_edge.tracking.detect.fit_quality import Facing, facing_advantage, leaning_backward


def forward_in_plan(posture):
    """Returns the chest's (2,) facing, seen from above."""
    return np.array(facing_direction(chest_axes(posture.rotations)[0]))


STILL = (0.0, 0.0, 0.0)


def standing(yaw: float = 0.0) -> Posture:
    return Posture(
        np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(yaw), model.lengths_for_height(1.7)
    )


def seen_facing(posture: Posture | None, plainly: float = 2.5) -> EstimateAtPoints:
    """Returns the network's estimate for the posture's facing. If ``plainly`` is None, it has no
    preference.
    """
    joints = standing().joints() if posture is None else posture.joints()
    return seen_as(estimate_of(joints, ways=ways_of(posture, plainly)))


def verdicts(posture: Posture, seen: EstimateAtPoints, velocity=STILL, frames: int = 40) -> list[bool]:
    facing = Facing()
    return [facing.is_wrong(seen, posture, EYE, np.array(velocity, float)) for _ in range(frames)]


@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.5, np.pi, -2.0])
def test_correct_facing_is_kept(yaw):
    assert not any(verdicts(standing(yaw), seen_facing(standing(yaw))))


@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.5, np.pi, -2.0])
def test_wrong_facing_is_corrected_after_a_delay(yaw):
    wrong = verdicts(flip_posture(standing(yaw)), seen_facing(standing(yaw)))
    assert any(wrong)
    assert not any(wrong[:10]), "a few frames must not turn a person"


def test_person_walking_backwards_is_turned_round():
    """The network has no preference, so the walking direction decides."""
    sideways = standing(np.pi / 2)
    assert any(verdicts(flip_posture(sideways), seen_facing(None), velocity=(1.2, 0.0, 0.0)))
    assert not any(verdicts(sideways, seen_facing(None), velocity=(1.2, 0.0, 0.0)))


def test_stepping_back_from_a_settled_place_does_not_turn_a_person():
    facing, seen = Facing(), seen_facing(standing())
    assert not any(facing.is_wrong(seen, standing(), EYE, np.zeros(3)) for _ in range(30))
    assert not any(facing.is_wrong(seen, standing(), EYE, np.array([0.0, 0.0, -0.8])) for _ in range(30))


def test_facing_does_not_flip_when_bending_forward():
    bent = standing(0.4)
    bent.rotations[model.CHEST] = rotation(x=2.0)
    np.testing.assert_allclose(forward_in_plan(bent), [np.sin(0.4), np.cos(0.4)], atol=1e-9)


def bent(pitch: float, yaw: float = 0.0) -> Posture:
    """Returns a standing posture with the trunk bent forward by an angle in radians."""
    posture = standing(yaw)
    posture.rotations[model.PELVIS] = posture.rotations[model.PELVIS] @ rotation(x=pitch)
    return posture


@pytest.mark.parametrize("yaw", [0.0, 1.1, np.pi, -2.0])
def test_people_bend_forward(yaw):
    """A person bowing towards the sensor does not appear to lean back from it, even without network
    output.
    """
    assert leaning_backward(bent(0.0, yaw).rotations) == 0.0
    assert leaning_backward(bent(0.6, yaw).rotations) == 0.0
    assert leaning_backward(bent(-0.6, yaw).rotations) == pytest.approx(np.sin(0.6) - 0.15, abs=1e-6)
    assert any(verdicts(flip_posture(bent(0.6, yaw)), seen_facing(None)))
    assert not any(verdicts(bent(0.6, yaw), seen_facing(None)))


def test_person_lying_on_the_back_does_not_lean():
    assert leaning_backward(bent(-1.5).rotations) == 0.0


def test_weak_facing_evidence_does_not_flip():
    assert not any(verdicts(flip_posture(standing()), seen_facing(standing(), plainly=0.5)))


def test_established_facing_needs_more_evidence_to_flip():
    """The person is seen from the side, where the sensor provides no evidence."""
    sideways, other = standing(np.pi / 2), flip_posture(standing(np.pi / 2))
    against = seen_facing(other, plainly=1.5)
    assert any(verdicts(sideways, against))
    facing = Facing()
    rightly = [facing.is_wrong(seen_facing(sideways, 1.5), sideways, EYE, np.zeros(3)) for _ in range(30)]
    assert not any(rightly)
    assert not any(facing.is_wrong(against, sideways, EYE, np.zeros(3)) for _ in range(60))
    plainly = seen_facing(other, plainly=2.5)
    assert any(facing.is_wrong(plainly, sideways, EYE, np.zeros(3)) for _ in range(60))


def any_posture(random) -> Posture:
    """Returns a person at a random position with random bends and rotations."""
    posture = standing(random.uniform(-np.pi, np.pi))
    posture.position = posture.position + random.normal(0, 1, 3)
    posture.rotations[model.PELVIS] = rotation(*random.normal(0, [0.5, 2, 0.5]))
    posture.rotations[model.CHEST] = rotation(*random.normal(0, 0.6, 3))
    return posture


@pytest.mark.parametrize("seed", range(40))
def test_the_chest_turned_about_is_that_of_the_posture_turned_about(seed):
    posture = any_posture(np.random.default_rng(seed))
    for candidate, axes in ((posture, chest_axes), (flip_posture(posture), chest_axes_about)):
        chest = candidate.rotations[model.PELVIS] @ candidate.rotations[model.CHEST]
        np.testing.assert_allclose(np.transpose(axes(posture.rotations)), chest[:, :2], atol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_a_frames_evidence_is_the_difference_to_the_posture_turned_about(seed):
    """It is computed term by term: the network, the walking direction, and implausible backward leaning."""
    random = np.random.default_rng(seed)
    posture, velocity = any_posture(random), random.normal(0, 0.7, 3)
    sighting = seen_as(estimate_of(posture.joints(), ways=random.normal(0, 2, 8)))
    turned = flip_posture(posture)
    slow = compute_facing_score(sighting, posture, EYE) - compute_facing_score(sighting, turned, EYE)
    speed = np.linalg.norm(velocity[[0, 2]])
    plainly = np.clip((speed - 0.45) / 0.45, 0.0, 1.0)
    slow += 4.5 * plainly * (velocity[[0, 2]] / speed) @ forward_in_plan(posture)
    slow += 15.0 * (leaning_backward(turned.rotations) - leaning_backward(posture.rotations))
    ways = sighting.estimate.facing
    advantage = facing_advantage(posture.rotations, posture.position, EYE, velocity, ways)
    assert advantage == pytest.approx(slow, abs=1e-9)
