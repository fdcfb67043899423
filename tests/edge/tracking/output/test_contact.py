"""Tests of foot contacts against the synthetic performer's true contacts."""

import numpy as np
import pytest

from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.tracking.output import contact
from enliven_edge.tracking.output.contact import FootContacts
from enliven_synthesis.sensor.synthetic import SyntheticSensor

STEP = 33_333_333
UP = np.array([0.0, 1.0, 0.0])


def walk(offset: float = 0.0, noise: float = 0.0, frames: int = 250):
    """Returns [(body, (left, right) planted)] of the walk. Joints are noisy and raised by ``offset``
    metres.
    """
    random = np.random.default_rng(0)
    with SyntheticSensor(choreography="walk", realtime=False) as sensor:
        for i in range(frames):
            body = sensor.truth(i * STEP)
            dance = sensor.studio.choreography
            planted = [dance.planted(side, i * STEP * 1e-9 % dance.duration) for side in (0, 1)]
            joints = body.joints + random.normal(0, noise, (20, 3)) + offset * UP
            yield Body(1, joints, body.confidence), planted


@pytest.mark.parametrize(("offset", "noise"), [(0.0, 0.0), (0.03, 0.002), (-0.02, 0.002)])
def test_a_walk_s_contacts_are_those_of_its_footwork(offset, noise):
    contacts = FootContacts()
    detected, true = [], []
    for i, (body, planted) in enumerate(walk(offset, noise)):
        detected.append(contacts(body.joints, body.confidence, i * STEP) > 0.5)
        true.append(planted)
    detected, true = np.array(detected), np.array(true)
    assert 0.05 < np.mean(~true) < 0.6, "the walk must lift its feet"
    assert np.mean(detected == true) > 0.87


def test_contact_does_not_flicker():
    contacts = FootContacts()
    detected = np.array(
        [contacts(b.joints, b.confidence, i * STEP) > 0.5 for i, (b, _) in enumerate(walk(0, 0.002))]
    )
    true = np.array([p for _, p in walk(0, 0.002)])
    changes, expected = (np.abs(np.diff(x.astype(int), axis=0)).sum() for x in (detected, true))
    assert changes <= expected + 2


def test_standing_is_standing_and_a_jump_is_not():
    with SyntheticSensor(choreography="idle", realtime=False) as sensor:
        body = sensor.truth(0)
    contacts = FootContacts()
    for i in range(10):
        detected = contacts(body.joints, body.confidence, i * STEP)
    assert detected.min() > 0.9
    for i in range(10, 15):
        detected = contacts(body.joints + 0.07 * (i - 9) * UP, body.confidence, i * STEP)
    assert detected.max() < 0.1


def test_a_foot_that_is_not_seen_stands_nowhere():
    with SyntheticSensor(choreography="idle", realtime=False) as sensor:
        body = sensor.truth(0)
    confidence = body.confidence.copy()
    confidence[[Joint.FOOT_LEFT, Joint.ANKLE_LEFT]] = 0.0
    contacts = FootContacts()
    for i in range(5):
        left, right = contacts(body.joints, confidence, i * STEP)
    assert left == 0.0 and right > 0.9


def test_a_body_that_floats_does_not_stand():
    """The floor height is fixed, so feet half a metre above it have no contact."""
    with SyntheticSensor(choreography="idle", realtime=False) as sensor:
        body = sensor.truth(0)
    contacts = FootContacts()
    for i in range(30):
        detected = contacts(body.joints + 0.5 * UP, body.confidence, i * STEP)
    assert detected.max() < 0.1


class _Slowly:
    """Computes the same as :class:`FootContacts` for all points at once, in whole arrays."""

    def __init__(self) -> None:
        self.last, self.time_ns = None, 0

    def __call__(self, joints, confidence, time_ns):
        floor, lift, fastest, hysteresis = contact.STANDING_LIMITS
        points = np.array([[15, 14], [19, 18]])
        places, highest = joints[points], floor + np.array([0.0, 0.06])
        height, seconds, self.time_ns = places[..., 1], (time_ns - self.time_ns) * 1e-9, time_ns
        if self.last is None or not 0.0 < seconds < 1.0:
            self.ground, self.speed = np.minimum(height, highest), np.zeros((2, 2))
            self.stands = (height < 0.6 * highest).any(1)
        else:
            moved = np.linalg.norm(places - self.last, axis=-1) / seconds
            self.speed += (moved - self.speed) / (1.0 + 1.0 / (2 * np.pi * 6.0 * seconds))
            self.ground = np.minimum(np.minimum(height, self.ground + 0.03 * seconds), highest)
        self.last = places
        stiff = np.where(self.stands, hysteresis, 1.0)[:, None]
        excess = np.maximum((height - self.ground) / lift, self.speed / fastest) / stiff
        likely = 1.0 / (
            1.0 + np.exp(np.minimum(5.0 * (np.maximum(excess, height / highest).min(1) - 1.0), 50.0))
        )
        self.stands = likely > 0.5
        return likely * np.clip(confidence[points].max(1) / 0.1, 0.0, 1.0)


@pytest.mark.parametrize("seed", range(20))
def test_foot_by_foot_is_as_all_at_once(seed):
    """Feet appear and disappear randomly, and some frames are missing."""
    random = np.random.default_rng(seed)
    fast, slow = FootContacts(), _Slowly()
    joints, time_ns = random.normal(0, 1, (20, 3)), 0
    for _ in range(60):
        joints = joints + random.normal(0, 0.02 * random.random(), (20, 3))
        joints[12:, 1] = np.abs(0.7 * joints[12:, 1])
        confidence = random.choice([0.0, 0.05, 0.9], 20)
        time_ns += int(random.choice([STEP, 3 * STEP, 2_000_000_000], p=[0.9, 0.08, 0.02]))
        expected = slow(joints, confidence, time_ns)
        np.testing.assert_allclose(fast(joints, confidence, time_ns), expected, atol=1e-9)
