"""The floor as it is seen now, against the plain least squares that the compiled one stands for."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.camera import world_from_level_camera
from enliven_edge.tracking.body_model.posture import rotation
from enliven_edge.tracking.scene.floor import _lying_plane, corrected

GAIN = 0.3


def seen_floor(seed: int, tilt: float = 0.01):
    """(h, w, 3) points of a tilted floor with things on it, (h, w) those that may be used, and the plane."""
    random = np.random.default_rng(seed)
    x, z = np.meshgrid(np.linspace(-2, 2, 60), np.linspace(-4, -1, 45))
    a, b, c = random.normal(0, [tilt, tilt, 0.01])
    y = a * x + b * z + c + random.normal(0, 0.01, x.shape)
    y += np.where(random.random(x.shape) < 0.2, random.uniform(0, 1, x.shape), 0.0)
    return np.stack([x, y, z], 2), random.random(x.shape) < 0.8, (a, b, c)


def plane_slowly(points, usable):
    floor = points[usable & (np.abs(points[..., 1]) < 0.12)]
    for width in (0.08, 0.05, 0.04):
        flat = np.column_stack([floor[:, 0], floor[:, 2], np.ones(len(floor))])
        plane = np.linalg.lstsq(flat, floor[:, 1], rcond=None)[0]
        floor = floor[np.abs(floor[:, 1] - flat @ plane) < width]
    return plane


@pytest.mark.parametrize("seed", range(20))
def test_the_plane_is_that_of_least_squares(seed):
    points, usable, _ = seen_floor(seed)
    plane, seen = _lying_plane(points, usable)
    assert seen
    np.testing.assert_allclose(plane, plane_slowly(points, usable), atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_a_corrected_mounting_brings_the_floor_nearer_to_level(seed):
    """By its gain: what was seen lies flatter, and nearer to height 0, in the corrected world."""
    points, usable, (a, b, c) = seen_floor(seed)
    before = world_from_level_camera(1.2)
    made = corrected(before, points, usable, GAIN)
    between = made @ np.linalg.inv(before)
    up = between[:3, :3] @ np.array([-a, 1.0, -b])
    assert np.hypot(up[0], up[2]) / up[1] == pytest.approx((1 - GAIN) * np.hypot(a, b), abs=2e-3)
    place = between @ np.array([0.0, c, 0.0, 1.0])
    assert place[1] == pytest.approx((1 - GAIN) * c, abs=4e-3)
    np.testing.assert_allclose(made[:3, :3] @ made[:3, :3].T, np.eye(3), atol=1e-9)


def test_where_little_floor_is_seen_nothing_is_corrected():
    points, usable, _ = seen_floor(0)
    before = world_from_level_camera(1.2)
    assert corrected(before, points, np.zeros_like(usable), GAIN) is before
    strip = usable & (np.abs(points[..., 0]) < 0.2)
    assert corrected(before, points, strip, GAIN) is before, "a strip says nothing of its tilt"
    line = points.copy()
    line[..., 2] = line[..., 0]
    assert corrected(before, line, usable, GAIN) is before, "nor does a line"
    steep = points @ rotation(z=0.2).T
    assert corrected(before, steep, usable, GAIN) is before, "that is no floor"
