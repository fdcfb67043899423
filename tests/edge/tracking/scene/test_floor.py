"""Tests of the compiled floor fit in the current frame against plain least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import world_from_level_camera
from enliven_edge.tracking.body_model.posture import rotation
from enliven_edge.tracking.scene.floor import correct_mounting, fit_level_plane, world_from_floor

GAIN = 0.3


def seen_floor(seed: int, tilt: float = 0.01):
    """Returns (h, w, 3) points of a tilted floor with objects, (h, w) usable points, and the plane."""
    random = np.random.default_rng(seed)
    x, z = np.meshgrid(np.linspace(-2, 2, 60), np.linspace(-4, -1, 45))
    a, b, c = random.normal(0, [tilt, tilt, 0.01])
    y = a * x + b * z + c + random.normal(0, 0.01, x.shape)
    y += np.where(random.random(x.shape) < 0.2, random.uniform(0, 1, x.shape), 0.0)
    return np.stack([x, y, z], 2), random.random(x.shape) < 0.8, (a, b, c)


def plane_slowly(points, ranges):
    """Computes the same iterations with NumPy's least squares."""
    x, y, z = points
    flat, plane, noise = np.column_stack([x, z, np.ones(len(x))]), np.zeros(3), None
    for _ in range(8):
        off = np.abs(y - flat @ plane)
        near = off < (0.08 if noise is None else 3.0 * noise * ranges + 0.003)
        noise = 1.4826 * np.median(off[near] / ranges[near])
        kept = off < 2.0 * noise * ranges + 0.003
        root = 1.0 / (noise * ranges[kept] + 0.003)
        plane = np.linalg.lstsq(flat[kept] * root[:, None], y[kept] * root, rcond=None)[0]
    return plane


@pytest.mark.parametrize("seed", range(20))
def test_the_plane_is_that_of_least_squares(seed):
    points, usable, _ = seen_floor(seed)
    floor = np.ascontiguousarray(points[usable].T)
    plane, spread = fit_level_plane(floor, -floor[2])
    assert spread > 0.3
    np.testing.assert_allclose(plane, plane_slowly(floor, -floor[2]), atol=1e-9)


def seen_room(seed: int, height: float, tilt: float, floor_share: float = 0.5, noise: float = 0.0015):
    """Returns the (4, 4) mounting, and camera-frame points of a floor, a box and a wall, by rows.

    Args:
        floor_share: fraction of the points on the floor.
        noise: standard deviation along the ray at 1 m, metres. It grows with the squared distance, as for
            structured light.
    """
    random, mount = np.random.default_rng(seed), world_from_level_camera(height, tilt)
    count = round(6000 * floor_share)
    floor = np.stack(
        [random.uniform(-2, 2, count), np.zeros(count), -np.sqrt(random.uniform(1.5, 16, count))], 1
    )
    rest = 6000 - count
    wall = np.stack([random.uniform(-2, 2, rest), random.uniform(0, 2.5, rest), np.full(rest, -4.0)], 1)
    wall[::10] = wall[::10] * [0.2, 0.4, 0.0] + [0.8, 0.0, -2.6]
    camera_from_world = np.linalg.inv(mount)
    seen = np.concatenate([floor, wall]) @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    seen = seen[seen[:, 2] > 0.4]
    seen *= 1.0 + (noise * seen[:, 2] * random.normal(0, 1, len(seen)))[:, None]
    return mount, seen[np.argsort(np.round(seen[:, 1] / seen[:, 2], 2), kind="stable")]


@given(st.floats(0.6, 2.2), st.floats(0.0, 0.4), st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_the_foot_of_a_wall_tilts_no_floor(height, tilt, seed):
    """To 0.2 degrees and a centimetre, at the noise of a structured-light sensor."""
    mount, points = seen_room(seed, height, tilt)
    estimated = world_from_floor(points)
    assert estimated is not None
    assert np.degrees(np.arccos(min(1.0, estimated[1, :3] @ mount[1, :3]))) < 0.2
    assert estimated[1, 3] == pytest.approx(height, abs=0.01)


@pytest.mark.parametrize("seed", range(30))
def test_a_floor_that_is_a_tenth_of_the_image_is_found_with_any_seed(seed):
    mount, points = seen_room(3, 1.1, 0.1, floor_share=0.11)
    estimated = world_from_floor(points, seed=seed)
    assert estimated is not None
    assert np.degrees(np.arccos(min(1.0, estimated[1, :3] @ mount[1, :3]))) < 0.4
    assert estimated[1, 3] == pytest.approx(1.1, abs=0.015)


@pytest.mark.parametrize("seed", range(10))
def test_a_corrected_mounting_brings_the_floor_nearer_to_level(seed):
    """The floor points are flatter and nearer to height 0 in the corrected world, by the factor of the
    gain.
    """
    points, usable, (a, b, c) = seen_floor(seed)
    before = world_from_level_camera(1.2)
    updated = correct_mounting(before, points, usable, GAIN)
    between = updated @ np.linalg.inv(before)
    up = between[:3, :3] @ np.array([-a, 1.0, -b])
    assert np.hypot(up[0], up[2]) / up[1] == pytest.approx((1 - GAIN) * np.hypot(a, b), abs=2e-3)
    place = between @ np.array([0.0, c, 0.0, 1.0])
    assert place[1] == pytest.approx((1 - GAIN) * c, abs=4e-3)
    np.testing.assert_allclose(updated[:3, :3] @ updated[:3, :3].T, np.eye(3), atol=1e-9)


def test_little_visible_floor_gives_no_correction():
    points, usable, _ = seen_floor(0)
    before = world_from_level_camera(1.2)
    assert correct_mounting(before, points, np.zeros_like(usable), GAIN) is before
    strip = usable & (np.abs(points[..., 0]) < 0.2)
    assert correct_mounting(before, points, strip, GAIN) is before, "a strip says nothing of its tilt"
    line = points.copy()
    line[..., 2] = line[..., 0]
    assert correct_mounting(before, line, usable, GAIN) is before, "nor does a line"
    steep = points @ rotation(z=0.2).T
    assert correct_mounting(before, steep, usable, GAIN) is before, "that is no floor"
