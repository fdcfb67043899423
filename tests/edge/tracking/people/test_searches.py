"""Tests of the innermost search loops against plain versions: capsules, pixels, samples."""

import numpy as np
import pytest
from bodies_for_tests import foot, nearest, random_posture
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.body_model.capsules import misfits
from enliven_edge.tracking.frame.observation import nearest_columns, nearest_pixel, sample_pixels


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_nearest_capsule_matches_the_obvious_search(seed):
    posture = random_posture(seed)
    ends, radii = posture.capsules()
    point = np.random.default_rng(seed).normal([0, 1, -2.5], 0.5)
    normal = np.array([0.0, 0.0, 1.0])
    costs = []
    for (a, b), (ra, rb) in zip(ends, radii, strict=True):
        t = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        out = point - (a + t * (b - a))
        distance = np.linalg.norm(out) - (ra + t * (rb - ra))
        costs.append(abs(distance) + 0.04 * (1 - out @ normal / np.linalg.norm(out)))
    likes = np.random.default_rng(seed + 1).uniform(0, 0.1, len(costs)).astype(np.float32)
    # Two capsules with a common end have the same cost; the search compares 18 bits of them.
    costs = np.array(costs)
    for each, liked in ((costs, ()), (costs + likes, (likes,))):
        assert each[nearest(point, normal, ends, radii, *liked)[0]] < each.min() * (1 + 1e-5) + 1e-6


@given(st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_misfits_are_mean_distances_both_ways(seed):
    postures = [random_posture(seed + k, 0.8) for k in range(2)]
    points = np.random.default_rng(seed).normal([0, 1, -2.5], 0.5, (30, 3)).astype(np.float32)
    shapes = [posture.capsules() for posture in postures]
    distances = misfits(np.ascontiguousarray(points.T), np.stack([e for e, _ in shapes]), shapes[0][1], 0.4)
    for (ends, _), value in zip(shapes, distances, strict=True):
        radii = shapes[0][1]
        away = np.array([[abs(foot(*p, e, r)[1]) for e, r in zip(ends, radii, strict=True)] for p in points])
        assert value == pytest.approx(np.minimum(away.min(1), 0.4).mean() + away.min(0).mean(), rel=1e-3)


@given(st.integers(0, 10_000), st.floats(0.001, 0.3))
@settings(max_examples=25, deadline=None)
def test_the_nearest_pixel_is_that_of_the_obvious_search(seed, share):
    random = np.random.default_rng(seed)
    mask = random.uniform(size=(23, 31)) < share
    columns, (v, u) = nearest_columns(mask), random.integers(0, (23, 31))
    row, column = nearest_pixel(v, u, columns)
    if not mask.any():
        assert (row, column) == (-1, -1)
    else:
        rows, places = np.nonzero(mask)
        assert mask[row, column]
        assert (row - v) ** 2 + (column - u) ** 2 == ((rows - v) ** 2 + (places - u) ** 2).min()


@given(st.integers(0, 10_000), st.integers(1, 900))
@settings(max_examples=25, deadline=None)
def test_samples_are_different_pixels_of_the_person_evenly_spread(seed, points):
    mask = np.random.default_rng(seed).uniform(size=(20, 30)) < 0.5
    rows, columns = np.nonzero(mask)
    kept = sample_pixels(mask, points)
    assert len(kept) == min(points, len(rows))
    index = {pair: k for k, pair in enumerate(zip(rows, columns, strict=True))}
    order = np.array([index[tuple(pair)] for pair in kept])
    assert (np.diff(order) > 0).all()
    assert np.ptp(np.diff(order)) <= 1 if len(order) > 2 else True
