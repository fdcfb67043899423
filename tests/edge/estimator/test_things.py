"""Tests of clutter objects: rays hit solids correctly, positions are kept, and samples are labelled as
clutter.
"""

from __future__ import annotations

from dataclasses import astuple
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people_for_estimator import turned_at_random

from enliven_edge.tracking.estimator.labels import NOBODY
from enliven_synthesis.training.clutter import ClutterSolid, random_clutter, random_wall_piece
from enliven_synthesis.training.rendering import PersonRenderer
from enliven_synthesis.training.samples import CLUTTER_FRACTION, training_sample

STEPS, FARTHEST = 1500, 6.0
"""Number of samples along a ray, and their maximum distance in metres."""
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
SEEDS = st.integers(0, 100_000)


@pytest.fixture(scope="module")
def studio() -> PersonRenderer:
    return PersonRenderer()


def random_solid(dice) -> ClutterSolid:
    return ClutterSolid(
        dice.normal(0, 0.5, 3), dice.uniform(0.05, 1.0, 3), turned_at_random(dice), dice.random() < 0.5
    )


def holds(solid: ClutterSolid, points: np.ndarray) -> np.ndarray:
    """Returns (...) True for the (..., 3) points inside the solid."""
    local = (points - solid.centre) @ solid.turn / solid.half
    return (np.linalg.norm(local, axis=-1) if solid.round else np.abs(local).max(-1)) <= 1.0


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_a_ray_enters_where_its_first_point_inside_is(seed):
    """Tested on rays that enter less than one step before the first sample inside."""
    dice = np.random.default_rng(seed)
    solid, eye = random_solid(dice), dice.normal(size=3)
    eye *= dice.uniform(2.5, 3.5) / np.linalg.norm(eye)
    towards = solid.centre + dice.normal(0, 0.6, (5, 6, 3)) - eye
    direction = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
    along, step = np.linspace(0.0, FARTHEST, STEPS, retstep=True)
    inside = holds(solid, eye + along[:, None, None, None] * direction)
    first, met = along[inside.argmax(0)], inside.any(0)
    entry = solid.entry(eye, direction)
    assert (np.abs(entry - first)[met] <= step * 1.001).all()
    grazed = eye + np.where(np.isfinite(entry), entry + step, 0.0)[..., None] * direction
    assert not holds(solid, grazed)[~met].any()


@given(SEEDS, st.booleans())
@settings(max_examples=30, deadline=None)
def test_axis_aligned_rays_hit_solids_in_front_only(seed, is_round):
    """Tests rays that are level with faces, and rays that start next to objects."""
    dice = np.random.default_rng(seed)
    half, beside = dice.uniform(0.1, 1.0, 3), dice.uniform(-1.5, 1.5, 2)
    solid = ClutterSolid(np.array([0.0, 0.0, 3.0]), half, np.eye(3), is_round)
    eye = np.array([*(beside * half[:2]), 0.0])
    (entry,) = solid.entry(eye, np.array([[0.0, 0.0, 1.0]]))
    if is_round:
        square = 1.0 - (beside**2).sum()
        expected = 3.0 - half[2] * np.sqrt(square) if square > 0 else np.inf
    else:
        expected = 3.0 - half[2] if np.abs(beside).max() <= 1.0 else np.inf
    assert entry == pytest.approx(expected)
    assert solid.entry(eye, np.array([[0.0, 0.0, -1.0]])) == np.inf, "what is behind is not met"


@given(SEEDS, st.floats(-3, 3), st.floats(-5, 1))
@settings(max_examples=200, deadline=None)
def test_clutter_is_near_its_position(seed, x, z):
    """The centre of every part is above the floor and within 1.5 m."""
    clutter = random_clutter(np.array([x, z]), np.random.default_rng(seed))
    assert clutter
    for solid in clutter:
        corners = solid.centre + (solid.half * CORNERS) @ solid.turn.T
        assert np.hypot(corners[:, 0] - x, corners[:, 2] - z).max() < 1.5
        assert solid.centre[1] >= 0.0
        assert (solid.half > 0).all()
        np.testing.assert_allclose(solid.turn @ solid.turn.T, np.eye(3), atol=1e-12)


def test_clutter_stands_on_the_floor():
    """Its lowest point is close to the floor. Rotated parts may penetrate the floor slightly."""
    for seed in range(100):
        clutter = random_clutter(np.zeros(2), np.random.default_rng(seed))
        lowest = min((s.centre + (s.half * CORNERS) @ s.turn.T)[:, 1].min() for s in clutter)
        assert -0.7 < lowest < 0.1


def test_a_piece_of_a_wall_is_mostly_about_where_and_as_large_as_asked_for():
    has_middle, near, size_right = [], [], []
    for seed in range(60):
        dice = np.random.default_rng(seed)
        middle, size = dice.uniform([40, 50], [110, 150]), dice.uniform(20, 80, 2)
        piece = random_wall_piece((150, 200), middle, size, dice)
        assert piece.dtype == bool and piece.shape == (150, 200)
        has_middle.append(piece[tuple(middle.astype(int))])
        off = np.median(np.argwhere(piece), axis=0) - middle
        near.append((np.abs(off) < 0.5 * size + 8).all())
        size_right.append(0.3 * size.prod() < piece.sum() < 2.5 * size.prod())
    assert np.mean(has_middle) > 0.8 and np.mean(near) > 0.9 and np.mean(size_right) > 0.8


@pytest.mark.parametrize("seed", range(25))
def test_clutter_picture_contains_no_person(studio, seed):
    picture = studio.render_clutter(np.random.default_rng(seed))
    assert np.count_nonzero(picture.z) >= 60
    assert picture.figure is None
    assert (picture.label == NOBODY).all() and picture.label.shape == picture.z.shape == picture.around.shape
    assert np.isfinite(picture.z).all() and (picture.z >= 0).all() and np.isfinite(picture.around).all()
    np.testing.assert_array_equal(picture.z[picture.z > 0], picture.around[picture.z > 0])


def test_the_same_dice_take_the_same_picture(studio):
    """The result does not depend on the images that were rendered before."""
    for seed in range(5):
        first, second = (
            each.render_clutter(np.random.default_rng(seed)) for each in (studio, PersonRenderer())
        )
        assert all(np.array_equal(a, b) for a, b in zip(astuple(first), astuple(second), strict=True))


@pytest.fixture(scope="module")
def lessons(studio):
    dice = np.random.default_rng(5)
    return [training_sample(studio, dice, 0.5) for _ in range(150)]


@pytest.mark.slow
def test_clutter_lessons_have_no_person_labels(lessons):
    about = [lesson for lesson in lessons if np.isnan(lesson.facing)]
    assert about
    for lesson in about:
        assert (lesson.joints == 0).all() and lesson.joints.shape == (20, 3)
        assert (lesson.parts == NOBODY).all()
        assert lesson.image[0].any() and np.isfinite(lesson.image).all() and lesson.cell > 0


@pytest.mark.slow
def test_person_lessons_have_joint_labels(lessons):
    for lesson in lessons:
        if np.isfinite(lesson.facing):
            assert np.ptp(lesson.joints, axis=0).max() > 0.1


def test_fraction_of_clutter_lessons_is_as_configured(lessons):
    share = np.mean([np.isnan(lesson.facing) for lesson in lessons])
    assert 0.4 * CLUTTER_FRACTION < share < 1.8 * CLUTTER_FRACTION
