"""Tests of the measure of sliding feet: known motions of a slab and a wheel have known speeds."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path[:0] = [str(Path(__file__).parent)]

from standing_feet import patch_speeds  # noqa: E402

STEP = 1 / 60
TIMES = np.arange(40) * STEP


def slab(random):
    """Returns (V, 3) metres: a sole of 10 by 25 cm with an upper side."""
    sole = random.uniform([-0.05, 0.0, -0.125], [0.05, 0.0, 0.125], size=(400, 3))
    return np.concatenate([sole, np.add(sole, [0.0, 0.08, 0.0])])


def about(axis, angles):
    """Returns (T, 3, 3) rotations by angles (T,) about +X (0) or +Y (1)."""
    cos, sin, ones, zeros = np.cos(angles), np.sin(angles), np.ones_like(angles), np.zeros_like(angles)
    if axis:
        rows = [[cos, zeros, sin], [zeros, ones, zeros], [-sin, zeros, cos]]
    else:
        rows = [[ones, zeros, zeros], [zeros, cos, -sin], [zeros, sin, cos]]
    return np.moveaxis(np.array(rows), 2, 0)


def test_a_slab_that_is_dragged_slides_at_its_speed():
    foot = slab(np.random.default_rng(0)) + TIMES[:, None, None] * [0.3, 0.0, 0.4]
    np.testing.assert_allclose(patch_speeds(foot, TIMES), 0.5, rtol=1e-9)


def test_a_slab_that_spins_slides_by_its_median_radius():
    points = slab(np.random.default_rng(1))
    foot = np.einsum("tij,vj->tvi", about(1, 2.0 * TIMES), points)
    radius = np.median(np.hypot(points[:400, 0], points[:400, 2]))
    np.testing.assert_allclose(patch_speeds(foot, TIMES), 2.0 * radius, rtol=1e-3)


@pytest.mark.parametrize("radius", [0.1, 0.3])
def test_a_wheel_that_rolls_does_not_slide(radius):
    rim = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    points = radius * np.stack([0.0 * rim, np.cos(rim), np.sin(rim)], axis=1)
    angles = 2.0 * TIMES
    rolls = radius * angles[:, None, None] * [0.0, 0.0, 1.0]
    rolling, dragged = (np.einsum("tij,vj->tvi", about(0, angles), points) + way for way in (rolls, 0.0))
    assert patch_speeds(rolling, TIMES).max() < 0.05 * 2.0 * radius
    assert patch_speeds(dragged, TIMES).min() > 0.9 * 2.0 * radius
