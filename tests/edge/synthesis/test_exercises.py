"""Tests of the exercises: rigid bones, soles on the floor, no jumps, varied seeds."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import assert_alike

from enliven.errors import InputError
from enliven.person.joints import BONES, Joint
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.exercises import exercise_names, get_exercise


def danced(name: str, seed: int, build: Proportions | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Returns (F, 20, 3) joints and (F, 2, 3) soles at 60 frames per second."""
    performer, moves = Performer(build), get_exercise(name, seed)
    figures = [performer.pose(moves.posture(t)) for t in np.arange(0.0, moves.duration, 1 / 60)]
    return np.stack([f.joints for f in figures]), np.stack([performer.soles(f) for f in figures])


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("name", exercise_names())
def test_exercises_are_physically_possible(name: str, seed: int) -> None:
    joints, soles = danced(name, seed)
    lengths = np.stack([np.linalg.norm(joints[:, b] - joints[:, a], axis=-1) for a, b in BONES], -1)
    assert np.ptp(lengths, axis=0).max() < 1e-6
    assert soles.min() > -0.04  # a kneeling foot's toes are lower
    assert joints[..., 1].min() > 0.0
    assert (np.linalg.norm(np.diff(joints, axis=0), axis=-1) * 60).max() < 9.0


def test_exercises_reach_their_extreme_poses() -> None:
    head = lambda joints: joints[:, Joint.HEAD, 1]  # noqa: E731
    joints, _ = danced("overhead", 0)
    assert joints[:, Joint.HAND_LEFT, 1].max() > head(joints).max() + 0.3
    joints, _ = danced("crouch", 0)
    assert joints[:, Joint.HIP_CENTER, 1].min() < 0.6
    joints, _ = danced("kneel", 0)
    assert joints[:, Joint.KNEE_RIGHT, 1].min() < 0.2
    joints, _ = danced("floor", 0)
    assert joints[:, [Joint.HAND_LEFT, Joint.HAND_RIGHT], 1].min() < 0.15
    joints, _ = danced("one leg", 0)
    assert joints[:, Joint.FOOT_LEFT, 1].max() > 0.4
    joints, _ = danced("stroll", 0)
    assert np.ptp(joints[:, 0, 2]) > 3.0
    joints, _ = danced("still", 0)
    assert np.ptp(joints, axis=0).max() < 0.02
    joints, _ = danced("turn", 0)
    across = joints[:, Joint.SHOULDER_LEFT] - joints[:, Joint.SHOULDER_RIGHT]
    turned = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2 * np.pi, abs=0.05)


def test_a_seed_is_another_performance_and_always_the_same() -> None:
    first, second = danced("signals", 1)[0], danced("signals", 2)[0]
    assert len(first) != len(second) or np.abs(first - second).max() > 0.1
    assert_alike(first, danced("signals", 1)[0])


def test_an_unknown_exercise_lists_the_known() -> None:
    with pytest.raises(InputError, match="still, overhead"):
        get_exercise("handstand")
