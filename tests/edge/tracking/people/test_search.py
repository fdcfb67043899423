"""Tests of deciding which pixel groups are people. Raised arms are not, and people do not float."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from postures_seen_for_tests import CAMERA, MOUNT, picture

from enliven.camera import Intrinsics
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people import person, search
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.people.reidentification import BodyMeasurements
from enliven_edge.tracking.people.search import ScoredDetection, Search
from enliven_edge.tracking.scene.background_kernels import FOREGROUND, UNLIKELY
from enliven_edge.tracking.segment.candidate import Candidate, measure_blob, union_masks
from enliven_edge.tracking.segment.person_shape import measure_shape
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import run_to_end

SETTINGS = TrackerSettings()


@pytest.fixture(scope="module")
def scene():
    """Returns (view, (h, w) pixels) of a person with both arms stretched out and up."""
    z, mask = picture(posture_of(standing_pose(arm_raise=2.0, elbow=0.2)))
    return view_of(z), mask


def posture_of(rotations: np.ndarray) -> Posture:
    return Posture(np.array([0.0, 0.95, -2.5]), rotations, lengths_for_height(1.7))


def view_of(z: np.ndarray) -> FrameView:
    camera = WorkingCamera(Intrinsics(160, 120, *CAMERA), 160)
    return FrameView(0, z, world_points(z, camera.ray, MOUNT), camera, MOUNT)


def newcomer(view: FrameView, pixels: np.ndarray) -> Candidate:
    """Returns a pixel group as found in the first frame."""
    candidate = Candidate(view.points[pixels].mean(0), 0)
    area = area_of(view, pixels)
    candidate.update(pixels, candidate.centre, measure_shape(view, pixels, area), area, (0.0, 1.0), 0)
    return candidate


def area_of(view: FrameView, pixels: np.ndarray) -> float:
    """Returns the area in square metres, as seen from the sensor."""
    return measure_blob(view, pixels, np.zeros(pixels.shape, np.uint8))[1]


def halves(view: FrameView, mask: np.ndarray) -> list[np.ndarray]:
    left = view.points[..., 0] < 0.0
    return [mask & left, mask & ~left]


def searched(view: FrameView, newcomers: list[Candidate]):
    results: list[ScoredDetection] = []
    run_to_end(looking().search_each(view, newcomers, results, alone=True))
    return results


def looking() -> Search:
    return Search(Fitter(SETTINGS.fit), lambda *_: SETTINGS)


def test_two_halves_of_a_person_become_one(scene):
    view, mask = scene
    parts = halves(view, mask)
    two = [newcomer(view, part) for part in parts]
    for candidate, part in zip(two, parts, strict=True):
        candidate.pixels, candidate.parts = part, parts
    results = searched(view, two)
    assert [result[0] for result in results] == [two[0]]
    np.testing.assert_array_equal(two[0].pixels, mask)
    np.testing.assert_allclose(two[0].centre, view.points[mask].mean(0))
    assert two[0].shape == newcomer(view, mask).shape
    assert abs(float(results[0][1].posture.position[0])) < 0.1


def test_two_people_holding_hands_stay_two():
    """One body does not explain both people, so the pixels stay separate."""
    z, mask = picture(posture_of(standing_pose(arm_raise=0.5)))
    parts = [np.roll(mask, shift, 1) for shift in (-23, 23)]
    view = view_of(np.minimum(np.roll(z, -23, 1), np.roll(z, 23, 1)))
    parts[1] &= ~parts[0]
    two = [newcomer(view, part) for part in parts]
    for candidate, part in zip(two, parts, strict=True):
        candidate.pixels, candidate.parts = part, parts
    results = searched(view, two)
    assert len(results) == 2
    offset = results[0][1].posture.position - results[1][1].posture.position
    assert 0.7 < float(np.linalg.norm(offset)) < 1.1


@given(st.integers(1, 5), st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_unions_are_all_parts_then_pairs_the_largest_first(count, seed):
    random = np.random.default_rng(seed)
    whose = random.integers(-1, count, (8, 8))
    parts = [whose == k for k in range(count)]
    part = parts[seed % count]
    unions = union_masks(part, parts)
    assert len(unions) == (0 if count == 1 else 1 if count == 2 else count)
    sizes = [int(union.sum()) for union in unions[1:]]
    assert sizes == sorted(sizes, reverse=True)
    assert all((union | ~part).all() for union in unions)
    if unions:
        np.testing.assert_array_equal(unions[0], whose >= 0)
    assert union_masks(part.copy(), parts) == [], "of what is none of the parts"


def test_no_person_is_guessed_high_on_a_wall(scene, monkeypatch):
    view, mask = scene
    looks = looking()
    assert run_to_end(looks.find_best_guess(view, [newcomer(view, mask)], alone=True))
    lifted = MOUNT.copy()
    lifted[1, 3] += 0.6
    high = replace(view, points=world_points(view.z, view.camera.ray, lifted), world_from_camera=lifted)
    monkeypatch.setattr(search, "_is_probably_person", lambda *_: True)
    assert not run_to_end(looks.find_best_guess(high, [newcomer(high, mask)], alone=True))


def test_an_area_is_that_of_the_pixels_themselves(scene):
    """A nearer object has a smaller area than its fraction of the pixels."""
    view, mask = scene
    for part in halves(view, mask):
        expected = sum(view.z[v, u] ** 2 / (CAMERA[0] * CAMERA[1]) for v, u in np.argwhere(part))
        assert area_of(view, part) == pytest.approx(expected)


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_blob_measures_are_those_of_its_pixels(scene, seed):
    """Its centre, and its fractions in front of the known and of the filled-in background."""
    view, mask = scene
    random = np.random.default_rng(seed)
    kind, part = (
        random.integers(0, 4, mask.shape).astype(np.uint8),
        mask & (random.uniform(size=mask.shape) < 0.5),
    )
    centre, _, shares = measure_blob(view, part, kind)
    np.testing.assert_allclose(centre, view.points[part].mean(0), atol=1e-9)
    assert shares == pytest.approx((np.mean(kind[part] == FOREGROUND), np.mean(kind[part] != UNLIKELY)))


def seen_by_network(scene, probabilities, *, good: bool = False) -> Person:
    """Returns a person that the network confirmed in each frame."""
    view, mask = scene
    someone = Person(
        1, Follower(SETTINGS, Fitter(SETTINGS.fit), posture_of(standing_pose())), BodyMeasurements(), 0
    )
    someone.follower.follow = lambda *_: good
    someone.follower.confidence = np.ones(20)
    for probability in probabilities:
        someone.follower.person_probability = probability
        someone.follow(view, mask, is_fully_visible=True)
    return someone


@pytest.mark.parametrize(("plain_frames", "vague"), [(0, True), (9, True), (10, False)])
def test_long_confirmed_person_stays_a_person(plain_frames, vague, scene):
    """The network may reject later postures. A blob that it never accepted is dropped."""
    someone = seen_by_network(scene, [0.95] * plain_frames + [0.1] * 30)
    assert someone.is_probably_object == vague
    assert person.CERTAIN_FRAMES == 10


@pytest.mark.parametrize(
    ("plain_frames", "later", "frames", "vague"),
    [(0, 0.3, 30, True), (0, 0.3, 10, False), (0, 0.5, 30, False), (10, 0.1, 30, False)],
)
def test_blob_never_confirmed_as_person_is_dropped_even_if_moving(plain_frames, later, frames, vague, scene):
    """A fit to the strip of wall next to a person slides along it, which is detected after half a second."""
    someone = seen_by_network(scene, [0.95] * plain_frames + [later] * frames, good=True)
    someone.has_moved = someone.has_person_outline = True
    assert someone.is_probably_object == vague
    assert someone.is_confirmed == (plain_frames >= person.CERTAIN_FRAMES)


def test_network_is_queried_only_if_useful(scene):
    """It is sometimes queried for a person with raised arms, but not for a panel, which cannot be a
    person.
    """
    view, pixels = scene
    raised = newcomer(view, pixels)
    raised.shape = replace(raised.shape, head_ratio=1.0)
    assert not raised.is_convincing
    assert [raised.needs_recognition(ns) for ns in (0, 100_000_000, 300_000_000)] == [True, False, True]
    raised.is_recognised = True
    assert raised.is_convincing
    panel = newcomer(view, pixels)
    panel.shape = replace(panel.shape, head_ratio=1.0, thickness=0.01, width=0.5)
    assert not panel.needs_recognition(0)
    panel.is_recognised = True
    assert not panel.is_convincing


@pytest.mark.parametrize(("share", "due"), [(0.6, True), (0.8, False)])
def test_blob_without_removed_furniture_is_searched_at_once(scene, share, due):
    view, pixels = scene
    candidate = newcomer(view, pixels)
    candidate.is_recognised = True
    tried = copy.copy(candidate)
    tried.postpone_search(0)
    candidate.copy_search_times(tried)
    now = 33_000_000
    assert not candidate.is_due(now, 0.1, alone=False, missing=False)
    candidate.update(pixels, candidate.centre, candidate.shape, share * candidate.area, (0.0, 1.0), now)
    assert candidate.is_due(now, 0.1, alone=False, missing=False) == due
