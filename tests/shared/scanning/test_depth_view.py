"""Tests of preparing a depth image (half-size points, planes and tiles) against plain loops."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics
from enliven.scanning import DepthNoiseModel, DepthPreparation
from enliven.scanning.depth_view import TILE

NEAR, FAR, GATE, NOISE = 0.3, 5.0, 0.04, DepthNoiseModel()


def slow_half(depth):
    """Returns (h, w) the harmonic mean of those of 2 x 2 pixels that are within the gate of the nearest, 0
    for none.
    """
    height, width = depth.shape
    out = np.zeros(((height + 1) // 2, (width + 1) // 2))
    for v, u in np.ndindex(out.shape):
        some = depth[2 * v : 2 * v + 2, 2 * u : 2 * u + 2].ravel() * 1e-3
        some = some[(some >= NEAR) & (some <= FAR)]
        if len(some):
            inverse = 1.0 / some[some < some.min() / (1 - GATE)]
            out[v, u] = 1.0 / inverse.mean()
    return out


def slow_fit(half, camera, v, u):
    """Returns the unit normal (3,) and the weight of a pixel's plane by least squares in inverse depth, or
    None.
    """
    here, at = 1.0 / half[v, u], []
    for j, i in itertools.product((v - 2, v, v + 2), (u - 2, u, u + 2)):
        there = 0 <= j < half.shape[0] and 0 <= i < half.shape[1] and half[j, i] > 0
        if there and abs(1.0 / half[j, i] - here) < GATE * here:
            at.append((*ray(camera, j, i), 1.0 / half[j, i]))
    x, y, inverse = np.array(at).T
    if len(at) < 4 or np.linalg.matrix_rank(np.stack([x, y, np.ones_like(x)])) < 3:
        return None
    (a, b, c), *_ = np.linalg.lstsq(np.stack([x, y, np.ones_like(x)], 1), inverse, rcond=None)
    normal, own = -np.array([a, b, c]), np.array([*ray(camera, v, u), 1.0])
    facing = -normal @ own / np.linalg.norm(normal) / np.linalg.norm(own)
    sure = (NOISE.sigma(NOISE.start) / NOISE.sigma(half[v, u])) ** 2
    return normal / np.linalg.norm(normal), facing * (len(at) / 9) ** 2 * sure


def ray(camera, v, u):
    """Returns x and y of the ray through the centre of 2 x 2 pixels, or of those inside the image."""
    column = (2 * u + min(2 * u + 1, camera.width - 1)) / 2
    row = (2 * v + min(2 * v + 1, camera.height - 1)) / 2
    return (column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy


def slow_tile(depth):
    """Returns a tile's nearest and farthest depth, and the fraction of a full tile's pixels without depth."""
    is_known = (depth >= 1e3 * NEAR) & (depth <= 1e3 * FAR)
    some = depth[is_known] * 1e-3
    return min(some, default=np.inf), max(some, default=0.0), (~is_known).sum() / TILE**2


@settings(max_examples=20)
@given(
    height=st.integers(9, 40),
    width=st.integers(9, 40),
    step=st.integers(0, 3000),
    seed=st.integers(0, 2**16),
    whole=st.booleans(),
)
def test_prepared_image_matches_plain_loops(height, width, step, seed, whole):
    random = np.random.default_rng(seed)
    depth = (
        800.0
        + 6.0 * np.arange(width)
        + 3.0 * np.arange(height)[:, None]
        + random.normal(0, 2, (height, width))
    )
    depth[:, random.integers(0, width) :] += step
    depth[random.random(depth.shape) < 0.1] = 0
    depth[random.random(depth.shape) < 0.05] = 65535
    depth = np.rint(depth).astype(np.uint16) if whole else depth.astype(np.float32)
    camera = Intrinsics(width, height, 60.0, 62.0, width / 2, height / 2)
    view = DepthPreparation(camera, NOISE, NEAR, FAR).prepare(depth)
    half, there = slow_half(depth.astype(float)), view.worth > 0
    assert view.points.shape[:2] == half.shape and there.any()
    # float32 inverse depths.
    np.testing.assert_allclose(view.points[there][:, 2], half[there], rtol=1e-5)
    for v, u in zip(*np.nonzero(there), strict=True):
        assert view.points[v, u, :2] / view.points[v, u, 2] == pytest.approx(ray(camera, v, u), abs=1e-6)
        normal, worth = slow_fit(half, camera, v, u)
        # Values that depend weakly on two rows of pixels are less accurate in float32.
        assert view.normals[v, u] @ normal > 1.0 - 1e-4 and view.worth[v, u] == pytest.approx(worth, rel=0.01)
    np.testing.assert_allclose(np.linalg.norm(view.normals[there], axis=1), 1.0, rtol=1e-5)
    for r, c in np.ndindex(view.tiles.shape[:2]):
        tile = depth[r * TILE : (r + 1) * TILE, c * TILE : (c + 1) * TILE].astype(float)
        np.testing.assert_allclose(view.tiles[r, c], slow_tile(tile), rtol=1e-6)
    # A pixel's plane goes through its own point.
    for v, u in zip(*np.nonzero(view.weights), strict=True):
        z = float(depth[v, u]) * 1e-3
        point = np.array([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])
        assert abs(view.planes[v, u, :3] @ point - view.planes[v, u, 3]) < 1e-5


def test_depth_0_is_nothing_even_where_nothing_is_too_near():
    camera = Intrinsics(20, 20, 60.0, 60.0, 10.0, 10.0)
    view = DepthPreparation(camera, NOISE, 0.0, FAR).prepare(np.zeros((20, 20), np.uint16))
    assert not view.known and (view.tiles[..., 2] > 0).all()
