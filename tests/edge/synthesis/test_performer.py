"""Tests of the synthetic performer: bone lengths, joint limits, and planted feet that do not slide."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_performer import SlowPerformer

from enliven.errors import InputError
from enliven.person.joints import BONES, Joint
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.body.rotations import GRID_STEP
from enliven_synthesis.motion.choreographies import choreography_names, get_choreography
from enliven_synthesis.motion.tracks import Track, ease, smooth_pulse

RATE = 30.0
STEPS = 2 * GRID_STEP
"""Tolerance in metres. The two implementations may round to different grid steps."""


def _joints(name: str, performer: Performer | None = None) -> np.ndarray:
    """Returns the (F, 20, 3) joints of a whole choreography."""
    performer, moves = performer or Performer(), get_choreography(name)
    times = np.arange(0.0, moves.duration + 1e-9, 1.0 / RATE)
    return np.stack([performer.pose(moves.posture(float(t))).joints for t in times])


def _lengths(joints: np.ndarray) -> np.ndarray:
    return np.stack([np.linalg.norm(joints[..., b, :] - joints[..., a, :], axis=-1) for a, b in BONES], -1)


def _bend(joints: np.ndarray, a: int, b: int, c: int) -> np.ndarray:
    """Returns the bend of the limb a-b-c at b in degrees, 0 if it is straight."""
    u, v = joints[:, b] - joints[:, a], joints[:, c] - joints[:, b]
    cosine = (u * v).sum(-1) / np.linalg.norm(u, axis=-1) / np.linalg.norm(v, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


@pytest.mark.parametrize("name", choreography_names())
@pytest.mark.parametrize("height", [1.2, 1.75, 1.95])
def test_bones_keep_their_lengths(name: str, height: float) -> None:
    lengths = _lengths(_joints(name, Performer(Proportions(height=height))))
    assert np.ptp(lengths, axis=0).max() < 1e-6


_angle = st.floats(-0.6, 0.6)
_foot = st.builds(
    FootPose,
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.sampled_from([0.0, 0.1, 0.4]),
    _angle,
    st.floats(-0.6, 0.0),
    _angle,
)
_arm = st.builds(
    ArmPose,
    st.floats(-0.7, 2.5),
    st.floats(0, 1.6),
    _angle,
    st.floats(0, 2.4),
    _angle,
    _angle,
    st.floats(0, 0.3),
)


_posture = st.builds(
    PerformerPosture, _foot, _foot, _arm, _arm, _angle, _angle, st.floats(-0.5, 0.1), *[_angle] * 9
)


@settings(deadline=None, max_examples=150)
@given(_posture, st.sampled_from([1.2, 1.75]))
def test_any_posture_has_the_performers_bones(made: PerformerPosture, height: float) -> None:
    performer = Performer(Proportions(height=height))
    usual = performer.pose(PerformerPosture(FootPose(0.15, 0.0), FootPose(-0.15, 0.0)))
    figure = performer.pose(made)
    assert np.allclose(_lengths(figure.joints), _lengths(usual.joints), atol=1e-6)
    rotations = figure.frames[:, :, :3]
    assert np.allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3), atol=1e-6)
    assert np.allclose(np.linalg.det(rotations), 1.0, atol=1e-6)


@settings(deadline=None, max_examples=100)
@given(_posture)
def test_posture_matches_the_slow_reference(made: PerformerPosture) -> None:
    build = Proportions(height=1.6, shoulders=1.2, hips=0.8, arms=0.9, legs=1.1)
    figure, slow = Performer(build).pose(made), SlowPerformer(build).pose(made)
    np.testing.assert_allclose(figure.joints, slow.joints, rtol=0, atol=STEPS)
    np.testing.assert_allclose(figure.frames, slow.frames, rtol=0, atol=STEPS)


@pytest.mark.parametrize("name", choreography_names())
def test_joints_stay_within_human_limits(name: str) -> None:
    joints = _joints(name)
    for side in ("LEFT", "RIGHT"):
        shoulder, elbow, wrist, hip, knee, ankle = (
            Joint[f"{part}_{side}"] for part in ("SHOULDER", "ELBOW", "WRIST", "HIP", "KNEE", "ANKLE")
        )
        assert _bend(joints, shoulder, elbow, wrist).max() < 150
        assert _bend(joints, hip, knee, ankle).max() < 140
        # A knee bends forward: in the direction of the hips, it is in front of the line from hip to ankle.
        across = joints[:, knee] - (joints[:, hip] + joints[:, ankle]) / 2
        ahead = np.cross(joints[:, Joint.HIP_LEFT] - joints[:, Joint.HIP_RIGHT], [0.0, 1.0, 0.0])
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        assert (across * ahead).sum(1).min() > -0.02
    spine = joints[:, Joint.SHOULDER_CENTER] - joints[:, Joint.HIP_CENTER]
    assert np.degrees(np.arccos(spine[:, 1] / np.linalg.norm(spine, axis=-1))).max() < 65


@pytest.mark.parametrize("name", choreography_names())
def test_planted_feet_do_not_slide_and_no_foot_sinks(name: str) -> None:
    moves, joints = get_choreography(name), _joints(name)
    for side, ball in enumerate((Joint.FOOT_LEFT, Joint.FOOT_RIGHT)):
        planted = np.array([moves.planted(side, n / RATE) for n in range(len(joints))])
        pairs = planted[1:] & planted[:-1]
        # A flight shorter than a frame would hide sliding, but there is none.
        steps = np.linalg.norm(np.diff(joints[:, ball], axis=0), axis=-1)
        assert pairs.sum() > 0.5 * len(pairs)
        assert steps[pairs].max() < 1e-6
        floor = joints[planted, ball, 1]
        assert np.ptp(floor) < 1e-6
        assert joints[:, ball, 1].min() > floor[0] - 1e-6


@pytest.mark.parametrize("name", choreography_names())
def test_a_choreography_closes_and_never_jumps(name: str) -> None:
    joints = _joints(name)
    assert np.abs(joints[-1] - joints[0]).max() < 1e-3
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) * RATE
    assert speed.max() < 5.0


def test_the_chair_is_taken_hold_of_in_its_posture() -> None:
    joints = _joints("chair")[: int(1.5 * RATE)]
    assert np.ptp(joints, axis=0).max() < 0.06  # The performer hardly moves.
    apart = joints[:, Joint.ANKLE_LEFT, 0] - joints[:, Joint.ANKLE_RIGHT, 0]
    assert np.allclose(apart, 0.45, atol=0.02)
    for side in ("LEFT", "RIGHT"):
        elbow, wrist = joints[:, Joint[f"ELBOW_{side}"]], joints[:, Joint[f"WRIST_{side}"]]
        assert np.allclose(elbow[:, 1], 1.1, atol=0.04)
        fore = (wrist - elbow) / np.linalg.norm(wrist - elbow, axis=-1, keepdims=True)
        assert fore[:, 2].min() > 0.95 and np.abs(fore[:, 1]).max() < 0.15


def test_the_chair_walks_marches_hops_and_flaps() -> None:
    joints = _joints("chair")
    home = joints[0]
    for knee in (Joint.KNEE_LEFT, Joint.KNEE_RIGHT):
        assert joints[:, knee, 1].max() > home[knee, 1] + 0.12
    hips = joints[:, Joint.HIP_CENTER] - home[Joint.HIP_CENTER]
    assert hips[:, 0].max() > 0.2 and hips[:, 2].max() > 0.2
    both_up = np.minimum(joints[:, Joint.FOOT_LEFT, 1], joints[:, Joint.FOOT_RIGHT, 1])
    assert both_up.max() > 0.10
    assert joints[:, Joint.WRIST_LEFT, 1].max() > joints[:, Joint.WRIST_LEFT, 1][0] + 0.25
    across = joints[:, Joint.SHOULDER_LEFT] - joints[:, Joint.SHOULDER_RIGHT]
    turned = np.degrees(np.arctan2(-across[:, 2], across[:, 0]))
    assert turned.max() > 30 and turned.min() < -30


def test_left_is_the_performers_left() -> None:
    home = _joints("idle")[0]
    for part in ("SHOULDER", "ELBOW", "WRIST", "HIP", "KNEE", "ANKLE", "FOOT"):
        assert home[Joint[f"{part}_LEFT"], 0] > home[Joint[f"{part}_RIGHT"], 0] + 0.1
    assert home[Joint.FOOT_LEFT, 2] > home[Joint.ANKLE_LEFT, 2]  # The performer faces the camera.


@pytest.mark.parametrize("height", [1.0, 1.6, 1.9])
def test_performer_has_the_requested_height(height: float) -> None:
    performer = Performer(Proportions(height=height))
    figure = performer.pose(PerformerPosture(FootPose(0.08, 0.0), FootPose(-0.08, 0.0)))
    crown = figure.joints[Joint.HEAD, 1] + 0.12 * height / 1.75
    assert crown == pytest.approx(height, abs=0.03 * height)


def test_an_unknown_choreography_lists_the_known() -> None:
    with pytest.raises(InputError, match="chair, walk, wave, idle"):
        get_choreography("tango")


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-2, 2), min_size=2, max_size=6), st.floats(-1, 8))
def test_tracks_pass_their_keys_and_never_overshoot(values: list[float], time: float) -> None:
    track = Track(*[(float(n), v) for n, v in enumerate(values)])
    assert all(math.isclose(track(float(n)), v, abs_tol=1e-12) for n, v in enumerate(values))
    assert min(values) - 1e-9 <= track(time) <= max(values) + 1e-9


@settings(deadline=None, max_examples=50)
@given(st.floats(-3, 3), st.floats(0, 1), st.floats(0.05, 1), st.floats(0.05, 1))
def test_eases_and_pulses_stay_between_nothing_and_all(
    t: float, start: float, length: float, rise: float
) -> None:
    assert 0 <= ease(t) <= 1 and math.isclose(ease(t) + ease(1 - t), 1, abs_tol=1e-9)
    assert 0 <= smooth_pulse(t, start, start + length, rise) <= 1
    assert smooth_pulse(start + length / 2, start, start + length, rise) == pytest.approx(1)
