"""Tests of motions with limbs close to the trunk: rigid bones, forearms in front, varied seeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.person.joints import BONES, Joint
from enliven_synthesis.body.arm_ik import solve_arm
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.close_limbs import CloseLimbs, close_limb_names

FASTEST = 9.0
"""Maximum joint speed, that of a jab, metres per second."""
WRISTS = [Joint.WRIST_LEFT, Joint.WRIST_RIGHT]


def moved(name: str, seed: int, build: Proportions | None = None) -> np.ndarray:
    """Returns (F, 20, 3) joints at 60 frames per second."""
    motion = CloseLimbs(Performer(build), name, seed)
    return np.stack([motion.figure(t).joints for t in np.arange(0.0, motion.duration, 1 / 60)])


@pytest.mark.parametrize("seed", [0, 7])
@pytest.mark.parametrize("name", close_limb_names())
def test_close_limb_motions_are_physically_possible(name: str, seed: int) -> None:
    joints = moved(name, seed, Proportions(1.62, 1.1))
    lengths = np.stack([np.linalg.norm(joints[:, b] - joints[:, a], axis=-1) for a, b in BONES], -1)
    assert np.ptp(lengths, axis=0).max() < 1e-6
    assert joints[..., 1].min() > 0.0
    assert (np.linalg.norm(np.diff(joints, axis=0), axis=-1) * 60).max() < FASTEST
    # At half time, a wrist is in front of the trunk or on a hip, which is the purpose of these motions.
    wrists = joints[len(joints) // 2, WRISTS]
    assert np.linalg.norm(wrists - joints[len(joints) // 2, Joint.SPINE], axis=1).min() < 0.6


@pytest.mark.parametrize("build", [Proportions(1.75), Proportions(1.7, 1.28, hips=1.1)])
def test_hanging_hands_are_next_to_the_hips_and_not_in_them(build: Proportions) -> None:
    """Each wrist is farther to the side than the hip joint by more than half a thigh's width."""
    start = CloseLimbs(Performer(build), "folded").figure(0.0).joints
    hips, wrists = start[[Joint.HIP_LEFT, Joint.HIP_RIGHT]], start[WRISTS]
    assert (np.abs(wrists[:, 0]) - np.abs(hips[:, 0])).min() > 0.09


def test_seeds_differ_and_an_unknown_name_is_refused() -> None:
    assert np.abs(CloseLimbs(Performer(), "guard", 1).figure(1.0).joints - moved("guard", 2)[60]).max() > 0.01
    with pytest.raises(InputError, match=r"Known: .*folded"):
        CloseLimbs(Performer(), "somersault")


@given(st.tuples(*[st.floats(-0.6, 0.6)] * 3), st.integers(0, 1))
@settings(max_examples=60, deadline=None)
def test_wrist_reaches_its_target_or_the_arms_limit(wanted, side) -> None:
    performer = Performer()
    upper, bend = solve_arm(performer, np.eye(3), np.array(wanted), np.array([0.3, -0.8, -0.5]), side)
    shoulder = performer.shoulder * [1.0 - 2.0 * side, 1.0, 1.0]
    elbow = shoulder - performer.upper_arm * upper[:, 1]
    fore = upper @ [0.0, -np.cos(bend), np.sin(bend)]
    away = np.linalg.norm(wanted - shoulder)
    arm = performer.upper_arm + performer.forearm
    missed = max(0.0, 0.35 * arm - away, away - 0.995 * arm)
    assert np.linalg.norm(elbow + performer.forearm * fore - wanted) == pytest.approx(missed, abs=1e-6)
