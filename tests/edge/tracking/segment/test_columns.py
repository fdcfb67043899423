"""Tests of finding people side by side in a pixel group: the compiled search against a plain version."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.segment.pieces import find_columns, split_people


def obvious_columns(points):
    """Returns (N, 2) x and z of the people in (M, 3) points, computed with arrays."""
    flat = points[:, [0, 2]]
    origin = flat.min(0)
    cells = np.floor((flat - origin) / 0.06).astype(int)
    height = np.zeros(cells.max(0) + 1)
    np.maximum.at(height, (cells[:, 0], cells[:, 1]), points[:, 1])
    kept = []
    for index in np.argsort(-height, axis=None)[:200]:
        place = np.array(np.unravel_index(index, height.shape))
        top = float(height[tuple(place)])
        if top < 0.7:
            break
        high = points[points[:, 1] > top - 0.15]
        near = np.linalg.norm(high[:, [0, 2]] - (origin + (place + 0.5) * 0.06), axis=1) < 0.2
        centre = high[near][:, [0, 2]].mean(0)
        if all(np.linalg.norm(centre - other) > 0.42 for other in kept) and filled(points, centre, top):
            kept.append(centre)
    return np.array(kept).reshape(-1, 2)


def filled(points, centre, top):
    """Returns True if the points below a peak fill the shape of a person."""
    away = np.linalg.norm(points[:, [0, 2]] - centre, axis=1)
    if points[away < 0.3, 1].max() > top + 0.2:
        return False
    met = np.unique(np.floor(points[away < 0.24, 1] / 0.1))
    wanted = np.arange(np.ceil(0.35 * top / 0.1), np.floor(top / 0.1))
    return len(wanted) > 0 and np.isin(wanted, met).mean() > 0.8


def standing_people(seed):
    """Returns (M, 3) points of up to four upright cylinders with a head, and of a table between them."""
    random = np.random.default_rng(seed)
    parts = [random.uniform((-1.5, 0.0, -3.0), (1.5, 0.75, -2.0), (150, 3))]
    for _ in range(random.integers(0, 5)):
        centre, tall = random.uniform((-1.5, 0.0, -3.0), (1.5, 0.0, -2.0)), random.uniform(0.8, 1.9)
        around = random.uniform(0, np.pi, 400)
        height = random.uniform(0, tall, 400)
        radius = np.where(height > tall - 0.25, 0.09, 0.18)
        parts.append(centre + np.stack([radius * np.cos(around), height, radius * np.sin(around)], 1))
    return np.concatenate(parts)


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_the_people_are_those_of_the_obvious_search(seed):
    points = standing_people(seed)
    columns = find_columns(np.ascontiguousarray(points.T))
    np.testing.assert_allclose(columns, obvious_columns(points), atol=1e-9)


@pytest.mark.parametrize("seed", [1, 5, 9, 12])
def test_a_pixel_belongs_to_the_nearest_of_them(seed):
    points = standing_people(seed)
    image = points[: len(points) // 10 * 10].reshape(-1, 10, 3)
    mask = np.random.default_rng(seed).uniform(size=image.shape[:2]) < 0.9
    parts, columns = split_people(image, mask), obvious_columns(image[mask])
    assert len(parts) == max(1, len(columns))
    np.testing.assert_array_equal(np.sum(parts, axis=0), mask)
    for k, part in enumerate(parts if len(columns) > 1 else []):
        away = np.linalg.norm(image[part][:, None, [0, 2]] - columns[None], axis=2)
        assert (away[:, k] <= away.min(1) + 1e-9).all()
    assert len(columns) > 1 or (parts[0] == mask).all()


def test_the_examples_have_several_people():
    """The tests above include cases with no, one and several people."""
    counts = {len(obvious_columns(standing_people(seed))) for seed in range(60)}
    assert {0, 1, 2} <= counts
