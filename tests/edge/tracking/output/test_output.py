"""Tests of the tracker's output: it can be switched off, and has no NaN or jumps; mirroring and
extrapolation.
"""

import dataclasses
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import assert_alike

from enliven.camera import world_from_level_camera
from enliven.person.body import Body
from enliven.person.joints import BONES, Joint
from enliven.rotation import from_rotation_vector, multiply, normalized, rotate, to_matrix
from enliven.settings import load_settings
from enliven_edge.tracking.output import speed_limit
from enliven_edge.tracking.output.output import Output
from enliven_edge.tracking.settings import OutputSettings, SmoothingSettings, TrackerSettings
from enliven_synthesis.sensor.synthetic import SyntheticSensor

STEP = 33_333_333


def settings_of(amount: float = 1.0, **output) -> TrackerSettings:
    return TrackerSettings(smoothing=SmoothingSettings(amount=amount), output=OutputSettings(**output))


@cache
def truth(choreography: str, frames: int, fps: float = 30.0) -> list[Body]:
    """Returns true bodies with synthetic orientations that rotate with the motion."""
    with SyntheticSensor(choreography=choreography, realtime=False) as sensor:
        bodies = []
        for i in range(frames):
            body = sensor.truth(round(i * 1e9 / fps))
            turns = from_rotation_vector(body.joints * 0.8)
            bodies.append(dataclasses.replace(body, orientations=turns, stature=1.8))
        return bodies


def run(output: Output, bodies: list[Body], step: int = STEP) -> list[Body]:
    return [output([body], i * step)[0] for i, body in enumerate(bodies)]


def noisy(seed: int, frames: int = 20) -> list[Body]:
    random = np.random.default_rng(seed)
    return [
        Body(1, random.normal(size=(20, 3)) * 3, random.random(20), normalized(random.normal(size=(20, 4))))
        for _ in range(frames)
    ]


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_smoothing_zero_is_exactly_the_fit_whatever_it_does(seed):
    bodies = noisy(seed)
    for smoothed, body in zip(run(Output(settings_of(0.0)), bodies), bodies, strict=True):
        np.testing.assert_array_equal(smoothed.joints, body.joints)
        np.testing.assert_array_equal(smoothed.orientations, body.orientations)
        np.testing.assert_array_equal(smoothed.confidence, body.confidence)


@given(st.integers(0, 1000), st.floats(0.0, 5.0))
@settings(max_examples=40, deadline=None)
def test_output_is_always_finite(seed, amount):
    random = np.random.default_rng(seed)
    output = Output(settings_of(amount, predict=0.05))
    for i, body in enumerate(noisy(seed)):
        for array in (body.joints, body.orientations):
            broken = random.random(20) < 0.3
            array[broken] = random.choice([np.nan, np.inf, 0.0])
        body.confidence[random.random(20) < 0.3] = random.choice([np.nan, -1.0, 7.0])
        lost = ~np.isfinite(body.joints).all(1)
        (smoothed,) = output([body], i * STEP)
        for array in (smoothed.joints, smoothed.orientations, smoothed.confidence, smoothed.contacts):
            assert np.isfinite(array).all()
        np.testing.assert_allclose(np.linalg.norm(smoothed.orientations, axis=1), 1.0, atol=1e-9)
        assert smoothed.confidence.min() >= 0.0 and smoothed.confidence.max() <= 1.0
        assert (smoothed.confidence[lost] == 0.0).all()


def test_lost_joint_stays_with_low_confidence():
    output, bodies = Output(settings_of(0.0)), truth("idle", 5)
    for i, body in enumerate(bodies):
        joints = body.joints.copy()
        if i >= 2:
            joints[Joint.HAND_LEFT] = np.nan
        (smoothed,) = output([dataclasses.replace(body, joints=joints)], i * STEP)
    np.testing.assert_array_equal(smoothed.joints[Joint.HAND_LEFT], bodies[1].joints[Joint.HAND_LEFT])
    assert smoothed.confidence[Joint.HAND_LEFT] == 0.0 and smoothed.confidence[Joint.HAND_RIGHT] == 1.0


def test_one_bad_frame_throws_no_limb_across_the_room():
    output, bodies = Output(settings_of(1.0)), truth("idle", 30)
    for i, body in enumerate(bodies):
        joints = body.joints.copy()
        if i == 20:
            joints[[Joint.HAND_LEFT, Joint.WRIST_LEFT]] += (1.5, 0.4, 0.0)
        (smoothed,) = output([dataclasses.replace(body, joints=joints)], i * STEP)
        assert np.linalg.norm(smoothed.joints - body.joints, axis=1).max() < 0.02
        assert smoothed.confidence[Joint.HAND_LEFT] == (0.0 if i == 20 else 1.0)


def test_a_leap_that_stays_is_followed_and_arrives():
    output, bodies = Output(settings_of(1.0)), truth("idle", 60)
    away = np.array([0.0, 0.0, -1.2])
    for i, body in enumerate(bodies):
        joints = body.joints + (away if i >= 20 else 0.0)
        (smoothed,) = output([dataclasses.replace(body, joints=joints)], i * STEP)
        if i == 20:
            assert smoothed.confidence.max() == 0.0
    np.testing.assert_allclose(smoothed.joints, bodies[-1].joints + away, atol=0.02)
    assert smoothed.confidence.min() == 1.0


def test_possible_human_motion_is_not_limited(monkeypatch):
    fast = truth("wave", 60)
    limited = run(Output(settings_of(0.5)), fast)
    monkeypatch.setattr(speed_limit, "_MAX_JOINT_SPEED_M_S", 1e6)
    free = run(Output(settings_of(0.5)), fast)
    for a, b in zip(limited, free, strict=True):
        assert_alike(a.joints, b.joints)


def lag_of(made: list[Body], bodies: list[Body]) -> float:
    """Returns the lag of the joints behind the truth in seconds, by least squares over all motion."""
    got, true = (np.array([b.joints for b in several]) for several in (made, bodies))
    speed = np.gradient(true, 1 / 30, axis=0)
    moves = np.linalg.norm(speed, axis=2) > 0.5
    moves[:15] = False
    return float(((true - got) * speed).sum(2)[moves].sum() / (speed**2).sum(2)[moves].sum())


def test_bodies_without_orientations_are_smoothed_and_predicted_too():
    bodies = [dataclasses.replace(body, orientations=None) for body in truth("walk", 20)]
    smoothed = run(Output(settings_of(1.0, predict=0.05)), bodies)
    assert all(body.orientations is None and np.isfinite(body.joints).all() for body in smoothed)


@pytest.mark.parametrize("choreography", ["walk", "wave"])
def test_filter_lag_is_compensated_for_moving_joints(choreography):
    """The lag decreases by at least a third. A share of 0 leaves it unchanged."""
    bodies = truth(choreography, 90)
    late, on_time = (
        lag_of(run(Output(TrackerSettings(smoothing=SmoothingSettings(undelayed=share))), bodies), bodies)
        for share in (0.0, 1.0)
    )
    assert late > 0.008
    assert abs(on_time) < 0.67 * late


@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_lag_compensation_adds_little_jitter_at_rest(seed):
    """With a centimetre of noise per frame, jitter grows by at most 3 %."""
    random, body = np.random.default_rng(seed), truth("idle", 1)[0]
    still = [
        dataclasses.replace(body, joints=body.joints + random.normal(0, 0.01, (20, 3))) for _ in range(90)
    ]
    shakes = []
    for share in (0.0, 1.0):
        smoothed = run(Output(TrackerSettings(smoothing=SmoothingSettings(undelayed=share))), still)
        shakes.append(np.std([b.joints for b in smoothed[10:]], axis=0).mean())
    assert shakes[1] < 1.03 * shakes[0]


@pytest.mark.parametrize("seconds", [0.05, 0.1])
def test_looking_ahead_is_nearer_to_what_comes(seconds):
    bodies = truth("walk", 90)
    later = [b.joints for b in bodies[round(seconds * 30) :]]
    ahead = run(Output(settings_of(0.5, predict=seconds)), bodies)[: len(later)]
    plain = run(Output(settings_of(0.5)), bodies)[: len(later)]
    error = [
        np.mean(
            [np.linalg.norm(b.joints - t, axis=1).mean() for b, t in zip(smoothed, later, strict=True)][15:]
        )
        for smoothed in (ahead, plain)
    ]
    assert error[0] < 0.8 * error[1]


def test_looking_ahead_keeps_every_bone_as_long_as_it_is():
    ahead, plain = (run(Output(settings_of(1.0, predict=p)), truth("wave", 40)) for p in (0.15, 0.0))
    start, end = np.array(BONES).T
    for a, b in zip(ahead, plain, strict=True):
        lengths = [np.linalg.norm(x.joints[end] - x.joints[start], axis=1) for x in (a, b)]
        np.testing.assert_allclose(*lengths, atol=1e-9)


def test_still_people_stay_still_when_looked_ahead():
    body = truth("idle", 1)[0]
    for smoothed in run(Output(settings_of(1.0, predict=0.3)), [body] * 10):
        np.testing.assert_allclose(smoothed.joints, body.joints, atol=1e-9)
        np.testing.assert_allclose(to_matrix(smoothed.orientations), to_matrix(body.orientations), atol=1e-9)


def test_measured_latency_is_looked_ahead_by_and_bounded():
    output = Output(settings_of(1.0, predict="measured"))
    assert output.prediction_seconds == 0.0
    output.latency = 0.07
    assert output.prediction_seconds == 0.07
    output.latency = 9.0
    assert output.prediction_seconds == 0.3
    output.latency = -1.0
    assert output.prediction_seconds == 0.0
    assert Output(settings_of(1.0, predict=0.05)).prediction_seconds == 0.05


def test_each_performer_has_a_smoothing_of_its_own():
    tracker = load_settings(TrackerSettings, {"smoothing": {"amount": 2.0, "amounts": [0.0, -1.0, 5.0]}})
    output = Output(tracker)
    assert [output.smoothing_amount(p) for p in (1, 2, 3, 4)] == [0.0, 2.0, 5.0, 2.0]
    bodies = noisy(0, 6)
    for i, body in enumerate(bodies):
        people = [dataclasses.replace(body, id=p) for p in (1, 2, 3)]
        first, second, third = output(people, i * STEP)
    np.testing.assert_array_equal(first.joints, body.joints)
    away = [np.abs(x.joints - body.joints).mean() for x in (second, third)]
    assert 0.0 < away[0] < away[1]
    output.smooth(3, 0.0)
    output.smooth(1, None)
    (smoothed,) = output([dataclasses.replace(body, id=3)], 7 * STEP)
    np.testing.assert_array_equal(smoothed.joints, body.joints)
    assert output.smoothing_amount(1) == 2.0


def test_in_the_mirror_left_is_right_and_the_sensor_s_plane_is_the_mirror():
    mount = world_from_level_camera(1.2)
    mount[:3, 3] = 0.5, 1.2, 2.0
    (body,) = truth("walk", 1)
    plain, mirror = (Output(settings_of(0.0, mirror=m))([body], 0, mount)[0] for m in (False, True))
    hand, other = mirror.joints[Joint.HAND_LEFT], plain.joints[Joint.HAND_RIGHT]
    np.testing.assert_allclose(hand, [2 * 0.5 - other[0], other[1], other[2]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(to_matrix(mirror.orientations)), 1.0, atol=1e-9)


@pytest.mark.parametrize(
    "mount", [None, world_from_level_camera(3.0, np.pi / 2), world_from_level_camera(2.0, 0.6, np.pi)]
)
def test_the_mirror_stands_upright_however_the_sensor_hangs(mount):
    (body,) = truth("idle", 1)
    (mirrored,) = Output(settings_of(0.0, mirror=True))([body], 0, mount)
    np.testing.assert_allclose(np.sort(mirrored.joints[:, 1]), np.sort(body.joints[:, 1]), atol=1e-9)


@given(st.integers(0, 500))
@settings(max_examples=15, deadline=None)
def test_the_output_turns_with_the_world(seed):
    random = np.random.default_rng(seed)
    whole = normalized(random.normal(size=4))
    bodies = truth("wave", 12)
    turned = [
        dataclasses.replace(b, joints=rotate(whole, b.joints), orientations=multiply(whole, b.orientations))
        for b in bodies
    ]
    settings_ = settings_of(1.0, predict=0.1)
    for a, b in zip(run(Output(settings_), bodies), run(Output(settings_), turned), strict=True):
        np.testing.assert_allclose(rotate(whole, a.joints), b.joints, atol=1e-9)
        expected = to_matrix(multiply(whole, a.orientations))
        np.testing.assert_allclose(to_matrix(b.orientations), expected, atol=1e-7)


def test_filter_resets_after_long_gap_or_clock_reset():
    output, bodies = Output(settings_of(5.0)), noisy(1, 3)
    for time_ns, body in zip((0, 60_000_000_000, 1_000_000), bodies, strict=True):
        (smoothed,) = output([body], time_ns)
        np.testing.assert_array_equal(smoothed.joints, body.joints)


def test_stature_and_identity_go_through():
    (smoothed,) = Output()([dataclasses.replace(truth("idle", 1)[0], id=7)], 0)
    assert (smoothed.id, smoothed.stature) == (7, 1.8)
