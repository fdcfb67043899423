"""Tests of the floor, of image reduction and of normals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.frame.observation import (
    WorkingCamera,
    nearest_columns,
    surface_samples,
    world_points,
)
from enliven_edge.tracking.frame.reduction import is_same, known_pixels, reduce_depth
from enliven_edge.tracking.scene.floor import world_from_floor


def floor_and_wall(mount: np.ndarray, seed: int) -> np.ndarray:
    """Returns camera-frame points on a floor and a wall at 4 m, with a centimetre of noise."""
    random = np.random.default_rng(seed)
    floor = np.stack([random.uniform(-2, 2, 3000), np.zeros(3000), random.uniform(-4, -1.2, 3000)], 1)
    wall = np.stack([random.uniform(-2, 2, 3000), random.uniform(0, 2.5, 3000), np.full(3000, -4.0)], 1)
    world = np.concatenate([floor, wall]) + random.normal(0, 0.01, (6000, 3))
    camera_from_world = np.linalg.inv(mount)
    return world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]


@given(st.floats(0.5, 2.4), st.floats(-0.3, 0.5), st.booleans(), st.integers(0, 100))
@settings(max_examples=20, deadline=None)
def test_the_floor_is_found_from_any_mounting(height, tilt, upside_down, seed):
    mount = world_from_level_camera(height, tilt, np.pi if upside_down else 0.0)
    world_from_camera = world_from_floor(floor_and_wall(mount, seed), upside_down)
    assert world_from_camera is not None
    assert world_from_camera[1, 3] == pytest.approx(height, abs=0.03)
    np.testing.assert_allclose(world_from_camera[:3, :3], mount[:3, :3], atol=0.03)


def test_a_wall_alone_is_no_floor():
    random = np.random.default_rng(0)
    wall = np.stack([random.uniform(-1, 1, 2000), random.uniform(-1, 1, 2000), np.full(2000, 2.0)], 1)
    assert world_from_floor(wall) is None
    assert world_from_floor(np.zeros((0, 3))) is None


def test_reduction_is_a_median_of_what_is_known():
    depth = np.zeros((8, 8), np.uint16)
    depth[:4, :4], depth[:4, 4:] = 1000, 65535
    depth[0, 0], depth[4, 4] = 0, 3000
    reduced = reduce_depth(depth, 4, 2, 2)
    np.testing.assert_allclose(reduced, [[1.0, 0.0], [0.0, 3.0]])


@given(st.integers(0, 1000), st.integers(1, 9), st.booleans())
@settings(max_examples=40, deadline=None)
def test_reducing_is_the_lower_median_of_the_known(seed, stride, holes):
    random = np.random.default_rng(seed)
    depth = random.integers(400, 4000, (36, 45)).astype(np.uint16)
    if holes:
        depth[random.random(depth.shape) < 0.5] = 0
        depth[random.random(depth.shape) < 0.1] = 65535
    h, w, step = 36 // stride, 45 // stride, max(1, stride // 3)
    expected = np.zeros((h, w))
    for v, u in np.ndindex(h, w):
        far = min(stride, 3 * step)
        block = depth[v * stride : v * stride + far : step, u * stride : u * stride + far : step].ravel()
        values = np.sort(block[(block > 0) & (block < 65535)])
        expected[v, u] = values[(len(values) - 1) // 2] * 1e-3 if len(values) else 0.0
    np.testing.assert_array_equal(reduce_depth(depth, stride, h, w), expected)


def test_normals_of_a_slanted_plane():
    camera = WorkingCamera(Intrinsics(160, 120, 130, 130, 79.5, 59.5), 160)
    normal = np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])
    ray = np.concatenate([camera.ray, np.ones((120, 160, 1))], -1)
    z = (normal @ np.array([0, 0, 2.0])) / (ray @ normal)
    points = world_points(z, camera.ray, np.eye(4))
    pixels = np.array([(20, 30), (60, 80), (100, 120)])
    samples, normals = surface_samples(points, z, pixels, np.zeros(3))
    np.testing.assert_allclose(normals, np.tile(normal, (3, 1)), atol=1e-6)
    np.testing.assert_allclose(samples, points[tuple(pixels.T)], atol=1e-6)


def normal_slowly(points, z, v, u, eye):
    """Returns the (3,) normal at a pixel by NumPy, or the direction to the eye at borders, edges and unknown
    pixels.
    """
    toward, (height, width) = eye - points[v, u], z.shape
    if 0 < v < height - 1 and 0 < u < width - 1:
        around = z[[v, v, v - 1, v + 1], [u - 1, u + 1, u, u]]
        if around.min() > 0 and np.ptp(around) < 0.06 + 0.04 * around.min():
            normal = np.cross(points[v, u + 1] - points[v, u - 1], points[v + 1, u] - points[v - 1, u])
            toward = normal * (1 if normal @ toward >= 0 else -1)
    return toward / np.linalg.norm(toward)


@given(st.integers(0, 10_000), st.floats(0.0, 0.1))
@settings(max_examples=25, deadline=None)
def test_normals_match_the_slow_reference(seed, rough):
    """On a slope with steps and holes, up to the image's border."""
    random, camera = np.random.default_rng(seed), WorkingCamera(Intrinsics(24, 18, 20, 20, 11.5, 8.5), 24)
    z = 2.0 + 0.01 * np.arange(24) + rough * random.standard_normal((18, 24))
    z[random.random(z.shape) < 0.1] = 0.0
    mount = world_from_level_camera(1.2, random.uniform(-0.5, 0.5))
    points, eye = world_points(z, camera.ray, mount), mount[:3, 3].copy()
    pixels = np.ascontiguousarray(np.argwhere(z > 0))
    samples, normals = surface_samples(points, z, pixels, eye)
    expected = [normal_slowly(points, z, v, u, eye) for v, u in pixels]
    np.testing.assert_allclose(normals, expected, atol=1e-5)
    np.testing.assert_array_equal(samples, points[tuple(pixels.T)].astype(np.float32))


@given(st.integers(0, 10_000), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_the_nearest_column_is_that_of_the_obvious_search(seed, share):
    random = np.random.default_rng(seed)
    mask = (random.random((9, 13)) < share) & (random.random((9, 1)) < 0.8)
    for row, columns in zip(mask, nearest_columns(mask), strict=True):
        masked = np.flatnonzero(row)
        for u, nearest in enumerate(columns):
            # Of two equally near values, argmin takes the first: the left one.
            assert nearest == (masked[np.abs(masked - u).argmin()] if len(masked) else -1)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_depth_is_counted_and_images_compared_as_numpy_does(seed, known):
    rng = np.random.default_rng(seed)
    z = np.where(rng.random((7, 9)) < known, rng.random((7, 9)) + 0.1, 0.0)
    assert known_pixels(z) == np.count_nonzero(z > 0.0)
    other = z.copy()
    assert is_same(z, other)
    other[rng.integers(7), rng.integers(9)] += 1e-6
    assert not is_same(z, other)
    assert not is_same(z, z[:, :8].copy())
