"""Tests that disconnected pixels of a person are not learnt by a new background model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.people import MultiPersonTracker
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.people.reidentification import BodyMeasurements
from enliven_edge.tracking.scene.background_kernels import UNSEEN
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.segment.candidate import MAX_YOUNG_AGE_S
from enliven_edge.tracking.segment.pieces import is_limb_fragment
from enliven_edge.tracking.segment.segmentation import segment_people
from enliven_edge.tracking.settings import TrackerSettings

CAMERA = WorkingCamera(Intrinsics(80, 60, 66, 66, 39.5, 29.5), 80)
MOUNT = world_from_level_camera(1.2)
SOMEBODY = (-0.25, 0.25, 0.1, 1.7)
"""Left, right, bottom and top of a person in metres (world), 2.4 m from the sensor."""
SHANK, BENCH = (0.4, 0.52, 0.25, 0.6), (0.35, 1.15, 0.1, 0.35)
"""A small object next to a person, and an object that is too large and too low to be a person."""


def drawn(*boxes) -> FrameView:
    """Returns a view of flat boxes without a background."""
    z = np.zeros((60, 80))
    x, y = CAMERA.ray[..., 0] * 2.4, 1.2 - CAMERA.ray[..., 1] * 2.4
    for left, right, bottom, top in boxes:
        z[(x > left) & (x < right) & (y > bottom) & (y < top)] = 2.4
    return FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)


def held(view: FrameView, somebody_at: float | None, age: float = 0.0) -> np.ndarray:
    """Returns (h, w) pixels that the background model must not learn, with a person at ``somebody_at`` or
    none.
    """
    settings = TrackerSettings(estimator=False)
    fitter = Fitter(settings.fit)
    tracker = MultiPersonTracker(settings, fitter)
    if somebody_at is not None:
        posture = Posture(np.array([somebody_at, 0.95, -2.4]), standing_pose(), lengths_for_height(1.75))
        tracker.people.append(Person(1, Follower(settings, fitter, posture), BodyMeasurements(), 0))
    room = BackgroundModel(view.z.shape)
    room.age = age
    kind = np.where(view.z > 0, UNSEEN, 0).astype(np.uint8)
    return tracker.finder.find(view, kind, segment_people(view, kind, []), room, believe=False)


def test_shank_next_to_a_person_is_held():
    view = drawn(SHANK)
    np.testing.assert_array_equal(held(view, 0.1), view.z > 0)


@pytest.mark.parametrize("somebody_at", [None, -0.4, 1.3])
def test_a_shank_far_from_everybody_is_not_held(somebody_at):
    assert not held(drawn(SHANK), somebody_at).any()


def test_large_object_next_to_a_person_is_not_held():
    assert not held(drawn(BENCH), 0.3).any()


def test_no_fragment_is_held_once_background_is_known():
    assert not held(drawn(SHANK), 0.1, age=MAX_YOUNG_AGE_S).any()


def test_shank_next_to_an_undetected_person_is_held():
    view = drawn(SOMEBODY, SHANK)
    np.testing.assert_array_equal(held(view, None), view.z > 0)
    assert not held(drawn(SOMEBODY, (1.0, 1.12, 0.25, 0.6)), None)[:, 65:].any()


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_a_fragment_reaches_as_its_median_and_percentile_say(seed):
    random = np.random.default_rng(seed)
    part = random.normal(0.0, random.uniform(0.1, 0.6), (random.integers(1, 40), 3))
    contact = random.normal(random.uniform(-0.8, 0.8), 0.1, (random.integers(1, 9), 3))
    gap = abs(np.median(part[:, 2]) - np.median(contact[:, 2]))
    away = np.percentile(np.linalg.norm(part - contact.mean(0), axis=1), 90)
    assume(abs(gap - 0.6) > 1e-9 and abs(away - 0.8) > 1e-9)
    assert is_limb_fragment(part, contact) == (gap < 0.6 and away < 0.8)
