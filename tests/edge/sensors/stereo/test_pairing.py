"""Tests that images of two cameras are paired by time, also if images are lost or late."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.errors import ResourceError
from enliven_edge.sensors.stereo.pairing import CameraImage, ImagePairing

STEP, TOLERANCE = 33_333_333, 1_000_000
IMAGE = np.zeros((1, 1), np.uint8)


def arrivals(lost, late, jitter):
    """Returns images of two synchronised cameras, in order of arrival."""
    pictures = []
    for eye in (0, 1):
        for number in range(len(lost[eye])):
            if not lost[eye][number]:
                taken_ns = number * STEP + jitter[(2 * number + eye) % len(jitter)]
                arrives = number * STEP + late * eye
                pictures.append((arrives, eye, CameraImage(eye, IMAGE, taken_ns, number)))
    return [picture for *_, picture in sorted(pictures, key=lambda each: each[:2])]


flags = st.lists(st.booleans(), min_size=40, max_size=40)


@given(
    flags,
    flags,
    st.integers(0, 2 * STEP),
    st.lists(st.integers(0, TOLERANCE // 2), min_size=1, max_size=7),
)
def test_every_picture_that_has_a_partner_finds_it(lost_left, lost_right, late, jitter):
    pairing, pairs = ImagePairing("test", TOLERANCE), []
    both = [n for n in range(40) if not lost_left[n] and not lost_right[n]]
    try:
        for picture in arrivals((lost_left, lost_right), late, jitter):
            pair = pairing.add(picture)
            if pair is not None:
                pairs.append(pair)
    except ResourceError:
        # After several losses in a row the cameras count as out of step.
        assert max(b - a for a, b in itertools.pairwise([*both, 40])) * STEP > 700_000_000
        return
    assert all(abs(left.time_ns - right.time_ns) <= TOLERANCE for left, right in pairs)
    assert all((left.eye, right.eye) == (0, 1) for left, right in pairs)
    assert [left.sequence for left, _ in pairs] == [right.sequence for _, right in pairs] == both


def test_unsynchronised_cameras_are_reported_with_their_offset():
    pairing = ImagePairing("test", TOLERANCE)
    with pytest.raises(ResourceError, match=r"not synchronised: their images are 12\.0 ms apart.*sync"):
        for number in range(200):
            for eye in (0, 1):
                assert pairing.add(CameraImage(eye, IMAGE, number * STEP + eye * 12_000_000, number)) is None
    assert 4.5 < number * STEP * 1e-9 < 5.5, "cameras that are synchronised need a while to find their step"


def test_lost_synchronisation_is_reported_before_a_loss():
    pairing, pairs = ImagePairing("test", TOLERANCE), 0
    with pytest.raises(ResourceError, match=r"not synchronised: their images are 9\.0 ms"):
        for number in range(200):
            apart = 9_000_000 if number >= 20 else 0
            for eye in (0, 1):
                pairs += pairing.add(CameraImage(eye, IMAGE, number * STEP + eye * apart, number)) is not None
    assert pairs == 20 and 0.7 < (number - 20) * STEP * 1e-9 < 1.0


def test_cameras_that_find_their_step_late_are_forgiven():
    pairing, pairs = ImagePairing("test", TOLERANCE), 0
    for number in range(140):
        apart = max(0, 120 - number) * 1_000_000 // 6
        for eye in (0, 1):
            pairs += pairing.add(CameraImage(eye, IMAGE, number * STEP + eye * apart, number)) is not None
    assert pairs == 140 - 120 + 6 and pairing.apart_ns == 0


@pytest.mark.parametrize("eye", [0, 1])
def test_camera_without_images_is_named(eye):
    pairing = ImagePairing("test", TOLERANCE)
    with pytest.raises(ResourceError, match=f"the {('right', 'left')[eye]} camera sends no images"):
        for number in range(200):
            pairing.add(CameraImage(eye, IMAGE, number * STEP, number))
