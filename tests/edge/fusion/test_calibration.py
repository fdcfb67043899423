"""Tests of calibration from walking people: exact data gives the exact result, and problems are reported."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walkers import Walker, stand, told

from enliven.errors import InputError
from enliven.space.rigid_transform import (
    angle_between,
    compose_transform,
    invert,
    rotation_from_vector,
    transform_points,
)
from enliven_edge.fusion.calibration.calibration import calibrate
from enliven_edge.fusion.calibration.quality import Verdict
from enliven_edge.fusion.calibration.tracks import BodyStream, BodyTrack, stream_from_frames
from enliven_edge.fusion.settings import CalibrationSettings
from enliven_synthesis.motion.wander import WalkPath

A, B = stand(0.0, 0.0, 0.0), stand(2.4, -1.8, 70.0)
TIMES = np.arange(0.0, 16.0, 1 / 30)
SHORT = np.arange(0.0, 8.0, 1 / 20)


def streams(walkers, places, times=TIMES, clocks=None, names="abcdef", **more):
    """Returns one stream per sensor. Frames of different sensors have different times."""
    clocks = clocks or [10.0] * len(places)
    return [
        stream_from_frames(
            name, told(walkers, place, times + 0.011 * i, clock=clock, sensor=name, seed=i, **more)
        )
        for i, (name, place, clock) in enumerate(zip(names, places, clocks, strict=False))
    ]


@cache
def seen_by_both(walker_shape=(8.0, 1.6, 1.2)):
    """Returns two error-free streams of a short walk, for tests that modify them."""
    return streams([Walker(WalkPath(*walker_shape))], [A, B], SHORT, [10.0, 13.0])


@cache
def b_of_both():
    """Returns the (4, 4) pose of the second sensor."""
    return calibrate(seen_by_both()).world_from_sensor["b"]


def errors(calibration, places, names="abcdef"):
    """Returns the error of each sensor's pose relative to the first, in metres and degrees."""
    rows = []
    for name, place in zip(names, places, strict=False):
        true = invert(places[0]) @ place
        pose = calibration.world_from_sensor[name]
        rows.append((np.linalg.norm(pose[:3, 3] - true[:3, 3]), np.degrees(angle_between(pose, true))))
    return np.array(rows)


def changed(stream: BodyStream, transform: np.ndarray) -> BodyStream:
    """Returns the stream as recorded by a sensor at another position."""
    tracks = tuple(
        dataclasses.replace(t, joints=transform_points(transform, t.joints)) for t in stream.tracks
    )
    return dataclasses.replace(stream, tracks=tracks)


@pytest.mark.slow
def test_exact_bodies_give_exact_places_and_clocks():
    calibration = calibrate(streams([Walker()], [A, B], clocks=[10.0, 13.25]))
    assert calibration.is_good and calibration.advice == []
    # The remaining error is due to linear interpolation of a curved motion between two frames.
    metres, degrees = errors(calibration, [A, B]).max(0)
    assert metres < 1e-4 and degrees < 1e-3
    assert calibration.clock_offset_ns["b"] == pytest.approx(-3.25e9, abs=5e4)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(
    st.sampled_from([0, 1]), st.floats(-3.1, 3.1), st.floats(-3, 3), st.floats(-3, 3),
)  # fmt: skip
def test_moving_either_sensor_moves_the_answer_along(which, angle, x, z):
    """Equivariance: a_from_b becomes M a_from_b or a_from_b M^-1."""
    told_by, before = list(seen_by_both()), b_of_both()
    motion = compose_transform(rotation_from_vector(np.array([0.0, angle, 0.0])), np.array([x, 0.0, z]))
    told_by[which] = changed(told_by[which], motion)
    after = calibrate(told_by).world_from_sensor["b"]
    expected = motion @ before if which == 0 else before @ invert(motion)
    assert np.allclose(after, expected, atol=2e-4)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_without_gravity_any_motion_is_found(pitch, roll):
    a, b = seen_by_both()
    motion = compose_transform(rotation_from_vector(np.array([pitch, 0.3, roll])), np.array([0.4, 0.9, -2.0]))
    calibration = calibrate([a, changed(b, motion)], CalibrationSettings(floor_known=False))
    expected = invert(A) @ B @ invert(motion)
    assert np.allclose(calibration.world_from_sensor["b"], expected, atol=1e-3)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(st.floats(-200.0, 200.0))
def test_the_clocks_difference_is_found(clock):
    a, b = seen_by_both()
    later = dataclasses.replace(b, first_ns=b.first_ns + round(clock * 1e9))
    calibration = calibrate([a, later])
    assert calibration.clock_offset_ns["b"] == pytest.approx(-(3.0 + clock) * 1e9, abs=2e5)


@pytest.mark.slow
def test_noise_does_not_pull_the_clock_between_frames():
    """Interpolated joints are less noisy halfway between frames, which must not bias the time offset."""
    calibration = calibrate(streams([Walker(WalkPath(16, 1.6, 0.9))], [A, B], noise=0.03))
    assert abs(calibration.clock_offset_ns["b"]) < 2.5e6
    assert errors(calibration, [A, B])[1, 0] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_person_matching_is_independent_of_ids_and_order(order):
    people = [
        Walker(),
        Walker(WalkPath(12, 1.5, 1.5, (1, 1), 1.57), 1.6, (0.4, 0.2)),
        Walker(WalkPath(9, 1, 0.6), 1.9),
    ]
    a = stream_from_frames("a", told(people, A, SHORT, sensor="a"))
    b = stream_from_frames("b", told([people[i] for i in order], B, SHORT + 0.013, sensor="b", ids=[5, 3, 9]))
    assert errors(calibrate([a, b]), [A, B]).max() < 1e-3


@pytest.mark.slow
def test_sensor_that_swaps_left_and_right_is_calibrated():
    """A sensor opposite the first one swaps left and right, always or sometimes."""
    opposite = stand(0.0, -5.0, 180.0)
    for swapped, part in ((lambda t: True, 1.0), (lambda t: t % 4 < 1.5, 0.38)):
        a = stream_from_frames("a", told([Walker()], A, TIMES, sensor="a"))
        b = stream_from_frames("b", told([Walker()], opposite, TIMES + 0.01, sensor="b", swapped=swapped))
        calibration = calibrate([a, b])
        assert calibration.is_good
        assert errors(calibration, [A, opposite]).max() < 2e-3
        assert calibration.pairs[0].quality.swapped == pytest.approx(part, abs=0.03)


def test_outlier_joints_are_ignored():
    """One hand of the second sensor is wrong for the whole walk, with full confidence."""
    a, b = streams([Walker()], [A, B])
    track = b.tracks[0]
    joints = track.joints.copy()
    joints[:, 10:12] += [0.5, 0.3, 0.2]
    b = BodyStream("b", b.first_ns, (BodyTrack(track.id, track.times, joints, track.confidence),))
    assert errors(calibrate([a, b]), [A, B])[1] == pytest.approx([0, 0], abs=0.01)


@pytest.mark.slow
def test_straight_walk_is_not_enough_and_gives_advice():
    calibration = calibrate(streams([Walker(WalkPath(16, 1.6, 0.0))], [A, B], noise=0.01))
    assert not calibration.is_good
    assert calibration.pairs[0].quality.verdict is Verdict.WALK_ON
    assert "keep walking, to the " in calibration.advice[0] and "of sensor b" in calibration.advice[0]
    # Sensor b sees the walk along its viewing direction only, without data to its left or right.
    assert calibration.pairs[0].quality.length == pytest.approx(1.6, abs=0.1)
    assert calibration.pairs[0].quality.breadth < 0.1


def test_a_short_look_is_not_enough():
    calibration = calibrate(streams([Walker()], [A, B], times=np.arange(0, 3, 1 / 30)))
    assert not calibration.is_good


def test_different_people_fail_calibration():
    """Each sensor sees another person on another path: calibration must fail with an error."""
    a = stream_from_frames("a", told([Walker()], A, TIMES, sensor="a", noise=0.01))
    other = Walker(WalkPath(11.0, 1.2, 1.7, (2, 1), 0.7), 1.55)
    b = stream_from_frames("b", told([other], B, TIMES, sensor="b", noise=0.01))
    calibration = calibrate([a, b])
    assert not calibration.is_good and calibration.advice


@pytest.mark.slow
def test_chain_of_partly_overlapping_sensors_is_calibrated():
    """There are three sensors. The first and the last never see the person at the same time."""
    far = stand(4.5, -4.0, 130.0)
    a, b, c = streams(
        [Walker(WalkPath(30.0, 1.6, 1.2, (2, 3)))], [A, B, far], np.arange(0, 30, 1 / 30), noise=0.01
    )

    def cut(stream, start, stop):
        (t,) = stream.tracks
        k = (t.times >= start) & (t.times < stop)
        return dataclasses.replace(
            stream, tracks=(BodyTrack(t.id, t.times[k], t.joints[k], t.confidence[k]),)
        )

    calibration = calibrate([cut(a, 0, 14), b, cut(c, 15, 30)])
    assert calibration.is_good
    assert errors(calibration, [A, B, far]).max(0) == pytest.approx([0, 0], abs=0.3)
    assert errors(calibration, [A, B, far])[:, 0].max() < 0.02
    assert [pair.is_good for pair in calibration.pairs] == [True, False, True]


@pytest.mark.slow
def test_a_loop_is_closed_with_less_error_than_its_worst_pair():
    places = [A, B, stand(-2.0, -2.0, -60.0)]
    calibration = calibrate(streams([Walker()], places, noise=0.03))
    assert calibration.is_good and 0 < calibration.loop_cm < 1.0
    assert errors(calibration, places)[:, 0].max() < 0.01


def test_one_sensor_or_one_name_twice_is_refused():
    a, b = seen_by_both()
    with pytest.raises(InputError, match="there is only one sensor"):
        calibrate([a])
    with pytest.raises(InputError, match="two sensors are called 'a'"):
        calibrate([a, dataclasses.replace(b, sensor="a")])


def test_sensor_that_saw_nobody_is_reported():
    a, _ = seen_by_both()
    calibration = calibrate([a, stream_from_frames("b", [])])
    assert calibration.pairs[0].fit is None and not calibration.is_good
    assert "b never saw a performer" in calibration.advice[0]
    assert "b" not in calibration.world_from_sensor


@pytest.mark.slow
def test_a_slow_sensor_is_placed_too():
    """The slow sensor has five frames per second, the other one thirty."""
    a = stream_from_frames("a", told([Walker()], A, TIMES, sensor="a"))
    b = stream_from_frames("b", told([Walker()], B, np.arange(0.02, 16.0, 0.2), sensor="b"))
    calibration = calibrate([a, b])
    assert calibration.is_good
    assert errors(calibration, [A, B])[1, 0] < 0.03
