"""Tests of foot contacts by height and speed with hysteresis, and of the blending of pins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import are_alike

from enliven.document.pin import ContactSettings
from enliven.motion.contact.contacts import (
    compute_hold_weights,
    detect_contact_frames,
    find_contacts,
    find_runs,
)

laws = settings(deadline=None, max_examples=60)
STEP = 1 / 60
HOW = ContactSettings()


def steps(phases, stride=0.5, lift=0.3):
    """Returns (F, 3) a foot that alternately stands and swings for the seconds in ``phases``, and when it
    stood.
    """
    at, stood, z = [], [], 0.0
    for i, seconds in enumerate(phases):
        count = round(seconds / STEP)
        for k in range(count):
            u = k / count
            at.append(
                [0.0, 0.05 + (lift * np.sin(np.pi * u) if i % 2 else 0.0), z + (stride * u if i % 2 else 0.0)]
            )
            stood.append(i % 2 == 0)
        z += stride if i % 2 else 0.0
    return np.array(at), np.array(stood)


def test_planted_foot_stays_in_place():
    at, stood = steps([0.5, 0.4, 0.6, 0.4, 0.5])
    contacts = find_contacts(at, STEP, 0.9, HOW)
    assert len(contacts.starts) == 3
    assert contacts.starts[0] == -np.inf and contacts.ends[-1] == np.inf
    np.testing.assert_allclose(contacts.places, [[0, 0.05, 0], [0, 0.05, 0.5], [0, 0.05, 1.0]], atol=1e-6)
    edges = np.flatnonzero(np.diff(stood.astype(int))) * STEP
    np.testing.assert_allclose([contacts.ends[0], contacts.starts[1]], edges[:2], atol=0.08)


@pytest.mark.parametrize("size", [0.1, 30.0])
def test_a_spider_is_judged_as_a_giraffe_is(size):
    at, _ = steps([0.5, 0.4, 0.6, 0.4, 0.5])
    ours, theirs = find_contacts(at * size, STEP, 0.9 * size, HOW), find_contacts(at, STEP, 0.9, HOW)
    assert are_alike(ours.starts, theirs.starts) and are_alike(ours.ends, theirs.ends)


def test_a_foot_in_the_air_or_sliding_does_not_stand():
    flying = np.stack([np.zeros(120), 1 + np.sin(np.arange(120) / 5), np.zeros(120)], 1)
    sliding = np.stack([np.zeros(120), np.zeros(120), np.arange(120) * STEP * 2.0], 1)
    assert len(find_contacts(sliding, STEP, 0.9, HOW).starts) == 0
    assert (
        find_contacts(flying, STEP, 0.9, HOW).ends - find_contacts(flying, STEP, 0.9, HOW).starts < 0.3
    ).all()


def test_single_frame_is_a_contact():
    contacts = find_contacts(np.array([[1.0, 2.0, 3.0]]), 1.0, 0.9, HOW)
    assert contacts.starts[0] == -np.inf and np.array_equal(contacts.places, [[1, 2, 3]])


def plain_touching(height, speed, low, slow, release):
    is_touching = []
    for h, v in zip(height, speed, strict=True):
        before = bool(is_touching and is_touching[-1])
        limit = release if before else 1.0
        is_touching.append(bool(h <= low * limit and v <= slow * limit))
    return is_touching


@laws
@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=40), st.floats(1, 3))
def test_hysteresis_is_the_definition(foot, release):
    height, speed = np.array(foot).T.copy()
    down = np.empty(len(height), np.bool_)
    detect_contact_frames(height, speed, 0.3, 0.3, release, down)
    assert down.tolist() == plain_touching(height, speed, 0.3, 0.3, release)
    assert [b for a, e in find_runs(down) for b in range(a, e + 1)] == np.flatnonzero(down).tolist()


def held(times, starts, ends, places, blend=0.2):
    times = np.atleast_1d(np.asarray(times, float))
    weights, goals = np.empty(len(times)), np.empty((len(times), 3))
    compute_hold_weights(
        times,
        np.array(starts, float),
        np.array(ends, float),
        np.array(places, float).reshape(-1, 3),
        blend,
        weights,
        goals,
    )
    return weights, goals


def test_a_pin_holds_wholly_in_contact_and_lets_go_smoothly():
    weights, goals = held([0.0, 1.0, 1.5, 2.0, 2.1, 2.2, 5.0], [1.0], [2.0], [[1, 2, 3]])
    np.testing.assert_allclose(weights, [0, 1, 1, 1, 0.5, 0, 0], atol=1e-9)
    np.testing.assert_allclose(goals[1:5], np.tile([1, 2, 3], (4, 1)))
    fine = np.linspace(0.5, 2.5, 4001)
    weights, _ = held(fine, [1.0], [2.0], [[1, 2, 3]])
    assert np.abs(np.diff(weights)).max() < 1.6 * (fine[1] - fine[0]) / 0.2
    # Without blending, the pin is either on or off.
    assert held([0.99, 1.0, 2.01], [1.0], [2.0], [[0, 0, 0]], 0.0)[0].tolist() == [0, 1, 0]


def test_between_two_contacts_the_place_moves_without_a_jump():
    fine = np.linspace(0.9, 1.25, 5001)
    weights, goals = held(fine, [0.0, 1.15], [1.0, 2.0], [[0, 0, 0], [1, 0, 0]])
    assert np.abs(np.diff(goals[:, 0])).max() < 0.01 and np.abs(np.diff(weights)).max() < 0.01
    assert goals[fine <= 1.0, 0].max() == 0.0 and goals[fine >= 1.15, 0].min() == 1.0
    assert weights[(fine <= 1.0) | (fine >= 1.15)].min() == 1.0


def test_motion_without_contacts_is_unchanged():
    weights, goals = held([0.0, 1.0], [], [], [])
    assert not weights.any() and not goals.any()
