"""Tests of identities, appearance, and re-identification."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.kernels import quantile
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.people.reidentification import BodyMeasurements, PersonGallery
from enliven_edge.tracking.scene.zone import Zone, ZoneLock
from enliven_edge.tracking.settings import PeopleSettings

SECOND = 1_000_000_000
HERE = np.array([0.0, 0.9, -2.5])


def looks(height, frames=20, noise=0.0, seed=0):
    random, appearance = np.random.default_rng(seed), BodyMeasurements()
    for _ in range(frames):
        lengths = lengths_for_height(height) * (1 + noise * random.standard_normal(12))
        appearance.update(lengths, height - 0.05 + noise * random.standard_normal())
    return appearance


def test_numbers_are_never_given_twice():
    gallery = PersonGallery(PeopleSettings())
    assert [gallery.make_new_id() for _ in range(3)] == [1, 2, 3]


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=60), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_a_percentile_is_numpys(values, share):
    assert quantile(np.sort(values), share) == pytest.approx(np.percentile(values, 100 * share), abs=1e-9)


def test_the_stature_is_that_of_standing_upright():
    appearance = BodyMeasurements()
    for i in range(60):
        appearance.update(lengths_for_height(1.7), 1.7 if i % 2 else 1.2)
    assert appearance.stature == pytest.approx(1.7, abs=0.01)
    assert BodyMeasurements().stature is None


@given(st.floats(1.4, 1.95), st.integers(0, 100))
@settings(max_examples=20, deadline=None)
def test_person_matches_themselves_and_not_a_taller_one(height, seed):
    first, again = looks(height, noise=0.01, seed=seed), looks(height, noise=0.01, seed=seed + 1)
    taller = looks(height + 0.12, noise=0.01, seed=seed + 2)
    assert again.mismatch(first) < 3.0
    assert taller.mismatch(first) > 9.0


def test_two_people_returning_together_are_distinguished():
    gallery = PersonGallery(PeopleSettings())
    gallery.leave(1, looks(1.65), HERE, 0)
    gallery.leave(2, looks(1.85), HERE, 0)
    newcomers = [(looks(1.83, 8), HERE), (looks(1.66, 8), HERE)]
    (first, sure), (second, also) = gallery.match(newcomers, SECOND)
    assert sure
    assert also
    assert (first.id, second.id) == (2, 1)


def test_unknown_person_is_not_reidentified():
    gallery = PersonGallery(PeopleSettings())
    gallery.leave(1, looks(1.6), HERE, 0)
    assert gallery.match([(looks(1.85), HERE)], SECOND) == [(None, True)]
    assert PersonGallery(PeopleSettings()).match([(looks(1.85), HERE)], 0) == [(None, True)]


def test_reidentification_between_similar_people_is_unsure():
    gallery = PersonGallery(PeopleSettings())
    gallery.leave(1, looks(1.75), HERE, 0)
    gallery.leave(2, looks(1.76), HERE, 0)
    ((_, sure),) = gallery.match([(looks(1.755), HERE)], SECOND)
    assert not sure


def test_position_decides_between_people_who_look_alike():
    gallery = PersonGallery(PeopleSettings())
    gallery.leave(1, looks(1.75), HERE + np.array([6.0, 0.0, 0.0]), 0)
    gallery.leave(2, looks(1.75), HERE, 0)
    ((absent, _),) = gallery.match([(looks(1.75), HERE)], SECOND // 2)
    assert absent.id == 2


def test_identity_is_forgotten_after_long_absence_unless_kept():
    gallery = PersonGallery(PeopleSettings(remember=10.0))
    gallery.leave(1, looks(1.7), HERE, 0)
    gallery.leave(2, looks(1.8), HERE, 0)
    gallery.forget_old(9 * SECOND, frozenset())
    assert [a.id for a in gallery.absent] == [1, 2]
    gallery.forget_old(11 * SECOND, frozenset({2}))
    assert [a.id for a in gallery.absent] == [2]


@given(st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=50, deadline=None)
def test_a_zone_holds_what_is_inside_it(x, z):
    square = Zone(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)))
    outside = float(np.hypot(max(abs(x) - 1, 0), max(abs(z) - 1, 0)))
    place = np.array([x, 0.9, z])
    assert square.contains(place) == (outside == 0.0) or outside < 1e-9
    assert square.contains(place, margin=outside + 1e-6)
    if outside > 0.1:
        assert not square.contains(place, margin=outside - 0.05)
    assert Zone().contains(place)


def test_a_hollow_in_a_zone_is_outside():
    shape = Zone(((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0)))
    assert shape.contains(np.array([0.3, 1.0, 2.0]))
    assert not shape.contains(np.array([2.0, 1.0, 3.0]))


def test_lock_admits_only_the_named_people():
    lock = ZoneLock()
    assert lock.admits(5)
    assert not lock.is_closed
    lock.ids = frozenset({1})
    assert lock.admits(1)
    assert not lock.admits(5)
    assert lock.is_closed


def test_single_newcomer_near_a_loss_is_reidentified():
    """This does not depend on the first estimate of bone lengths. A late, distant or clearly taller person is
    not matched.
    """
    gallery = PersonGallery(PeopleSettings())
    gallery.leave(1, looks(1.7), HERE, 0)
    nearby, elsewhere = HERE + 0.1, HERE + 1.0
    unlike = BodyMeasurements()
    unlike.update(1.25 * lengths_for_height(1.7), None)
    assert unlike.mismatch(looks(1.7)) > 5.0
    ((absent, sure),) = gallery.match([(unlike, nearby)], SECOND)
    assert sure and absent.id == 1
    for newcomer, time in (((looks(1.95), nearby), SECOND), ((looks(1.95), elsewhere), 5 * SECOND)):
        ((absent, _),) = gallery.match([newcomer], time)
        assert absent is None
